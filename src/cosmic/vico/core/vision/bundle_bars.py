"""Fibres of a bundle as bars that are drawn side by side, and fitted to what is seen."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats, Floats32
from cosmic.vico.core.vision.bundle_strip import ALONG_PX, Strip

STEP: Final = 0.1
"""Of what is changed to see what it changes: pixels, or rows."""
WIDER: Final = 0.02
"""So much wider the blur, or higher a fibre, likewise."""
EVERY: Final = slice(None)
LEAST_BLUR_PX: Final = 0.6
MOST_BLUR_PX: Final = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Bars:
    """Fibres of a bundle.

    Attributes
    ----------
    courses : ndarray, shape (fibres, order + 1)
        Polynomials of the offset across, of rows from -1 to 1 over the strip, lowest order first.
    ends : ndarray, shape (fibres, 2)
        In rows.
    widths, heights : ndarray, shape (fibres,)
    """

    courses: Floats
    ends: Floats
    widths: Floats
    heights: Floats
    blur_px: float


def relative(strip: Strip, rows: Floats) -> Floats:
    """Return rows from -1 to 1 over the strip."""
    return np.asarray(2.0 * rows / (len(strip.axis) - 1) - 1.0)


def offsets(strip: Strip, bars: Bars, rows: Floats) -> Floats:
    """Return where each fibre lies across at some rows, shape (fibres, n)."""
    powers = relative(strip, rows)[None, :] ** np.arange(bars.courses.shape[1])[:, None]
    return np.asarray(bars.courses @ powers)


def cover(strip: Strip, bars: Bars, rows: Floats, number: int, columns: slice = EVERY) -> Floats32:
    """Return what one fibre covers of each place, by its height; its ends are cut square."""
    powers = relative(strip, rows)[None, :] ** np.arange(bars.courses.shape[1])[:, None]
    course = bars.courses[number]
    aside = strip.across[None, columns] - (course @ powers).astype(np.float32)[:, None]
    orders = np.arange(1, len(course))
    lean = (course[1:] * orders) @ powers[:-1] * (2.0 / (ALONG_PX * (len(strip.axis) - 1)))
    lean = lean.astype(np.float32)[:, None]
    half = np.float32(0.5 * bars.widths[number] + 0.5)
    found = np.clip(half * np.sqrt(1.0 + lean**2) - np.abs(aside), 0.0, 1.0)
    # Only rows near an end are cut by it.
    first, last = bars.ends[number]
    room = 2.0 + float(np.abs(lean).max()) * float(np.abs(aside).max()) / ALONG_PX
    for part, end, inwards in (
        (slice(0, int(np.searchsorted(rows, first + room))), first, 1.0),
        (slice(int(np.searchsorted(rows, last - room)), len(rows)), last, -1.0),
    ):
        at = rows[part, None].astype(np.float32) + lean[part] * aside[part] / np.float32(ALONG_PX)
        found[part] *= np.clip(np.float32(inwards) * (at - np.float32(end)) + 0.5, 0.0, 1.0)
    return np.asarray(found * bars.heights[number], dtype=np.float32)


def together(covers: Floats32) -> Floats32:
    """Return what bars look like together: where two lie on each other, the stronger counts."""
    found: Floats32 = np.minimum(covers.sum(axis=0), _most(covers))
    return found


def _most(covers: Floats32) -> Floats32:
    tops = covers.max(axis=(1, 2))
    found = np.zeros(covers.shape[1:], np.float32)
    for number in np.argsort(tops):
        np.copyto(found, tops[number], where=covers[number] > 0)
    return found


def blurred(image: Floats32, blur_px: float) -> Floats32:
    """Return what a strip looks like with a blur."""
    found = cv2.GaussianBlur(
        image, (0, 0), blur_px, sigmaY=blur_px / ALONG_PX, borderType=cv2.BORDER_REPLICATE
    )
    return np.asarray(found, dtype=np.float32)


def drawn(strip: Strip, bars: Bars, rows: Floats) -> Floats32:
    """Return what fibres look like in some rows of a strip."""
    covers = np.array([cover(strip, bars, rows, n) for n in range(len(bars.widths))])
    return blurred(together(covers), bars.blur_px)


@dataclass(frozen=True, slots=True)
class Free:
    """What a fit may change besides the courses."""

    ends: bool = False
    shape: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """How what is drawn changes.

    Attributes
    ----------
    images : ndarray, shape (k, rows, across)
        With what moves a fibre aside, its ends, its width and height, and with the blur.
    image : ndarray of int, shape (n,)
        Which of them each number of the bars has.
    powers : ndarray, shape (n, rows)
        How much of it in each row.
    """

    drawn: Floats32
    images: Floats32
    image: npt.NDArray[np.intp]
    powers: Floats

    def square(self, rest: Floats32) -> tuple[Floats, Floats]:
        """Return the matrix and the right side of the least squares of what is left."""
        by_row = self.images.transpose(1, 0, 2)
        both = (by_row @ by_row.transpose(0, 2, 1)).astype(np.float64)
        with_rest = (by_row @ rest[:, :, None])[:, :, 0].astype(np.float64)
        found = both[:, self.image[:, None], self.image[None, :]]
        square = np.einsum("rij,ir,jr->ij", found, self.powers, self.powers, optimize=True)
        return square, np.einsum("ri,ir->i", with_rest[:, self.image], self.powers)


def _slopes(strip: Strip, bars: Bars, rows: Floats, free: Free) -> Slopes:
    """Return how what is drawn changes with each number of the bars."""
    count, order = bars.courses.shape
    covers = np.array([cover(strip, bars, rows, n) for n in range(count)])
    base = blurred(together(covers), bars.blur_px)
    powers = relative(strip, rows)[None, :] ** np.arange(order)[:, None]
    same = np.ones((2 * free.ends + 2 * free.shape, len(rows)))
    images: list[Floats32] = []
    which: list[int] = []
    for number in range(count):
        columns = _columns(covers[number], 3.0 * bars.blur_px + 2.0)
        which += [len(images)] * order
        which += range(len(images) + 1, len(images) + 1 + len(same))
        for other, step in _moved(bars, number, free):
            part = covers[:, :, columns].copy()
            part[number] = cover(strip, other, rows, number, columns)
            slope = np.zeros_like(base)
            slope[:, columns] = blurred(together(part), bars.blur_px) - base[:, columns]
            images.append(slope / np.float32(step))
    used = [powers, same] * count
    if free.shape:
        which.append(len(images))
        wider = blurred(together(covers), bars.blur_px * (1.0 + WIDER)) - base
        images.append(wider / np.float32(WIDER))
        used.append(same[:1])
    return Slopes(base, np.array(images), np.array(which), np.concatenate(used))


def _moved(bars: Bars, number: int, free: Free) -> Iterator[tuple[Bars, float]]:
    """Yield bars of which one is moved, lengthened, wider, or higher, and by how much."""
    yield replace(bars, courses=_more(bars.courses, (number, 0))), STEP
    if free.ends:
        for end in (0, 1):
            yield replace(bars, ends=_more(bars.ends, (number, end))), STEP
    if free.shape:
        yield replace(bars, widths=_more(bars.widths, number)), STEP
        here = np.arange(len(bars.heights)) == number
        yield replace(bars, heights=bars.heights * (1.0 + WIDER * here)), WIDER


def _more(values: Floats, where: int | tuple[int, int]) -> Floats:
    """Return values of which one is larger by `STEP`."""
    found = values.copy()
    found[where] += STEP
    return found


def _columns(covered: Floats32, room: float) -> slice:
    """Return where a fibre lies across, and some room."""
    on = np.flatnonzero(covered.any(axis=0))
    if not len(on):
        return EVERY
    return slice(max(0, int(on[0] - room)), int(on[-1] + room) + 2)


def _changed(bars: Bars, change: Floats, free: Free) -> Bars:
    """Return bars after a change of all that is free."""
    count, order = bars.courses.shape
    size = order + 2 * free.ends + 2 * free.shape
    parts = change[: count * size].reshape(count, size)
    widths, heights, ends, blur = bars.widths, bars.heights, bars.ends, bars.blur_px
    if free.ends:
        ends = ends + parts[:, order : order + 2]
    if free.shape:
        widths = np.maximum(widths + parts[:, -2], 1.0)
        heights = heights * np.clip(1.0 + parts[:, -1], 0.5, 2.0)
        blur = float(np.clip(blur * (1.0 + change[-1]), LEAST_BLUR_PX, MOST_BLUR_PX))
    return Bars(bars.courses + parts[:, :order], ends, widths, heights, blur)


def fitted(strip: Strip, bars: Bars, rows: Floats, free: Free, turns: int) -> Bars:
    """Return bars that look more like the strip."""
    first = int(rows[0])
    part = slice(first, first + len(rows))
    seen, height = strip.seen[part], strip.height[part]

    def miss(some: Bars) -> float:
        rest = (height - drawn(strip, some, rows))[seen]
        return float(rest @ rest)

    price, damping = miss(bars), 1e-3
    for _ in range(turns):
        slopes = _slopes(strip, bars, rows, free)
        slopes.images[:, ~seen] = 0.0
        square, right = slopes.square((height - slopes.drawn) * seen)
        better = False
        for _ in range(3):
            slack = damping * np.diag(square) + 1e-9 * (1.0 + float(np.trace(square)))
            damped = square + np.diag(slack)
            trial = _changed(
                bars, np.asarray(np.linalg.solve(damped, right), dtype=np.float64), free
            )
            new = miss(trial)
            if new < price:
                better = price - new > 1e-4 * price
                bars, price, damping = trial, new, max(0.1 * damping, 1e-6)
                break
            damping *= 10.0
        if not better:
            break
    return bars
