"""The one interface of DAQCo: ``rig.daqco``, its windows, plans and stations use nothing else."""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Final, TypeVar

from pydantic import ValidationError
from PySide6.QtCore import Qt
from typing_extensions import override

from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.files import (
    EXPORTS,
    RECORDINGS,
    NamedFile,
    RecordingFolders,
    named_file,
    recordings_in,
)
from cosmic.daqco.api.limit_watch import LimitWatch
from cosmic.daqco.api.plan_channel import ChannelHandle
from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.core.chunk import DataChunk, missing_samples
from cosmic.daqco.core.display_pieces import DISPLAY_S, DisplayPieces
from cosmic.daqco.core.limits import LOWEST_RATE_HZ, Crossing, Limit, LimitGuard
from cosmic.daqco.core.output_control import OutputState
from cosmic.daqco.core.plan import highest_rate_hz
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings, DaqcoSettings, LimitSettings
from cosmic.daqco.hw.board_group import ClockAgreement
from cosmic.daqco.hw.interface import BoardInfo, Volts
from cosmic.daqco.hw.outputs import Waveform
from cosmic.frame.application import CosmicApplicationBase
from cosmic.frame.arguments import checked_class
from cosmic.frame.background import OnResult
from cosmic.frame.clock import Clock
from cosmic.frame.config import wrong_values
from cosmic.frame.declaration import Companion, Declared, command, newest, state, stream
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable, RecordingError
from cosmic.frame.file_names import NameOption, directory_problem, space_left
from cosmic.frame.network.application import remote_api
from cosmic.frame.network.caller import called_remotely, caller_dead_man
from cosmic.frame.network.transport import Rule
from cosmic.frame.operation import Task
from cosmic.frame.weakly import weakly

T = TypeVar("T")

SLOW_S: Final = 20.0
"""Opening boards and closing files may take that long."""
FOLDER_AGE_S: Final = 2.0
"""How old what is known of a directory elsewhere may become before it is asked for again."""
MOST_CROSSINGS: Final = 20
NOTHING_KNOWN: Final = DaqcoSettings(
    channel=(ChannelSettings(name="unknown", board="unknown", input="ai0", active=False),)
)
"""Stands for settings while a station was never reached."""


@dataclass(frozen=True, slots=True)
class DaqCounters:
    """What has been counted since acquisition began; `backlog` in samples a channel."""

    samples: int
    lost: int
    backlog: int


NO_ZERO_S: Final = 5.0
"""A value as old as that is not called zero once acquisition has ended."""


@dataclass(frozen=True, slots=True)
class DaqLimit:
    """A limit and whether it was crossed."""

    settings: LimitSettings
    crossed: bool
    value: float | None
    reaction_ms: float | None
    reason: str


