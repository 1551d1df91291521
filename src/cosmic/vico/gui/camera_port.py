"""What the view of a camera asks of the application.

Everything returns at once; see `cosmic.vico.gui.ports`.
"""

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from cosmic.frame.task import Task
from cosmic.vico.core.picture import Picture
from cosmic.vico.gui.calibrate_menu import MapShown
from cosmic.vico.gui.seen import Algorithm, Analysis, Pixel
from cosmic.vico.hw.interface import CameraCounters, CameraInfo, CameraRanges, CameraSettings


class VideoFormat(Protocol):
    """A way to record."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What `CameraPort.record` takes, and what the operator reads."""

    @property
    @abstractmethod
    def suffix(self) -> str:
        """Of the file, such as ".mkv"; empty for a folder of pictures."""

    @property
    @abstractmethod
    def description(self) -> str:
        """What it is good for, in one line."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why it cannot be used now, such as a codec that is missing; else empty."""


class Recording(Protocol):
    """The recording that runs, or the last one."""

    @property
    @abstractmethod
    def active(self) -> bool:
        """Frames are being written."""

    @property
    @abstractmethod
    def path(self) -> Path | None:
        """The file or folder; None before the first recording."""

    @property
    @abstractmethod
    def written(self) -> int:
        """Frames in the file."""

    @property
    @abstractmethod
    def dropped(self) -> int:
        """Frames that are not in the file, for whatever reason."""

    @property
    @abstractmethod
    def waiting(self) -> int:
        """Frames in the queue."""

    @property
    @abstractmethod
    def size_bytes(self) -> int:
        """How large it is."""

    @property
    @abstractmethod
    def left_s(self) -> float | None:
        """How long the disk lasts at this pace; None while unknown."""

    @property
    @abstractmethod
    def failure(self) -> str:
        """Why it ended by itself, fit for the operator; empty when it did not."""


class CameraPort(Protocol):
    """One camera as its view sees it."""

    # What is in force

    @property
    @abstractmethod
    def name(self) -> str:
        """What the platform calls it, such as "top"."""

    @property
    @abstractmethod
    def info(self) -> CameraInfo | None:
        """Which camera it is; None while none is connected."""

    @property
    @abstractmethod
    def ranges(self) -> CameraRanges | None:
        """What it accepts now; None while it is not connected."""

    @property
    @abstractmethod
    def settings(self) -> CameraSettings | None:
        """What is in force, as read back; None while it is not connected."""

    @property
    @abstractmethod
    def counters(self) -> CameraCounters:
        """What became of the frames since the start."""

    @property
    @abstractmethod
    def running(self) -> bool:
        """It takes pictures, or waits for its trigger."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why no pictures come, such as an unplugged camera; empty when all is well."""

    @property
    @abstractmethod
    def refused(self) -> str:
        """Why the last wish was not granted, where that was heard later; or empty."""

    # Pictures

    @abstractmethod
    def latest(self) -> Picture | None:
        """Return the newest whole picture, as it is to be shown; None before the first."""

    @property
    @abstractmethod
    def focus(self) -> float | None:
        """How sharp the newest picture is, the measure of the autofocus; None while unknown."""

    @property
    @abstractmethod
    def has_background(self) -> bool:
        """Pictures are corrected by a background."""

    @abstractmethod
    def set_background(self) -> None:
        """Correct pictures by the newest one, or by the next where none is there yet."""

    @abstractmethod
    def clear_background(self) -> None:
        """Show pictures as they come."""

    # Commands

    @abstractmethod
    def configure(self, settings: CameraSettings) -> Task:
        """Begin to put settings in force; the task fails with what the camera refuses.

        Raises
        ------
        ConfigError
            What can be told to be wrong at once.
        """

    @abstractmethod
    def start(self) -> object:
        """Begin to take pictures."""

    @abstractmethod
    def stop(self) -> object:
        """End taking pictures; a recording is closed."""

    @abstractmethod
    def software_trigger(self) -> None:
        """Take one picture, with the software trigger."""

    # Machine vision

    @property
    @abstractmethod
    def algorithms(self) -> Sequence[Algorithm]:
        """The chain, in its order."""

    @abstractmethod
    def switch(self, algorithm: str, *, on: bool) -> None:
        """Have an algorithm run on the pictures, or not."""

    @property
    @abstractmethod
    def analysis(self) -> Analysis | None:
        """The newest result; None while nothing is on."""

    # Files

    @property
    @abstractmethod
    def elsewhere(self) -> str:
        """Whose disk files go to, where it is not this computer's; empty: it is."""

    @property
    @abstractmethod
    def directory(self) -> Path:
        """Where pictures go unless the operator says otherwise."""

    @property
    @abstractmethod
    def formats(self) -> Sequence[VideoFormat]:
        """The ways to record; the first is the usual one."""

    @property
    @abstractmethod
    def recording(self) -> Recording:
        """The recording that runs, or the last one."""

    @abstractmethod
    def room_s(self, directory: Path, format_name: str) -> float | None:
        """Return how long the disk lasts for a recording there; None while nobody knows.

        Raises
        ------
        ConfigError
            There is no such directory.
        """

    @abstractmethod
    def snap(self, path: Path, *, overwrite: bool = False) -> Task:
        """Begin to write the newest picture; the camera goes on meanwhile."""

    @abstractmethod
    def record(self, path: Path, format_name: str, *, overwrite: bool = False) -> None:
        """Begin to record."""

    @abstractmethod
    def stop_recording(self) -> None:
        """Ask for the file to be closed; it is when `recording.active` is False."""

    @abstractmethod
    def time_lapse(
        self,
        path: Path,
        format_name: str,
        *,
        interval_s: float,
        count: int,
        overwrite: bool = False,
    ) -> Task:
        """Begin to record one picture each `interval_s`, `count` in all."""

    # Places

    @property
    @abstractmethod
    def calibration_problem(self) -> str:
        """Why pixels cannot be told as places on the platform; empty when they can."""

    @abstractmethod
    def platform_um(self, place_px: Pixel) -> tuple[float, ...] | None:
        """Return where on the platform a pixel is, x, y (, z); None while not calibrated."""

    @property
    @abstractmethod
    def targets(self) -> Sequence[str]:
        """What can be moved to a place in the picture, such as "left"."""

    @abstractmethod
    def click_to_move(self, place_px: Pixel, what: str) -> str:
        """Begin to move `what` to that place and return what was begun, in words.

        Raises
        ------
        MoveRefused, NotAvailable
            The gate says no, or the place cannot be told.
        """

    @property
    @abstractmethod
    def calibrated(self) -> Sequence[MapShown]:
        """The maps from platform to picture that are in force."""

    @abstractmethod
    def calibrate_stage(self, tool: str) -> Task:
        """Begin to measure such a map by moving a tool; raises `NotAvailable`."""

    @abstractmethod
    def find_rotation_centre(self) -> Task:
        """Begin to measure about which place the plate turns; raises `NotAvailable`."""
