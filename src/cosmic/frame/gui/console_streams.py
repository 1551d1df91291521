"""What the console's thread prints and reads, kept apart from the rest of the process."""

import sys
import threading
from collections.abc import Callable, Iterable
from typing import Final, TextIO, cast

_MOST_WAITING: Final = 16_384
_LOOK_AGAIN_S: Final = 0.1


class OutputBuffer:
    """Text on its way from the console's thread to the window; any thread.

    A program that prints faster than the window shows is slowed down, not collected.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._parts: list[str] = []
        self._size = 0
        self._closed = False

    def put(self, text: str) -> bool:
        """Add `text`, waiting for room; True when the buffer was empty before."""
        with self._changed:
            while self._size > _MOST_WAITING and not self._closed:
                self._changed.wait(_LOOK_AGAIN_S)
            if self._closed:
                return False
            was_empty = not self._parts
            self._parts.append(text)
            self._size += len(text)
            return was_empty

    def take(self) -> str:
        """Remove and return all text."""
        with self._changed:
            text = "".join(self._parts)
            self._parts.clear()
            self._size = 0
            self._changed.notify_all()
            return text

    def close(self) -> None:
        """Drop what is still written: nobody reads it any more."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class _Stream:
    """Stands for one of the process' streams; differs from it in one thread only."""

    def __init__(self, original: TextIO | None, ident: int) -> None:
        self._original = original
        self._ident = ident

    def _is_mine(self) -> bool:
        return threading.get_ident() == self._ident

    def isatty(self) -> bool:
        return not self._is_mine() and self._original is not None and self._original.isatty()

    def flush(self) -> None:
        if not self._is_mine() and self._original is not None:
            self._original.flush()

    def fileno(self) -> int:
        if self._is_mine() or self._original is None:
            raise OSError("the console is not a file")
        return self._original.fileno()

    def __getattr__(self, name: str) -> object:
        return getattr(self._original, name)


class _OutStream(_Stream):
    def __init__(self, original: TextIO | None, ident: int, sink: Callable[[str], object]) -> None:
        super().__init__(original, ident)
        self._sink = sink

    def write(self, text: str) -> int:
        if self._is_mine():
            if text:
                self._sink(text)
        elif self._original is not None:
            self._original.write(text)
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)


class _InStream(_Stream):
    def __init__(self, original: TextIO | None, ident: int, source: Callable[[], str]) -> None:
        super().__init__(original, ident)
        self._source = source

    def readline(self, size: int = -1) -> str:
        if self._is_mine():
            return self._source()
        return "" if self._original is None else self._original.readline(size)

    def close(self) -> None:
        """Stay open: ``exit()`` closes the input first."""


class ThreadStreams:
    """Gives the calling thread standard streams of its own until `restore`.

    Parameters
    ----------
    sink : callable
        Takes what the thread prints.
    source : callable
        Returns a line, with its line end, when the thread reads.
    """

    def __init__(self, sink: Callable[[str], object], source: Callable[[], str]) -> None:
        ident = threading.get_ident()
        self._before = (sys.stdin, sys.stdout, sys.stderr)
        self._mine = (
            cast("TextIO", _InStream(sys.stdin, ident, source)),
            cast("TextIO", _OutStream(sys.stdout, ident, sink)),
            cast("TextIO", _OutStream(sys.stderr, ident, sink)),
        )
        sys.stdin, sys.stdout, sys.stderr = self._mine

    def restore(self) -> None:
        """Put back what was there, unless somebody else has replaced it since; any thread."""
        if sys.stdin is self._mine[0]:
            sys.stdin = self._before[0]
        if sys.stdout is self._mine[1]:
            sys.stdout = self._before[1]
        if sys.stderr is self._mine[2]:
            sys.stderr = self._before[2]
