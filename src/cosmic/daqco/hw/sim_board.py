"""A simulated board: paced by the platform's clock, with a real board's limits and troubles."""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from cosmic.daqco.hw.board_checks import BUFFER_S, check_chunk, check_inputs, check_rate
from cosmic.daqco.hw.interface import (
    Board,
    BoardChunk,
    BoardInfo,
    InputSettings,
    OverrunError,
)
from cosmic.daqco.hw.pulses import PulseTrain
from cosmic.daqco.hw.sim_faults import BoardFaults
from cosmic.daqco.hw.sim_outputs import Terminals
from cosmic.daqco.hw.sim_signal import Signal
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.events import Unsubscribe
from cosmic.frame.time_scale import Horizon, Worker
from cosmic.twin.trigger_line import TriggerLine

logger = logging.getLogger(__name__)

TIMEBASE_HZ: Final = 20e6
FIFO_SAMPLES: Final = 4095

LATE_S: Final = 0.04
"""So late may the receiver be, by the wall, before the platform's time waits for it."""

EXPECTED_LATE_S: Final = 0.02
"""The same where somebody waits for what there is by then, by the platform's time: a movement that
a force ends is to end as soon on a fast clock as on that of the wall. Boards that are fetched one
after the other began some milliseconds apart."""

EDGE_SAMPLES: Final = 1e-3
"""What is asked for up to a sample is asked for with that sample, whatever the rounding."""

MakeSignal = Callable[[Sequence[InputSettings], int], Signal]


@dataclass(slots=True)
class Pieces:
    """The first sample of the piece that a board of a library gave last, and the one after it.

    Boards that acquire together end a piece at the same sample.
    """

    first: int = -1
    end: int = -1


@dataclass(frozen=True, slots=True)
class _Setup:
    inputs: tuple[InputSettings, ...]
    rate_hz: float
    """As the board tells it."""
    true_hz: float
    """As its clock really runs."""
    chunk_samples: int
    signal: Signal
    offsets_s: npt.NDArray[np.float64]
    """Of the samples of a chunk, from its first."""


@dataclass(slots=True)
class _Run:
    """One acquisition under way; only the receiving thread moves its samples.

    Attributes
    ----------
    next_sample, due_sample : int
        The first one of the next chunk, and the first one after it.
    """

    setup: _Setup
    start_s: float
    horizon: Horizon
    next_sample: int = 0
    due_sample: int = 0

    def time_s(self, sample: int) -> float:
        """Return when a sample is truly taken."""
        return self.start_s + sample / self.setup.true_hz

    def reported_s(self, sample: int) -> float:
        """Return when it is, as far as the board's clock knows."""
        return self.start_s + sample / self.setup.rate_hz

    def first_at(self, reported_s: float) -> int:
        """Return the first sample that is reported for this time or a later one."""
        return math.ceil((reported_s - self.start_s) * self.setup.rate_hz + EDGE_SAMPLES)


