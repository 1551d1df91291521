"""`CameraThread`: takes the images of one camera in a thread of its own (thesis 5.2, V1)."""

import logging
import math
from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Condition, Lock
from typing import Final

import numpy as np
from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.buffer import DataBuffer
from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceError,
    DeviceFault,
    NotAvailable,
    NotConnectedError,
    only_cosmic_errors,
)
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import OPEN_S, Heartbeat
from cosmic.frame.operation import Task
from cosmic.frame.threads import WorkerThread, forbid_waiting_here
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.interface import (
    Camera,
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    Frame,
    FrameStatus,
    array_of,
)

logger = logging.getLogger(__name__)

LOOK_S: Final = 0.05
SHOWN_HZ: Final = 40.0
LOOKED_S: Final = 1.0
SEARCH_S: Final = 1.0
REFUSALS: Final = frozenset({DeviceFault.BUSY, DeviceFault.PARAMETER, DeviceFault.UNSUPPORTED})
"""What a camera may answer without being lost."""

Receiver = Callable[[CameraImage], object]
Command = Callable[[Camera], None]


def _mismatch(frame: Frame, settings: CameraSettings) -> str:
    """Return how a frame differs from what a camera says of itself; "" where it does not."""
    if not frame.ready:  # a simulated camera's, which looking at would draw
        return ""
    if not -math.inf < frame.exposed_s <= frame.time_s < math.inf:
        # Who waits for an image of a time would get an old one, or none.
        return f"an image came at {frame.time_s!r} s that was exposed at {frame.exposed_s!r} s"
    shape, kind = array_of(settings)
    data = frame.data
    came = (
        f"shape {data.shape}, {data.dtype}"
        if isinstance(data, np.ndarray)
        else f"no array but {type(data).__name__}"
    )
    expected = f"shape {shape}, {np.dtype(kind)}"
    if came == expected and frame.pixel_format == settings.pixel_format:
        return ""
    return (
        f"an image of {came}, {frame.pixel_format} came; its settings say {expected}, "
        f"{settings.pixel_format}"
    )


