"""ViCo as a CoSMic application (thesis 5.2): cameras, lens and light of one platform."""

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from PySide6.QtCore import QObject, Qt
from typing_extensions import override

from cosmic.frame.application import GuiFactory
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import HeartbeatWatch
from cosmic.frame.operation import Task
from cosmic.frame.task_application import TaskApplication
from cosmic.vico.api.coordinate_transform import CoordinateTransform
from cosmic.vico.core.camera_libraries import CameraLibraries
from cosmic.vico.core.camera_unit import CameraUnit
from cosmic.vico.core.focus_models import FocusModels
from cosmic.vico.core.image import Circumstances
from cosmic.vico.core.lens_control import PeripheralThread
from cosmic.vico.core.settings import CameraConfig, VicoSettings
from cosmic.vico.core.zoom_scale import ZoomScale
from cosmic.vico.hw.interface import CameraInfo, CameraLibrary, CameraSettings, Frame, Trigger
from cosmic.vico.hw.peripherals import Lens, LensAxis, Light

logger = logging.getLogger(__name__)


class VicoApplication(TaskApplication):
    """Owns cameras, lens and light; its methods may be called from any thread.

    Parameters
    ----------
    make_library : callable
        Returns the driver of a backend.
    open_lens, open_light : callable
        Open what the platform has; return None where it has none.

    Attributes
    ----------
    units : mapping of str to CameraUnit
        By the camera's name, in the order of the platform file.
    sample_source : callable or None
        Takes a camera and when an exposure of it began by the trigger; returns the number of the
        sample at which it did and the time of that sample, or None. Returns at once.
    position_source : callable or None
        Returns where every axis was at a platform time; called in the cameras' threads.
    focus_models : FocusModels
        How fast images blur with the focus, as far as sweeps have taught it.
    transform : CoordinateTransform or None
        What joins pixels and platform, where micromanipulation is hosted as well.
    """

    def __init__(
        self,
        make_library: Callable[[str], CameraLibrary],
        open_lens: Callable[[], Lens | None],
        open_light: Callable[[], Light | None],
        settings: VicoSettings,
        *,
        clock: Clock,
        policy: FailurePolicy,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("ViCo", policy, gui_factory, parent)
        self.policy = policy
        self.settings = settings
        self.clock = clock
        self.libraries = CameraLibraries(make_library, settings.camera)
        self.zoom_scale: ZoomScale = settings.lens.zoom_scale()
        self.focus_models = FocusModels()
        self.position_source: Callable[[float], Mapping[str, float]] | None = None
        self.sample_source: Callable[[str, float], tuple[int, float] | None] | None = None
        self.transform: CoordinateTransform | None = None
        self.found: tuple[CameraInfo, ...] = ()
        self.focus_search: Task | None = None
        self.peripherals = PeripheralThread(
            open_lens, open_light, clock, policy, timeout_s=settings.lens.timeout_s
        )
        self.units: dict[str, CameraUnit] = {
            config.name: CameraUnit(
                config, self.libraries, self._circumstances, policy, settings.analysis
            )
            for config in settings.camera
        }
        self._watch = HeartbeatWatch(
            "driver watch",
            [self.peripherals.heartbeat, *(each.thread.heartbeat for each in self.units.values())],
            policy,
        )
        direct = Qt.ConnectionType.DirectConnection
        self.peripherals.state_changed.connect(self._on_state_changed, direct)
        for unit in self.units.values():
            unit.thread.status_changed.connect(self._on_state_changed, direct)
            unit.recordings.on_change(self._on_state_changed)

    # Starting and ending

    @override
    def initialize(self) -> None:
        """Begin to look for everything; nothing is waited for, and what is missing is told."""
        self.start()
        self._watch.start()
        self.peripherals.start()
        for unit in self.units.values():
            unit.start()

    @override
    def shut_down(self) -> None:
        """Close recordings, cameras, lens and light, and end all threads; any state."""
        self.request_end()
        for unit in self.units.values():
            unit.request_end()
        self.peripherals.request_end()
        self._watch.request_end()
        ended = [unit.join() for unit in self.units.values()]
        if not self.peripherals.join():
            logger.error("lens and light: a driver does not return; it is left behind")
        if all(ended):
            self.libraries.close()
        self._watch.join()
        self.join()

    def rescan(self) -> Task:
        """Begin to look for cameras; what was found is in `found`."""

        def job(task: Task) -> None:
            self.found = self.libraries.found()
            task.finish()
            self.status_changed.emit()

        return self.begin("Looking for cameras", job)

    def use(self, camera: str, key: str) -> Task:
        """Begin to take the images of `camera` with the one of that key.

        Raises
        ------
        ConfigError
            There is no such camera on the platform, or that key is one of another backend.
        """
        unit = self.unit(camera)
        self.libraries.check_backend(unit.config, key)
        unit.use(key)
        task = Task(f"{camera}: {key}")
        task.finish()
        return task

    def stop_lens(self) -> None:
        """Stop both motors of the lens and whatever moves them; returns at once."""
        if self.focus_search is not None:
            self.focus_search.cancel()
        self.peripherals.abort()

    @property
    def has_lens(self) -> bool:
        """The platform has a motorised lens."""
        return self.settings.lens.backend != "none"

    @property
    def has_light(self) -> bool:
        """The platform has a lamp that can be dimmed."""
        return self.settings.light.backend != "none"

    @property
    def cameras(self) -> Sequence[str]:
        """Names of the cameras, in the order of the platform file."""
        return tuple(self.units)

    def unit(self, name: str) -> CameraUnit:
        """Return a camera by its name.

        Raises
        ------
        ConfigError
            There is none; the text lists those there are.
        """
        if name not in self.units:
            known = ", ".join(self.units) or "none"
            raise ConfigError(f"there is no camera {name!r}; the platform has: {known}")
        return self.units[name]

    @property
    def first_camera(self) -> str:
        """Name of the camera that is meant where none is named.

        Raises
        ------
        NotAvailable
            The platform has none.
        """
        for name in self.units:
            return name
        raise NotAvailable("the platform file names no camera; add a [[vico.camera]]")

    @property
    def directory(self) -> Path:
        """Where images go unless somebody says otherwise."""
        return Path(self.settings.directory).expanduser() if self.settings.directory else Path.cwd()

    # What was known of a frame

    def _circumstances(
        self, config: CameraConfig, frame: Frame, settings: CameraSettings
    ) -> Circumstances:
        """Tell what was set in the middle of an exposure; in the camera's thread."""
        middle_s = frame.exposed_s + 0.5 * settings.exposure_s
        history = self.peripherals.history
        zoom = history.counts_at(LensAxis.ZOOM, middle_s) if config.behind_lens else None
        focus = history.counts_at(LensAxis.FOCUS, middle_s) if config.behind_lens else None
        positions = self.position_source(middle_s) if self.position_source is not None else {}
        sample, sample_s = self._sample(config, frame, settings)
        return Circumstances(
            exposure_s=settings.exposure_s,
            gain_db=settings.gain_db,
            zoom_counts=zoom,
            focus_counts=focus,
            light_percent=history.light_at(middle_s),
            scale_um_px=self._scale_um_px(config, zoom, settings.binning),
            positions=positions,
            sample=sample,
            sample_s=sample_s,
        )

    def _sample(
        self, config: CameraConfig, frame: Frame, settings: CameraSettings
    ) -> tuple[int | None, float | None]:
        """Return the sample at which the exposure began, and its time, where that is known."""
        if settings.trigger is not Trigger.HARDWARE or self.sample_source is None:
            return None, None
        return self.sample_source(config.name, frame.exposed_s) or (None, None)

    def _scale_um_px(
        self, config: CameraConfig, zoom_counts: float | None, binning: int
    ) -> float | None:
        """Return what a pixel is: as calibrated where it was, else as the lens is built."""
        if self.transform is not None:
            scale = self.transform.scale_um_px(config.name, zoom_counts)
            if scale is not None:
                return scale * binning
        if not config.behind_lens:
            return None if config.scale_um_px is None else config.scale_um_px * binning
        if zoom_counts is None:
            return None
        return self.zoom_scale.scale_um_px(zoom_counts, binning)

    def _on_state_changed(self, *_state: object) -> None:
        self.status_changed.emit()
