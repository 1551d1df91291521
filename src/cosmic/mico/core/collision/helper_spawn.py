"""One process of the gate from its start to its end: without restarts, one thread at a time."""

import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from itertools import count
from multiprocessing.connection import Pipe
from typing import IO, Any, Final

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.mico.core.collision.helper_wire import (
    LONGEST_ANSWER,
    PROTOCOL,
    READY,
    End,
    Reply,
    decode_reply,
    encode,
)
from cosmic.mico.core.collision.model import SceneModel

MODULE: Final = "cosmic.mico.core.collision.helper"
END_S: Final = 2.0
_STALLED_S: Final = 1
_LAST_WORDS: Final = 4000
# Small problems: threads in the numerical libraries only take the time from others.
_ONE_THREAD: Final = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}


class HelperFaultError(CosmicError):
    """The process is dead, hangs or talks rubbish: it must be replaced."""


class HelperLateError(HelperFaultError):
    """The process did not answer in time."""


class HelperRefusalError(CosmicError):
    """The process is well, but cannot answer this question; the text is its reason."""


class HelperProcess:
    """Starts the process at once; it is of use after `poll_ready` has said so.

    Parameters
    ----------
    scene : bytes
        What `pickle_scene` returned.
    handlers : mapping of str
        "module:function" by kind of question, for kinds beyond those of the helper itself.

    Raises
    ------
    OSError
        It cannot be started.
    """

    def __init__(self, scene: bytes, handlers: Mapping[str, str]) -> None:
        self.ready = False
        self.began_s = WALL.now_s()
        self._numbers = count(READY + 1)
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - read when the process has ended
        self._pipe, theirs = Pipe()
        try:
            self._process = _spawn(scene, theirs, handlers, self._words)
        except OSError:
            self._pipe.close()
            self._words.close()
            raise
        finally:
            theirs.close()
        _limit_stalls(self._pipe)

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """False once it has ended."""
        return self._process.poll() is None

    def poll_ready(self, wait_s: float) -> bool:
        """Return whether it can be asked, waiting for that at most `wait_s`.

        Raises
        ------
        HelperFaultError
            It has died, or cannot load the scene.
        """
        if not self.ready:
            try:
                if not self._pipe.poll(wait_s):
                    return False
            except (OSError, EOFError) as exc:
                raise HelperFaultError(f"it cannot be reached ({exc})") from exc
            reply = self._receive()
            if reply.number != READY or not reply.good:
                raise HelperFaultError(f"it could not load the scene: {reply.value}")
            self.ready = True
        return True

    def ask(self, kind: str, payload: object, timeout_s: float) -> object:
        """Put a question and return the answer to it, never that to another.

        Raises
        ------
        HelperFaultError
            There was no answer, or one without sense.
        HelperRefusalError
            It could not answer this question, and says why.
        """
        number = next(self._numbers)
        until_s = WALL.now_s() + timeout_s
        try:
            self._pipe.send_bytes(encode((number, kind, payload, timeout_s)))
        except OSError as exc:
            raise HelperFaultError(f"it takes no questions ({type(exc).__name__})") from exc
        while True:
            left_s = until_s - WALL.now_s()
            if left_s <= 0.0 or not self._poll(left_s):
                raise HelperLateError(f"it did not answer within {timeout_s:g} s")
            reply = self._receive()
            # An older one belongs to a question whose asker was interrupted.
            if reply.number == number:
                break
            if not READY < reply.number < number:
                raise HelperFaultError(f"it answered question {reply.number}, asked was {number}")
        if not reply.good:
            raise HelperRefusalError(str(reply.value))
        return reply.value

    def _poll(self, wait_s: float) -> bool:
        try:
            return self._pipe.poll(wait_s)
        except OSError as exc:
            raise HelperFaultError(f"it cannot be reached ({type(exc).__name__})") from exc

    def _receive(self) -> Reply:
        try:
            return decode_reply(self._pipe.recv_bytes(LONGEST_ANSWER))
        except (EOFError, OSError) as exc:
            raise HelperFaultError(self._how_it_ended() or "the connection broke") from exc
        except ProtocolError as exc:
            raise HelperFaultError(str(exc)) from exc

    def _how_it_ended(self) -> str:
        try:
            code = self._process.wait(0.2)
        except subprocess.TimeoutExpired:
            return ""
        if code < 0:
            return f"it was ended by signal {-code} ({signal.strsignal(-code)})"
        return f"it ended with code {code}"

    def kill(self) -> None:
        """End it at once; any thread, also while another waits for an answer."""
        self._process.kill()

    def end(self) -> str:
        """End it, give everything back and return what it wrote last; harmless repeated."""
        self._process.kill()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            return f"process {self.pid} does not end"
        finally:
            self._pipe.close()
            words = self._last_words()
            self._words.close()
        return words

    def _last_words(self) -> str:
        if self._words.closed:
            return ""
        length = self._words.seek(0, os.SEEK_END)
        self._words.seek(max(0, length - _LAST_WORDS))
        return self._words.read().decode(errors="replace").strip()


def pickle_scene(model: SceneModel) -> bytes:
    """Return the scene as the process reads it, without what is only drawn."""
    return pickle.dumps(replace(model, views=()), protocol=PROTOCOL)


def _spawn(
    scene: bytes, theirs: End, handlers: Mapping[str, str], words: IO[bytes]
) -> "subprocess.Popen[bytes]":
    """Start the process with the scene as its input.

    A file, unlike a pipe, never makes us wait until the process has come up to read it.
    """
    with tempfile.TemporaryFile() as file:
        file.write(scene)
        file.seek(0)
        more = [f"{kind}={place}" for kind, place in handlers.items()]
        # -P: files that happen to lie in the working directory are not taken for modules.
        command = [sys.executable, "-P", "-m", MODULE, str(theirs.fileno()), *more]
        return subprocess.Popen(
            command,
            stdin=file,
            stdout=subprocess.DEVNULL,
            stderr=words,
            env=os.environ | _ONE_THREAD,
            **_inheritance(theirs),
        )


def _inheritance(theirs: End) -> dict[str, Any]:
    """Return the arguments of Popen that hand the end of the pipe, and nothing else, over.

    In a session of its own a Ctrl+C in the console never reaches the process.
    """
    if sys.platform == "win32":
        # Written from the documentation; not run on Windows so far.
        os.set_handle_inheritable(theirs.fileno(), True)
        return {
            "startupinfo": subprocess.STARTUPINFO(
                lpAttributeList={"handle_list": [theirs.fileno()]}
            ),
            "creationflags": subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP,
        }
    return {"pass_fds": (theirs.fileno(),), "start_new_session": True}


def _limit_stalls(pipe: End) -> None:
    """Make a message that stops half-way an OSError instead of a wait for ever."""
    if sys.platform == "win32":
        return
    limit = struct.pack("ll", _STALLED_S, 0)
    with socket.socket(fileno=os.dup(pipe.fileno())) as end:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)
