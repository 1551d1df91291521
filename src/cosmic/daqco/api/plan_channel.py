"""One channel of ``rig.daqco``, in the shape that plans of bluesky expect of a detector."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, Protocol

import numpy as np
from typing_extensions import override

from cosmic.daqco.api.channel_flyer import ChannelFlyer, samples_of
from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.events import Unsubscribe
from cosmic.frame.plan_shape import (
    DataKeys,
    EventPage,
    PlanStatus,
    Readings,
    configure,
    number_key,
    plain_name,
    text_key,
    unix_now_s,
    unix_of_platform_s,
)
from cosmic.frame.plan_signal import PlanSignal

AVERAGE_S: Final = 0.1
LONGEST_AVERAGE_S: Final = 600.0


class Acquisition(Protocol):
    """What a channel needs of `Daqco`."""

    @property
    def settings(self) -> DaqcoSettings:
        """Channels and scales in force."""

    @property
    def scales(self) -> dict[str, Scale]:
        """Scale of every channel."""

    @property
    def running(self) -> bool:
        """Samples are being acquired."""

    @property
    def rate_hz(self) -> float:
        """Samples per second and channel."""

    @property
    def problem(self) -> str:
        """Why nothing is acquired."""

    @property
    def latest_chunk(self) -> DataChunk | None:
        """The newest chunk; None before the first."""

    def subscribe(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        """Call `receiver(chunk)` with every chunk."""

    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()` when anything but samples changed."""


