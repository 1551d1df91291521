"""Heights, and one image that is sharp everywhere, from images at several focus heights.

An edge that is blurred by s has an energy of its slope (the sum of its squares) that goes as 1/s,
and the square of the blur grows with the square of the distance from focus. So one over the square
of the energy is a parabola in the height of the focus, and its lowest point is where the edge lies.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats, Floats32
from cosmic.frame.errors import ConfigError
from cosmic.vico.core.vision.grey import grey_image
from cosmic.vico.hw.interface import Pixels

FEWEST_IMAGES: Final = 4
REDUCED: Final = 4
"""The height map is made at so many times less resolution: a window is larger anyway."""
WINDOW_PX: Final = 10.0
NOISE_TIMES: Final = 8.0
NEAR_PEAK: Final = 0.3
"""Of the largest energy: below it an edge is blurred into the next one, and no parabola holds."""
LARGEST_STD: Final = 0.5
"""Of the distance between two images: what is known less has no height."""
FILL_PX: Final = (4.0, 12.0, 40.0, 160.0)


@dataclass(frozen=True, slots=True, eq=False)
class FocalStack:
    """Images of the same things at several heights of the focus, the lowest first.

    Attributes
    ----------
    images : tuple of ndarray, shape (height, width)
    heights_um : ndarray, shape (n,)
        What is in focus on each.
    """

    images: tuple[Pixels, ...]
    heights_um: Floats

    @classmethod
    def of(
        cls, images: Sequence[npt.NDArray[np.generic]], heights_um: Sequence[float] | Floats
    ) -> "FocalStack":
        """Return images, in any order, as a stack.

        Raises
        ------
        ConfigError
            There are fewer than four, or two of one height, they have different shapes, or a height
            is no number.
        """
        heights = np.asarray(heights_um, dtype=np.float64)
        if len(images) != len(heights) or len(images) < FEWEST_IMAGES:
            raise ConfigError(
                f"focal stack: {len(images)} images with {len(heights)} heights; take "
                f"{FEWEST_IMAGES} or more, each with its height"
            )
        order = np.argsort(heights)
        if not (np.isfinite(heights).all() and (np.diff(heights[order]) > 0).all()):
            raise ConfigError("focal stack: each image needs a height of its own")
        grey = [grey_image(images[number]) for number in order]
        if len({each.shape for each in grey}) > 1:
            raise ConfigError("focal stack: the images have different shapes")
        return cls(tuple(grey), heights[order])

    @property
    def step_um(self) -> float:
        """The usual distance between two images."""
        return float(np.median(np.diff(self.heights_um)))


@dataclass(frozen=True, slots=True, eq=False)
class HeightMap:
    """How high lies what an image shows.

    Attributes
    ----------
    height_um, std_um : ndarray, shape (height, width), float32
        NaN where nothing has edges, or none is in focus within the stack.
    """

    height_um: Floats32
    std_um: Floats32


@dataclass(frozen=True, slots=True, eq=False)
class Vertices:
    """The lowest points of many parabolas.

    Attributes
    ----------
    height_um, std_um : ndarray
        NaN where there is none, or it lies outside the stack.
    """

    height_um: Floats
    std_um: Floats


def vertices(heights_um: Floats, energy: Floats) -> Vertices:
    """Return where edges are in focus, from the energy of their slopes.

    Parameters
    ----------
    heights_um : ndarray, shape (n,)
    energy : ndarray, shape (n, ...)
        What noise adds taken off; one at or below 0 says nothing.
    """
    shape = energy.shape[1:]
    flat = energy.reshape(len(heights_um), -1)
    top = np.maximum(flat.max(axis=0), 1e-30)
    part = np.clip(flat / top, 0.0, 1.0)
    used = part >= NEAR_PEAK
    safe = np.where(used, part, 1.0)
    middle, width = float(heights_um.mean()), float(np.ptp(heights_um))
    at = (heights_um - middle) / width
    # An error of the energy counts three times as much in one over its square.
    weight = np.where(used, safe**6, 0.0)
    design = np.stack([np.ones_like(at), at, at**2], axis=1)
    normal = np.einsum("np,ni,nj->pij", weight, design, design)
    right = np.einsum("np,ni,np->pi", weight, design, safe**-2)
    normal += 1e-9 * np.eye(3)
    inverse = np.linalg.inv(normal)
    curve = np.einsum("pij,pj->pi", inverse, right)
    rest = np.where(used, safe**-2 - np.einsum("pi,ni->np", curve, design), 0.0)
    free = np.maximum(used.sum(axis=0) - 3, 1)
    noise = (weight * rest**2).sum(axis=0) / free
    slope, bend = curve[:, 1], curve[:, 2]
    good = (bend > 0) & (used.sum(axis=0) >= FEWEST_IMAGES)
    bend = np.where(good, bend, 1.0)
    vertex = -0.5 * slope / bend
    by = np.stack([np.zeros_like(slope), -0.5 / bend, 0.5 * slope / bend**2], axis=1)
    variance = noise * np.einsum("pi,pij,pj->p", by, inverse, by)
    good &= (vertex >= at[0]) & (vertex <= at[-1])
    height = np.where(good, middle + width * vertex, np.nan)
    std = np.where(good, width * np.sqrt(np.maximum(variance, 0.0)), np.nan)
    return Vertices(height.reshape(shape), std.reshape(shape))


def height_map(stack: FocalStack) -> HeightMap:
    """Return how high lies what has edges."""
    energy = np.stack([_energy(each) for each in stack.images]).astype(np.float64)
    floor = np.median(energy.reshape(len(energy), -1), axis=1)
    scatter = 1.4826 * float(np.median(np.abs(energy - floor[:, None, None])))
    clear = energy - floor[:, None, None]
    found = vertices(stack.heights_um, clear)
    seen = clear.max(axis=0) > NOISE_TIMES * max(scatter, 1e-12)
    known = seen & (found.std_um < LARGEST_STD * stack.step_um)
    rows, columns = stack.images[0].shape[:2]
    size = columns, rows
    height = np.where(known, found.height_um, np.nan).astype(np.float32)
    std = np.where(known, found.std_um, np.nan).astype(np.float32)
    return HeightMap(_enlarged(height, size), _enlarged(std, size))


def sharp_image(stack: FocalStack, heights: HeightMap | None = None) -> Pixels:
    """Return one image that is sharp wherever one of the stack is (extended depth of field).

    Where nothing has edges the neighbourhood says which image is taken.
    """
    known = (heights or height_map(stack)).height_um
    wanted = _filled(known, float(stack.heights_um[len(stack.heights_um) // 2]))
    at = np.interp(wanted, stack.heights_um, np.arange(len(stack.heights_um)))
    low = np.minimum(at.astype(np.intp), len(stack.images) - 2)
    share = at - low
    layers: Floats = np.stack(stack.images).astype(np.float64)
    height, width = known.shape
    rows, columns = np.arange(height)[:, None], np.arange(width)[None, :]
    mixed = (1.0 - share) * layers[low, rows, columns] + share * layers[low + 1, rows, columns]
    whole: Floats = np.round(mixed)
    eight = stack.images[0].dtype == np.uint8
    return whole.astype(np.uint8) if eight else whole.astype(np.uint16)


def _energy(image: Pixels) -> Floats32:
    """Return the squared slope about each point, brightness left out, at less resolution."""
    values = image.astype(np.float32)
    values /= np.float32(max(float(values.mean()), 1e-6))
    smooth = cv2.GaussianBlur(values, (0, 0), 0.8)
    squared = cv2.Sobel(smooth, cv2.CV_32F, 1, 0) ** 2 + cv2.Sobel(smooth, cv2.CV_32F, 0, 1) ** 2
    small = cv2.resize(squared, None, fx=1 / REDUCED, fy=1 / REDUCED, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), WINDOW_PX / REDUCED), dtype=np.float32)


def _enlarged(small: Floats32, size: tuple[int, int]) -> Floats32:
    return np.asarray(cv2.resize(small, size, interpolation=cv2.INTER_NEAREST), dtype=np.float32)


def _filled(known: Floats32, otherwise: float) -> Floats32:
    """Return heights everywhere: what is unknown takes those of its surroundings."""
    here = np.isfinite(known)
    if not here.any():
        return np.full_like(known, otherwise)
    filled = np.where(here, known, np.float32(0.0)).astype(np.float32)
    weight = here.astype(np.float32)
    result = np.full_like(known, np.float32(np.median(known[here])))
    for reach in reversed(FILL_PX):
        near = _blurred(weight, reach)
        average = _blurred(filled, reach) / np.maximum(near, np.float32(1e-6))
        result = np.where(near > 0.02, average, result)
    return np.asarray(result, dtype=np.float32)


def _blurred(values: Floats32, reach_px: float) -> Floats32:
    """Return a wide blur, made at less resolution."""
    factor = max(1, int(reach_px / 4.0))
    size = values.shape[1] // factor + 1, values.shape[0] // factor + 1
    small = cv2.resize(values, size, interpolation=cv2.INTER_AREA)
    smooth = cv2.GaussianBlur(small, (0, 0), reach_px / factor)
    whole = cv2.resize(smooth, values.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(whole, dtype=np.float32)
