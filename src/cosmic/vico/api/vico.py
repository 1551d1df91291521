"""The ViCo part of the scripted API: ``rig.vico``; windows use it as well."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from cosmic.frame.errors import CosmicError
from cosmic.frame.listeners import tell
from cosmic.frame.task import Task
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.lens import LensHandle, LightHandle
from cosmic.vico.hw.interface import CameraInfo, Pixels

if TYPE_CHECKING:
    from cosmic.vico.api.fibres import PlacedFibre


class Vico:
    """Cameras, lens and light of the platform; any thread."""

    def __init__(self, application: VicoApplication) -> None:
        self._application = application
        self._handles: dict[str, CameraHandle] = {}
        settings = application.settings
        self.lens = LensHandle(application) if settings.lens.backend != "none" else None
        self.light = LightHandle(application) if settings.light.backend != "none" else None
        self._listeners: tuple[Callable[[], object], ...] = ()
        application.status_changed.connect(self._tell)

    @property
    def application(self) -> VicoApplication:
        """The application behind it."""
        return self._application

    @property
    def cameras(self) -> Sequence[str]:
        """Names of the cameras, in the order of the platform file."""
        return tuple(self._application.units)

    def camera(self, name: str = "") -> CameraHandle:
        """Return a camera, or the first; raises `ConfigError` where there is none of that name."""
        chosen = name or self._application.first_camera
        if chosen not in self._handles:
            self._handles[chosen] = CameraHandle(self._application, chosen)
        return self._handles[chosen]

    @property
    def found(self) -> Sequence[CameraInfo]:
        """Every camera there was at the last look for them."""
        return self._application.found

    def rescan(self) -> Task:
        """Begin to look for cameras."""
        return self._application.rescan()

    def use(self, camera: str, key: str) -> Task:
        """Begin to take the pictures of `camera` with the one of that key."""
        self._application.unit(camera).use(key)
        task = Task(f"{camera}: {key}")
        task.finish()
        return task

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