@checked_class
class ChannelHandle:
    """A channel: Readable, Configurable, Triggerable and Flyable, without bluesky; any thread.

    Triggered, it averages what comes from then on over `average_s`. Flown, it collects every
    sample from `kickoff` to `complete`.
    """

    parent: None = None

    def __init__(self, acquisition: Acquisition, channel: str, clock: Clock) -> None:
        self._acquisition = acquisition
        self._channel = channel
        self._clock = clock
        self._average_s = AVERAGE_S
        self._read: tuple[float, float, float] | None = None
        self._flyer: ChannelFlyer | None = None
        self._live = LiveChannel(self, acquisition)

    @override
    def __repr__(self) -> str:
        return f"<ChannelHandle {self._channel}>"

    @property
    def channel(self) -> str:
        """Name of the channel, as in the platform file."""
        return self._channel

    @property
    def name(self) -> str:
        """Name of the channel, without a dot, as bluesky demands."""
        return plain_name(self._channel)

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return self._acquisition.scales[self._channel].unit

    @property
    def average_s(self) -> float:
        """Over which time of the platform a trigger averages; set it.

        Raises
        ------
        ConfigError
            It is set to something that is not above 0 and at most ten minutes.
        """
        return self._average_s

    @average_s.setter
    def average_s(self, duration_s: float) -> None:
        if not 0.0 < duration_s <= LONGEST_AVERAGE_S:
            text = f"above 0 and at most {LONGEST_AVERAGE_S:g} s"
            raise ConfigError(f"{self._channel}: average_s is {text}, not {duration_s!r}")
        self._average_s = float(duration_s)

    # One value

    def trigger(self) -> PlanStatus:
        """Begin to average samples taken from now on; the status ends when there are enough.

        It fails with `NotAvailable` where acquisition does not run, or ends meanwhile.
        """
        status = PlanStatus(f"averaging {self._channel}")
        since_s, average_s = self._clock.now_s(), self._average_s
        parts: list[Values] = []
        count = 0

        def take(chunk: DataChunk) -> None:
            nonlocal count
            if status.done:
                return
            values = samples_of(chunk, self._channel, since_s)
            parts.append(values)
            count += len(values)
            wanted = max(2, round(average_s * chunk.rate_hz))
            if count >= wanted:
                self._keep(parts, wanted, since_s + 0.5 * average_s)
                status.finish()

        self._watch(take, status)
        return status

    def _keep(self, parts: list[Values], wanted: int, middle_s: float) -> None:
        values = np.concatenate(parts)[:wanted]
        mean, std = float(values.mean()), float(values.std(ddof=1))
        self._read = (mean, std, unix_of_platform_s(self._clock, middle_s))

    def read(self) -> Readings:
        """Return mean and standard deviation of the last trigger; without one the newest value.

        Raises
        ------
        NotAvailable
            Nothing has been acquired yet.
        """
        mean, std, when_s = self._read or self.newest()
        return {
            self.name: {"value": mean, "timestamp": when_s},
            f"{self.name}_std": {"value": std, "timestamp": when_s},
        }

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        key = number_key(self._source, self.unit)
        return {self.name: key, f"{self.name}_std": key.copy()}

    def read_configuration(self) -> Readings:
        """Return averaging time, sampling rate and scale."""
        now_s = unix_now_s()
        values = {
            "average_s": self._average_s,
            "rate_hz": self._acquisition.rate_hz,
            "scale": self._acquisition.scales[self._channel].name,
        }
        return {
            f"{self.name}_{key}": {"value": value, "timestamp": now_s}
            for key, value in values.items()
        }

    def describe_configuration(self) -> DataKeys:
        """Return what `read_configuration` returns, in bluesky's terms."""
        return {
            f"{self.name}_average_s": number_key(self._source, "s"),
            f"{self.name}_rate_hz": number_key(self._source, "Hz"),
            f"{self.name}_scale": text_key(self._source),
        }

    def configure(self, settings: Mapping[str, Any]) -> tuple[Readings, Readings]:
        """Change `average_s`; return the settings before and after. Raises `ConfigError`."""

        def average(duration_s: float) -> None:
            self.average_s = duration_s

        return configure(self, settings, {"average_s": average})

    @property
    def hints(self) -> dict[str, list[str]]:
        """Which of its readings a plot shows: the mean."""
        return {"fields": [self.name]}

    @property
    def live(self) -> "LiveChannel":
        """Its newest value, for monitors and suspenders."""
        return self._live

    # Every sample

    def kickoff(self) -> PlanStatus:
        """Begin to collect every sample; the status ends with the first.

        What an earlier flight has left is forgotten. It fails as `trigger`.
        """
        if self._flyer is not None:
            self._flyer.abandon(NotAvailable(f"{self._channel}: another flight was begun"))
        flyer = ChannelFlyer(self._channel, self.name, self._clock)
        self._flyer = flyer
        self._watch(flyer.take, flyer.ended, flyer.abandon)
        return flyer.begun

    def complete(self) -> PlanStatus:
        """End collecting with what is sampled now; the status ends when that has come.

        It fails where samples were lost, or acquisition ended; what came is there all the same.
        """
        if self._flyer is None:
            status = PlanStatus(f"completing {self._channel}")
            status.fail(NotAvailable(f"{self._channel}: complete comes after kickoff"))
            return status
        return self._flyer.complete()

    def describe_collect(self) -> dict[str, DataKeys]:
        """Return what `collect_pages` returns: one stream, which has the name of the channel."""
        keys = {
            self.name: number_key(self._source, self.unit),
            f"{self.name}_time_s": number_key(self._source, "s"),
        }
        return {self.name: keys}

    def collect_pages(self) -> Iterator[EventPage]:
        """Yield what has come and was not collected: value and platform time of every sample."""
        if self._flyer is not None:
            yield from self._flyer.pages()

    # How

    def _watch(
        self,
        take: Callable[[DataChunk], None],
        status: PlanStatus,
        abandon: Callable[[CosmicError], object] | None = None,
    ) -> None:
        """Hand chunks to `take` until `status` ends, which it does with acquisition as well."""
        fail = abandon or status.fail

        def receive(chunk: DataChunk) -> None:
            try:
                take(chunk)
            except CosmicError as exc:
                fail(exc)

        def look() -> None:
            # A core that has failed still runs for a moment while it says so.
            if self._acquisition.problem or not self._acquisition.running:
                why = self._acquisition.problem or "acquisition does not run"
                fail(NotAvailable(f"{self._channel}: {why}"))

        endings = [self._acquisition.subscribe(receive), self._acquisition.on_change(look)]

        def forget(_status: PlanStatus) -> None:
            for end in endings:
                end()

        status.add_callback(forget)
        look()

    def newest(self) -> tuple[float, float, float]:
        """Return mean, standard deviation and time of the newest chunk; raises `NotAvailable`."""
        chunk = self._acquisition.latest_chunk
        if chunk is None:
            raise NotAvailable(self._acquisition.problem or "nothing has been acquired yet")
        values = samples_of(chunk, self._channel, chunk.time_s)
        std = float(values.std(ddof=1)) if len(values) > 1 else math.nan
        return float(values.mean()), std, unix_of_platform_s(self._clock, chunk.time_s)

    @property
    def _source(self) -> str:
        for each in self._acquisition.settings.channel:
            if each.name == self._channel:
                return f"{each.board}/{each.input}"
        return self._channel


class LiveChannel(PlanSignal):
    """``rig.daqco["force"].live``: the mean of the newest samples, as they come; any thread.

    Bluesky's monitors and suspenders take it.
    """

    parent: None = None

    def __init__(self, channel: ChannelHandle, acquisition: Acquisition) -> None:
        self._of = channel
        self._acquisition = acquisition

    @property
    def name(self) -> str:
        """Name of its reading, such as "force_live"."""
        return f"{self._of.name}_live"

    @override
    def get(self) -> float:
        """Return the mean of the newest samples; raises `NotAvailable` before the first."""
        return self._of.newest()[0]

    def read(self) -> Readings:
        """Return the same as a bluesky reading."""
        mean, _, when_s = self._of.newest()
        return {self.name: {"value": mean, "timestamp": when_s}}

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        return {self.name: self._of.describe()[self._of.name]}

    @override
    def _on_news(self, listener: Callable[[], object]) -> Unsubscribe:
        return self._acquisition.subscribe(lambda _chunk: listener())
