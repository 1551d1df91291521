"""What `Daqco`, couplings and windows ask of DAQCo, wherever its boards are."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Protocol, TypeVar

from PySide6.QtCore import SignalInstance

from cosmic.daqco.api.errands import Told
from cosmic.daqco.api.files import NamedFile
from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import Crossing, Limit
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.clock import Clock
from cosmic.frame.file_names import NameOption
from cosmic.frame.task import Task

T = TypeVar("T")


class SampleBuffer(Protocol):
    """The newest samples, and all of them for whoever wants them; any thread."""

    @property
    @abstractmethod
    def latest_chunk(self) -> DataChunk | None:
        """The newest chunk; None before the first."""

    @property
    @abstractmethod
    def samples(self) -> int:
        """How many samples a channel came in since the start."""

    @property
    @abstractmethod
    def lost(self) -> int:
        """Samples a channel that did not reach this process."""

    @abstractmethod
    def get_latest_data(self) -> dict[str, float]:
        """Return the newest value of every channel in its physical unit; empty before any."""

    @abstractmethod
    def subscribe(self, receiver: Callable[[DataChunk], None]) -> Callable[[], None]:
        """Call `receiver(chunk)` with every chunk, in order; returns what ends it."""

    @abstractmethod
    def follow(self, receiver: Callable[[DataChunk], None]) -> Callable[[], None]:
        """Call `receiver(chunk)` with the newest, for a display; some may be passed over."""


class LimitWatch(Protocol):
    """The limits, watched where the boards are; any thread. See `LimitGuard`."""

    trip: Callable[[str], None] | None

    @property
    @abstractmethod
    def limits(self) -> dict[str, Limit]:
        """The limits by channel."""

    @property
    @abstractmethod
    def crossings(self) -> tuple[Crossing, ...]:
        """What happened so far, oldest first."""

    @abstractmethod
    def subscribe(self, listener: Callable[[Crossing], None]) -> None:
        """Call `listener(crossing)` after each trip."""

    @abstractmethod
    def set_limit(self, limit: Limit) -> None:
        """Set the limit of a channel, armed or not; raises `ConfigError`, `NotAvailable`."""

    @abstractmethod
    def acknowledge(self, channel: str) -> None:
        """Forget that a limit was crossed; raises `NotAvailable` while it still is."""

    @abstractmethod
    def remove(self, channel: str) -> None:
        """Forget the limit of a channel."""


class Recordings(Protocol):
    """One recording at a time; any thread. See `Recorder`."""

    @property
    @abstractmethod
    def state(self) -> RecordingState:
        """How the recording stands."""

    @abstractmethod
    def on_change(self, listener: Callable[[], object]) -> None:
        """Call `listener()` when a recording begins, goes on or ends, in any thread."""

    @abstractmethod
    def start(self, path: Path, *, overwrite: bool = False) -> None:
        """Begin to write; raises `NotAvailable`, `RecordingError`."""

    @abstractmethod
    def stop(self) -> None:
        """Close the file and wait until it is closed; harmless when nothing is recorded."""

    @abstractmethod
    def mark(self, text: str) -> None:
        """Write a mark with the present time; nothing where no recording runs."""


class Files(Protocol):
    """Where recordings go; any thread. See `LocalFiles`."""

    @property
    @abstractmethod
    def elsewhere(self) -> str:
        """Where the files lie, as the operator is told; empty on this computer."""

    @abstractmethod
    def problem(self, directory: str) -> str:
        """Return why nothing can be stored in `directory`; empty when it can."""

    @abstractmethod
    def free_bytes(self, directory: Path) -> int:
        """Return how much room there is for recordings; raises `RecordingError`."""

    @abstractmethod
    def name(self, base: str, option: NameOption, directory: Path, when: datetime) -> NamedFile:
        """Return the file for a recording that is begun now; raises `RecordingError`."""

    @abstractmethod
    def recordings(self, directory: Path) -> tuple[Path, ...]:
        """Return the newest recordings in a directory, newest first."""

    @abstractmethod
    def export(self, source: Path, target: Path) -> Task:
        """Begin to export a recording, by the suffix of `target`."""


class DaqcoHost(Protocol):
    """`DaqcoApplication`, or `RemoteDaqcoApplication` where the boards are elsewhere; any thread.

    Reading a property never waits for a device or a line.
    """

    @property
    @abstractmethod
    def clock(self) -> Clock:
        """The clock by which the samples are dated."""

    @property
    @abstractmethod
    def buffer(self) -> SampleBuffer:
        """The samples."""

    @property
    @abstractmethod
    def guard(self) -> LimitWatch:
        """The limits."""

    @property
    @abstractmethod
    def recorder(self) -> Recordings:
        """Recordings."""

    @property
    @abstractmethod
    def files(self) -> Files:
        """Where they go."""

    @property
    @abstractmethod
    def status_changed(self) -> SignalInstance:
        """Emitted when anything but samples, limits and recordings changed, in any thread."""

    @property
    @abstractmethod
    def away(self) -> str:
        """Why the station with the boards cannot be reached; empty while it can."""

    @property
    @abstractmethod
    def settings(self) -> DaqcoSettings:
        """What is in force."""

    @property
    @abstractmethod
    def directory(self) -> Path:
        """Where recordings go unless somebody says otherwise."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why acquisition cannot run, or ended by itself; empty when all is well."""

    @property
    @abstractmethod
    def infos(self) -> Mapping[str, BoardInfo]:
        """The boards there are, by name."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """Samples are being acquired."""

    @property
    @abstractmethod
    def rate_hz(self) -> float:
        """The rate the boards really make; that of the settings while nothing runs."""

    @abstractmethod
    def scales(self) -> dict[str, Scale]:
        """Return the scale in force of every channel, by its name."""

    @abstractmethod
    def look_for_boards(self) -> None:
        """Look for boards and open those there are; raises `NotConnectedError`."""

    @abstractmethod
    def start_acquisition(self) -> None:
        """Begin to acquire; raises `LimitError`, `NotConnectedError`, `DeviceError`."""

    @abstractmethod
    def stop_acquisition(self) -> None:
        """End acquiring; harmless when nothing runs."""

    @abstractmethod
    def apply(self, settings: DaqcoSettings) -> None:
        """Put `settings` in force; raises as `DaqcoApplication.apply`."""

    @abstractmethod
    def set_scale(self, channel: str, scale: Scale) -> None:
        """Give a channel a scale; raises `ConfigError`."""

    @abstractmethod
    def on_crossing(self, listener: Callable[[Crossing], object]) -> None:
        """Call `listener(crossing)` when a limit was crossed, or nobody can say it was not."""

    @abstractmethod
    def carry_out(self, action: Callable[[], T], told: Told[T], *, slow: bool = False) -> None:
        """Do what may have to wait for a line; `told` at its end, maybe in another thread.

        What is `slow` waits for boards or a disk: at home it is done in another thread, too.
        """
