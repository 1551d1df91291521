"""What the camera shows of fibres, on images that are known to be new."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.coordinate_transform import PlatformTransform
from cosmic.frame.arrays import Floats
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceTimeout, NotAvailable
from cosmic.frame.operation import Task
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.pixel_map import PixelMap
from cosmic.vico.core.vision.algorithms import grey
from cosmic.vico.core.vision.fibre import Fibre

logger = logging.getLogger(__name__)

LIMIT_WALL_S: Final = 15.0
Box = tuple[int, int, int, int]


def _nothing() -> None:
    return


class ImageWanted:
    """An image exposed from a time on; to be yielded by an operation."""

    def __init__(self, camera: CameraHandle, clock: Clock) -> None:
        self._camera = camera
        self._since_s = clock.now_s()
        self._late_wall_s = WALL.now_s() + LIMIT_WALL_S
        self._image: CameraImage | None = None
        self._forget: Callable[[], None] = _nothing

    @property
    def done(self) -> bool:
        """It is there, or was given up."""
        if self._image is None:
            self._image = self._camera.image_since(self._since_s)
        return self._image is not None or WALL.now_s() > self._late_wall_s

    def add_callback(self, callback: Callable[["ImageWanted"], object]) -> None:
        """Call `callback(self)` when it may be there, in the camera's thread."""

        def look() -> None:
            if self.done:
                self._leave()
                callback(self)

        self._forget = self._camera.on_image(look)
        look()

    def _leave(self) -> None:
        """Hear of no more images, and let go of who wanted this one: he has it, and it him."""
        forget, self._forget = self._forget, _nothing
        forget()

    def wait(self, timeout_s: float | None = None) -> CameraImage:
        """Wait for it, and return it.

        Raises
        ------
        NotAvailable
            None came in time; the text says why.
        DeviceTimeout
            It had not come after `timeout_s` of wall time.
        """
        if not self.done:
            left_s = max(0.0, self._late_wall_s - WALL.now_s())
            wait_s = left_s if timeout_s is None else min(timeout_s, left_s)
            try:
                self._image = self._camera.next_image(wait_s, self._since_s)
            except NotAvailable as exc:
                if not self.done:
                    raise DeviceTimeout(str(exc)) from exc
        if self._image is None:
            why = self._camera.problem or "none arrived"
            raise NotAvailable(f"no image of {self._camera.name} in {LIMIT_WALL_S:g} s: {why}")
        return self._image

    def cancel(self) -> None:
        """Want it no longer: nothing was set in motion."""
        self._leave()
        self._late_wall_s = -math.inf


@dataclass(frozen=True, slots=True, eq=False)
class SeenFibre:
    """A fibre on an image and on the platform.

    Attributes
    ----------
    line_um, line_px : ndarray, shape (n, 2)
        Centre line on the platform and on the image.
    scale_part : float
        Standard deviation of the scale, as a part of it.
    """

    fibre: Fibre
    line_um: Floats
    line_px: Floats
    scale_um_px: float
    scale_part: float = 0.0

    @property
    def length_um(self) -> float:
        """Along the centre line."""
        return self.fibre.length_px * self.scale_um_px

    @property
    def width_um(self) -> float:
        """Mean width."""
        return self.fibre.width_px * self.scale_um_px

    @property
    def length_std_um(self) -> float:
        """Standard deviation of the length."""
        return math.hypot(
            self.fibre.length_std_px * self.scale_um_px, self.scale_part * self.length_um
        )

    @property
    def width_std_um(self) -> float:
        """Standard deviation of the mean width."""
        return math.hypot(
            self.fibre.width_std_px * self.scale_um_px, self.scale_part * self.width_um
        )

    @property
    def curl_std(self) -> float:
        """Standard deviation of the curl."""
        known = self.fibre.uncertainties["curl"]
        return known if isinstance(known, float) else math.nan


def find_seen(image: CameraImage, mapped: PixelMap, box: Box | None = None) -> list[SeenFibre]:
    """Find fibres on an image, or on a part of it: left, top, right, bottom in pixels."""
    # Imported here: it loads OpenCV and scipy.
    from cosmic.vico.core.vision.finding import find_fibres

    height, width = image.data.shape[:2]
    left, top, right, bottom = box or (0, 0, width, height)
    pixels = np.ascontiguousarray(grey(image.data)[top:bottom, left:right])
    if min(pixels.shape) < 16:
        return []
    found = []
    for fibre in find_fibres(pixels):
        line_px = fibre.centre_line_px + np.array([left, top], dtype=np.float64)
        found.append(
            SeenFibre(fibre, mapped.to_um(line_px), line_px, mapped.scale_um_px, mapped.scale_part)
        )
    return found