class CameraThread(WorkerThread):
    """Opens a camera, takes images until it is told not to, and looks for it when it is lost.

    Receivers get every frame, incomplete ones too, in the camera's thread and in order; they
    must return at once. The newest whole image waits for whoever only wants to look.

    Parameters
    ----------
    open_camera : callable
        Opens it; raises `NotConnectedError` while it is not there.
    prepare : callable
        What to put in force in a camera just opened, from what it accepts.
    circumstances : callable
        What is known of the moment a frame was exposed; called in the camera's thread.

    Signals
    -------
    status_changed()
        Connected, lost, started, stopped or configured; its driver hangs, or goes on.

    Attributes
    ----------
    heartbeat : Heartbeat
        Stays away while a call of the driver does not return.
    """

    may_wait = False

    status_changed = Signal()

    def __init__(
        self,
        name: str,
        open_camera: Callable[[], Camera],
        prepare: Callable[[Camera], CameraSettings],
        circumstances: Callable[[Frame, CameraSettings], Circumstances],
        policy: FailurePolicy,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(f"camera {name}", policy, parent)
        self.camera_name = name
        self._open_camera = open_camera
        self._prepare = prepare
        self._circumstances = circumstances
        self._commands: SimpleQueue[tuple[Task, Command]] = SimpleQueue()
        self._camera: Camera | None = None
        self._wanted_running = True
        self._running = False
        self._problem = ""
        self._settings: CameraSettings | None = None
        self._kept: tuple[str, CameraSettings] | None = None
        self._ranges: CameraRanges | None = None
        self._last_id: int | None = None
        self._refused_s: float | None = None
        self._reopen = False
        self._newest: DataBuffer[CameraImage] = DataBuffer()
        self._shown: CameraImage | None = None
        self._looked_s = self._drawn_s = -SEARCH_S
        self._arrived = Condition()
        self._received: Event[CameraImage] = Event()
        self._renewed: Event[[]] = Event()
        self._ended: Event[[]] = Event()
        self._lock = Lock()
        self._over = False
        self._stall = ""
        self.heartbeat = Heartbeat(self._on_stall)

    # What there is; any thread

    @property
    def info(self) -> CameraInfo | None:
        """Which camera it is; None while none is connected."""
        camera = self._camera
        return camera.info if camera is not None else None

    @property
    def ranges(self) -> CameraRanges | None:
        """What it accepts now; None while it is not connected."""
        return self._ranges

    @property
    def settings(self) -> CameraSettings | None:
        """What is in force; None while it is not connected."""
        return self._settings

    @property
    def counters(self) -> CameraCounters:
        """What became of the frames since the start."""
        camera = self._camera
        return camera.counters if camera is not None else CameraCounters()

    @property
    def running(self) -> bool:
        """It takes images, or waits for its trigger."""
        return self._running and not self._stall

    @property
    def problem(self) -> str:
        """Why no images come; empty when all is well."""
        return self._stall or self._problem

    @property
    def newest(self) -> CameraImage | None:
        """The newest whole image; None before the first.

        While somebody looks again and again it is one whose pixels are at hand, `SHOWN_HZ` times
        a second; a simulated camera would else draw it in the thread that looks.
        """
        self._looked_s = WALL.now_s()
        return self._shown or self._newest.latest()

    @property
    def last(self) -> CameraImage | None:
        """The newest whole image, for one who wants a certain one and does not look at all."""
        return self._newest.latest()

    def on_newest(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()` in the camera's thread when there is a newer `last`."""
        return self._renewed.subscribe(listener)

    def subscribe(self, receiver: Receiver) -> Unsubscribe:
        """Call `receiver(image)` with every frame, in the camera's thread."""
        return self._received.subscribe(receiver)

    def on_end(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()` when the camera is closed for good; at once where it is."""
        unsubscribe = self._ended.subscribe(listener)
        if self._over:
            listener()
        return unsubscribe

    def next_image(self, since_s: float, timeout_s: float) -> CameraImage:
        """Wait for a whole image whose exposure began at `since_s` of platform time or later.

        Raises
        ------
        NotAvailable
            None came within `timeout_s` of wall time; the text says why, where that is known.
        WrongThreadError
            Called in the GUI thread.
        """
        forbid_waiting_here("waiting for an image")

        def fresh() -> bool:
            newest = self._newest.latest()
            return newest is not None and newest.frame.exposed_s >= since_s

        with self._arrived:
            self._arrived.wait_for(lambda: fresh() or self._over, timeout_s)
            newest = self._newest.latest()
        if newest is None or not fresh():
            self._check_open()
            reason = self.problem or ("it is stopped" if not self._running else "none arrived")
            raise NotAvailable(f"no image of {self.camera_name} in {timeout_s:g} s: {reason}")
        return newest

    # Commands; any thread

    def configure(self, settings: CameraSettings) -> Task:
        """Begin to put settings in force; a camera that runs is restarted where it must be."""

        def command(camera: Camera) -> None:
            before = camera.settings
            if not self._running or _while_running(before, settings):
                self._settings = camera.configure(settings)
            else:
                self._restart(camera, settings, before)
            self._keep(camera)
            self._shown = None  # it was taken with other settings
            logger.info("%s takes images with %s", self.name, self._settings)

        return self._put(f"Settings of {self.camera_name}", command)

    def start_images(self) -> Task:
        """Begin to take images; harmless while it does."""

        def command(camera: Camera) -> None:
            self._wanted_running = True
            if not self._running:
                self._begin(camera)

        return self._put(f"Starting {self.camera_name}", command)

    def stop_images(self) -> Task:
        """End taking images; the newest stays."""

        def command(camera: Camera) -> None:
            self._wanted_running = False
            self._running = False
            camera.stop()
            if (newest := self.last) is not None:
                self._draw(newest)  # it stays, and is drawn while that can be

        return self._put(f"Stopping {self.camera_name}", command)

    def reopen(self) -> None:
        """Give the camera back and open it anew: another one, where that was chosen meanwhile."""
        self._reopen = True

    def trigger(self) -> None:
        """Take one image, with the software trigger.

        Raises
        ------
        NotAvailable
            Another trigger is in force, or no camera is connected.
        """
        self._check_open()
        camera = self._camera
        if camera is None:
            raise NotAvailable(f"{self.camera_name}: {self.problem or 'not connected'}")
        camera.trigger()

    def _check_open(self) -> None:
        if self._over:
            raise NotAvailable(f"{self.camera_name} is closed")

    def _put(self, title: str, command: Command) -> Task:
        task = Task(title)
        with self._lock:
            if self._over:
                task.fail(NotAvailable(f"{self.camera_name} is closed"))
            elif self._stall:
                task.fail(NotAvailable(self._stall))
            else:
                self._commands.put((task, command))
        return task

    # In the camera's thread

    @override
    def run_body(self) -> None:
        try:
            while not self.end_requested:
                try:
                    self._work()
                except CosmicError as exc:
                    self._lose(exc)
        finally:
            self._close()
            self.heartbeat.end()
            with self._lock:
                self._over = True
            self._refuse_commands("closed")
            with self._arrived:
                self._arrived.notify_all()
            self._ended.emit()

    def _work(self) -> None:
        """Open the camera and take images until the end, another camera or a failure."""
        self._reopen = False
        self.heartbeat.beat(OPEN_S)
        self._close()
        with only_cosmic_errors(self.camera_name):
            self._camera = camera = self._open_camera()
            self._settings = self._as_before(camera)
            self._keep(camera)
        logger.info("%s: %s %s connected", self.name, camera.info.vendor, camera.info.model)
        if self._wanted_running:
            self._begin(camera)
        self._problem = ""
        self.status_changed.emit()
        while not (self.end_requested or self._reopen):
            self.heartbeat.beat()
            self._obey(camera)
            if not self._running:
                self._end_requested.wait(LOOK_S)
                continue
            frame = self._receive(camera)
            if frame is not None:
                self._hand_on(frame, camera.settings)

    def _as_before(self, camera: Camera) -> CameraSettings:
        """Put in force what was before a camera was lost, or what `prepare` says of a new one."""
        kept = self._kept
        if kept is not None and kept[0] == camera.info.key:
            try:
                return camera.configure(kept[1])
            except ConfigError as exc:
                logger.warning("%s: came back, and refuses what was in force: %s", self.name, exc)
        return camera.configure(self._prepare(camera))

    def _keep(self, camera: Camera) -> None:
        """Note what is in force, for the case that the camera is lost and comes back."""
        self._ranges = camera.ranges
        if self._settings is not None:
            self._kept = camera.info.key, self._settings

    def _receive(self, camera: Camera) -> Frame | None:
        """Return the next frame that is as its settings say; raises `DeviceError`."""
        with only_cosmic_errors(self.camera_name):
            frame = camera.receive(LOOK_S)
            if frame is None:
                return None
            # Reading them back may cost a brought camera as much as an image.
            mismatch = _mismatch(frame, self._settings or camera.settings)
        if mismatch:
            self._refuse(camera.info, mismatch)
            return None
        if self._refused_s is not None and WALL.now_s() - self._refused_s >= SEARCH_S:
            self._set_problem("")
            self._refused_s = None
        return frame

    def _refuse(self, info: CameraInfo, mismatch: str) -> None:
        """Say why an image is not handed on; the next ones may be right."""
        text = (
            f"{self.camera_name} ({info.vendor} {info.model}, {info.serial}): {mismatch}. It is "
            f"refused. Correct the driver, or what it reads back as its settings"
        )
        self._refused_s = WALL.now_s()
        if text != self._problem:
            logger.error("%s", text)
            self._set_problem(text)

    def _set_problem(self, text: str) -> None:
        self._problem = text
        self.status_changed.emit()

    def _begin(self, camera: Camera) -> None:
        self._last_id = self._refused_s = None
        self._problem = ""
        with only_cosmic_errors(self.camera_name):
            camera.start()
        self._running = True

    def _restart(self, camera: Camera, settings: CameraSettings, before: CameraSettings) -> None:
        """Stop the camera for what cannot change while it runs; it goes on in any case."""
        camera.stop()
        self._running = False
        try:
            self._settings = camera.configure(settings)
        except CosmicError:
            self._settings = camera.configure(before)
            raise
        finally:
            self._begin(camera)

    def _obey(self, camera: Camera) -> None:
        while True:
            try:
                task, command = self._commands.get_nowait()
            except Empty:
                return
            try:
                with only_cosmic_errors(self.camera_name):
                    command(camera)
            except CosmicError as exc:
                task.fail(exc)
                if isinstance(exc, DeviceError) and exc.fault not in REFUSALS:
                    raise
            else:
                task.finish()
            self.status_changed.emit()

    def _hand_on(self, frame: Frame, settings: CameraSettings) -> None:
        lost = frame.frame_id - self._last_id - 1 if self._last_id is not None else 0
        self._last_id = frame.frame_id
        image = CameraImage(
            camera=self.camera_name,
            frame=frame,
            circumstances=self._circumstances(frame, settings),
            lost_before=max(0, lost),
        )
        self._received.emit(image)
        if frame.status is FrameStatus.COMPLETE:
            self._show(image)
            with self._arrived:
                self._newest.put(image)
                self._arrived.notify_all()
            self._renewed.emit()

    def _show(self, image: CameraImage) -> None:
        now_s = WALL.now_s()
        if now_s - self._looked_s > LOOKED_S:
            self._shown = None
        elif now_s - self._drawn_s >= 1.0 / SHOWN_HZ:
            self._drawn_s = now_s
            self._draw(image)
            self._shown = image

    def _draw(self, image: CameraImage) -> None:
        """Wait for the pixels of a simulated image; that is no call of a driver."""
        self.heartbeat.beat(math.inf)
        image.data.view()
        self.heartbeat.beat()

    def _lose(self, error: CosmicError) -> None:
        """Say why there are no images, and wait before the camera is looked for again."""
        text = str(error)
        if text != self._problem:
            log = logger.warning if isinstance(error, NotConnectedError) else logger.error
            log("%s: %s; it is looked for every %g s", self.name, text, SEARCH_S)
        self._problem = text
        self._close()
        self._refuse_commands(text)
        self.status_changed.emit()
        until_s = WALL.now_s() + SEARCH_S
        while not (self.end_requested or self._reopen) and WALL.now_s() < until_s:
            self.heartbeat.beat()
            self._end_requested.wait(LOOK_S)
            self._refuse_commands(text)

    def _on_stall(self, stalled_s: float) -> None:
        """Say that the driver hangs, or that it goes on; thread of the watch."""
        before = self._stall
        if stalled_s:
            what = "the image shown is an old one" if self._running else "no images come"
            text = (
                f"{self.camera_name}: its driver has not returned from a call for {stalled_s:g} s; "
                f"{what}. Unplug the camera and plug it in again, or restart the program"
            )
            with self._lock:
                self._stall = text
            logger.error("%s", text)
            self._refuse_commands("its driver does not return")
        elif before:
            with self._lock:
                self._stall = ""
            logger.warning("%s: its driver has returned, and goes on", self.camera_name)
        self.status_changed.emit()

    def _refuse_commands(self, reason: str) -> None:
        while not self._commands.empty():
            task, _ = self._commands.get_nowait()
            task.fail(NotAvailable(f"{self.camera_name}: {reason}"))

    def _close(self) -> None:
        camera, self._camera = self._camera, None
        self._running = False
        self._settings = self._ranges = None
        if camera is not None:
            camera.close()


def _while_running(before: CameraSettings, after: CameraSettings) -> bool:
    """Return whether nothing differs but what a running camera may change."""
    return (before.roi, before.binning, before.pixel_format, before.trigger) == (
        after.roi,
        after.binning,
        after.pixel_format,
        after.trigger,
    )
