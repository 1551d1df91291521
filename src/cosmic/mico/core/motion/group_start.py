"""The start of several axes at once: prepared by their devices, then sent back to back."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Final, Protocol

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceError, MoveCancelled
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.straight import LineWatch, StraightLine
from cosmic.mico.hw.interface import MatchedMove

logger = logging.getLogger(__name__)

_TURN_S: Final = 1e-6
"""A wait as short as this lets every thread that waits for the interpreter go first."""


class StartingAxis(Protocol):
    """One axis that is ready to go; the methods may be called in any device's thread."""

    @property
    def name(self) -> str:
        """Name of the axis."""

    def go(self) -> bool:
        """Send the movement to the controller; False where it was withdrawn before."""

    def prepare(self) -> bool:
        """Use up the leave to move with the others; False where it was withdrawn before."""

    def conclude(self, error: CosmicError | None) -> None:
        """Take note that it was sent with the others, or why it was not."""

    def report(self) -> None:
        """Report to its own device that it was sent."""


@dataclass(frozen=True, slots=True)
class GroupStarted:
    """Several axes were started back to back.

    Attributes
    ----------
    skew_ms : float
        From the call of the library for the first axis to that for the last, in wall time.
    """

    names: tuple[str, ...]
    skew_ms: float


class GroupStart:
    """Collects the axes of a group as their devices get them ready; the last one starts all.

    An SCU cannot start several channels by one command, so they are started by calls back to
    back in one thread, past the devices' own (see "Stop and the simultaneous start of a group" in
    the architecture). Whoever waits for the others holds no thread up: an axis that is halted
    or replaced meanwhile is withdrawn.

    Parameters
    ----------
    count : int
        How many axes there are.
    line : LineStart or None
        They start by one command and keep to a line, all of them or none.
    """

    def __init__(
        self,
        count: int,
        on_started: Callable[[GroupStarted], None],
        line: "LineStart | None" = None,
    ) -> None:
        self._count = count
        self._on_started = on_started
        self.line = line
        self._lock = Lock()
        self._ready: list[StartingAxis] = []
        self._skew_ms: float | None = None

    @property
    def skew_ms(self) -> float | None:
        """From the first call to the last, in milliseconds; None before the start."""
        return self._skew_ms

    def arrive(self, axis: StartingAxis) -> None:
        """Say that an axis is ready; the last one starts them all. Device thread."""
        with self._lock:
            self._ready.append(axis)
            complete = len(self._ready) == self._count
        if complete:
            self._start()

    def _start(self) -> None:
        stamps_s = self._start_in_turn() if self.line is None else self._start_at_once(self.line)
        # A report wakes the other devices' threads, which would only be in the way before.
        for axis in self._ready:
            axis.report()
        names = tuple(axis.name for axis in self._ready)
        self._ready = []
        if not stamps_s:
            return
        self._skew_ms = 1e3 * (stamps_s[-1] - stamps_s[0])
        logger.info("%s started together, within %.2f ms", ", ".join(names), self._skew_ms)
        self._on_started(GroupStarted(names, self._skew_ms))

    def _start_in_turn(self) -> list[float]:
        stamps_s: list[float] = []
        # With a fresh turn of the interpreter all calls are over before another thread may claim
        # it. A shorter turn would hand it over between two of them.
        WALL.sleep(_TURN_S)
        for axis in self._ready:
            now_s = WALL.now_s()
            if axis.go():
                stamps_s.append(now_s)
        return stamps_s

    def _start_at_once(self, line: "LineStart") -> list[float]:
        prepared = [axis.prepare() for axis in self._ready]
        error: CosmicError | None = None
        if not all(prepared):
            error = MoveCancelled("another axis of the line could not start")
        else:
            try:
                line.send()
            except DeviceError as exc:
                error = exc
        for axis in self._ready:
            axis.conclude(error)
        if error is not None:
            line.leave("")
            return []
        return [WALL.now_s()]


class LineStart:
    """Axes of one device that keep to a line: one leaves it, and all are stopped. Any thread.

    Parameters
    ----------
    move_together : callable
        Starts them by one command.
    """

    def __init__(
        self, line: StraightLine, move_together: Callable[[Sequence[MatchedMove]], None]
    ) -> None:
        self._line = line
        self._watch = LineWatch(line)
        self._move_together = move_together
        self._movements: tuple[Movement, ...] = ()
        self._left = False

    def follow(self, movements: Sequence[Movement]) -> None:
        """Say what is cancelled when the line is left."""
        self._movements = tuple(movements)

    def send(self) -> None:
        """Start them; raises `DeviceError`."""
        self._move_together(self._line.moves)

    def lags(self, name: str, position: float) -> str | None:
        """Take a position that was just read; return why the line is left, or None."""
        return None if self._left else self._watch.lags(name, position)

    def leave(self, name: str) -> None:
        """Stop all axes, for one has stopped, failed, or goes elsewhere."""
        if self._left:
            return
        self._left = True
        running = [each for each in self._movements if not each.done]
        if running and name:
            logger.warning("%s left the line: the others are stopped", name)
        for movement in running:
            movement.cancel()
