"""The direct lines of one client: one that stays free for what is urgent, and some for calls."""

import logging
from collections.abc import Callable
from threading import Lock
from typing import Final

from cosmic.frame.network.direct_line import DirectLine, LineLost

logger = logging.getLogger(__name__)

CALL_LINES: Final = 4
"""As many calls at a time go over lines of their own; more go over the engine."""

OpenLine = Callable[[bool], DirectLine]


class DirectLines:
    """Lends a line to each caller; any thread.

    The urgent line carries nothing but what overtakes everything (a stop), and shows the station
    that this process lives: when it ends, the system has closed it, and what this client moves
    stops at once. The session goes on as long as the engine reaches the station.

    Parameters
    ----------
    open_line : callable
        Opens one, for what is urgent or for calls; raises `LineLost`.

    Raises
    ------
    LineLost
        No direct line can be had there.
    """

    def __init__(self, open_line: OpenLine) -> None:
        self._open_line = open_line
        self._lock = Lock()
        urgent = open_line(True)
        self._urgent: DirectLine | None = urgent
        self._urgent_lent = False
        self._free: list[DirectLine] = []
        self._lent: list[DirectLine] = []
        self._closed = False
        try:
            self._free.append(open_line(False))
        except LineLost:
            urgent.close()
            raise

    def ask(self, message: bytes, timeout_s: float, *, urgent: bool) -> bytes | None:
        """Ask over a line that is free; None, and nothing was sent, where there is none.

        Raises
        ------
        StationTimeout
            No answer came in time.
        LineLost
            The line broke before the answer came.
        """
        line = self._borrow_urgent() if urgent else self._borrow()
        if line is None:
            return None
        try:
            answer = line.ask(message, timeout_s)
        except LineLost:
            self._release(line, broken=True)
            raise
        except BaseException:
            self._release(line)
            raise
        self._release(line)
        return answer

    def close(self) -> None:
        """End all of them; whoever waits for an answer gets `LineLost`."""
        with self._lock:
            self._closed = True
            idle, self._free = self._free, []
            lent = list(self._lent)
            if self._urgent is not None and not self._urgent_lent:
                idle.append(self._urgent)
        for each in lent:  # closed by whoever uses it
            each.shut()
        for each in idle:
            each.close()

    def _borrow_urgent(self) -> DirectLine | None:
        with self._lock:
            line = self._urgent
            if self._closed or line is None or self._urgent_lent or not line.settle():
                return None
            self._urgent_lent = True
            self._lent.append(line)
            return line

    def _borrow(self) -> DirectLine | None:
        with self._lock:
            for line in reversed(self._free):  # the one used last is the warm one
                if not self._closed and line.settle():
                    self._free.remove(line)
                    self._lent.append(line)
                    return line
            lent = len(self._lent) - self._urgent_lent
            if self._closed or lent + len(self._free) >= CALL_LINES:
                return None
        return self._opened()

    def _opened(self) -> DirectLine | None:
        try:
            line = self._open_line(False)
        except LineLost as exc:
            logger.debug("no further direct line: %s", exc)
            return None
        with self._lock:
            if not self._closed:
                self._lent.append(line)
                return line
        line.close()
        return None

    def _release(self, line: DirectLine, *, broken: bool = False) -> None:
        with self._lock:
            self._lent.remove(line)
            urgent = line is self._urgent
            if urgent:
                self._urgent_lent = False
            if not self._closed and not broken:
                if not urgent:
                    self._free.append(line)
                return
            if urgent:
                self._urgent = None  # from now on the engine carries what is urgent
        line.close()
