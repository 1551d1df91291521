"""Breaks Python code that runs in the console, without touching anybody else's."""

import dis
import sys
import sysconfig
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from types import CodeType, FrameType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from _typeshed import TraceFunction

CONSOLE_FILE: Final = "<console>"
_LIBRARIES: Final = (
    *(sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")),
    str(Path(__file__).resolve().parents[2]),
)


class Interrupter:
    """Raises KeyboardInterrupt in the thread that runs the user's code.

    Only lines that the user wrote are broken: those of the console and of modules outside the
    libraries and CoSMic. A library is never left in the middle of what it does, with a lock
    held for instance; what waits in there is ended by whoever owns the wait.
    """

    def __init__(self) -> None:
        self._wanted = threading.Event()

    @property
    def wanted(self) -> bool:
        """True from `request` until the code was broken."""
        return self._wanted.is_set()

    def request(self) -> None:
        """Break the code that runs; any thread."""
        self._wanted.set()

    def clear(self) -> None:
        """Forget a request that came when nothing ran."""
        self._wanted.clear()

    def sleep(self, duration_s: float) -> None:
        """Wait in such a way that an interrupt ends it."""
        if self._wanted.wait(max(0.0, duration_s)):
            self._break()

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Make what the calling thread runs inside interruptible."""
        before = sys.gettrace()
        sys.settrace(self._on_call)
        try:
            yield
        finally:
            sys.settrace(before)

    def _on_call(self, frame: FrameType, event: str, arg: object) -> "TraceFunction | None":
        if not _is_users(frame.f_code.co_filename):
            return None
        # A loop on one instruction, as ``while True: pass``, never comes to another line.
        frame.f_trace_opcodes = _turns_on_itself(frame.f_code)
        return self._on_line(frame, event, arg)

    def _on_line(self, frame: FrameType, event: str, arg: object) -> "TraceFunction | None":  # noqa: ARG002
        if self._wanted.is_set():
            self._break()
        return self._on_line

    def _break(self) -> None:
        self._wanted.clear()
        raise KeyboardInterrupt


@lru_cache(maxsize=256)
def _turns_on_itself(code: CodeType) -> bool:
    return any(
        each.opname.startswith("JUMP") and each.argval == each.offset
        for each in dis.get_instructions(code)
    )


def _is_users(file: str) -> bool:
    if file.startswith("<"):
        return file.startswith(CONSOLE_FILE[:-1])
    return not file.startswith(_LIBRARIES)
