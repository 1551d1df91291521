"""`ControlHandle`: a control loop that runs, as whoever began it sees it."""

import math
from types import TracebackType
from typing import Final, Self

import numpy as np
from typing_extensions import override

from cosmic.autonomy.control.force_servo import ForceServo
from cosmic.autonomy.control.law import ControlState
from cosmic.autonomy.control.loop import (
    ControlEnding,
    ControlLoop,
    ControlReading,
    ControlStatistics,
)
from cosmic.autonomy.control.sources import Source
from cosmic.autonomy.control.trace import ControlTrace
from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceTimeout,
    LimitError,
    NotAvailable,
)
from cosmic.frame.threads import forbid_waiting_here
from cosmic.frame.verdict import Reason, refuse

LOOK_WALL_S: Final = 0.02
"""How often `wait_settled` looks."""


@checked_class
class ControlHandle:
    """A control loop that runs, as scripts and windows see it; any thread.

    As a context manager it ends at the end of the block.
    """

    def __init__(
        self,
        loop: ControlLoop,
        set_point: float,
        *,
        tolerance: float,
        limits: tuple[float, float],
        settle_s: float,
    ) -> None:
        self._loop = loop
        self._set_point = set_point
        self._tolerance = tolerance
        self._limits = limits
        self._settle_s = settle_s

    @override
    def __repr__(self) -> str:
        return f"<ControlHandle: {self.source} by {self.axis}, {self.state}>"

    @property
    def source(self) -> str:
        """Channel or axis that is measured."""
        return self._loop.source.name

    @property
    def unit(self) -> str:
        """Unit of what is measured."""
        return self._loop.source.unit

    @property
    def axis(self) -> str:
        """Axis that is moved."""
        return self._loop.sink.name

    @property
    def axis_unit(self) -> str:
        """Unit of that axis."""
        return self._loop.sink.unit

    @property
    def limits(self) -> tuple[float, float]:
        """Between which values it goes on; in `unit`."""
        return self._limits

    @property
    def set_point(self) -> float:
        """What is to be held in the end; on a ramp `reading.set_point` is on its way there."""
        return self._set_point

    @property
    def tolerance(self) -> float:
        """How far off the value may be and count as held; in `unit`."""
        return self._tolerance

    @property
    def state(self) -> ControlState:
        """What it is at."""
        return self._loop.state

    @property
    def running(self) -> bool:
        """True until it has ended."""
        return self._loop.ending is None

    @property
    def ending(self) -> ControlEnding | None:
        """Why it ended; None while it runs."""
        return self._loop.ending

    @property
    def reason(self) -> str:
        """Why it ended, in words; empty while it runs."""
        return self._loop.reason

    @property
    def error(self) -> CosmicError | None:
        """What ended it; None while it runs, and where it was asked to end."""
        return self._loop.error

    @property
    def reading(self) -> ControlReading:
        """Value, set point and output now."""
        return self._loop.reading

    @property
    def stiffness_un_um(self) -> float | None:
        """Stiffness that the loop goes by, uN/um; None where it is no force-servo."""
        law = self._loop.law
        return law.stiffness_un_um if isinstance(law, ForceServo) else None

    @property
    def statistics(self) -> ControlStatistics:
        """Period, packets and priority."""
        return self._loop.statistics()

    def trace(self, seconds: float = 10.0) -> ControlTrace:
        """Return set point, value and output of the last `seconds` of wall time, up to 20."""
        return self._loop.trace(seconds)

    def aim(self, set_point: float) -> None:
        """Go for another set point, in a ramp.

        Raises
        ------
        LimitError
            It does not lie inside the limits, or inside what the channel can measure.
        """
        check_inside(self.source, self.unit, set_point, self._limits)
        check_measurable(self._loop.source, set_point)
        self._set_point = set_point
        self._loop.law.aim(set_point)

    def stop(self) -> None:
        """End it and stop the axis; returns at once. Harmless once it has ended."""
        self._loop.finish()

    def wait(self, timeout_s: float | None = None) -> ControlEnding:
        """Wait for its end and return why; raises `DeviceTimeout` after `timeout_s`."""
        return self._loop.over.wait(timeout_s)

    def wait_settled(self, tolerance: float | None = None, timeout_s: float = 30.0) -> float:
        """Wait until the value is held, and return its mean.

        Held means: the set point is reached, and the mean over the settling time lies within
        `tolerance` of it, each half of that time too.

        Parameters
        ----------
        tolerance : float
            In `unit`; that of the loop if None.
        timeout_s : float
            Wall time.

        Raises
        ------
        CosmicError
            What ended the loop.
        DeviceTimeout
            It was not held after `timeout_s`; the loop goes on.
        """
        forbid_waiting_here("waiting for a control loop")
        within = self._tolerance if tolerance is None else tolerance
        if not 0.0 < within < math.inf:
            raise ConfigError(f"tolerance must be a number above 0, got {tolerance!r}")
        end_s = WALL.now_s() + timeout_s
        while WALL.now_s() < end_s:
            held = self._held(within)
            if held is not None:
                return held
            if self._loop.over.done:
                raise self.error or NotAvailable(f"{self.source}: the loop was ended")
            WALL.sleep(LOOK_WALL_S)
        reading = self.reading
        raise DeviceTimeout(
            f"{self.source} was not held after {timeout_s:g} s: {reading.measured:.4g} "
            f"{self.unit} instead of {reading.set_point:.4g} {self.unit}, {self.state}"
        )

    def _held(self, tolerance: float) -> float | None:
        if self.state is not ControlState.HOLDING:
            return None
        trace = self.trace(self._settle_s)
        if not trace.wall_s.size or trace.wall_s[-1] - trace.wall_s[0] < 0.9 * self._settle_s:
            return None
        goal = self._set_point
        if np.any(trace.set_point != goal):
            return None
        halves = np.array_split(trace.measured, 2)
        if any(abs(float(half.mean()) - goal) > tolerance for half in halves):
            return None
        return float(trace.measured.mean())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
        self._loop.join()

    def join(self) -> None:
        """Wait until its thread has ended; for whoever closes the platform."""
        self._loop.join()


def check_inside(name: str, unit: str, value: float, limits: tuple[float, float]) -> None:
    """Raise `LimitError` where a set point does not lie inside the limits."""
    low, high = limits
    if low < value < high and math.isfinite(value):
        return
    text = f"{name}: a set point of {value:g} {unit} does not lie inside {low:g} to {high:g}"
    limit = high if value >= high else low
    raise LimitError(refuse(Reason.LIMIT, text, value=value, limit=limit, unit=unit))


def check_measurable(source: Source, value: float) -> None:
    """Raise `LimitError` where a set point lies beyond what its source can measure."""
    low, high = source.measurable
    if low < value < high:
        return
    text = (
        f"{source.name}: a set point of {value:g} {source.unit} cannot be held: it measures "
        f"from {low:g} to {high:g} {source.unit}"
    )
    limit = high if value >= high else low
    raise LimitError(refuse(Reason.LIMIT, text, value=value, limit=limit, unit=source.unit))
