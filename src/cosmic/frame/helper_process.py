"""A helper process that answers questions over a pipe: its start, its questions, its end.

Both ends are started from the same installation by the same user, and nobody else can write to
the pipe between them, so that pickles are safe here. Free of Qt: the helpers import it too.
"""

import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import count
from multiprocessing.connection import Pipe
from typing import IO, TYPE_CHECKING, Any, Final

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.forked import FORKED, Owner

if sys.platform == "win32":
    from multiprocessing.connection import PipeConnection as _PipeEnd
else:
    from multiprocessing.connection import Connection as _PipeEnd

if TYPE_CHECKING:  # the classes take no arguments at run time
    End = _PipeEnd[Any, Any]
else:
    End = _PipeEnd

PROTOCOL: Final = 5
READY: Final = 0
"""Number of the first message of the process, which answers no question."""
LONGEST_ANSWER: Final = 1 << 26
END_S: Final = 2.0
_LAST_WORDS: Final = 4000
# Small problems: threads in the numerical libraries only take the time from others.
_ONE_THREAD: Final = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}


@dataclass(frozen=True, slots=True)
class Reply:
    """What the process answered to the question of that number.

    Attributes
    ----------
    good : bool
        False when it could not answer; `value` is then the reason as text.
    """

    number: int
    good: bool
    value: object


def encode(parts: Iterable[object]) -> bytes:
    """Return a message for the pipe."""
    return pickle.dumps(tuple(parts), protocol=PROTOCOL)


