"""Fibres of a bundle told apart by drawing them: bars side by side, which may touch or cross.

Where fibres of a bundle touch no ground is seen between them, but what they look like together
follows from where each of them lies. The strip along the bundle is straightened. Where the fibres
are seen apart they are counted; from there each is followed both ways, as a smooth curve of one
width, so that all of them drawn together look like the strip. What is left unexplained, or an end
that nothing shows, says that they are not told apart.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.vico.core.vision.bundle_bars import (
    Bars,
    Free,
    blurred,
    cover,
    drawn,
    fitted,
    offsets,
    relative,
    together,
)
from cosmic.vico.core.vision.bundle_strip import (
    ALONG_PX,
    MARGIN_PX,
    SAME,
    SEED_PX,
    Strip,
    seeds,
    strip_of,
)
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.smoothing import arc_lengths, directions, softened

GROWN_PX: Final = 24.0
ORDERS: Final = ((0.0, 2), (160.0, 3), (260.0, 4))
"""Of the curve of a fibre, by the length of what is seen."""
TURNS: Final = 4
GROWING_TURNS: Final = 2
FIRST_BLUR_PX: Final = 1.2
END_ROWS: Final = 3
SHOWN: Final = 50.0
"""Of squared deviations of the noise: by so much a wrong end is less likely."""
FAR_BACK: Final = 0.3
"""Of a fibre: so far back its end is looked for."""
UNEXPLAINED: Final = 0.25
"""Of the height: where drawn and seen differ by more, something is not explained."""
DUST: Final = 0.4
MISSED: Final = 0.1
"""In squared widths: as large as a speck of dust may be, and what is drawn and not seen."""
ROUGHLY: Final = 12.0
"""In squared widths: so much may be unexplained before all is fitted."""
MOST_HIDDEN: Final = 0.005
"""Of the length: over which the ends may be anywhere."""
FINER: Final = 4


def _raised(bars: Bars, order: int) -> Bars:
    """Return bars whose courses have at least some order."""
    more = order + 1 - bars.courses.shape[1]
    return replace(bars, courses=np.pad(bars.courses, ((0, 0), (0, max(0, more)))))


def _order(rows: int) -> int:
    return next(order for least, order in reversed(ORDERS) if rows * ALONG_PX >= least)


def _noted_ends(strip: Strip, bars: Bars, rows: Floats, side: int) -> Bars:
    """Return bars, of which those end that are no longer seen in some rows, from the inside out."""
    ends = bars.ends.copy()
    outward = -1 if side == 0 else 1
    soft = softened(strip.height.T.astype(np.float64), 1.0).T
    for number, off in enumerate(offsets(strip, bars, rows)):
        if np.isfinite(ends[number, side]):
            continue
        near = np.abs(strip.across[None, :] - off[:, None]) < max(0.25 * bars.widths[number], 0.8)
        core = (soft[rows.astype(int)] * near).sum(axis=1) / np.maximum(near.sum(axis=1), 1)
        below = core < 0.5 * bars.heights[number]
        gone = [n for n in range(len(below) - END_ROWS + 1) if below[n : n + END_ROWS].all()]
        if gone:
            ends[number, side] = rows[gone[0]] - 0.5 * outward
    return replace(bars, ends=ends)


def followed(strip: Strip, first: int, last: int, middles: Floats, width: float) -> Bars | None:
    """Return fibres followed from where they are seen apart to their ends."""
    rows = np.arange(first, last, dtype=np.float64)
    count = middles.shape[1]
    order = _order(len(rows))
    courses = np.polyfit(relative(strip, rows), middles, order)[::-1].T
    top = np.full(count, float(np.percentile(strip.height[first:last], 90.0)))
    endless = np.tile([-np.inf, np.inf], (count, 1))
    bars = Bars(
        np.asarray(courses, dtype=np.float64),
        endless,
        np.full(count, width + 1.0),
        top,
        FIRST_BLUR_PX,
    )
    bars = fitted(strip, bars, rows, Free(shape=True), 2 * TURNS)
    total = len(strip.axis)
    step = int(GROWN_PX / ALONG_PX)
    while not np.isfinite(bars.ends).all():
        for side in (0, 1):
            if np.isfinite(bars.ends[:, side]).all():
                continue
            old = (first, last)
            first, last = (max(0, first - step), last) if side == 0 else (first, last + step)
            last = min(total, last)
            if (first, last) == old:
                return None
            if side == 0:
                ahead = np.arange(max(0, first - END_ROWS), old[0])[::-1]
            else:
                ahead = np.arange(old[1], min(total, last + END_ROWS))
            bars = _noted_ends(strip, bars, ahead.astype(np.float64), side)
            rows = np.arange(first, last, dtype=np.float64)
            bars = fitted(strip, _raised(bars, _order(last - first)), rows, Free(), GROWING_TURNS)
    return bars


def finished(strip: Strip, bars: Bars) -> Bars | None:
    """Return bars fitted in everything, each end where it is most likely; None: astray."""
    rows = np.arange(len(strip.axis), dtype=np.float64)
    free = Free(ends=True, shape=True)
    bars = fitted(strip, bars, rows, free, 3 * TURNS)
    for _ in range(2):
        if not _possible(strip, bars):
            return None
        ends = np.array(
            [
                [
                    at[np.argmin(price)]
                    for at, price in map(partial(_ends, strip, bars, number), (0, 1))
                ]
                for number in range(len(bars.widths))
            ]
        )
        if (np.abs(ends - bars.ends) * ALONG_PX < 1.0).all():
            break
        bars = fitted(strip, replace(bars, ends=ends), rows, free, 2 * TURNS)
    return bars if _possible(strip, bars) else None


def _possible(strip: Strip, bars: Bars) -> bool:
    """Return whether all fibres are long, and lie on the strip."""
    last = len(strip.axis) - 1.0
    if not ((bars.ends >= 0.0) & (bars.ends <= last)).all():
        return False
    if not (np.ptp(bars.ends, axis=1) * ALONG_PX >= SEED_PX).all():
        return False
    for number, (first, stop) in enumerate(bars.ends):
        rows = np.linspace(first, stop, 50)
        columns = offsets(strip, bars, rows)[number] - float(strip.across[0])
        if not ((columns >= 0.0) & (columns <= len(strip.across) - 1.0)).all():
            return False
        if not strip.seen[np.round(rows).astype(int), np.round(columns).astype(int)].all():
            return False
    return True


def _ends(strip: Strip, bars: Bars, number: int, side: int) -> tuple[Floats, Floats]:
    """Return rows at which a fibre may end, and how unlike the strip it is then drawn."""
    first, last = bars.ends[number]
    back = np.array(
        [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, *np.arange(2.0, FAR_BACK * (last - first), 3.0)]
    )
    at = first + back if side == 0 else last - back
    near = slice(
        int(max(0.0, at.min() - MARGIN_PX)), int(min(len(strip.axis), at.max() + MARGIN_PX))
    )
    rows = np.arange(near.start, near.stop, dtype=np.float64)
    covers = np.array([cover(strip, bars, rows, n) for n in range(len(bars.widths))])
    price = []
    for each in at:
        ends = bars.ends.copy()
        ends[number, side] = each
        covers[number] = cover(strip, replace(bars, ends=ends), rows, number)
        rest = (strip.height[near] - blurred(together(covers), bars.blur_px)) * strip.seen[near]
        price.append(float((rest**2).sum()) / strip.noise**2)
    return at, np.array(price)


def hidden_px(strip: Strip, bars: Bars, number: int) -> float:
    """Return over which length the ends of a fibre may be anywhere."""
    found = 0.0
    for side in (0, 1):
        at, price = _ends(strip, bars, number, side)
        found += float(np.ptp(at[price < price.min() + SHOWN])) * ALONG_PX
    return found


def explained(strip: Strip, bars: Bars, dust: float = DUST, missed: float = MISSED) -> bool:
    """Return whether all that is drawn is seen, and no more is seen than dust."""
    rows = np.arange(len(strip.axis), dtype=np.float64)
    rest = (strip.height - drawn(strip, bars, rows)) * strip.seen
    width, height = float(bars.widths.mean()), float(bars.heights.mean())
    soft = blurred(rest, max(1.0, 0.2 * width))
    for odd, most in ((soft > UNEXPLAINED * height, dust), (soft < -UNEXPLAINED * height, missed)):
        _, _, stats, _ = cv2.connectedComponentsWithStats(odd.view(np.uint8), connectivity=8)
        areas = stats[1:, cv2.CC_STAT_AREA]
        if float(areas.max(initial=0)) * ALONG_PX > most * width**2:
            return False
    return True


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """One fibre as it was drawn.

    Attributes
    ----------
    line : ndarray, shape (n, 2)
        Full-size pixels, about `ALONG_PX` apart.
    """

    line: Floats
    width: float
    height: float
    blur_px: float

    @property
    def length_px(self) -> float:
        """Its length."""
        return float(arc_lengths(self.line)[-1])


def separated_bars(scene: Scene, own: Mask) -> list[Bar]:
    """Return the fibres of a bundle, none where they are not told apart."""
    strip = strip_of(scene, own)
    if strip is None:
        return []
    for first, last, middles, width in seeds(strip):
        begun = followed(strip, first, last, middles, width)
        if begun is None or not (_alike(begun) and explained(strip, begun, ROUGHLY, ROUGHLY)):
            continue
        bars = finished(strip, begun)
        if bars is None:
            continue
        found = _bars(strip, bars)
        if _clear(strip, bars, found):
            return found
    return []


def _bars(strip: Strip, bars: Bars) -> list[Bar]:
    found = []
    for number, (first, last) in enumerate(bars.ends):
        rows = np.linspace(first, last, max(8, int(last - first)))
        line = strip.line(rows, offsets(strip, bars, rows)[number])
        found.append(
            Bar(line, float(bars.widths[number]), float(bars.heights[number]), bars.blur_px)
        )
    return found


def _alike(bars: Bars) -> bool:
    return all(float(each.min()) > SAME * float(each.max()) for each in (bars.widths, bars.heights))


def _clear(strip: Strip, bars: Bars, found: list[Bar]) -> bool:
    """Return whether fibres are alike, each end is seen, and together they explain the strip."""
    return (
        _alike(bars)
        and explained(strip, bars)
        and all(
            hidden_px(strip, bars, n) < MOST_HIDDEN * each.length_px for n, each in enumerate(found)
        )
    )


def alone(scene: Scene, bars: list[Bar]) -> list[Scene]:
    """Return a scene for each fibre of a bundle, without what the others look like beside it."""
    points = np.concatenate([each.line for each in bars])
    room = 2.0 * max(each.width for each in bars) + 8.0
    low = np.maximum(np.floor(points.min(axis=0) - room), 0).astype(int)
    high = np.minimum(np.ceil(points.max(axis=0) + room), scene.corner + 1).astype(int)
    covers = np.array([each.height * _painted(each, low, high) for each in bars])
    every = together(covers)
    found = []
    for each, own in zip(bars, covers, strict=True):
        rest = cv2.GaussianBlur(every - own, (0, 0), each.blur_px)
        image, taken = scene.image.copy(), scene.taken.copy()
        image[low[1] : high[1], low[0] : high[0]] -= scene.sign * rest
        for other in bars:
            if other is not each:
                _erased(scene, taken, other)
        found.append(replace(scene, image=image, taken=taken))
    return found


def _painted(bar: Bar, low: np.ndarray, high: np.ndarray) -> Floats32:
    """Return what share of each pixel of a part of the image a fibre covers."""
    tangent = directions(bar.line)
    side = 0.5 * bar.width * np.column_stack([-tangent[:, 1], tangent[:, 0]])
    outline = np.concatenate([bar.line + side, (bar.line - side)[::-1]]) - low
    size = (high - low) * FINER
    fine = np.zeros((size[1], size[0]), np.uint8)
    points = np.round(((outline + 0.5) * FINER - 0.5) * 16.0).astype(np.int32)
    cv2.fillPoly(fine, [points], 255, cv2.LINE_8, 4)
    small = cv2.resize(fine, tuple((high - low).tolist()), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.float32) / np.float32(255.0)


def _erased(scene: Scene, taken: Floats32, bar: Bar) -> None:
    """Take a fibre away from what stands out, with its blur."""
    points = np.round(scene.reduced(bar.line) * 16.0).astype(np.int32)
    thick = int(np.ceil((bar.width + 4.0) / scene.factor)) + 1
    cv2.polylines(taken, [points], False, 0.0, thick, cv2.LINE_8, 4)
