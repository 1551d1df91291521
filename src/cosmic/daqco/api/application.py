"""DAQCo as a CoSMic application (thesis 5.5, 6.2)."""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from threading import RLock
from typing import Final, TypeVar

from PySide6.QtCore import QObject, Qt
from typing_extensions import override

from cosmic.daqco.api.recorder import Recorder
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.guarded import check_arming, check_guarded, successor, unit_of
from cosmic.daqco.core.left_behind import OpenRecordings
from cosmic.daqco.core.limits import Limit, LimitGuard
from cosmic.daqco.core.output_control import OutputControl
from cosmic.daqco.core.plan import AcquisitionPlan, make_plan, restarts
from cosmic.daqco.core.recording_format import RecordedExposure
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings, ScaleSettings
from cosmic.daqco.core.udaq_buffer import UDaqBuffer
from cosmic.daqco.core.udaq_core import UDaqCore
from cosmic.daqco.hw.board_group import ClockAgreement
from cosmic.daqco.hw.interface import Board, BoardInfo, BoardLibrary, OverrunError
from cosmic.daqco.hw.outputs import open_outputs
from cosmic.daqco.hw.pulses import PulseTrain
from cosmic.frame.application import GuiFactory
from cosmic.frame.background import BackgroundJobs, OnResult, do_and_report
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotAvailable,
)
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Task
from cosmic.frame.task_application import TaskApplication
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

T = TypeVar("T")

FIRST_DATA_S: Final = 1.0
LONGER: Final = 1.0
"""How many times as much a chunk of a simulation has, for each time that it is faster."""

LONGEST_CHUNK_S: Final = 0.25
"""They must come, at the pace of the wall too, before they are missed."""


MOST_RESTARTS: Final = 3
RESTARTS_S: Final = 60.0
"""So often within this time acquisition begins again by itself after an overrun."""


def lost_text(lost: int | None, rate_hz: float) -> str:
    """Return how many samples were lost, in words and in time."""
    if lost is None:
        return "an unknown number of samples of each channel was lost"
    return f"{lost} samples of each channel ({1000.0 * lost / rate_hz:.0f} ms) were lost"


class RestartBudget:
    """How often acquisition may begin again by itself; one thread."""

    def __init__(self) -> None:
        self._taken_s: deque[float] = deque(maxlen=MOST_RESTARTS)

    def take(self, now_s: float) -> bool:
        """Take one restart; False where there were too many of late."""
        full = len(self._taken_s) == MOST_RESTARTS
        if full and now_s - self._taken_s[0] < RESTARTS_S:
            return False
        self._taken_s.append(now_s)
        return True


WATCH_S: Final = 0.02
HANG_S: Final = 5.0
"""A board that has not answered for so long hangs."""
BRIEFLY_S: Final = 0.1


class SilenceWatch(WorkerThread):
    """Looks again and again whether an armed channel has fallen silent, or a board hangs.

    Parameters
    ----------
    asked : callable
        Tells which board has not answered, and a number of what it was asked.
    hangs : callable
        Called with the name of a board that has not answered for `HANG_S`.
    """

    def __init__(
        self,
        guard: LimitGuard,
        asked: Callable[[], tuple[str, int] | None],
        hangs: Callable[[str], object],
        policy: FailurePolicy,
    ) -> None:
        super().__init__("limit watch", policy)
        self._guard = guard
        self._asked = asked
        self._hangs = hangs

    @override
    def run_body(self) -> None:
        before, looks = self._asked(), 0
        while not self._end_requested.wait(WATCH_S):
            self._guard.look_for_silence()
            # Looks are counted: a computer that stood still is not taken for a board that hangs.
            asked = self._asked()
            looks = looks + 1 if asked == before and asked is not None else 0
            before = asked
            if asked is not None and looks == round(HANG_S / WATCH_S):
                self._hangs(asked[0])


