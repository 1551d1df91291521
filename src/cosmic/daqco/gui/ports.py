"""What the widgets of DAQCo ask of the application, and nothing more.

Every value is read at once: nothing here waits for a device. What is not a type of the core is a
Protocol of properties, so that a frozen dataclass of the application will do.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Protocol, TypeVar

from cosmic.daqco.api.errands import Told
from cosmic.daqco.api.files import NamedFile
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.settings import ChannelSettings, DaqcoSettings, LimitSettings
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.file_names import NameOption
from cosmic.frame.task import Task

T = TypeVar("T")
Unsubscribe = Callable[[], None]


class Counters(Protocol):
    """What has been counted since acquisition began."""

    @property
    @abstractmethod
    def samples(self) -> int:
        """Samples a channel that were acquired."""

    @property
    @abstractmethod
    def lost(self) -> int:
        """Samples a channel that were lost, by the board or on the way to a receiver."""

    @property
    @abstractmethod
    def backlog(self) -> int:
        """Samples a channel that were acquired and are not yet written."""


class Recording(Protocol):
    """The recording that runs, or the last one."""

    @property
    @abstractmethod
    def active(self) -> bool:
        """Samples are being written."""

    @property
    @abstractmethod
    def path(self) -> Path | None:
        """The file; None before the first recording."""

    @property
    @abstractmethod
    def duration_s(self) -> float:
        """How much is in the file, in time."""

    @property
    @abstractmethod
    def size_bytes(self) -> int:
        """How large the file is."""

    @property
    @abstractmethod
    def failure(self) -> str:
        """Why it ended by itself, fit for the operator; empty when it did not."""


class LimitState(Protocol):
    """A force limit and whether it was crossed."""

    @property
    @abstractmethod
    def settings(self) -> LimitSettings:
        """Channel, low, high, hysteresis, armed; in the unit of the channel's scale."""

    @property
    @abstractmethod
    def crossed(self) -> bool:
        """Crossed and latched until it is reset."""

    @property
    @abstractmethod
    def value(self) -> float | None:
        """The value that crossed it; None when it was not, or when data had stopped coming."""

    @property
    @abstractmethod
    def reaction_ms(self) -> float | None:
        """From the crossing sample to the stop; None while unknown."""

    @property
    @abstractmethod
    def reason(self) -> str:
        """Why it is crossed or cannot be armed, fit for the operator; else empty."""


class DaqPort(Protocol):
    """The application as its widgets see it; all of it may be called in the GUI thread.

    Methods that refuse raise a `CosmicError` whose text is fit for the operator. Where the boards
    are at another station, what commands would wait for the line: `carry_out` has it done.
    """

    # What is in force

    @property
    @abstractmethod
    def settings(self) -> DaqcoSettings:
        """Rate, refresh rate, channels, scales and limits in force."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """Samples are being acquired."""

    @property
    @abstractmethod
    def rate_hz(self) -> float:
        """The rate that the boards really make; that of the settings while nothing runs."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why acquisition stopped by itself, such as a lost board; empty when all is well."""

    @property
    @abstractmethod
    def away(self) -> str:
        """Why the station with the boards cannot be reached; empty while it can."""

    @property
    @abstractmethod
    def elsewhere(self) -> str:
        """Where the files lie, such as "at the station fibres"; empty on this computer."""

    @property
    @abstractmethod
    def counters(self) -> Counters:
        """What has been counted."""

    @property
    @abstractmethod
    def recording(self) -> Recording:
        """The recording that runs, or the last one."""

    @property
    @abstractmethod
    def limits(self) -> Sequence[LimitState]:
        """The limits there are, in the order of the settings."""

    @property
    @abstractmethod
    def directory(self) -> Path:
        """Where recordings go unless the operator says otherwise."""

    # Listening

    @abstractmethod
    def follow(self, receiver: Callable[[DataChunk], object]) -> Unsubscribe:
        """Call `receiver(chunk)` with the newest samples, in order, in another thread.

        At home with every chunk; from another station some may be passed over. A chunk has the
        active channels only, in the order of the settings. The receiver returns at once. After
        the returned function was called, no more calls begin.
        """

    @abstractmethod
    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()`, in any thread, when anything but samples and counters changed."""

    @abstractmethod
    def carry_out(self, action: Callable[[], T], told: Told[T], *, slow: bool = False) -> None:
        """Do `action`, which commands; `told(result, error)` at its end, maybe in another thread.

        At home both is done at once, unless it is `slow`: then a thread waits for it.
        """

    # Acquisition

    @abstractmethod
    def boards(self) -> Sequence[BoardInfo]:
        """Return the boards there are, as found at the last look for them."""

    @abstractmethod
    def highest_rate_hz(self, channels: Sequence[ChannelSettings]) -> float:
        """Return the highest rate that all boards together can give the active of `channels`."""

    @abstractmethod
    def start(self) -> None:
        """Begin to acquire."""

    @abstractmethod
    def stop(self) -> None:
        """End acquiring; a recording is closed."""

    @abstractmethod
    def apply(self, settings: DaqcoSettings) -> None:
        """Put `settings` in force; acquisition goes on with them if it ran.

        Refused while recording when rate or active channels would change.
        """

    # Recording

    @abstractmethod
    def start_recording(self, path: Path, *, overwrite: bool = False) -> None:
        """Write what is acquired to `path`; refused when it exists and `overwrite` is False."""

    @abstractmethod
    def stop_recording(self) -> None:
        """Close the file; returns when it is closed or when closing it failed (see `failure`)."""

    @abstractmethod
    def folder_problem(self, directory: str) -> str:
        """Return why nothing can be recorded in `directory`; empty when it can."""

    @abstractmethod
    def name_recording(
        self, base: str, option: NameOption, directory: Path, when: datetime
    ) -> NamedFile:
        """Return the file for a recording that is begun now; it commands."""

    @abstractmethod
    def free_bytes(self, directory: Path) -> int:
        """Return how much room there is for files in `directory`; raises when there is none."""

    @abstractmethod
    def recordings(self, directory: Path) -> tuple[Path, ...]:
        """Return the newest recordings in a directory, newest first; it commands."""

    @abstractmethod
    def export(self, source: Path, target: Path) -> Task:
        """Begin to export a recording to CSV or TDMS, by the suffix of `target`."""

    # Limits

    @abstractmethod
    def set_limit(self, limit: LimitSettings) -> None:
        """Put in force the limit of a channel instead of the one it has."""

    @abstractmethod
    def remove_limit(self, channel: str) -> None:
        """Take away the limit of a channel."""

    @abstractmethod
    def reset_limit(self, channel: str) -> None:
        """Forget that the limit of a channel was crossed; refused while it still is."""