class SimulatedBoard(Board):
    """One simulated board; made by its library.

    Parameters
    ----------
    make_signal : callable
        Makes what the inputs carry, from their settings and the length of a chunk.
    timebase_hz : float
        The rate is this over a whole number, as on the real board; 0 allows any rate.
    clock_ppm : float
        How much faster than it says its sample clock runs, in parts of a million.
    terminals : Terminals or None
        Of the library: where triggers come in, and where it says that it has started.
    trigger_lines : mapping of str to TriggerLine, or None
        What is connected to counters, by board and counter.
    start_trigger : str
        Terminal whose rising edge starts it; empty: it starts when told to.
    paced : bool
        False: chunks are due at once, however many are asked for.
    owners : dict of str to SimulatedBoard
        Of the library: who has configured each board; nobody else can until it is closed.
    receiver : Worker
        Of the library: the thread that receives, one for all boards. While it waits for a chunk of
        one board it is not at work on the chunk of another.
    pieces : Pieces or None
        Of the library: where its boards end their pieces, which somebody may wait for.
    """

    def __init__(
        self,
        info: BoardInfo,
        clock: Clock,
        faults: BoardFaults,
        make_signal: MakeSignal,
        *,
        owners: dict[str, "SimulatedBoard"],
        receiver: Worker,
        pieces: Pieces | None = None,
        timebase_hz: float = TIMEBASE_HZ,
        paced: bool = True,
        clock_ppm: float = 0.0,
        terminals: Terminals | None = None,
        start_trigger: str = "",
        trigger_lines: Mapping[str, TriggerLine] | None = None,
    ) -> None:
        self._info = info
        self._clock = clock
        self._faults = faults
        self._make_signal = make_signal
        self._owners = owners
        self._timebase_hz = timebase_hz
        self._paced = paced
        self._fast = 1.0 + 1e-6 * clock_ppm
        self._terminals = terminals or Terminals()
        self._start_trigger = start_trigger
        self._trigger_lines = trigger_lines or {}
        self._train: PulseTrain | None = None
        self._setup: _Setup | None = None
        self._run: _Run | None = None
        self._closed = False
        self._receiver = receiver
        self._pieces = pieces or Pieces()
        self._leave_expected: Unsubscribe = lambda: None

    @property
    @override
    def info(self) -> BoardInfo:
        return self._info

    @override
    def configure(
        self, inputs: Sequence[InputSettings], rate_hz: float, chunk_samples: int
    ) -> float:
        self._check_there("configure")
        if self._run is not None:
            raise self._error("configure: it is acquiring; stop it first", DeviceFault.STATE)
        self._setup = None
        check_inputs(self._info, inputs)
        check_rate(self._info, len(inputs), rate_hz)
        check_chunk(self._info, chunk_samples)
        with self._faults.changed:
            if self._owners.setdefault(self._info.name, self) is not self:
                raise self._taken("configure")
        real_hz = self._nearest_rate_hz(rate_hz)
        signal = self._make_signal(inputs, chunk_samples)
        true_hz = real_hz * self._fast
        offsets_s = np.arange(chunk_samples) / true_hz
        self._setup = _Setup(tuple(inputs), real_hz, true_hz, chunk_samples, signal, offsets_s)
        logger.debug("%s: %d inputs at %g Hz", self._info.name, len(inputs), real_hz)
        return real_hz

    @override
    def start(self) -> None:
        self._check_there("start")
        if self._setup is None:
            raise self._error("start: it was not configured", DeviceFault.STATE)
        with self._faults.changed:
            if self._run is not None:
                raise self._error("start: it is acquiring already", DeviceFault.STATE)
            self._pieces.first = -1
            start_s = math.inf if self._start_trigger else self._clock.now_s()
            run = _Run(self._setup, start_s, self._clock.horizon())
            run.horizon.move_to(self._horizon_s(run, self._due_s(run)))
            self._run = run
            self._hear_expected()
        if self._start_trigger:
            self._terminals.once(self._start_trigger, lambda at_s: self._triggered(run, at_s))
        else:
            self._begun(run)

    @override
    def receive(self, timeout_s: float) -> BoardChunk | None:
        run = self._wait_until_due(timeout_s)
        if run is None:
            return None
        setup, first = run.setup, run.next_sample
        times_s = setup.offsets_s[: run.due_sample - first] + run.time_s(first)
        # Outside the lock: a source may be slow, and a stop must not wait for it.
        volts = setup.signal.volts(first, times_s)
        self._pieces.first, self._pieces.end = first, run.due_sample
        run.next_sample = run.due_sample
        if self._run is not run:
            return None
        return BoardChunk(first, run.reported_s(first), volts)

    @override
    def stop(self) -> None:
        with self._faults.changed:
            self._end_run()
            self._faults.changed.notify_all()

    @override
    def close(self) -> None:
        self.stop()
        self._closed = True
        with self._faults.changed:
            if self._owners.get(self._info.name) is self:
                del self._owners[self._info.name]

    def _triggered(self, run: _Run, at_s: float) -> None:
        with self._faults.changed:
            if self._run is not run:
                return
            run.start_s = at_s
            self._faults.changed.notify_all()
        self._begun(run)

    def pulse(self, train: PulseTrain | None) -> None:
        """Give these pulses with each acquisition from the next start on; None: none."""
        self._train = train

    def _begun(self, run: _Run) -> None:
        line, train = self._line, self._train
        if line is not None and train is not None:
            line.drive(run.time_s(train.first_sample), train.every_samples / run.setup.true_hz)
        self._terminals.rise(f"/{self._info.name}/ai/StartTrigger", run.start_s)

    def _wait_until_due(self, timeout_s: float) -> _Run | None:
        """Return the acquisition whose next chunk is due, or None; raises `DeviceError`."""
        end_s = WALL.now_s() + timeout_s
        changed = self._faults.changed
        with changed:
            run = self._run
            while run is not None and self._run is run:
                self._check_going(run)
                due_s = self._due_s(run)
                run.horizon.move_to(self._horizon_s(run, due_s))
                now_s = self._clock.now_s()
                if due_s <= now_s:
                    run.horizon.move_to(self._usual_horizon_s(due_s))  # it has come
                    self._receiver.busy()  # until it has handed the chunk on, and comes again
                    return run
                self._receiver.idle()
                left_s = end_s - WALL.now_s()
                if left_s <= 0.0:
                    return None
                # A clock that a test moves has no rate: it looks up every now and then.
                rate = self._clock.rate
                until_s = min(due_s, now_s + left_s * rate) if rate else due_s
                self._clock.wait(changed, until_s)
        return None

    def _due_s(self, run: _Run) -> float:
        if self._faults.hit("stalled", self._info.name):
            return math.inf
        run.due_sample = self._due_sample(run)
        if not self._paced:
            return -math.inf
        return run.time_s(run.due_sample)

    def _due_sample(self, run: _Run) -> int:
        """Return the first sample after the next chunk, which is whole unless it is waited for."""
        whole = run.next_sample + run.setup.chunk_samples
        if self._pieces.first == run.next_sample:
            return min(self._pieces.end, whole)
        expectations = self._clock.expectations
        if expectations is None or math.isinf(run.start_s):
            return whole
        wanted_s = expectations.next_s(run.reported_s(run.next_sample))
        if wanted_s == math.inf:
            return whole
        return min(max(run.first_at(wanted_s), run.next_sample + 1), whole)

    def _hear_expected(self) -> None:
        """Bring the end of a chunk forward when somebody waits for a part of it."""
        expectations = self._clock.expectations
        if expectations is not None:
            self._leave_expected = expectations.added.subscribe(self._expected)

    def _expected(self, time_s: float) -> None:
        with self._faults.changed:
            run = self._run
            if run is None or math.isinf(run.start_s) or not self._paced:
                return
            fetched = run.due_sample <= run.next_sample  # and nobody has come for the next yet
            due = run.next_sample + run.setup.chunk_samples if fetched else run.due_sample
            if time_s < run.time_s(due):
                # Already now: whoever fetches samples may come late to hear of it.
                wanted_s = max(run.time_s(run.first_at(time_s)), self._clock.now_s())
                run.horizon.move_to(wanted_s + EXPECTED_LATE_S)
                self._faults.changed.notify_all()

    def _horizon_s(self, run: _Run, due_s: float) -> float:
        """Return how far the platform's time may go before what is due then is fetched."""
        if self._paced and run.due_sample < run.next_sample + run.setup.chunk_samples:
            return due_s + EXPECTED_LATE_S
        return self._usual_horizon_s(due_s)

    def _usual_horizon_s(self, due_s: float) -> float:
        return due_s + LATE_S * max(1.0, self._clock.rate) if self._paced else math.inf

    def _check_going(self, run: _Run) -> None:
        """End the acquisition and raise when it failed; the lock is held."""
        try:
            self._check_there("receive")
            self._check_overrun(run)
        except DeviceError:
            self._end_run()
            raise

    def _end_run(self) -> None:
        """Acquire no more, and let the time run without this board; the lock is held."""
        if self._run is not None:
            self._run.horizon.close()
            if self._line is not None:
                self._line.rest(self._clock.now_s())
            self._leave_expected()
        self._run = None
        self._receiver.idle()

    @property
    def _line(self) -> TriggerLine | None:
        train = self._train
        place = f"{self._info.name}/{train.counter}" if train is not None else ""
        return self._trigger_lines.get(place)

    def _check_overrun(self, run: _Run) -> None:
        setup = run.setup
        if self._faults.hit("overrun", self._info.name):
            raise self._overrun(run, setup.chunk_samples)
        waits = math.isinf(run.start_s)  # for its trigger
        if not self._paced or waits or self._faults.hit("stalled", self._info.name):
            return
        taken = int((self._clock.now_s() - run.start_s) * setup.true_hz)
        # The receiver is late by the wall: on a fast clock the buffer holds as much longer.
        room_s = BUFFER_S * max(1.0, self._clock.rate)
        room = int(room_s * setup.rate_hz) + FIFO_SAMPLES // len(setup.inputs)
        lost = taken - run.next_sample - max(room, 4 * setup.chunk_samples)
        if lost > 0:
            raise self._overrun(run, lost)

    def _overrun(self, run: _Run, lost: int) -> DeviceError:
        return OverrunError(
            f"{self._info.name}: receive: {lost} samples of each channel were lost after sample "
            f"{run.next_sample}: they were not fetched in time; close what slows the computer, or "
            f"lower the rate, and start again",
            lost=lost,
        )

    def _check_there(self, call: str) -> None:
        name = self._info.name
        if self._closed:
            raise self._error(f"{call}: it was closed; open it again", DeviceFault.STATE)
        if self._faults.hit("unplugged", name) or self._faults.hit("no_driver", name):
            raise NotConnectedError(
                f"{name}: {call}: the board is gone; check its cable and power, then start again",
                fault=DeviceFault.COMMUNICATION,
            )
        if self._faults.hit("reserved", name) and call in ("configure", "start"):
            raise self._taken(call)

    def _taken(self, call: str) -> DeviceError:
        return self._error(
            f"{call}: another program uses the board; close it, then try again", DeviceFault.STATE
        )

    def _error(self, text: str, fault: DeviceFault) -> DeviceError:
        return DeviceError(f"{self._info.name}: {text}", fault=fault)

    def _nearest_rate_hz(self, rate_hz: float) -> float:
        """Return the highest rate up to `rate_hz` that divides the time base."""
        if not self._timebase_hz:
            return rate_hz
        return self._timebase_hz / math.ceil(self._timebase_hz / rate_hz)
