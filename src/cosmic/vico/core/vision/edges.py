"""The end of a solid dark body, such as a jaw or a probe, measured by its straight edges."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np

from cosmic.frame.arrays import Floats, Floats32
from cosmic.vico.core.vision.grey import middle, middles, quantile
from cosmic.vico.hw.interface import Pixels

Pair = tuple[float, float]

DARKEST: Final = 0.02
LEAST_CONTRAST: Final = 0.25
BODY_LEVEL: Final = 0.4
CLIP_PX: Final = 0.3
FEWEST_PROFILES: Final = 5
# Neighbouring profiles share noise: the image is blurred, and each is the mean of three.
SHARED_NOISE: Final = 2.0


class Frame(NamedTuple):
    """A part of the image turned so that the tool points to the right.

    Columns go forward, rows to the tool's side; `origin_px` is where (0, 0) lies.
    """

    pixels: Floats32
    origin_px: Floats
    forward: Floats
    side: Floats

    def image_px(self, forward: float, aside: float) -> Pair:
        """Return where a point lies in the image."""
        x, y = self.origin_px + forward * self.forward + aside * self.side
        return float(x), float(y)


class Levels(NamedTuple):
    """Grey of the body and of the ground."""

    body: float
    ground: float

    @property
    def contrast(self) -> float:
        """Grey levels between them."""
        return self.ground - self.body


class Blob(NamedTuple):
    """A body to a pixel: its front and its sides, in the turned frame."""

    front: int
    low: int
    high: int
    back: int


@dataclass(frozen=True, slots=True)
class Line:
    """An edge as a straight line, position over point along it.

    Attributes
    ----------
    kept : float
        Part of the profiles that agree with it.
    """

    offset: float
    slope: float
    middle: float
    std: float
    slope_std: float
    kept: float

    def at(self, abscissa: float) -> float:
        """Return the edge's position."""
        return self.offset + self.slope * (abscissa - self.middle)

    def std_at(self, abscissa: float) -> float:
        """Return its standard deviation there."""
        return math.hypot(self.std, self.slope_std * (abscissa - self.middle))


@dataclass(frozen=True, slots=True)
class Body:
    """The end of one body in its turned frame: front edge and both sides."""

    front: Line
    low: Line
    high: Line

    @property
    def width(self) -> float:
        """Between the sides, across."""
        at = self.front.offset
        lean = 0.5 * (self.low.slope + self.high.slope)
        return (self.high.at(at) - self.low.at(at)) / math.hypot(1.0, lean)

    def corner(self, side: Line) -> tuple[float, float]:
        """Return where the front meets a side: forward, aside."""
        aside = side.at(self.front.offset)
        forward = self.front.at(aside)
        return forward, side.at(forward)

    @property
    def tip(self) -> tuple[float, float]:
        """The middle of the front."""
        one, other = self.corner(self.low), self.corner(self.high)
        return 0.5 * (one[0] + other[0]), 0.5 * (one[1] + other[1])

    @property
    def std(self) -> float:
        """Standard deviation of the tip, both directions together, per coordinate."""
        at = self.front.offset
        aside = 0.5 * math.hypot(self.low.std_at(at), self.high.std_at(at))
        return max(aside, self.front.std)


