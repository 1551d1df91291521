"""Aravis' fake GigE Vision camera as a process of its own, on the loopback address."""

import fcntl
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from cosmic.frame.errors import NotConnectedError
from cosmic.vico.hw.aravis_ctypes import load_library

PROGRAM = "arv-fake-gv-camera-0.8"
ADDRESS, PORT = "127.0.0.1", 3956
# A discovery command of GVCP, answered by any camera.
DISCOVER = bytes.fromhex("4211000200000001")


def missing() -> str:
    """Return what this computer lacks for such a camera; "" if nothing."""
    if shutil.which(PROGRAM) is None:
        return f"{PROGRAM} is not installed (Debian: aravis-tools)"
    try:
        load_library()
    except NotConnectedError as exc:
        return str(exc)
    return ""


class GigeCamera:
    """A camera Aravis-Fake-SERIAL; a context manager, which ends it.

    There can be one a computer, because the port is fixed: another one waits for its turn.
    """

    def __init__(self, serial: str) -> None:
        self.key = f"Aravis-Fake-{serial}"
        self._command = [PROGRAM, "-i", ADDRESS, "-s", serial]
        self._process: subprocess.Popen[bytes] | None = None
        self._ended = ExitStack()

    def __enter__(self) -> Self:
        lock = Path(tempfile.gettempdir()) / "cosmic-fake-gige.lock"
        turn = self._ended.enter_context(lock.open("w"))
        wait_until(lambda: _locked(turn.fileno()), 60.0, "the port is in use by other tests")
        try:
            self.start()
        except BaseException:
            self._ended.close()
            raise
        return self

    def __exit__(self, *_exc: object) -> None:
        self.kill()
        self._ended.close()

    def start(self, *, lost_per_thousand: int = 0) -> None:
        """Start it; of a thousand packets so many are lost on purpose."""
        quiet = subprocess.DEVNULL
        command = [*self._command, "-r", f"{lost_per_thousand}"]
        self._process = subprocess.Popen(command, stdout=quiet, stderr=quiet)
        wait_until(_answers, 5.0, "the fake camera does not answer")

    def kill(self) -> None:
        """End it at once, as if its cable were pulled."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


def wait_until(condition: Callable[[], bool], timeout_s: float, otherwise: str) -> None:
    """Wait for a condition, and fail with a text when it does not come true in time."""
    until_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until_s, otherwise
        time.sleep(0.005)


def _locked(file: int) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _answers() -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.settimeout(0.05)
        asking.sendto(DISCOVER, (ADDRESS, PORT))
        try:
            return bool(asking.recv(2048))
        except OSError:
            return False