def decode_reply(message: bytes) -> Reply:
    """Read what the process answered.

    Raises
    ------
    ProtocolError
        It is no answer.
    """
    try:
        number, good, value = pickle.loads(message)
    except Exception as exc:  # pickle raises nearly anything over rubbish
        raise ProtocolError("the answer cannot be read") from exc
    if not (isinstance(number, int) and isinstance(good, bool)):
        raise ProtocolError("the answer carries no number")
    return Reply(number, good, value)


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
    module : str
        Runs as a program; its first argument is the number of its end of the pipe. It sends
        `READY` once it can be asked.
    given : bytes
        Its standard input.
    arguments : sequence of str
        After the first.
    stalled_s : int
        How long a message may stop half-way.
    background : bool
        It leaves the processors to others that want them.

    Raises
    ------
    OSError
        It cannot be started.
    """

    def __init__(
        self,
        module: str,
        given: bytes = b"",
        arguments: Sequence[str] = (),
        stalled_s: int = 1,
        *,
        background: bool = False,
    ) -> None:
        self.ready = False
        self._owner = Owner()
        self.began_s = WALL.now_s()
        self._numbers = count(READY + 1)
        self._left: tuple[int, str, object] | None = None
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - read when the process has ended
        self._pipe, theirs = Pipe()
        try:
            self._process = _spawn(
                module, given, theirs, arguments, self._words, background=background
            )
        except OSError:
            self._pipe.close()
            self._words.close()
            raise
        finally:
            theirs.close()
        _limit_stalls(self._pipe, stalled_s)

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def foreign(self) -> bool:
        """True in a process that was forked: the answers are for the one that it came from."""
        return not self._owner.here

    @property
    def running(self) -> bool:
        """False once it has ended."""
        return self._process.poll() is None

    def poll_ready(self, wait_s: float) -> bool:
        """Return whether it can be asked, waiting for that at most `wait_s`.

        Raises
        ------
        HelperFaultError
            It has died, or cannot start its work.
        """
        self._check_owner()
        if not self.ready:
            try:
                if not self._pipe.poll(wait_s):
                    return False
            except (OSError, EOFError) as exc:
                raise HelperFaultError(f"it cannot be reached ({exc})") from exc
            reply = self._receive()
            if reply.number != READY or not reply.good:
                raise HelperFaultError(str(reply.value))
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
        number = self._asked(kind, payload, timeout_s)
        reply = self._reply_to(number, timeout_s)
        if reply is None:
            raise HelperLateError(f"it did not answer within {timeout_s:g} s")
        return self._value(reply)

    def ask_promptly(
        self, kind: str, payload: object, timeout_s: float, within_s: float
    ) -> object | None:
        """Put a question and return the answer, or None where it takes longer than `within_s`.

        The process goes on with it, and the same question put next is not asked a second time.

        Raises
        ------
        HelperFaultError, HelperRefusalError
            See `ask`.
        """
        number = self._asked(kind, payload, timeout_s)
        reply = self._reply_to(number, within_s)
        if reply is None:
            self._left = number, kind, payload
            return None
        return self._value(reply)

    def _asked(self, kind: str, payload: object, timeout_s: float) -> int:
        """Put a question, unless it is the one that is being answered; returns its number."""
        left, self._left = self._left, None
        if left is not None and left[1:] == (kind, payload):
            return left[0]
        number = self.next_number()
        self.put(number, kind, payload, timeout_s)
        return number

    def _reply_to(self, number: int, wait_s: float) -> Reply | None:
        """Return the reply to question `number`, None when it has not come after `wait_s`."""
        until_s = WALL.now_s() + wait_s
        while True:
            left_s = until_s - WALL.now_s()
            reply = self.take(left_s) if left_s > 0.0 else None
            if reply is None or reply.number == number:
                return reply
            # An older one belongs to a question whose asker was interrupted.
            if not READY < reply.number < number:
                raise HelperFaultError(f"it answered question {reply.number}, asked was {number}")

    @staticmethod
    def _value(reply: Reply) -> object:
        if not reply.good:
            raise HelperRefusalError(str(reply.value))
        return reply.value

    def next_number(self) -> int:
        """Return the number for a question; each is for one."""
        return next(self._numbers)

    def put(self, number: int, kind: str, payload: object, limit_s: float) -> None:
        """Put a question without waiting for its answer.

        Parameters
        ----------
        limit_s : float
            How long the process may work on it.

        Raises
        ------
        HelperFaultError
            It takes no questions.
        """
        self._check_owner()
        try:
            self._pipe.send_bytes(encode((number, kind, payload, limit_s)))
        except OSError as exc:
            raise HelperFaultError(f"it accepts no requests ({type(exc).__name__})") from exc

    def take(self, wait_s: float) -> Reply | None:
        """Return the next answer; None when there is none within `wait_s`.

        Raises
        ------
        HelperFaultError
            The process is gone, or its answer makes no sense.
        """
        return self._receive() if self._poll(wait_s) else None

    def _check_owner(self) -> None:
        if self.foreign:
            raise HelperFaultError(FORKED)

    def _poll(self, wait_s: float) -> bool:
        self._check_owner()
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
        if not self.foreign:
            self._process.kill()

    def end(self) -> str:
        """End it, give everything back and return what it wrote last; harmless repeated."""
        self.kill()
        try:
            if not self.foreign:
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


def _spawn(
    module: str,
    given: bytes,
    theirs: End,
    arguments: Sequence[str],
    words: IO[bytes],
    *,
    background: bool,
) -> "subprocess.Popen[bytes]":
    """Start the process with a file as its input.

    A file, unlike a pipe, never makes us wait until the process has come up to read it.
    """
    with tempfile.TemporaryFile() as file:
        file.write(given)
        file.seek(0)
        # -P: files that happen to lie in the working directory are not taken for modules.
        command = [sys.executable, "-P", "-m", module, str(theirs.fileno()), *arguments]
        return subprocess.Popen(
            command,
            stdin=file,
            stdout=subprocess.DEVNULL,
            stderr=words,
            env=os.environ | _ONE_THREAD,
            **_inheritance(theirs, background=background),
        )


def _inheritance(theirs: End, *, background: bool) -> dict[str, Any]:
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
            "creationflags": subprocess.CREATE_NO_WINDOW
            | subprocess.CREATE_NEW_PROCESS_GROUP
            | (subprocess.BELOW_NORMAL_PRIORITY_CLASS if background else 0),
        }
    return {"pass_fds": (theirs.fileno(),), "start_new_session": True}


def _limit_stalls(pipe: End, limit_s: int) -> None:
    """Make a message that stops half-way an OSError instead of a wait for ever."""
    if sys.platform == "win32":
        return
    limit = struct.pack("ll", limit_s, 0)
    with socket.socket(fileno=os.dup(pipe.fileno())) as end:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)
