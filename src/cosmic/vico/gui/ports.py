"""What the widgets of ViCo ask of the application, and nothing more.

Every value is read at once, and every method returns at once: nothing here waits for a device.
What takes its time is a `Task`. Methods that refuse raise a `CosmicError` whose text is fit for
the operator. What is not a type of the core is a Protocol of properties, so that a frozen
dataclass of the application will do.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Protocol

from cosmic.frame.task import Task
from cosmic.vico.gui.camera_port import CameraPort
from cosmic.vico.hw.interface import CameraInfo
from cosmic.vico.hw.peripherals import LensAxis, LensState

Unsubscribe = Callable[[], None]


class ZoomStep(Protocol):
    """A zoom position that has a name."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Such as "2x"."""

    @property
    @abstractmethod
    def zoom(self) -> float:
        """Magnification."""


class LensPort(Protocol):
    """The motorised lens as its panel sees it."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the operator reads."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why it cannot be used, such as a missing port; empty when all is well."""

    @property
    @abstractmethod
    def steps(self) -> Sequence[ZoomStep]:
        """Zoom positions with a name, from the smallest."""

    @property
    @abstractmethod
    def zoom_range(self) -> tuple[float, float]:
        """Least and most magnification."""

    @property
    @abstractmethod
    def zoom(self) -> float | None:
        """Magnification now; None while unknown."""

    @abstractmethod
    def state(self, axis: LensAxis) -> LensState | None:
        """Return what was last heard of a motor; None before."""

    @abstractmethod
    def home(self) -> Task:
        """Begin to run both motors to where counting begins."""

    @abstractmethod
    def zoom_to(self, zoom: float) -> Task:
        """Begin to zoom."""

    @abstractmethod
    def seek_focus(self, target_counts: int) -> Task:
        """Begin to focus there."""

    @abstractmethod
    def autofocus(self, camera: str) -> Task:
        """Begin to look for the sharpest picture of a camera."""

    @abstractmethod
    def abort(self) -> None:
        """Stop both motors and whatever moves them."""


class LightPort(Protocol):
    """The lamp as its slider sees it."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the operator reads."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why it cannot be used; empty when all is well."""

    @property
    @abstractmethod
    def percent(self) -> float | None:
        """How bright it is, 0 to 100; None while unknown."""

    @abstractmethod
    def set_percent(self, percent: float) -> object:
        """Begin to make it so bright; of several in a row the last counts."""


class VicoPort(Protocol):
    """The application as its widgets see it; all of it may be called in the GUI thread."""

    @property
    @abstractmethod
    def cameras(self) -> Sequence[str]:
        """Names of the cameras in use, in the order of the platform."""

    @abstractmethod
    def camera(self, name: str) -> CameraPort:
        """Return a camera in use; the same object each time."""

    @property
    @abstractmethod
    def found(self) -> Sequence[CameraInfo]:
        """Every camera there was at the last look for them."""

    @abstractmethod
    def rescan(self) -> Task:
        """Begin to look for cameras."""

    @abstractmethod
    def use(self, camera: str, key: str) -> Task:
        """Begin to take the pictures of `camera` with the one of that key (`CameraInfo.key`)."""

    @property
    @abstractmethod
    def lens(self) -> LensPort | None:
        """The motorised lens, where there is one."""

    @property
    @abstractmethod
    def light(self) -> LightPort | None:
        """The lamp, where there is one."""

    @abstractmethod
    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()`, in any thread, when anything but pictures and counters changed."""