def box_around(line_px: Floats, margin_px: float, image: CameraImage) -> Box:
    """Return the part of an image around a line."""
    height, width = image.data.shape[:2]
    low, high = line_px.min(axis=0) - margin_px, line_px.max(axis=0) + margin_px
    return (
        max(0, math.floor(low[0])),
        max(0, math.floor(low[1])),
        min(width, math.ceil(high[0]) + 1),
        min(height, math.ceil(high[1]) + 1),
    )


@dataclass(frozen=True, slots=True)
class Trace:
    """What lies along a line.

    Attributes
    ----------
    contrast : float
        How much darker than the ground it is, grey levels; 0 off the image.
    offset_px : float
        How far beside the line, to the left of its direction on the screen.
    """

    contrast: float
    offset_px: float


def trace_along(image: CameraImage, line_px: Floats, reach_px: float) -> Trace:
    """Look for something dark along a line, or beside it up to `reach_px`."""
    pixels = grey(image.data)
    points = _spaced(np.asarray(line_px, dtype=np.float64))
    ahead = np.gradient(points, axis=0)
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    normal = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    offsets = np.arange(-2.0 * reach_px, 2.0 * reach_px + 0.5, 0.5)
    samples = points[:, None, :] + offsets[None, :, None] * normal[:, None, :]
    rows, columns = np.rint(samples[..., 1]).astype(int), np.rint(samples[..., 0]).astype(int)
    height, width = pixels.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    if not inside.mean() > 0.8:
        return Trace(0.0, 0.0)
    greys = pixels[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(np.float64)
    profile = np.median(greys, axis=0)
    smooth = np.convolve(np.pad(profile, 2, mode="edge"), np.ones(5) / 5.0, mode="valid")
    ground = float(np.percentile(smooth, 75))
    near = np.abs(offsets) <= reach_px
    darkest = int(np.argmin(np.where(near, smooth, np.inf)))
    depth = ground - float(smooth[darkest])
    return Trace(max(0.0, depth), _middle_of(offsets, ground - smooth, darkest))


def _middle_of(offsets: Floats, depths: Floats, darkest: int) -> float:
    """Return the middle of what is at least half as dark: a wide fibre is as dark all over."""
    faint = np.flatnonzero(depths < 0.5 * depths[darkest])
    before, after = faint[faint < darkest], faint[faint > darkest]
    if not (len(before) and len(after)):
        return float(offsets[darkest])
    left, right = int(before[-1]), int(after[0])
    half = 0.5 * depths[darkest]

    def crossing(outside: int, inside: int) -> float:
        part = (half - depths[outside]) / (depths[inside] - depths[outside])
        return float(offsets[outside] + part * (offsets[inside] - offsets[outside]))

    return 0.5 * (crossing(left, left + 1) + crossing(right, right - 1))


def _spaced(line: Floats) -> Floats:
    """Return points a pixel apart along a line."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = max(4, int(lengths[-1]) + 1)
    at = np.linspace(0.0, lengths[-1], count)
    return np.column_stack([np.interp(at, lengths, line[:, 0]), np.interp(at, lengths, line[:, 1])])


def map_at(
    samples: object, image: CameraImage, height_um: float, tool: str | None = None
) -> PixelMap:
    """Return the map for things at a height; raises `NotAvailable` where it was not measured."""
    if not isinstance(samples, PlatformTransform):
        raise NotAvailable(
            "pixels cannot be converted to positions: micromanipulation is not hosted here"
        )
    return samples.map_of(image, height_um, tool)


RESTARTS: Final = 5
AFTER_FAILURE: Final = 1
"""Restarts of a camera that was given up at the look before, or has long been lost."""
GIVE_UP_WALL_S: Final = 10.0
"""How long a camera that says why there is no image is started again."""
LOST_WALL_S: Final = 1.0
"""How long an image is waited for while the camera says why there is none."""
APART_WALL_S: Final = 1.0
POLL_WALL_S: Final = 0.002
APART_PX: Final = 16


@dataclass(slots=True, eq=False)
class LastSeen:
    """The last image that was taken to be new.

    Attributes
    ----------
    given_up : bool
        None was to be had at the last look.
    lost_since_wall_s : float or None
        When the camera was first seen to say why there are no images; None: it does not.
    """

    image: CameraImage | None = None
    given_up: bool = False
    lost_since_wall_s: float | None = None

    def stays_lost(self, problem: str) -> bool:
        """Return whether the camera has long said why there is no image; `problem` is that now.

        It counts whether an image is wanted meanwhile or not: it is looked for all the time.
        """
        now_wall_s = WALL.now_s()
        if not problem:
            self.lost_since_wall_s = None
        elif self.lost_since_wall_s is None:
            self.lost_since_wall_s = now_wall_s
        since_wall_s = self.lost_since_wall_s
        return since_wall_s is not None and now_wall_s - since_wall_s > GIVE_UP_WALL_S

    def shows_the_same(self, image: CameraImage) -> bool:
        """Return whether a later image is the same to the last bit, which noise never allows."""
        before = self.image
        if before is None or before.frame.exposed_s == image.frame.exposed_s:
            return False
        some = image.data[::APART_PX, ::APART_PX]
        # One without any light in it, or with too much, has no noise.
        return np.array_equal(before.data[::APART_PX, ::APART_PX], some) and bool(np.ptp(some))


class LiveImage:
    """An image exposed from now on that is not an old one; to be yielded by an operation.

    Where the same image comes again, or none, the camera is stopped and started, some times.

    Parameters
    ----------
    last : LastSeen
        Shared by all images of one camera.
    """

    def __init__(self, camera: CameraHandle, clock: Clock, last: LastSeen) -> None:
        self._camera = camera
        self._clock = clock
        self._last = last
        self._wanted = ImageWanted(camera, clock)
        self._steps: list[Callable[[], Task]] = []
        self._task: Task | None = None
        self._again_wall_s = 0.0
        self._restarts = 0
        self._most = AFTER_FAILURE if last.given_up else RESTARTS
        self._lost_wall_s = WALL.now_s() + LOST_WALL_S
        self._give_up_wall_s = WALL.now_s() + GIVE_UP_WALL_S
        self._image: CameraImage | None = None
        self._error: CosmicError | None = None

    @property
    def done(self) -> bool:
        """A new one is there, or it was given up."""
        if self._image is not None or self._error is not None:
            return True
        if self._task is not None or self._steps:
            self._restart()
            return False
        if self._wanted.done:
            self._take()
        elif self._camera.problem and WALL.now_s() > self._lost_wall_s:
            self._begin_anew(
                NotAvailable(f"no image of {self._camera.name}: {self._camera.problem}")
            )
        return self._image is not None or self._error is not None

    def _take(self) -> None:
        try:
            image = self._wanted.wait(0.0)
        except NotAvailable as exc:
            self._begin_anew(exc)
            return
        if not self._last.shows_the_same(image):
            self._last.image = self._image = image
            self._last.given_up, self._last.lost_since_wall_s = False, None
            return
        self._begin_anew(
            NotAvailable(
                f"{self._camera.name} shows the same image again and again, also after its "
                f"stream was restarted {self._restarts} times: check the camera and its cable"
            )
        )

    def _begin_anew(self, trouble: CosmicError) -> None:
        problem = self._camera.problem
        late = bool(problem) and WALL.now_s() > self._give_up_wall_s
        lost = self._last.stays_lost(problem) and self._restarts >= AFTER_FAILURE
        if late or lost or self._restarts >= self._most:
            self._error, self._last.given_up = trouble, True
            return
        self._restarts += 1
        logger.warning("%s: no new image; its stream is restarted", self._camera.name)
        self._steps = [self._camera.stop, self._camera.start]
        self._again_wall_s = WALL.now_s() + APART_WALL_S * (self._restarts - 1)

    def _restart(self) -> None:
        """Go on with stopping and starting, without waiting for either."""
        if self._task is not None and not self._task.done:
            return
        if self._task is not None and self._task.failure is not None:
            logger.warning("%s: %s", self._camera.name, self._task.failure)
        self._task = None
        if not self._steps:
            self._wanted = ImageWanted(self._camera, self._clock)
            self._lost_wall_s = WALL.now_s() + LOST_WALL_S
        elif WALL.now_s() >= self._again_wall_s:
            self._task = self._steps.pop(0)()

    def add_callback(self, callback: Callable[["LiveImage"], object]) -> None:
        """Call `callback(self)` when the first image may be there, in the camera's thread."""
        self._wanted.add_callback(lambda _: callback(self))

    def wait(self, timeout_s: float | None = None) -> CameraImage:
        """Wait for it, and return it.

        Raises
        ------
        NotAvailable
            None came that is new; the text says why.
        DeviceTimeout
            It had not come after `timeout_s` of wall time.
        """
        until_wall_s = WALL.now_s() + (1e9 if timeout_s is None else timeout_s)
        while not self.done:
            left_s = until_wall_s - WALL.now_s()
            if left_s <= 0.0:
                raise DeviceTimeout(f"no new image of {self._camera.name} yet")
            WALL.sleep(min(left_s, POLL_WALL_S))
        if self._image is None:
            assert self._error is not None
            raise self._error
        return self._image

    def cancel(self) -> None:
        """Want it no longer; a camera that was stopped is started all the same."""
        self._wanted.cancel()
        if self._camera.start in self._steps:
            self._camera.start()
        self._steps, self._restarts = [], RESTARTS
        self._error = self._error or NotAvailable("the image is no longer wanted")
