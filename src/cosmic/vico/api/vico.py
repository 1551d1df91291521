"""The ViCo part of the scripted API: ``rig.vico``; windows use it as well."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import CosmicError
from cosmic.frame.listeners import tell
from cosmic.frame.task import Task
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.lens import LensHandle, LightHandle
from cosmic.vico.api.remote_application import RemoteVicoApplication
from cosmic.vico.api.remote_camera import RemoteCameraHandle
from cosmic.vico.api.remote_lens import RemoteLensHandle, RemoteLightHandle
from cosmic.vico.hw.interface import CameraInfo, Pixels

if TYPE_CHECKING:
    from cosmic.vico.api.fibres import PlacedFibre
    from cosmic.vico.api.places import CalibrationShown, RotationShown


@checked_class
class Vico:
    """Cameras, lens and light of the platform; any thread."""

    def __init__(self, application: VicoApplication | RemoteVicoApplication) -> None:
        self._application = application
        self._handles: dict[str, CameraHandle] = {}
        self._lens: LensHandle
        self._light: LightHandle
        if isinstance(application, RemoteVicoApplication):
            self._lens, self._light = RemoteLensHandle(application), RemoteLightHandle(application)
        else:
            self._lens, self._light = LensHandle(application), LightHandle(application)
        self._listeners: tuple[Callable[[], object], ...] = ()
        # At once and by a function that keeps this object: a call that still waits in a queue when
        # a plain object goes would reach what is no more.
        direct = Qt.ConnectionType.DirectConnection
        application.status_changed.connect(lambda: self._tell(), direct)

    @property
    def application(self) -> VicoApplication | RemoteVicoApplication:
        """The application behind it."""
        return self._application

    @property
    def cameras(self) -> Sequence[str]:
        """Names of the cameras, in the order of the platform file."""
        return tuple(self._application.cameras)

    def camera(self, name: str = "") -> CameraHandle:
        """Return a camera, or the first; raises `ConfigError` where there is none of that name."""
        chosen = name or self._application.first_camera
        if chosen not in self._handles:
            application = self._application
            self._handles[chosen] = (
                RemoteCameraHandle(application, chosen)
                if isinstance(application, RemoteVicoApplication)
                else CameraHandle(application, chosen)
            )
        return self._handles[chosen]

    @property
    def lens(self) -> LensHandle | None:
        """The motorised lens; None where there is none."""
        return self._lens if self._application.has_lens else None

    @property
    def light(self) -> LightHandle | None:
        """The lamp; None where there is none."""
        return self._light if self._application.has_light else None

    @property
    def found(self) -> Sequence[CameraInfo]:
        """Every camera there was at the last look for them."""
        return self._application.found

    def rescan(self) -> Task:
        """Begin to look for cameras."""
        return self._application.rescan()

    def use(self, camera: str, key: str) -> Task:
        """Begin to take the pictures of `camera` with the one of that key."""
        return self._application.use(camera, key)

    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()`, in any thread, when anything but pictures and counters changed."""
        self._listeners = (*self._listeners, listener)

        def forget() -> None:
            self._listeners = tuple(each for each in self._listeners if each is not listener)

        return forget

    def _tell(self) -> None:
        tell(self._listeners)

    # Pictures

    def snap(self, camera: str = "", timeout_s: float = 5.0) -> Pixels:
        """Take a picture: one exposed after this call; shape (height, width) or with 3 layers.

        Raises
        ------
        NotAvailable
            None came in time; the text says why.
        """
        return self.camera(camera).next_picture(timeout_s).data

    def find_fibres(self, camera: str = "", timeout_s: float = 5.0) -> "list[PlacedFibre]":
        """Take a picture and return the fibres on it, in pixels, in um and on the platform.

        Raises
        ------
        NotAvailable
            No picture came in time.
        """
        # Imported here: it loads scikit-image and scipy.
        from cosmic.vico.api.fibres import place_fibres

        picture = self.camera(camera).next_picture(timeout_s)
        return place_fibres(picture, self._application.places)

    # Places on the platform

    @property
    def tools(self) -> Sequence[str]:
        """What can be moved to a place in a picture, and what calibrates, such as "left"."""
        places = self._application.places
        return places.targets if places is not None else ()

    @property
    def calibrated(self) -> "Sequence[CalibrationShown]":
        """The maps from platform to picture that are in force."""
        places = self._application.places
        return places.calibrated if places is not None else ()

    def calibrate_stage(self, tool: str, camera: str = "") -> Task:
        """Begin to measure where on the platform the pixels of a camera lie, by moving a tool.

        The tip of `tool` must be in the picture and sharp, near the height that matters. It goes
        to nine places about where it stands, through the gate, and back.

        Raises
        ------
        ConfigError
            There is no such tool or camera.
        NotAvailable
            Another long operation is under way, or micromanipulation is not hosted.
        """
        return self.camera(camera).calibrate_stage(tool)

    def find_rotation_centre(self, camera: str = "") -> Task:
        """Begin to measure about which place the plate turns, by a fibre that lies on it.

        The table turns by 24 degrees to both sides, through the gate, and back.

        Raises
        ------
        NotAvailable
            Another long operation is under way, or micromanipulation is not hosted.
        """
        return self.camera(camera).find_rotation_centre()

    def rotation_centre(self, camera: str = "") -> "RotationShown | None":
        """Return about which place the plate turns, as a camera saw it last; None before."""
        places = self._application.places
        chosen = camera or self._application.first_camera
        return places.rotation_centre(chosen) if places is not None else None

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
        """Record every picture while the block runs; see `CameraHandle.record`.

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