def turned(
    image: Pixels, at_px: Pair, forward: Pair, *, back: float, ahead: float, aside: float
) -> Frame:
    """Return the surroundings of a point, turned; beyond the image its rim goes on."""
    ahead_of, side = np.array(forward), np.array([-forward[1], forward[0]])
    origin = np.array(at_px) - back * ahead_of - aside * side
    columns, rows = math.ceil(back + ahead) + 1, math.ceil(2.0 * aside) + 1
    matrix = np.column_stack([ahead_of, side, origin])
    pixels = cv2.warpAffine(
        image,
        matrix,
        (columns, rows),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return Frame(np.asarray(pixels, dtype=np.float32), origin, ahead_of, side)


def levels(frame: Frame) -> Levels | None:
    """Return the greys of body and ground; None where nothing is dark enough to be a tool."""
    some = frame.pixels[::2, ::2].astype(np.float64)
    low, high = quantile(some, DARKEST), quantile(some, 1.0 - DARKEST)
    found = Levels(low, middle(frame.pixels[frame.pixels >= 0.5 * (low + high)]))
    return found if found.contrast > max(LEAST_CONTRAST * found.ground, 8.0) else None


def blobs(frame: Frame, greys: Levels, width: float) -> list[Blob]:
    """Return the bodies that come from behind, by their point aside; thin things are none."""
    mask = (frame.pixels < greys.body + BODY_LEVEL * greys.contrast).astype(np.uint8)
    size = max(3, round(0.5 * width))
    shape = cv2.getStructuringElement(cv2.MORPH_RECT, (size, size))
    solid = cv2.morphologyEx(mask, cv2.MORPH_OPEN, shape, borderType=cv2.BORDER_REPLICATE)
    _, labels = cv2.connectedComponents(solid)
    found = []
    for label in np.unique(labels[:, 0]):
        if label == 0:
            continue
        here = labels == label
        thick = here.sum(axis=0)
        columns = np.flatnonzero(thick >= 0.5 * width)
        if len(columns) == 0:
            continue
        front = int(columns[-1])
        back = max(0, front - round(4.0 * width))
        rows = np.flatnonzero(here[:, back : front + 1].sum(axis=1) > 0.5 * (front - back))
        if len(rows):
            found.append(Blob(front, int(rows[0]), int(rows[-1]), back))
    return sorted(found, key=lambda each: each.low)


def measure(frame: Frame, greys: Levels, blob: Blob, width: float) -> Body | None:
    """Fit the edges of a body; None where too few profiles cross from dark to light."""
    reach = int(min(max(width, 12.0), 50.0))
    across = blob.high - blob.low
    inside = max(4, round(0.45 * across))
    margin = round(0.22 * across)
    inner = range(blob.low + margin, blob.high - margin + 1)
    front = _edge(frame.pixels, greys, blob.front, inner, (reach, reach))
    along = range(blob.back, max(blob.back, blob.front - round(0.4 * width)))
    flat = frame.pixels.T
    high = _edge(flat, greys, blob.high, along, (inside, reach))
    mirrored = flat[:, ::-1]
    last = flat.shape[1] - 1
    low = _edge(mirrored, greys, last - blob.low, along, (inside, reach))
    if front is None or high is None or low is None:
        return None
    flipped = Line(last - low.offset, -low.slope, low.middle, low.std, low.slope_std, low.kept)
    return Body(front, flipped, high)


def _edge(
    pixels: Floats32, greys: Levels, near: int, places: range, reach: tuple[int, int]
) -> Line | None:
    """Fit the edge that lies near a column, over some rows: dark before it, light after it."""
    rows, columns = pixels.shape
    at = np.arange(max(1, places.start), min(rows - 1, places.stop))
    first, last = max(0, near - reach[0]), min(columns, near + reach[1] + 1)
    if len(at) < FEWEST_PROFILES or near - first < 4 or last - near < 4:
        return None
    part = np.ascontiguousarray(pixels[at[0] - 1 : at[-1] + 2, first:last])
    profiles = (part[:-2] + part[1:-1] + part[2:]) / 3.0
    inner = middles(profiles[:, : max(3, (near - first) // 2)])
    outer = middles(profiles[:, -max(3, (last - near) // 2) :])
    # Where a fibre lies before the edge, the ground of the rest is what it would be seen against.
    clear = np.abs(outer - greys.ground) < 0.15 * greys.contrast
    half = 0.5 * (inner + np.where(clear, outer, greys.ground))
    light = profiles >= half[:, None]
    crossing = np.argmax(light, axis=1)
    usable = crossing > 0
    if usable.sum() < FEWEST_PROFILES:
        return None
    index, chosen = crossing[usable], np.flatnonzero(usable)
    before, after = profiles[chosen, index - 1], profiles[chosen, index]
    part_px = (half[usable] - before) / np.maximum(after - before, 1e-6)
    position = first + index - 1 + part_px
    return _straight(at[usable].astype(np.float64), position.astype(np.float64), len(at))


def _straight(abscissa: Floats, position: Floats, asked: int) -> Line | None:
    """Fit a line, leaving out what lies off it."""
    away = np.abs(position - middle(position))
    kept = away <= max(3.0, 4.0 * middle(away))
    for _ in range(3):
        if kept.sum() < FEWEST_PROFILES:
            return None
        fit = _Fit.of(abscissa[kept], position[kept])
        error = np.abs(fit.error(abscissa, position))
        kept = error <= max(CLIP_PX, 3.0 * 1.4826 * middle(error[kept]))
    count = int(kept.sum())
    if count < FEWEST_PROFILES:
        return None
    fit = _Fit.of(abscissa[kept], position[kept])
    error = fit.error(abscissa[kept], position[kept])
    sigma = SHARED_NOISE * math.sqrt(float(error @ error) / (count - 2))
    return Line(
        fit.offset,
        fit.slope,
        fit.middle,
        sigma / math.sqrt(count),
        sigma / math.sqrt(fit.power),
        count / asked,
    )


class _Fit(NamedTuple):
    middle: float
    offset: float
    slope: float
    power: float

    @classmethod
    def of(cls, abscissa: Floats, position: Floats) -> "_Fit":
        middle, offset = float(abscissa.mean()), float(position.mean())
        along = abscissa - middle
        power = float(along @ along)
        return cls(middle, offset, float(along @ (position - offset)) / power, power)

    def error(self, abscissa: Floats, position: Floats) -> Floats:
        return position - self.offset - self.slope * (abscissa - self.middle)
