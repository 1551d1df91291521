"""`ControlLoop`: source, law and sink joined at a fixed period, in a thread of its own."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from threading import Lock

from typing_extensions import override

from cosmic.autonomy.control.law import Answer, ControlState, Law
from cosmic.autonomy.control.pace import LoopTimer, PaceStatistics, ask_real_time, quick_switching
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.autonomy.control.sink import AxisSink
from cosmic.autonomy.control.sources import Sample, Source
from cosmic.autonomy.control.trace import ControlTrace, TraceRecorder
from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    LimitError,
    MoveCancelled,
    MoveRefused,
    StoppedError,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Operation
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)


class ControlEnding(StrEnum):
    """Why a control loop ended."""

    ASKED = "asked to"
    STALE = "no data"
    LIMIT = "limit"
    REFUSED = "refused"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"
    DEVICE = "device"
    DEFECT = "defect"


@dataclass(frozen=True, slots=True)
class ControlReading:
    """A loop at one moment.

    Attributes
    ----------
    measured, set_point : float
        In the unit of the source; nan before the first value.
    output : float
        Velocity asked for, in the unit of the axis a second.
    position : float
        Where the axis was sent, from the user's zero at the begin.
    error : float
        Measured less set point.
    """

    measured: float = math.nan
    set_point: float = math.nan
    output: float = 0.0
    position: float = math.nan

    @property
    def error(self) -> float:
        """Measured less set point."""
        return self.measured - self.set_point


@dataclass(frozen=True, eq=False, slots=True)
class ControlStatistics:
    """How a loop is doing.

    Attributes
    ----------
    pace : PaceStatistics
        Its period.
    packets : int
        Moves sent to the axis.
    real_time : str
        "" when the thread runs with real-time priority; otherwise why it does not.
    """

    pace: PaceStatistics
    packets: int
    real_time: str


class ControlLoop(WorkerThread):
    """Runs until it is ended, by whomever; then the axis is stopped.

    Parameters
    ----------
    rate : float
        Of the platform's clock, for the law lives in the platform's time.
    on_end : callable
        Called once with the loop when it has ended, in the thread that ended it.
    """

    may_wait = False

    def __init__(
        self,
        source: Source,
        law: Law,
        sink: AxisSink,
        settings: ControlSettings,
        *,
        rate: float,
        policy: FailurePolicy,
        on_end: Callable[["ControlLoop"], None] | None = None,
    ) -> None:
        super().__init__(f"control {source.name} {sink.name}", policy)
        self.source, self.law, self.sink = source, law, sink
        self._settings = settings
        self._rate = rate or 1.0
        self._timer = LoopTimer(1.0 / settings.rate_hz)
        self._trace = TraceRecorder(settings.rate_hz)
        self._on_end = on_end
        self._lock = Lock()
        self._ending: ControlEnding | None = None
        self._error: CosmicError | None = None
        self._over = Operation[ControlEnding](f"the loop of {source.name}")
        self._real_time = "it has not started"
        self._begun_wall_s = self._begun_s = 0.0
        self._zero = 0.0
        self.state = ControlState.STARTING
        self.reading = ControlReading()

    @property
    def ending(self) -> ControlEnding | None:
        """Why it ended; None while it runs."""
        return self._ending

    @property
    def error(self) -> CosmicError | None:
        """What ended it; None while it runs, and where it was asked to end."""
        return self._error

    @property
    def over(self) -> Operation[ControlEnding]:
        """Ends when its thread has done all there was to do, with why it ended."""
        return self._over

    def statistics(self) -> ControlStatistics:
        """Return how it is doing; any thread."""
        return ControlStatistics(self._timer.meter.statistics(), self.sink.packets, self._real_time)

    def trace(self, seconds: float) -> ControlTrace:
        """Return what it did in the last `seconds`; any thread."""
        return self._trace.last(seconds)

    def begin(self) -> None:
        """Take the axis and start; raises what `Source.begin` and `AxisSink.begin` raise."""
        self.sink.begin()
        self._zero = self.sink.zero
        self._begun_wall_s, self._begun_s = WALL.now_s(), self.source.clock.now_s()
        self.source.begin(self.finish)
        self.start()
        logger.info("control loop: %s by %s begins", self.source.name, self.sink.name)

    def finish(self, error: CosmicError | None = None, ending: ControlEnding | None = None) -> None:
        """End it and stop the axis; the first reason stays. Returns at once; any thread."""
        with self._lock:
            first = self._ending is None
            if first:
                self._ending = ending or _ending_of(error)
                self._error = error
                self.state = ControlState.ENDED
        if not first:
            return
        try:
            self.sink.close(error)
        except CosmicError as exc:  # its station is lost: what it commands ends there by itself
            logger.error("control loop: %s could not be stopped: %s", self.sink.name, exc)
        finally:
            self._end_requested.set()
            self._timer.end()
        log = logger.info if error is None else logger.warning
        log("control loop: %s by %s ended: %s", self.source.name, self.sink.name, self.reason)

    @property
    def reason(self) -> str:
        """Why it ended, in words; empty while it runs."""
        if self._ending is None:
            return ""
        return str(self._error) if self._error is not None else str(self._ending)

    @override
    def request_end(self) -> None:
        self.finish()
        super().request_end()

    # Its own thread

    @override
    def run_body(self) -> None:
        try:
            wanted = self._settings.real_time
            asked = ask_real_time(self._settings.priority) if wanted else "not asked for"
            self._real_time = asked
            if wanted and asked:
                logger.info("control loop: %s", asked)
            with quick_switching():
                self._run()
        except CosmicError as exc:
            self.finish(exc)
        except BaseException as exc:
            self.finish(
                DeviceError(f"{self.name}: its thread failed: {exc!r}"), ControlEnding.DEFECT
            )
            raise
        finally:
            self.finish()
            self.source.end()
            self._over.finish(self._ending or ControlEnding.ASKED)
            if self._on_end is not None:
                self._on_end(self)

    def _run(self) -> None:
        self._timer.begin()
        while not self.end_requested:
            passed_s = self._timer.wait()
            if passed_s <= 0.0 or self.end_requested:
                return
            self._cycle(passed_s)

    def _cycle(self, passed_s: float) -> None:
        # Speeds are such that what happens within the latency is safe: a cycle that comes later,
        # for the computer stood still, makes up for nothing.
        dt_s = min(passed_s * self._rate, self._settings.latency_s)
        sample = self._fresh()
        if sample is None or WALL.now_s() - sample.read_wall_s > self.source.pause_s:
            self.sink.brake(dt_s)
            return
        answer = self.law.step(sample.value, self.sink.target, dt_s)
        if answer.velocity == 0.0:
            self.sink.rest(dt_s)
        else:
            self.sink.move(answer.velocity, dt_s)
        self._note(sample.value, answer)

    def _fresh(self) -> Sample | None:
        """Return the newest value, None before the first; raises when it is old or no number."""
        source, clock = self.source, self.source.clock
        now_s = clock.now_s()
        sample = source.newest()
        since_s = self._begun_s if sample is None else sample.read_s
        if not now_s - since_s <= source.stale_s * (clock.rate or 1.0):
            raise _StaleError(f"no data of {source.name} for {source.stale_s:g} s")
        if sample is not None and not math.isfinite(sample.value):
            raise _StaleError(f"{source.name} is not a number")
        return sample

    def _note(self, measured: float, answer: Answer) -> None:
        position = self.sink.target - self._zero
        self.reading = ControlReading(measured, answer.set_point, answer.velocity, position)
        with self._lock:
            if self._ending is None:
                self.state = answer.state
        wall_s = WALL.now_s() - self._begun_wall_s
        self._trace.put((wall_s, answer.set_point, measured, answer.velocity, position))


class _StaleError(DeviceError):
    """The source does not tell any more what it measures."""


def _ending_of(error: CosmicError | None) -> ControlEnding:
    kinds: tuple[tuple[type[CosmicError], ControlEnding], ...] = (
        (_StaleError, ControlEnding.STALE),
        (StoppedError, ControlEnding.STOPPED),
        (LimitError, ControlEnding.LIMIT),
        (MoveRefused, ControlEnding.REFUSED),
        (MoveCancelled, ControlEnding.INTERRUPTED),
    )
    if error is None:
        return ControlEnding.ASKED
    return next((ending for kind, ending in kinds if isinstance(error, kind)), ControlEnding.DEVICE)