class DaqcoApplication(TaskApplication):
    """Owns boards, acquisition, buffer and limits; its methods may be called from any thread.

    Parameters
    ----------
    library : BoardLibrary
        The driver behind the boards.
    software, configuration : str
        Version and platform file, for the recordings.
    notes : OpenRecordings or None
        Where recordings that are being written are noted, for the next start to close.
    """

    def __init__(
        self,
        library: BoardLibrary,
        settings: DaqcoSettings,
        *,
        clock: Clock,
        policy: FailurePolicy,
        software: str = "",
        configuration: str = "",
        notes: OpenRecordings | None = None,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("DAQCo", policy, gui_factory, parent)
        self.library = library
        self.clock = clock
        self.buffer = UDaqBuffer()
        self.guard = LimitGuard(clock)
        self.guard.check = self._check_arming
        self.guard.unit_of = lambda channel: unit_of(channel, self._settings)
        self._policy = policy
        self._settings = settings
        self._lock = RLock()
        self._boards: dict[str, Board] = {}
        self._infos: dict[str, BoardInfo] = {}
        self._core: UDaqCore | None = None
        self._problem = ""
        self._hung: UDaqCore | None = None
        self._silence = SilenceWatch(self.guard, self._asked, self._on_hang, policy)
        self._background = BackgroundJobs("DAQCo background", policy)
        self._before_change: tuple[Callable[[DaqcoSettings], None], ...] = ()
        self._failed: Event[str] = Event()
        self.outputs = OutputControl(
            settings.output,
            lambda board: open_outputs(library, board),
            policy,
            self.status_changed.emit,
            note=lambda text: self.recorder.note("output", text),
        )
        self.stopped_outside: Callable[[], str] = lambda: ""
        self._restarts = RestartBudget()
        self.recorder = Recorder(
            self, policy, software=software, configuration=configuration, notes=notes
        )

    # What there is

    @property
    def settings(self) -> DaqcoSettings:
        """What is in force."""
        return self._settings

    @property
    def directory(self) -> Path:
        """Where recordings go unless somebody says otherwise."""
        return Path(self.settings.directory).expanduser() if self.settings.directory else Path.cwd()

    @property
    def problem(self) -> str:
        """Why acquisition cannot run, or ended by itself; empty when all is well."""
        return self._problem

    @property
    def infos(self) -> Mapping[str, BoardInfo]:
        """The boards there are, by name."""
        return dict(self._infos)

    @property
    def running(self) -> bool:
        """Samples are being acquired."""
        core = self._core
        return core is not None and core.isRunning() and not core.given_up

    @property
    def rate_hz(self) -> float:
        """The rate the boards really make; that of the settings while nothing runs."""
        core = self._core
        return core.rate_hz if core is not None else self._settings.rate_hz

    @property
    def pulses(self) -> PulseTrain | None:
        """The trigger of a camera that is given now."""
        core = self._core
        return core.plan.pulses if core is not None else None

    def exposure_near(self, time_s: float) -> RecordedExposure | None:
        """Return the pulse at which an exposure began that began about then; any thread.

        None where no pulse lies within half a period, or acquisition began anew since.
        """
        train, chunk = self.pulses, self.buffer.latest_chunk
        trigger = self._settings.camera_trigger
        if train is None or chunk is None or trigger is None:
            return None
        about = chunk.first_sample + (time_s - chunk.time_s) * chunk.rate_hz
        sample = train.nearest(about)
        if abs(sample - about) > 0.5 * train.every_samples:
            return None
        at_s = chunk.time_s + (sample - chunk.first_sample) / chunk.rate_hz
        return RecordedExposure(sample, at_s, train.number_of(sample), trigger.camera)

    def exposures_in(self, chunk: DataChunk) -> Iterator[RecordedExposure]:
        """Return the exposures of a camera that begin at samples of a chunk."""
        train, trigger = self.pulses, self._settings.camera_trigger
        if train is None or trigger is None:
            return
        for sample in train.samples_in(chunk.first_sample, chunk.samples):
            at_s = chunk.time_s + (sample - chunk.first_sample) / chunk.rate_hz
            yield RecordedExposure(sample, at_s, train.number_of(sample), trigger.camera)

    @property
    def clock_agreement(self) -> tuple[ClockAgreement, ...]:
        """How well the sample clocks of the boards agree that have clocks of their own."""
        core = self._core
        return core.agreement if core is not None else ()

    def scales(self) -> dict[str, Scale]:
        """Return the scale in force of every channel, by its name."""
        known = self._settings.scales()
        return {each.name: known[each.scale] for each in self._settings.channel}

    # Starting and ending

    @override
    def initialize(self) -> None:
        """Open the boards and begin to acquire; stays open with `problem` set where it cannot.

        Returns when there are first values.
        """
        self.start()
        self._silence.start()
        self._open()
        if self.running:
            self.buffer.wait_for_data(FIRST_DATA_S)

    def initialize_later(self) -> Task:
        """Do what `initialize` does in the application's thread; returns at once."""
        self.start()
        self._silence.start()

        def job(task: Task) -> None:
            self._open()
            task.finish()

        return self.begin("Opening the boards", job)

    def _open(self) -> None:
        try:
            self._set_configured_limits()
            self.look_for_boards()
            self.start_acquisition()
        except CosmicError as exc:
            self._fail(str(exc))
        self.outputs.begin()
        self.status_changed.emit()

    def _set_configured_limits(self) -> None:
        """Set the limits of the file; those that are to be armed are, once samples come."""
        for each in self._settings.limit:
            limit = Limit(
                each.channel,
                low=-float("inf") if each.low is None else each.low,
                high=float("inf") if each.high is None else each.high,
                hysteresis=each.hysteresis,
            )
            if each.armed:
                self.guard.set_suspended(limit)
            else:
                self.guard.set_limit(limit)

    def look_for_boards(self) -> None:
        """Look for boards and open those there are.

        Raises
        ------
        NotConnectedError
            The driver is not installed.
        """
        with self._lock:
            self._close_boards()
            self._infos = {info.name: info for info in self.library.list_boards()}

    def start_acquisition(self) -> None:
        """Begin to acquire with the settings in force; harmless while it runs.

        Raises
        ------
        LimitError
            A board does not do what the settings ask.
        NotConnectedError, DeviceError
            A board is not there, or taken.
        DeviceTimeout
            A board still hangs.
        """
        with self._lock:
            if self.running and not self._problem:
                return
            if self.end_requested:
                raise NotAvailable("DAQCo is closed")
            # One that failed may still be ending; forgotten while it runs, it ends the program.
            self._end_core()
            self._check_hung()
            settings = self._settings
            # However fast a simulation runs, on the wall there are no more than were asked for, or
            # it would do nothing else; who waits for samples has a chunk end there.
            longer_s = min(LONGER * self.clock.rate * settings.chunk_s, LONGEST_CHUNK_S)
            chunk_s = max(settings.chunk_s, longer_s)
            plan = make_plan(
                settings.channel, settings.rate_hz, chunk_s, self._infos, settings.camera_trigger
            )
            for name in plan.boards:
                if name not in self._boards:
                    self._boards[name] = self.library.open(name)
            core = UDaqCore(
                plan,
                self._boards,
                self.scales(),
                self._take,
                self._policy,
                clocked=tuple(settings.clock_sources),
                clock_ppm=settings.clock_ppm,
            )
            core.failed.connect(self._on_core_failed, Qt.ConnectionType.DirectConnection)
            self.buffer.clear()
            core.open()
            self._core, self._problem = core, ""
            self.guard.watch_silence(settings.silence_s, simulated=self._simulated(plan))
            self.guard.set_rate(core.rate_hz)
        logger.info(
            "acquiring %d channels at %g Hz from %s",
            len(plan.channels),
            core.rate_hz,
            ", ".join(plan.boards),
        )
        self.status_changed.emit()

    def _simulated(self, plan: AcquisitionPlan) -> bool:
        return all(self._infos[name].simulated for name in plan.boards)

    def stop_acquisition(self) -> None:
        """End acquiring; harmless when nothing runs.

        Limits that are armed are not watched meanwhile, which is told, and are armed again when
        acquisition starts.
        """
        with self._lock:
            if self._core is None:
                return
            self.guard.set_rate(0.0)
            self._end_core()
        logger.info("acquisition ended")
        self.status_changed.emit()

    def _end_core(self) -> None:
        core, self._core = self._core, None
        if core is not None:
            core.request_end()
            ended = core.join(BRIEFLY_S) if core.given_up else core.join()
            if not ended:
                self._hung = core
                if not core.given_up:
                    boards = ", ".join(core.plan.boards)
                    logger.error("%s: stop does not return; check cable and driver", boards)

    def _check_hung(self) -> None:
        """Raise while a board has not returned from an acquisition that was given up."""
        core, self._hung = self._hung, None
        if core is not None and not core.join(BRIEFLY_S):
            self._hung = core
            asked = core.asked
            whom, call = (asked[0], "receive") if asked else (", ".join(core.plan.boards), "stop")
            raise DeviceTimeout(
                f"{whom}: {call} still has not returned, and two threads cannot use one board. "
                f"Check its cable and its driver, then start again",
                fault=DeviceFault.TIMEOUT,
            )

    def apply(self, settings: DaqcoSettings) -> None:
        """Put `settings` in force; acquisition goes on with them if it ran.

        Raises
        ------
        LimitError, NotConnectedError, ConfigError
            They cannot be; what was in force stays.
        NotAvailable
            Rate or channels would change while recording, or something that an armed limit rests
            on: disarm that first.
        """
        with self._lock:
            if self._infos:
                make_plan(
                    settings.channel,
                    settings.rate_hz,
                    settings.chunk_s,
                    self._infos,
                    settings.camera_trigger,
                )
            before = self._settings
            limits = self.guard.limits.values()
            for check in self._before_change:
                check(settings)
            for limit in limits:
                if limit.armed or limit.suspended:
                    check_guarded(limit, before, settings)
            self._settings = settings
            core = self._core
            if core is not None and not restarts(before, settings):
                core.set_scales(self.scales())
                self.guard.watch_silence(settings.silence_s, simulated=self._simulated(core.plan))
            elif core is not None:
                self._restart(before)
            self._follow(limits, before)
        self.status_changed.emit()

    def _restart(self, before: DaqcoSettings) -> None:
        """Acquire anew; limits stay armed, and silence of more than `silence_s` trips them."""
        self._end_core()
        try:
            self.start_acquisition()
        except CosmicError:
            self._settings = before
            try:
                self.start_acquisition()
            except CosmicError as exc:
                self._fail(str(exc))
                self.guard.trip_all(f"acquisition does not run ({exc})")
            raise

    def _follow(self, limits: Iterable[Limit], before: DaqcoSettings) -> None:
        """Have limits that are not armed follow their channels, or say that they are gone."""
        for limit in limits:
            name, why = successor(limit.channel, before, self._settings)
            if why:
                self.guard.remove(limit.channel, why)
            elif name != limit.channel:
                self.guard.rename(limit.channel, name)

    def _check_arming(self, limit: Limit) -> None:
        check_arming(limit, self._settings)

    def before_change(self, check: Callable[[DaqcoSettings], None]) -> None:
        """Call `check(settings)` before they come into force; what it raises forbids them."""
        self._before_change = (*self._before_change, check)

    # Data

    def _take(self, chunk: DataChunk) -> None:
        """Take a chunk: the limits see it before anybody else; acquisition thread."""
        self.guard.look(chunk)
        self.buffer.put(chunk)

    def _on_core_failed(self, error: DeviceError) -> None:
        """Stop what the limits guard, then tell; acquisition thread, which ends."""
        if not isinstance(error, OverrunError):
            self.guard.trip_all(f"acquisition ended ({error})")
            self._fail(str(error))
        else:
            failed, amount = self._core, lost_text(error.lost, self.rate_hz)
            self.guard.trip_all(f"computer overloaded, {amount}: they were not processed")
            self._fail(str(error))
            self.recorder.note("overload", f"computer overloaded, {amount} ({error})")
            if self._restarts.take(WALL.now_s()):
                self._background.do(
                    lambda: self._start_again(failed, amount), self._on_started_again
                )
            else:
                self._fail(
                    f"{error}. Acquisition was restarted {MOST_RESTARTS} times within "
                    f"{RESTARTS_S:g} s and stays off now"
                )
        self.status_changed.emit()

    def _asked(self) -> tuple[str, int] | None:
        core = self._core
        return core.asked if core is not None else None

    def _on_hang(self, board: str) -> None:
        """End an acquisition of which a board does not answer; the watch's thread."""
        core = self._core
        if core is None or core.given_up:
            return
        core.give_up()
        error = DeviceTimeout(
            f"{board}: receive has not returned for {HANG_S:g} s: the board or its driver hangs. "
            f"Acquisition ended; check its cable and its driver, then start again",
            fault=DeviceFault.TIMEOUT,
        )
        self._on_core_failed(error)
        # Stopping may be what makes it return, and may hang as well.
        self._background.do(core.request_end, lambda _result, _error: None)

    def _start_again(self, failed: UDaqCore | None, amount: str) -> None:
        """Acquire again after an overrun, unless somebody did something else meanwhile."""
        with self._lock:
            if failed is None or self._core is not failed or self.end_requested:
                return
            self.start_acquisition()
        logger.warning("acquisition restarted after an overrun: %s", amount)

    def _on_started_again(self, _result: None, error: CosmicError | None) -> None:
        if error is not None:
            self._fail(str(error))
            self.status_changed.emit()

    def _fail(self, text: str) -> None:
        self._problem = text
        logger.error("DAQCo: %s", text)
        self._failed.emit(text)

    def on_failure(self, listener: Callable[[str], object]) -> Unsubscribe:
        """Call `listener(text)` each time acquisition ends by itself, or cannot begin."""
        return self._failed.subscribe(listener)

    def reset_outputs(self) -> None:
        """Let outputs be written again after a stop.

        Raises
        ------
        NotAvailable
            Something else keeps them stopped.
        """
        if why := self.stopped_outside():
            raise NotAvailable(f"motion is stopped ({why}): reset that stop, and outputs go on too")
        self.outputs.reset()

    def set_scale(self, channel: str, scale: Scale) -> None:
        """Give a channel a scale of any name; others of that name are replaced by it.

        Raises
        ------
        ConfigError
            There is no such channel.
        """
        settings = self._settings
        if channel not in {each.name for each in settings.channel}:
            names = ", ".join(each.name for each in settings.channel)
            raise ConfigError(f"there is no channel {channel!r}; there are {names}")
        added = ScaleSettings(name=scale.name, unit=scale.unit, coefficients=scale.coefficients)
        scales = (*(each for each in settings.scale if each.name != scale.name), added)
        channels = tuple(
            each.model_copy(update={"scale": scale.name}) if each.name == channel else each
            for each in settings.channel
        )
        self.apply(settings.model_copy(update={"scale": scales, "channel": channels}))

    def carry_out(
        self, action: Callable[[], T], on_result: OnResult[T], *, slow: bool = False
    ) -> None:
        """Do `action` and tell how it ended: at once, or in another thread what is `slow`."""
        if slow:
            self._background.do(action, on_result)
        else:
            do_and_report(action, on_result)

    # The end

    def _close_boards(self) -> None:
        for board in self._boards.values():
            board.close()
        self._boards.clear()

    @override
    def shut_down(self) -> None:
        """Close the recording, end acquisition, close the boards, end all threads; any state."""
        self.request_end()
        self._background.request_end()
        self._background.join()
        self.outputs.close()
        self.recorder.stop()
        self._silence.request_end()
        self._silence.join()
        self.stop_acquisition()
        with self._lock:
            if self._hung is None:  # closing it would hang as well
                self._close_boards()
        self.join()