@checked_class
class Daqco(Declared):
    """Channels, recordings and limits of the platform; any thread."""

    def __init__(self, application: DaqcoApplication) -> None:
        self._application = application
        self._recorder = application.recorder
        self._folders = RecordingFolders((application.directory,))
        self._handles: dict[str, ChannelHandle] = {}
        self._guard: LimitGuard | LimitWatch = application.guard
        # At once: a call that still waits in a queue when a plain object goes would reach what is
        # no more.
        direct = Qt.ConnectionType.DirectConnection
        application.status_changed.connect(weakly(self.note_change), direct)
        self._recorder.on_change(self.note_change)
        application.guard.subscribe(lambda _crossing: self.note_change())

    @override
    def made_companion(self) -> Companion:
        """Hear of crossings here, where the boards are elsewhere."""
        watch = LimitWatch(self)
        self._guard, self._handles = watch, {}
        return watch

    # What is in force

    @property
    def application(self) -> DaqcoApplication:
        """The application behind it, where its boards are here."""
        return self._application

    @property
    @override
    def clock(self) -> Clock:
        """The clock by which the samples are dated."""
        return self._application.clock

    @property
    @state(unknown=NOTHING_KNOWN)
    def settings(self) -> DaqcoSettings:
        """Rate, channels, scales and limits in force."""
        return self._application.settings

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the active channels."""
        return tuple(each.name for each in self.settings.channel if each.active)

    @property
    def units(self) -> dict[str, str]:
        """Physical unit of every active channel: ``{"force": "uN"}``."""
        scales = self.scales
        return {name: scales[name].unit for name in self.channels}

    @property
    def scales(self) -> dict[str, Scale]:
        """Scale in force of every channel, by its name."""
        settings = self.settings
        known = settings.scales()
        return {each.name: known[each.scale] for each in settings.channel}

    @property
    def running(self) -> bool:
        """Samples are being acquired, and the station with the boards is there."""
        return not self.away and self._acquiring

    @property
    @state
    def _acquiring(self) -> bool:
        return self._application.running

    @property
    @state(unknown=NOTHING_KNOWN.rate_hz)
    def rate_hz(self) -> float:
        """The rate that the boards really make; that of the settings while nothing runs."""
        return self._application.rate_hz

    @property
    def problem(self) -> str:
        """Why acquisition stopped by itself, or cannot run; empty when all is well."""
        return self.away or self._fault

    @property
    @state
    def _fault(self) -> str:
        return self._application.problem

    @property
    def counters(self) -> DaqCounters:
        """What has been counted since acquisition began."""
        recording = self.recording
        return DaqCounters(self._samples, recording.lost + self.missed, recording.backlog)

    @property
    @state(quiet=True)
    def _samples(self) -> int:
        return self._application.buffer.samples

    def boards(self) -> Sequence[BoardInfo]:
        """Return the boards there are, as found at the last look for them."""
        return self._boards

    @property
    @state
    def _boards(self) -> tuple[BoardInfo, ...]:
        return tuple(self._application.infos.values())

    @property
    @state(quiet=True)
    def clock_agreement(self) -> tuple[ClockAgreement, ...]:
        """How well the sample clocks of boards agree that have clocks of their own."""
        return self._application.clock_agreement

    def highest_rate_hz(self, channels: Sequence[ChannelSettings] | None = None) -> float:
        """Return the highest rate for the active ones of `channels`, or of those in force."""
        infos = {each.name: each for each in self._boards}
        return highest_rate_hz(channels or self.settings.channel, infos)

    def __getitem__(self, channel: str) -> ChannelHandle:
        """Return an active channel, for plans; raises `ConfigError` where none is named so."""
        if channel not in self.channels:
            names = ", ".join(self.channels)
            raise ConfigError(f"there is no active channel {channel!r}; there are {names}")
        handle = self._handles.get(channel)
        if handle is None:
            handle = ChannelHandle(self, channel, self.clock)
            self._handles[channel] = handle
        return handle

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __iter__(self) -> Iterator[ChannelHandle]:
        return (self[channel] for channel in self.channels)

    # Data

    @property
    @newest("follow")
    def latest_chunk(self) -> DataChunk | None:
        """The newest chunk; None before the first."""
        return self._application.buffer.latest_chunk

    def latest(self) -> dict[str, float]:
        """Return the newest value of every active channel in its physical unit.

        Raises
        ------
        NotAvailable
            Nothing has been acquired yet, or nothing is any more; `latest_chunk` has what was.
        """
        chunk = self.latest_chunk
        if chunk is None:
            raise NotAvailable(self.problem or "nothing has been acquired yet")
        if not self.running:
            age_s = self._application.clock.now_s() - chunk.end_time_s
            raise NotAvailable(
                f"{self.problem or 'acquisition is stopped'}; the newest value is {age_s:.1f} s old"
            )
        return chunk.newest()

    @stream(Rule.ALL, topic="chunks", missing=missing_samples)
    def subscribe(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        """Call `receiver(chunk)` with every chunk; returns the function that ends it.

        It is called in the acquisition thread, in order, and must return at once.
        """
        return self._application.buffer.subscribe(lambda chunk: (receiver(chunk), None)[1])

    @stream(Rule.LATEST, topic="display")
    def follow(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        """Call `receiver(chunk)` with the newest samples, for a display, some 20 times a second.

        From another station some may be passed over.
        """
        display_s = DISPLAY_S * max(1.0, self._application.clock.rate)
        pieces = DisplayPieces(receiver, display_s)
        return self._application.buffer.subscribe(pieces.take)

    @override
    def carry_out(
        self, action: Callable[[], T], on_result: OnResult[T], *, slow: bool = False
    ) -> None:
        """Do what may have to wait for a line or a disk, without waiting in a window's thread.

        `on_result` takes the result, or the `CosmicError` that was raised. Where the boards are
        here it is called at once, unless it is `slow`: then a thread waits for it.
        """
        self._application.carry_out(action, on_result, slow=slow)

    # Acquisition

    @command(timeout_s=SLOW_S)
    def start(self) -> None:
        """Begin to acquire; harmless while it runs.

        Raises
        ------
        LimitError
            A board does not do what the settings ask.
        DeviceError
            A board is gone, taken or not there.
        """
        if self.problem:
            self._application.look_for_boards()
        self._application.start_acquisition()

    @command(timeout_s=SLOW_S)
    def stop(self) -> None:
        """End acquiring; a recording is closed first."""
        self._recorder.stop()
        self._application.stop_acquisition()

    @command(timeout_s=SLOW_S)
    def apply(self, settings: DaqcoSettings) -> None:
        """Put `settings` in force; acquisition goes on with them if it ran.

        Raises
        ------
        LimitError, ConfigError, NotConnectedError
            They cannot be; what was in force stays.
        NotAvailable
            Rate or channels would change while recording.
        """
        if called_remotely():
            self._check_change(settings)
        self._application.apply(settings)

    def _check_change(self, settings: DaqcoSettings) -> None:
        """Refuse what another station may not change."""
        present = self._application.settings
        if settings.directory != present.directory:
            self._folders.folder(settings.directory)
        fixed = [
            (each.drivers, each.clock_sources, each.start_triggers, each.output)
            for each in (settings, present)
        ]
        if fixed[0] != fixed[1]:
            raise ConfigError(
                "drivers, clocks, triggers and outputs are set in the platform file only"
            )

    def configure(self, *, rate_hz: float) -> None:
        """Set the sampling rate, 10 to 15000 Hz and as far as the boards go; raises as `apply`."""
        try:
            fields = self.settings.model_dump() | {"rate_hz": rate_hz}
            settings = DaqcoSettings.model_validate(fields)
        except ValidationError as exc:
            raise ConfigError(
                f"the sampling rate cannot be set: {wrong_values(exc)}; the old one stays"
            ) from None
        self.apply(settings)

    @command(timeout_s=SLOW_S)
    def set_scale(self, channel: str, scale: Scale) -> None:
        """Give a channel another scale; raises `ConfigError` where there is no such channel."""
        self._application.set_scale(channel, scale)

    @command(timeout_s=SLOW_S)
    def tare(self, channel: str) -> float:
        """Call the present value of a channel zero, by another scale; returns what it was.

        A scale that other channels have too stays theirs: this one gets one of its own.

        Raises
        ------
        NotAvailable
            Nothing has been acquired yet, not this channel, or nothing for some seconds.
        """
        chunk = self.latest_chunk
        if chunk is None or channel not in chunk.channels:
            raise NotAvailable(self.problem or f"{channel}: nothing has been acquired yet")
        age_s = self._application.clock.now_s() - chunk.end_time_s
        if not self.running and age_s > NO_ZERO_S:
            raise NotAvailable(
                f"{channel}: {self.problem or 'acquisition is stopped'}; a value of {age_s:.1f} s "
                "ago is no zero of now. Start the acquisition, and tare again"
            )
        # By the scale in force: the newest samples may have come before a tare just now.
        scale = self.scales[channel]
        value = float(scale.apply(chunk.volts[chunk.channels.index(channel)]).mean())
        first, *rest = scale.coefficients
        own = self.own_scale_name(channel)
        self.set_scale(channel, Scale(own, scale.unit, (first - value, *rest)))
        return value

    def own_scale_name(self, channel: str) -> str:
        """Return the name of a channel's scale, or another one where other channels have that.

        Raises
        ------
        ConfigError
            There is no such channel.
        """
        scales = self.scales
        if channel not in scales:
            names = ", ".join(scales)
            raise ConfigError(f"there is no channel {channel!r}; there are {names}")
        name = scales[channel].name
        taken = {each.scale for each in self.settings.channel if each.name != channel}
        while name in taken:
            name = f"{name} ({channel})"
        return name

    # Recording

    @property
    @state(unknown=RecordingState())
    def recording(self) -> RecordingState:
        """The recording that runs, or the last one."""
        return self._recorder.state

    @property
    @state(unknown=Path())
    def directory(self) -> Path:
        """Where recordings go unless somebody says otherwise."""
        return self._application.directory

    @command(timeout_s=SLOW_S)
    def start_recording(
        self, path: str | Path, *, overwrite: bool = False, before_s: float = 0.0
    ) -> None:
        """Write what is acquired to `path` until `stop_recording`, and what came just before.

        Where the boards are elsewhere the file lies there, and a relative path begins there.

        Parameters
        ----------
        before_s : float
            The recording begins so long before now, as far as so much was acquired; 0 to 5 s.

        Raises
        ------
        NotAvailable
            Nothing is acquired, or a recording runs already.
        RecordingError
            The name, which ends in .h5, the directory or the disk forbid it, or there is such a
            file and `overwrite` is False.
        ConfigError
            `before_s` is out of range.
        """
        path = self._file(path, RECORDINGS)
        if path.suffix.lower() not in RECORDINGS:
            raise RecordingError(
                f"{path}: a recording is an HDF5 file whose name ends in .h5; record to "
                f"{path.stem or 'push'}.h5, and export that to CSV or TDMS afterwards"
            )
        self._recorder.start(path, overwrite=overwrite, before_s=before_s)

    @command(timeout_s=SLOW_S)
    def stop_recording(self) -> None:
        """Close the file; returns when it is closed."""
        self._recorder.stop()

    @contextmanager
    def record(self, path: str | Path, *, overwrite: bool = False) -> Iterator[Path]:
        """Record to `path` while the block runs; raises as `start_recording`.

        Raises
        ------
        CosmicError
            At the end of the block, where the recording ended by itself before.
        """
        self.start_recording(path, overwrite=overwrite)
        try:
            yield Path(path)
        finally:
            self.stop_recording()
        if self.recording.failure:
            raise CosmicError(self.recording.failure)

    @command
    def mark(self, text: str) -> None:
        """Write a mark into the recording that runs.

        Raises
        ------
        NotAvailable
            Nothing is recorded.
        """
        self._recorder.mark(text)

    @command(reads=True, remembered_s=FOLDER_AGE_S, meanwhile="")
    def folder_problem(self, directory: str | Path) -> str:
        """Return why nothing can be recorded in `directory`; empty when it can."""
        directory = os.fspath(directory)
        if not called_remotely() or not directory.strip():
            return directory_problem(directory)
        try:
            return directory_problem(str(self._folders.folder(directory)))
        except RecordingError as exc:
            return str(exc)

    @command(reads=True, remembered_s=FOLDER_AGE_S)
    def free_bytes(self, directory: Path) -> int:
        """Return how much room there is for recordings in `directory`."""
        return space_left(self._folder(directory), 1.0).free_bytes

    @command(reads=True)
    def name_recording(
        self, base: str, option: NameOption, directory: Path, when: datetime
    ) -> NamedFile:
        """Return the file for a recording begun at `when`, a time with its zone.

        Raises
        ------
        RecordingError
            The directory cannot be used.
        """
        return named_file(base, option, self._folder(directory), when.astimezone())

    @command(reads=True)
    def recordings(self, directory: Path) -> tuple[Path, ...]:
        """Return the newest recordings in a directory, newest first; raises `RecordingError`."""
        return recordings_in(self._folder(directory))

    @command(timeout_s=SLOW_S)
    def export(self, source: Path, target: Path) -> Task:
        """Begin to export a recording to CSV or TDMS, by the suffix of `target`.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """
        # Imported here: its libraries take their time to load.
        from cosmic.daqco.api.export import export_file

        source, target = self._file(source, RECORDINGS), self._file(target, EXPORTS)

        def job(task: Task) -> None:
            def report(fraction: float) -> bool:
                task.report(fraction, target.name)
                return not task.cancel_requested

            try:
                export_file(source, target.suffix.lstrip("."), target, report)
                task.report(1.0, "done")
                task.finish()
            except CosmicError as exc:
                task.fail(exc)

        return self._application.begin(f"Export to {target.name}", job)

    def _file(self, path: str | Path, suffixes: tuple[str, ...]) -> Path:
        """Return a file as it was named here, or where other stations may have it."""
        return self._folders.file(str(path), suffixes) if called_remotely() else Path(path)

    def _folder(self, directory: Path) -> Path:
        return self._folders.folder(str(directory)) if called_remotely() else directory

    # Limits

    @property
    def guard(self) -> LimitGuard | LimitWatch:
        """What watches the limits; its `trip` is called before anybody hears of a crossing."""
        return self._guard

    def on_crossing(self, listener: Callable[[Crossing], object]) -> None:
        """Call `listener(crossing)` when a limit was crossed, or nobody can say it was not.

        The station with the boards has stopped what it has to stop by then.
        """
        self._guard.subscribe(lambda crossing: (listener(crossing), None)[1])

    @property
    @state
    def limits_there(self) -> tuple[Limit, ...]:
        """The limits as they are watched where the boards are."""
        return tuple(self._application.guard.limits.values())

    @property
    @state(quiet=True)
    def crossings_there(self) -> tuple[Crossing, ...]:
        """The newest crossings seen where the boards are, oldest first."""
        return self._application.guard.crossings[-MOST_CROSSINGS:]

    @stream(Rule.ALL, topic="crossings")
    def watch_crossings(self, receiver: Callable[[Crossing], object]) -> Callable[[], None]:
        """Call `receiver(crossing)` with each crossing seen where the boards are."""
        guard = self._application.guard
        return guard.subscribe(lambda crossing: (receiver(crossing), None)[1])

    @stream(Rule.ALL, topic="failures")
    def watch_failures(self, receiver: Callable[[str], object]) -> Callable[[], None]:
        """Call `receiver(text)` each time acquisition ends by itself, or cannot begin."""
        return self._application.on_failure(receiver)

    @property
    def limits(self) -> tuple[DaqLimit, ...]:
        """The limits there are."""
        newest = {each.channel: each for each in self._guard.crossings}
        return tuple(
            self._shown(limit, newest.get(limit.channel) if limit.tripped else None)
            for limit in self._guard.limits.values()
        )

    def _shown(self, limit: Limit, crossing: Crossing | None) -> DaqLimit:
        known = crossing is not None and math.isfinite(crossing.value)
        reason = crossing.text if crossing is not None else ""
        if not reason and limit.suspended:
            reason = "not watched: acquisition is off; armed again when it starts"
        elif not reason and self.rate_hz < LOWEST_RATE_HZ:
            reason = f"limits are watched from {LOWEST_RATE_HZ:g} Hz on"
        reaction_ms = None
        if crossing is not None and math.isfinite(crossing.reaction_s):
            reaction_ms = 1000.0 * crossing.reaction_s
        return DaqLimit(
            settings=LimitSettings(
                channel=limit.channel,
                low=limit.low if math.isfinite(limit.low) else None,
                high=limit.high if math.isfinite(limit.high) else None,
                hysteresis=limit.hysteresis,
                armed=limit.armed,
            ),
            crossed=limit.tripped,
            value=crossing.value if crossing is not None and known else None,
            reaction_ms=reaction_ms,
            reason=reason,
        )

    @command(timeout_s=SLOW_S)
    def set_limit(self, limit: LimitSettings) -> None:
        """Put the limit of a channel in force; crossing it while armed stops every actuator.

        Raises
        ------
        ConfigError
            There is no such channel, or the numbers make no sense.
        NotAvailable
            It is to be armed, and channels are sampled too slowly.
        """
        if limit.channel not in self.channels:
            names = ", ".join(self.channels)
            raise ConfigError(f"there is no active channel {limit.channel!r}; there are {names}")
        self._application.guard.set_limit(
            Limit(
                limit.channel,
                low=-math.inf if limit.low is None else limit.low,
                high=math.inf if limit.high is None else limit.high,
                hysteresis=limit.hysteresis,
                armed=limit.armed,
            )
        )
        self.note_change()

    def arm_limit(
        self,
        channel: str,
        *,
        low: float | None = None,
        high: float | None = None,
        hysteresis: float | None = None,
    ) -> None:
        """Stop every actuator when `channel` leaves `low` to `high`; raises as `set_limit`.

        What is not given stays as the limit of this channel has it: a force sensor breaks in both
        directions. `set_limit` takes a side away.
        """
        now = next(
            (each.settings for each in self.limits if each.settings.channel == channel), None
        )
        if now is not None:
            low = now.low if low is None else low
            high = now.high if high is None else high
            hysteresis = now.hysteresis if hysteresis is None else hysteresis
        try:
            limit = LimitSettings(
                channel=channel, low=low, high=high, hysteresis=hysteresis or 0.0, armed=True
            )
        except ValidationError as exc:
            what = "; ".join(each["msg"].removeprefix("Value error, ") for each in exc.errors())
            raise ConfigError(f"limit of {channel}: {what}") from None
        self.set_limit(limit)

    @command(timeout_s=SLOW_S)
    def disarm_limit(self, channel: str) -> None:
        """Watch a channel no longer; its limit stays, to be armed again by `set_limit`.

        Raises
        ------
        ConfigError
            The channel has no limit.
        """
        limit = self._application.guard.limits.get(channel)
        if limit is None:
            raise ConfigError(f"{channel!r} has no limit that could be disarmed")
        self._application.guard.set_limit(replace(limit, armed=False, suspended=False))
        self.note_change()

    @command(timeout_s=SLOW_S)
    def remove_limit(self, channel: str) -> None:
        """Take away the limit of a channel; raises `ConfigError` where there is no such channel."""
        self._check_limited(channel)
        self._application.guard.remove(channel)
        self.note_change()

    @command(timeout_s=SLOW_S)
    def reset_limit(self, channel: str) -> None:
        """Forget that the limit of a channel was crossed.

        Raises
        ------
        NotAvailable
            The channel is still beyond it.
        ConfigError
            There is no such channel.
        """
        self._check_limited(channel)
        self._application.guard.acknowledge(channel)
        self.note_change()

    def _check_limited(self, channel: str) -> None:
        guard = self._application.guard
        if channel not in self.channels and channel not in guard.limits:
            names = ", ".join(self.channels)
            raise ConfigError(f"there is no active channel {channel!r}; there are {names}")

    # Outputs

    @property
    @state
    def outputs(self) -> tuple[OutputState, ...]:
        """What each output gives that the configuration names."""
        return self._application.outputs.states

    @property
    @state
    def outputs_stopped(self) -> str:
        """Why nothing may be written to outputs; empty while it may."""
        return self._application.outputs.stopped

    @command(moves=True)
    def set_output(self, name: str, volts: float) -> None:
        """Give a voltage at an analogue output from now on.

        Raises
        ------
        ConfigError
            There is no such output in the configuration, or it is a digital line.
        MoveRefused
            The voltage is outside the limits of the output (`LimitError`) or no number, or outputs
            are stopped (`StoppedError`). Nothing was written.
        DeviceError
            The board is gone or refused.
        """
        self._application.outputs.set_voltage(name, volts, caller_dead_man())

    @command(moves=True)
    def set_line(self, name: str, *, high: bool) -> None:
        """Set a digital line; raises as `set_output`."""
        self._application.outputs.set_line(name, high=high, dead_man=caller_dead_man())

    @command(moves=True, timeout_s=SLOW_S)
    def play(
        self, name: str, volts: Volts, rate_hz: float, *, repeat: bool = False, trigger: str = ""
    ) -> float:
        """Give the values of a waveform at an analogue output; return the rate really made, Hz.

        It goes on while this returns. Afterwards the output keeps the last value.

        Parameters
        ----------
        volts : ndarray, shape (n,), float64, V
            All are checked against the limits before the first is given.
        repeat : bool
            Begin anew at the end, until another value is set.
        trigger : str
            Terminal whose rising edge begins it, such as "/Dev1/PFI0", or "/Dev1/ai/StartTrigger"
            for the next start of the acquisition; empty: it begins at once.

        Raises
        ------
        ArgumentError
            There are no values, too many, or the rate is none.
        NotAvailable
            The board plays no waveforms, or one already.
        LimitError, StoppedError, ConfigError, DeviceError
            As `set_output`.
        """
        waveform = Waveform(volts, rate_hz, repeat, trigger)
        return self._application.outputs.play(name, waveform, caller_dead_man())

    @command(at_once=True)
    def stop_outputs(self, reason: str = "stop of the outputs") -> None:
        """Drive outputs marked ``stops`` to their safe values, and refuse to write any until reset.

        It returns at once; anybody may give it.
        """
        self._application.outputs.stop(reason)
        self.note_change()

    @command(moves=True)
    def reset_outputs(self) -> None:
        """Let outputs be written again after a stop; they keep their safe values until then.

        Raises
        ------
        NotAvailable
            MiCo is stopped: reset that stop.
        """
        self._application.reset_outputs()


def daqco_of(application: CosmicApplicationBase) -> Daqco:
    """Return what an application offers, whether its boards are here or at another station.

    Raises
    ------
    TypeError
        It is no DAQCo.
    """
    if isinstance(application, DaqcoApplication):
        return Daqco(application)
    return remote_api(application, Daqco)
