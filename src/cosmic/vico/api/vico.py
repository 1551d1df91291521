"""The one interface of ViCo: ``rig.vico``, its windows, plans and stations use nothing else."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from typing_extensions import override

from cosmic.frame.application import CosmicApplicationBase
from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import Clock
from cosmic.frame.declaration import Companion, Declared, command, part, state
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.application import remote_api
from cosmic.frame.operation import Task
from cosmic.frame.threads import may_wait_here
from cosmic.frame.weakly import weakly
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.camera_images import RemoteImages
from cosmic.vico.api.coordinate_transform import (
    CalibrationShown,
    CoordinateTransform,
    Pixel,
    RotationShown,
)
from cosmic.vico.api.lens import LensHandle, LightHandle
from cosmic.vico.api.sent_image import NOT_HOSTED, ReceivedImage
from cosmic.vico.core.image import CameraImage
from cosmic.vico.hw.interface import CameraInfo, Pixels

if TYPE_CHECKING:
    from cosmic.vico.api.fibres import PlacedFibre


class ImageTransform(CoordinateTransform):
    """What each image brings along of its place; movements are begun there. Any thread."""

    def __init__(self, vico: "Vico") -> None:
        self._vico = vico

    @override
    def scale_um_px(self, camera: str, zoom_counts: float | None) -> float | None:
        return None  # it stands on every image

    @override
    def problem(self, image: CameraImage) -> str:
        return image.plate_problem if isinstance(image, ReceivedImage) else NOT_HOSTED

    @override
    def platform_um(self, image: CameraImage, point_px: Pixel) -> tuple[float, float]:
        if not isinstance(image, ReceivedImage) or image.plate is None:
            raise NotAvailable(self.problem(image))
        x, y = point_px
        return image.plate.to_um((float(x), float(y)))

    @property
    @override
    def targets(self) -> Sequence[str]:
        return self._vico.tools

    @override
    def move_to(self, image: CameraImage, point_px: Pixel, what: str) -> str:
        there_um = self.platform_um(image, point_px)
        clicked_px = (float(point_px[0]), float(point_px[1]))
        camera = self._vico.camera(image.camera)
        if may_wait_here():
            return camera.click(clicked_px, there_um, what)
        camera.click_aside(clicked_px, there_um, what)
        x_um, y_um = there_um
        return f"{what}: asked to move to x {x_um:.1f}, y {y_um:.1f} µm"

    @override
    def calibrate_stage(self, tool: str, camera: str) -> Task:
        return self._vico.camera(camera).calibrate_stage(tool)

    @override
    def find_rotation_centre(self, camera: str) -> Task:
        return self._vico.camera(camera).find_rotation_centre()

    @property
    @override
    def calibrated(self) -> Sequence[CalibrationShown]:
        return self._vico.calibrated

    @override
    def rotation_centre(self, camera: str) -> RotationShown | None:
        return self._vico.rotation_centre(camera)


class _Follower(Companion):
    """Has images of another station come only while somebody looks."""

    def __init__(self, vico: "Vico") -> None:
        self._vico = vico

    @override
    def look(self, silent_s: float) -> None:
        for each in self._images():
            each.tidy()

    @override
    def close(self) -> None:
        for each in self._images():
            each.close()

    def _images(self) -> list[RemoteImages]:
        found = (each.images for each in self._vico.camera_handles.values())
        return [each for each in found if isinstance(each, RemoteImages)]


@checked_class
class Vico(Declared):
    """Cameras, lens and light of the platform; any thread."""

    def __init__(self, application: VicoApplication) -> None:
        self._application = application
        self._handles = {name: CameraHandle(application, name) for name in application.cameras}
        self._lens, self._light = LensHandle(application), LightHandle(application)
        self._on_images: ImageTransform | None = None
        # At once: a call that still waits in a queue when a plain object goes would reach what is
        # no more.
        direct = Qt.ConnectionType.DirectConnection
        application.status_changed.connect(weakly(self._publish), direct)

    def _publish(self) -> None:
        self.note_change()
        for each in (*self._handles.values(), self._lens, self._light):
            each.note_change()

    @override
    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        """Read points from the images that come."""
        self._on_images = ImageTransform(self)

    @override
    def made_companion(self) -> Companion:
        """Follow what is looked at, where the cameras are elsewhere."""
        return _Follower(self)

    @property
    def application(self) -> VicoApplication:
        """The application behind it, where the cameras are here."""
        return self._application

    @property
    @override
    def clock(self) -> Clock:
        """The platform's."""
        return self._application.clock

    @property
    @part
    def camera_handles(self) -> Mapping[str, CameraHandle]:
        """The cameras by their names, in the order of the platform file."""
        return self._handles

    @property
    def cameras(self) -> Sequence[str]:
        """Names of the cameras, in the order of the platform file."""
        return tuple(self.camera_handles)

    def camera(self, name: str = "") -> CameraHandle:
        """Return a camera, or the first; raises `ConfigError` where there is none of that name."""
        handles = self.camera_handles
        chosen = name or self._first_camera
        if chosen not in handles:
            known = ", ".join(handles) or self.away or "none"
            raise ConfigError(f"there is no camera {chosen!r}; the platform has: {known}")
        handle = handles[chosen]
        if self._on_images is not None and isinstance(handle.images, RemoteImages):
            handle.images.join_transform(self._on_images)
        return handle

    @property
    def _first_camera(self) -> str:
        for name in self.camera_handles:
            return name
        raise NotAvailable(self.away or "the platform file names no camera; add a [[vico.camera]]")

    @property
    @part
    def lens(self) -> LensHandle | None:
        """The motorised lens; None where there is none."""
        return self._lens if self._application.has_lens else None

    @property
    @part
    def light(self) -> LightHandle | None:
        """The lamp; None where there is none."""
        return self._light if self._application.has_light else None

    @property
    def found(self) -> Sequence[CameraInfo]:
        """Every camera there was at the last look for them."""
        return self._found

    @property
    @state
    def _found(self) -> tuple[CameraInfo, ...]:
        return tuple(self._application.found)

    @command
    def rescan(self) -> Task:
        """Begin to look for cameras."""
        return self._application.rescan()

    @command
    def use(self, camera: str, key: str) -> Task:
        """Begin to take the images of `camera` with the one of that key."""
        return self._application.use(camera, key)

    # Images

    def snap(self, camera: str = "", timeout_s: float = 5.0) -> Pixels:
        """Take an image: one exposed after this call; shape (height, width) or with 3 layers.

        Raises
        ------
        NotAvailable
            None came in time; the text says why.
        """
        return self.camera(camera).next_image(timeout_s).data

    def find_fibres(self, camera: str = "", timeout_s: float = 5.0) -> "list[PlacedFibre]":
        """Take an image and return the fibres on it, in pixels, in um and on the platform.

        Raises
        ------
        NotAvailable
            No image came in time.
        """
        # Imported here: it loads OpenCV and scipy.
        from cosmic.vico.api.fibres import locate_fibres

        image = self.camera(camera).next_image(timeout_s)
        return locate_fibres(image, self._transform)

    # Points on the platform

    @property
    def _transform(self) -> CoordinateTransform | None:
        return self._on_images or self._application.transform

    @property
    def tools(self) -> Sequence[str]:
        """What can be moved to a point in an image, and what calibrates, such as "left"."""
        return () if self.away else self._tools

    @property
    @state
    def _tools(self) -> tuple[str, ...]:
        transform = self._application.transform
        return tuple(transform.targets) if transform is not None else ()

    @property
    def calibrated(self) -> Sequence[CalibrationShown]:
        """The maps from platform to image that are in force."""
        return self._calibrated

    @property
    @state
    def _calibrated(self) -> tuple[CalibrationShown, ...]:
        transform = self._application.transform
        return tuple(transform.calibrated) if transform is not None else ()

    def calibrate_stage(self, tool: str, camera: str = "") -> Task:
        """Begin to measure where on the platform the pixels of a camera lie, by moving a tool.

        The tip of `tool` must be in the image and sharp, near the height that matters. It goes
        to nine points about where it stands, through the gate, and back.

        Raises
        ------
        ConfigError
            There is no such tool or camera.
        NotAvailable
            Another long operation is under way, or micromanipulation is not hosted.
        """
        return self.camera(camera).calibrate_stage(tool)

    def find_rotation_centre(self, camera: str = "") -> Task:
        """Begin to measure about which point the plate turns, by a fibre that lies on it.

        The table turns by 24 degrees to both sides, through the gate, and back.

        Raises
        ------
        NotAvailable
            Another long operation is under way, or micromanipulation is not hosted.
        """
        return self.camera(camera).find_rotation_centre()

    def rotation_centre(self, camera: str = "") -> RotationShown | None:
        """Return about which point the plate turns, as a camera saw it last; None before."""
        return self.camera(camera).rotation

    # Recording

    @contextmanager
    def record(
        self,
        path: str | Path,
        format_name: str = "ffv1",
        *,
        camera: str = "",
        overwrite: bool = False,
    ) -> Iterator[Path]:
        """Record every image while the block runs; see `CameraHandle.record`.

        Raises
        ------
        CosmicError
            At the end of the block, where the recording ended by itself before.
        """
        handle = self.camera(camera)
        handle.record(path, format_name, overwrite=overwrite)
        try:
            yield Path(path)
        finally:
            handle.stop_recording(wait=True)
        if handle.recording.failure:
            raise CosmicError(handle.recording.failure)


def vico_of(application: CosmicApplicationBase) -> Vico:
    """Return what an application offers, whether its cameras are here or at another station.

    Raises
    ------
    TypeError
        It is no ViCo.
    """
    if isinstance(application, VicoApplication):
        return Vico(application)
    return remote_api(application, Vico)
