"""Turning movements as they happen into the lines of a trajectory; pure."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Final

from cosmic.frame.units import AxisUnit
from cosmic.mico.core.motion.messages import MovementBegun
from cosmic.mico.core.motion.orders import MOTION_WORDS, Jog, MoveBy, MoveTo, Step
from cosmic.mico.core.trajectory.model import Leg, Move, Speed, StartPosition, Statement, Steps

STILL: Final[dict[str, float]] = {"um": 0.5, "deg": 0.0005}
"""What a position may differ by without the axis having moved."""
NEAR: Final = 4.0
"""How many times that an axis may stand away from a target that it has reached."""
SPACING_S: Final = 0.25
"""Movements that are redirected all the time are cut into parts at least as long as this."""
REPLACED_S: Final = 0.1
"""A movement that ended so shortly before the next one was replaced by it."""

Positions = Mapping[str, float]


@dataclass(slots=True)
class _Part:
    """One axis' movement in the segment."""

    begun: MovementBegun
    start: float
    unit: AxisUnit
    sensed: bool
    frequency_hz: int | None
    moving: bool = True
    broken_off: bool = False
    end: float | None = None
    ended_s: float = 0.0
    written: bool = False

    @property
    def sign(self) -> int:
        motion = self.begun.motion
        if isinstance(motion, Jog):
            return motion.direction
        target = self.begun.target
        return 0 if target is None else 1 if target > self.start else -1

    def moved(self, positions: Positions, now_s: float) -> bool:
        """Return True when it has gone anywhere since the segment began."""
        if not self.sensed:
            return now_s - self.begun.time_s > REPLACED_S
        here = self.end if self.end is not None else positions.get(self.begun.name, self.start)
        return abs(here - self.start) > STILL[self.unit]


