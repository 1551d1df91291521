"""The DAQCo part of the scripted API: ``rig.daqco``; windows use it as well."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from PySide6.QtCore import Qt

from cosmic.daqco.api.channel_shape import ChannelHandle
from cosmic.daqco.api.ports import DaqcoHost
from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import LOWEST_RATE_HZ, Crossing, Limit
from cosmic.daqco.core.plan import highest_rate_hz
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings, DaqcoSettings, LimitSettings
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.listeners import tell
from cosmic.frame.task import Task


@dataclass(frozen=True, slots=True)
class DaqCounters:
    """What has been counted since acquisition began; `backlog` in samples a channel."""

    samples: int
    lost: int
    backlog: int


@dataclass(frozen=True, slots=True)
class DaqLimit:
    """A limit and whether it was crossed."""

    settings: LimitSettings
    crossed: bool
    value: float | None
    reaction_ms: float | None
    reason: str


@checked_class
class Daqco:
    """Channels, recordings and limits of the platform; any thread."""

    def __init__(self, application: DaqcoHost) -> None:
        self._application = application
        self._recorder = application.recorder
        self._listeners: tuple[Callable[[], object], ...] = ()
        self._handles: dict[str, ChannelHandle] = {}
        # At once and by a function that keeps this object: a call that still waits in a queue when
        # a plain object goes would reach what is no more.
        direct = Qt.ConnectionType.DirectConnection
        application.status_changed.connect(lambda: self._tell(), direct)
        self._recorder.on_change(self._tell)
        application.guard.subscribe(self._on_crossing)

    # What is in force

    @property
    def application(self) -> DaqcoHost:
        """The application behind it."""
        return self._application

    @property
    def away(self) -> str:
        """Why the station with the boards cannot be reached; empty while it can, and at home."""
        return self._application.away

    @property
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
        return self._application.scales()

    @property
    def running(self) -> bool:
        """Samples are being acquired."""
        return self._application.running

    @property
    def rate_hz(self) -> float:
        """The rate that the boards really make; that of the settings while nothing runs."""
        return self._application.rate_hz

    @property
    def problem(self) -> str:
        """Why acquisition stopped by itself, or cannot run; empty when all is well."""
        return self._application.problem

    @property
    def counters(self) -> DaqCounters:
        """What has been counted since acquisition began."""
        state = self._recorder.state
        buffer = self._application.buffer
        return DaqCounters(buffer.samples, state.lost + buffer.lost, state.backlog)

    def boards(self) -> Sequence[BoardInfo]:
        """Return the boards there are, as found at the last look for them."""
        return tuple(self._application.infos.values())

    def highest_rate_hz(self, channels: Sequence[ChannelSettings] | None = None) -> float:
        """Return the highest rate for the active ones of `channels`, or of those in force."""
        return highest_rate_hz(channels or self.settings.channel, self._application.infos)

    def __getitem__(self, channel: str) -> ChannelHandle:
        """Return an active channel, for plans; raises `ConfigError` where none is named so."""
        if channel not in self.channels:
            names = ", ".join(self.channels)
            raise ConfigError(f"there is no active channel {channel!r}; there are {names}")
        handle = self._handles.get(channel)
        if handle is None:
            handle = ChannelHandle(self, channel, self._application.clock)
            self._handles[channel] = handle
        return handle

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __iter__(self) -> Iterator[ChannelHandle]:
        return (self[channel] for channel in self.channels)

    # Data

    @property
    def latest_chunk(self) -> DataChunk | None:
        """The newest chunk; None before the first."""
        return self._application.buffer.latest_chunk

    def latest(self) -> dict[str, float]:
        """Return the newest value of every active channel in its physical unit.

        Raises
        ------
        NotAvailable
            Nothing has been acquired yet.
        """
        values = self._application.buffer.get_latest_data()
        if not values:
            raise NotAvailable(self.problem or "nothing has been acquired yet")
        return values

    def subscribe(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        """Call `receiver(chunk)` with every chunk; returns the function that ends it.

        It is called in the acquisition thread, in order, and must return at once.
        """
        return self._application.buffer.subscribe(lambda chunk: (receiver(chunk), None)[1])

    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()`, in any thread, when anything but samples changed."""
        self._listeners = (*self._listeners, listener)

        def forget() -> None:
            self._listeners = tuple(each for each in self._listeners if each is not listener)

        return forget

    def _tell(self) -> None:
        tell(self._listeners)

    def _on_crossing(self, _crossing: Crossing) -> None:
        self._tell()

    # Acquisition

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

    def stop(self) -> None:
        """End acquiring; a recording is closed first."""
        self._recorder.stop()
        self._application.stop_acquisition()

    def apply(self, settings: DaqcoSettings) -> None:
        """Put `settings` in force; acquisition goes on with them if it ran.

        Raises
        ------
        LimitError, ConfigError, NotConnectedError
            They cannot be; what was in force stays.
        NotAvailable
            Rate or channels would change while recording.
        """
        self._application.apply(settings)

    def configure(self, *, rate_hz: float) -> None:
        """Set the sampling rate, 10 to 15000 Hz and as far as the boards go; raises as `apply`."""
        try:
            fields = self.settings.model_dump() | {"rate_hz": rate_hz}
            settings = DaqcoSettings.model_validate(fields)
        except ValueError as exc:
            raise ConfigError(f"rate_hz: {rate_hz!r} is not accepted: {exc}") from None
        self.apply(settings)

    def set_scale(self, channel: str, scale: Scale) -> None:
        """Give a channel another scale; raises `ConfigError` where there is no such channel."""
        self._application.set_scale(channel, scale)

    # Recording

    @property
    def recording(self) -> RecordingState:
        """The recording that runs, or the last one."""
        return self._recorder.state

    @property
    def directory(self) -> Path:
        """Where recordings go unless somebody says otherwise."""
        return self._application.directory

    def start_recording(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write what is acquired to `path` until `stop_recording`.

        Raises
        ------
        NotAvailable
            Nothing is acquired, or a recording runs already.
        RecordingError
            The name, the directory or the disk forbid it, or there is such a file and
            `overwrite` is False.
        """
        self._recorder.start(Path(path), overwrite=overwrite)

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

    def mark(self, text: str) -> None:
        """Write a mark into the recording that runs."""
        self._recorder.mark(text)

    def free_bytes(self, directory: Path) -> int:
        """Return how much room there is for recordings in `directory`."""
        return self._application.files.free_bytes(directory)

    def export(self, source: Path, target: Path) -> Task:
        """Begin to export a recording to CSV or TDMS, by the suffix of `target`.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """
        return self._application.files.export(source, target)

    # Limits

    @property
    def limits(self) -> tuple[DaqLimit, ...]:
        """The limits there are."""
        newest = {each.channel: each for each in self._application.guard.crossings}
        return tuple(
            self._shown(limit, newest.get(limit.channel) if limit.tripped else None)
            for limit in self._application.guard.limits.values()
        )

    def _shown(self, limit: Limit, crossing: Crossing | None) -> DaqLimit:
        known = crossing is not None and math.isfinite(crossing.value)
        reason = crossing.text if crossing is not None else ""
        if not reason and limit.suspended:
            reason = "not watched: nothing is acquired; armed again when acquisition starts"
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
        self._tell()

    def arm_limit(
        self,
        channel: str,
        *,
        low: float | None = None,
        high: float | None = None,
        hysteresis: float = 0.0,
    ) -> None:
        """Stop every actuator when `channel` leaves `low` to `high`; raises as `set_limit`."""
        try:
            limit = LimitSettings(
                channel=channel, low=low, high=high, hysteresis=hysteresis, armed=True
            )
        except ValueError as exc:
            raise ConfigError(f"limit of {channel}: {exc}") from None
        self.set_limit(limit)

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
        self._tell()

    def remove_limit(self, channel: str) -> None:
        """Take away the limit of a channel."""
        self._application.guard.remove(channel)
        self._tell()

    def reset_limit(self, channel: str) -> None:
        """Forget that the limit of a channel was crossed.

        Raises
        ------
        NotAvailable
            The channel is still beyond it.
        """
        self._application.guard.acknowledge(channel)
        self._tell()
