"""`CameraUnit`: one camera of the platform and what hangs on it."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import Lock
from typing import Final

from cosmic.frame.errors import ConfigError
from cosmic.frame.events import Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.network.delivery import Backlog, InboxReader
from cosmic.frame.network.transport import Rule
from cosmic.vico.core.background import Background
from cosmic.vico.core.camera_libraries import CameraLibraries
from cosmic.vico.core.camera_recordings import CameraRecordings
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.settings import CameraConfig
from cosmic.vico.core.vision.algorithms import make_chain
from cosmic.vico.core.vision.chain import Analysis
from cosmic.vico.core.vision_thread import VisionThread
from cosmic.vico.hw.interface import (
    Camera,
    CameraSettings,
    Frame,
    FrameStatus,
    PixelFormat,
    Roi,
    Trigger,
)

logger = logging.getLogger(__name__)

Viewer = tuple[Callable[[CameraImage], object], Callable[[], bool]]


class LiveView(InboxReader[CameraImage]):
    """Corrects the newest image and hands it on in a thread of its own, while it is wanted.

    Parameters
    ----------
    correct : callable
        Makes of an image what is shown.
    """

    def __init__(
        self, name: str, correct: Callable[[CameraImage], CameraImage], policy: FailurePolicy
    ) -> None:
        self._newest: Backlog[CameraImage] = Backlog(Rule.LATEST)
        super().__init__(f"view of {name}", policy, self._newest, self._view)
        self._correct = correct
        self._lock = Lock()
        self._viewers: tuple[Viewer, ...] = ()

    def subscribe(
        self, receiver: Callable[[CameraImage], object], wanted: Callable[[], bool]
    ) -> Unsubscribe:
        """Call `receiver(image)` with the newest, while it is `wanted`; any thread."""
        viewer = (receiver, wanted)
        with self._lock:
            self._viewers = (*self._viewers, viewer)

        def end() -> None:
            with self._lock:
                self._viewers = tuple(each for each in self._viewers if each is not viewer)

        return end

    def put(self, image: CameraImage) -> None:
        """Offer an image; returns at once."""
        if image.frame.status is not FrameStatus.COMPLETE:
            return
        if any(wanted() for _, wanted in self._viewers):
            self._newest.put(image)

    def _view(self, image: CameraImage) -> None:
        shown = self._correct(image)
        for receiver, wanted in self._viewers:
            if wanted():
                receiver(shown)


CircumstancesOf = Callable[[CameraConfig, Frame, CameraSettings], Circumstances]

VISION_JOIN_WALL_S: Final = 60.0
"""An analysis cannot be broken off, and the first one on a busy computer takes many seconds."""


class CameraUnit:
    """A camera's thread, the chain of machine vision on its images, and its recordings.

    Attributes
    ----------
    thread : CameraThread
    recordings : CameraRecordings
    vision : VisionThread
        Runs `chain` on the newest image, background corrected.
    jobs : JobQueue
        Takes the images that plans ask for.
    live : LiveView
        Hands on what views at other stations show.
    """

    def __init__(
        self,
        config: CameraConfig,
        libraries: CameraLibraries,
        circumstances: CircumstancesOf,
        policy: FailurePolicy,
        analyses: Mapping[str, Mapping[str, object]] | None = None,
    ) -> None:
        self._config = config
        self._libraries = libraries
        self.background = Background()
        self.chain = make_chain(config.algorithms, analyses or {})
        for state in self.chain.states:
            self.chain.switch(state.name, on=state.name in config.algorithms)
        self.thread = CameraThread(
            config.name,
            lambda: libraries.open(self._config),
            self._prepare,
            lambda frame, settings: circumstances(self._config, frame, settings),
            policy,
        )
        self.recordings = CameraRecordings(self.thread, policy)
        self.jobs = JobQueue(f"images of {config.name}", policy)
        self.vision: VisionThread[Analysis] = VisionThread(config.name, self._analyse, policy)
        self.live = LiveView(config.name, self.corrected, policy)
        self.thread.subscribe(self._collect)
        self.thread.subscribe(self.live.put)
        self.thread.subscribe(self.vision.put)

    @property
    def config(self) -> CameraConfig:
        """Which camera it is meant to be."""
        return self._config

    def use(self, key: str) -> None:
        """Take the images with another camera of the same backend."""
        self._config = self._config.model_copy(update={"key": key})
        self.thread.reopen()

    def shown(self) -> CameraImage | None:
        """Return the newest image, background corrected; None before the first."""
        newest = self.thread.newest
        return self.corrected(newest) if newest is not None else None

    def start(self) -> None:
        """Begin to look for the camera and to take images."""
        self.vision.start()
        self.live.start()
        self.thread.start()

    def request_end(self) -> None:
        """Ask everything to end; returns at once."""
        self.recordings.request_stop()
        self.jobs.request_end()
        self.live.request_end()
        self.thread.request_end()
        self.vision.request_end()

    def join(self) -> bool:
        """Wait until everything has ended; False where the driver of the camera did not return."""
        self.recordings.stop()
        ended = self.thread.join()
        if not ended:
            logger.error("%s: its driver does not return; it is left behind", self._config.name)
        self.jobs.join()
        self.live.join()
        self.vision.join(VISION_JOIN_WALL_S)
        return ended

    def _collect(self, image: CameraImage) -> None:
        """Give the background what it waits for; in the camera's thread."""
        if not self.background.missing:
            return
        try:
            self.background.add(image.frame, self._binning())
        except ConfigError as exc:
            logger.warning("%s: %s", self._config.name, exc)

    def corrected(self, image: CameraImage) -> CameraImage:
        """Return an image without the background, where there is one that fits."""
        binning = self._binning()
        if not self.background.frames or self.background.misfit(image.frame, binning):
            return image  # of another size it is shown as it comes
        data = self.background.correct(image.frame, binning)
        return replace(image, frame=replace(image.frame, data=data))

    def _binning(self) -> int:
        settings = self.thread.settings
        return settings.binning if settings is not None else 1

    def _analyse(self, image: CameraImage) -> Analysis | None:
        if not any(state.on for state in self.chain.states):
            return None
        return self.chain.run(self.corrected(image))

    def _prepare(self, camera: Camera) -> CameraSettings:
        """Return what is configured, and what the camera has where nothing is."""
        config, now, ranges = self._config, camera.settings, camera.ranges
        roi = now.roi
        if config.binning != now.binning:
            width, height = camera.info.sensor_px
            roi = Roi(0, 0, width // config.binning, height // config.binning)
        pixel_format = PixelFormat(config.pixel_format)
        return CameraSettings(
            exposure_s=now.exposure_s if config.exposure_s is None else config.exposure_s,
            gain_db=now.gain_db if config.gain_db is None else config.gain_db,
            rate_hz=now.rate_hz if config.rate_hz is None else config.rate_hz,
            roi=roi,
            binning=config.binning,
            pixel_format=pixel_format if pixel_format in ranges.pixel_formats else now.pixel_format,
            trigger=now.trigger if config.trigger is None else Trigger(config.trigger),
        )