class SegmentBuilder:
    """Cuts what goes on into segments in which each axis moves one way; one thread.

    A segment is written as one line, or one block ``together``: within it the axes start at
    once. It is cut where a movement begins while others have been under way, so that the volume
    that a line can sweep holds all that was swept.

    Parameters
    ----------
    emit, comment : callable
        Called with each statement, and with each remark.
    begin_s : float
        Platform time at which the recording begins.
    timed : bool
        Give statements their times, and jogs their speeds.
    zero : mapping of float
        What positions count from, by axis; those of a named pose.
    """

    def __init__(
        self,
        emit: Callable[[Statement | tuple[str, StartPosition]], None],
        comment: Callable[[str], None],
        *,
        begin_s: float,
        timed: bool,
        zero: Mapping[str, float],
    ) -> None:
        self._emit = emit
        self._comment = comment
        self._begin_s = begin_s
        self._timed = timed
        self._zero = dict(zero)
        self._parts: dict[str, _Part] = {}
        self._since_s = 0.0
        self._started: set[str] = set()
        self._speeds: dict[str, tuple[float | None, str]] = {}

    def begun(
        self,
        event: MovementBegun,
        positions: Positions,
        *,
        sensed: bool,
        frequency_hz: int | None,
        resting: Collection[str] = (),
    ) -> None:
        """Take the beginning of a movement.

        Parameters
        ----------
        positions : mapping of float
            Where all axes are just then.
        frequency_hz : int or None
            The closed-loop frequency that was set for the axis; None: the usual one.
        resting : collection of str
            Axes that have come to rest, even if that was not told yet.
        """
        now_s = event.time_s
        self._settle(positions, now_s, resting)
        known = self._parts.get(event.name)
        if known is not None and self._goes_on(known, event, positions):
            known.begun = event
            known.moving, known.broken_off, known.end = True, False, None
            return
        if known is not None or any(
            not each.moving or each.moved(positions, now_s) for each in self._parts.values()
        ):
            self._cut(positions, now_s, but=event.name)
        if not self._parts:
            self._since_s = now_s
        start = positions.get(event.name, event.from_position or 0.0)
        self._parts[event.name] = _Part(event, start, event.unit, sensed, frequency_hz)
        self._emit_start(event, start, sensed=sensed)
        if not isinstance(event.motion, MoveTo | MoveBy | Step | Jog):
            words = MOTION_WORDS[type(event.motion)]
            self._comment(f"{event.name}: {words} is not repeated; where it ended is")

    def ended(self, name: str, positions: Positions, now_s: float, *, well: bool) -> None:
        """Take the end of a movement."""
        part = self._parts.get(name)
        if part is None or not part.moving:
            return
        part.moving, part.broken_off, part.ended_s = False, not well, now_s
        target = part.begun.target
        exact = well and target is not None and not isinstance(part.begun.motion, Jog)
        part.end = target if exact else positions.get(name, part.start)
        if part.written and part.broken_off:
            self._comment(f"{name} was stopped before the end of the steps above")

    def idle(self, now_s: float) -> None:
        """Write what is over; call it now and then while nothing happens."""
        parts = self._parts.values()
        if not parts or any(each.moving for each in parts):
            return
        if now_s - max(each.ended_s for each in parts) > REPLACED_S:
            self._cut({}, now_s, but="")

    def close(self, positions: Positions, now_s: float, resting: Collection[str] = ()) -> None:
        """Write the rest; what still moves is written as far as it got."""
        self._settle(positions, now_s, resting)
        self._cut(positions, now_s, but="")

    def _settle(self, positions: Positions, now_s: float, resting: Collection[str]) -> None:
        """Take the ends of movements that nobody has told yet."""
        for name, part in self._parts.items():
            if part.moving and name in resting:
                target, here = part.begun.target, positions.get(name)
                missed = (
                    target is not None
                    and here is not None
                    and (abs(here - target) > NEAR * STILL[part.unit])
                )
                self.ended(name, positions, now_s, well=not missed)

    def _emit_start(self, event: MovementBegun, start: float, *, sensed: bool) -> None:
        if sensed and event.name not in self._started:
            self._started.add(event.name)
            value = start - self._zero.get(event.name, 0.0)
            self._emit((event.name, StartPosition(value, event.unit, 0)))

    def _goes_on(self, part: _Part, event: MovementBegun, positions: Positions) -> bool:
        """Return True when a movement only takes the place of one the same way."""
        replaced = part.moving or (part.broken_off and event.time_s - part.ended_s <= REPLACED_S)
        if not (replaced and part.sensed and type(part.begun.motion) is type(event.motion)):
            return False
        here = positions.get(event.name, part.start)
        later = _Part(event, here, part.unit, part.sensed, part.frequency_hz)
        young = event.time_s - self._since_s < SPACING_S
        return later.sign == part.sign and (young or len(self._parts) == 1)

    def _cut(self, positions: Positions, now_s: float, *, but: str) -> None:
        """Write the segment so far; what is under way goes on in the next one."""
        parts, self._parts = self._parts, {}
        statements = []
        for name, part in parts.items():
            found = self._statement(name, part, positions, now_s)
            if found is not None:
                statements.append(found)
            if part.moving and name != but:
                part.start = positions.get(name, part.start)
                part.written = part.written or found is not None
                self._parts[name] = part
        if statements:
            self._emit_speeds(parts)
            at_s = max(0.0, round(self._since_s - self._begin_s, 3))
            self._emit(Leg(tuple(statements), 0, at_s if self._timed else None))
        self._since_s = now_s

    def _statement(
        self, name: str, part: _Part, positions: Positions, now_s: float
    ) -> Move | Steps | None:
        motion = part.begun.motion
        if not part.sensed:
            return self._steps(name, part, now_s)
        end = part.end if part.end is not None else positions.get(name, part.start)
        asked = isinstance(motion, MoveTo | MoveBy) and not part.moving and not part.broken_off
        if not asked and abs(end - part.start) <= STILL[part.unit]:
            return None
        return Move(name, end - self._zero.get(name, 0.0), part.unit, by=False, line=0)

    def _steps(self, name: str, part: _Part, now_s: float) -> Steps | None:
        motion = part.begun.motion
        if isinstance(motion, Step):
            if part.written:
                return None
            steps = motion.steps
            if part.broken_off:
                ran_s = part.ended_s - part.begun.time_s
                steps = round(min(1.0, ran_s * motion.frequency_hz / abs(steps)) * steps)
            if steps == 0:
                return None
            return Steps(name, steps, motion.amplitude_v, motion.frequency_hz, 0)
        if isinstance(motion, Jog):
            until_s = now_s if part.moving else part.ended_s
            since_s = max(part.begun.time_s, self._since_s)
            steps = round(motion.direction * motion.speed * (until_s - since_s))
            hertz = max(1, round(motion.speed))
            return Steps(name, steps, None, hertz, 0) if steps else None
        return None

    def _emit_speeds(self, parts: Mapping[str, _Part]) -> None:
        """Say how fast axes go, where that is not as fast as usual."""
        if not self._timed:
            return
        for name, part in parts.items():
            if not part.sensed:
                continue
            motion = part.begun.motion
            wanted: tuple[float | None, str] = (None, "")
            if isinstance(motion, Jog):
                wanted = (motion.speed, f"{part.unit}/s")
            elif part.frequency_hz is not None:
                wanted = (float(part.frequency_hz), "Hz")
            if wanted != self._speeds.get(name, (None, "")):
                self._speeds[name] = wanted
                self._emit(Speed(name, *wanted, 0))
