"""What is known of one fibre on an image."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from cosmic.frame.arrays import ByteMask, Floats


@dataclass(frozen=True, slots=True, eq=False)
class Fibre:
    """One fibre, in pixels of its image; pixel (0, 0) has its centre at (0.0, 0.0).

    Attributes
    ----------
    centre_line_px : ndarray, shape (n, 2), float64
        Points x, y from end to end, about two pixels apart.
    widths_px : ndarray, shape (n,), float64
        Width at each of them.
    length_px, length_std_px : float
        Along the centre line; the part that can be seen.
    length_interval_px : (float, float)
        Holds the length of a certain fibre in 95 of 100 cases.
    projected_length_px : float
        The largest distance between two of its points.
    width_px : float
        The mean of its width, of a blurred hollow bar that was fitted to its cross section.
    area_px2 : float
        Length times width; where it crosses itself both layers count.
    ends_px : ndarray, shape (2, 2), float64
    ends_std_px : ndarray, shape (2,), float64
    curl : float
        Curl index: length over projected length, minus one.
    kink : float
        Kibblewhite's kink index in 1/px: two for each kink of 21 to 45 degrees, three to 90 and
        four above, over the length.
    kinks : int
        Number of kinks from 10 degrees on.
    orientation_deg : float
        Of its longest extent, from 0 to below 180, from the x axis towards the y axis
        (clockwise on the screen).
    grasp_points_px : ndarray, shape (k, 2), float64
        Where a gripper finds it free and straight: one near each end, or none.
    contrast : float
        Grey levels between it and the ground.
    lighter : bool
        Whether it is lighter than the ground.
    certain : bool
        Whether all this can be relied on; if not, `doubts` says why.
    probability : float
        That it is one whole fibre, on images like those it was calibrated on; a certain one has
        0.999 and more.
    signs : tuple of float
        How clear each sign is that it is not one, or not whole, in the order of
        `certainty.NAMES`; by itself each counts from 1 on.
    uncertainties : mapping of str to float or str
        Standard deviation of each value by its name, or the reason why there is none.
    """

    centre_line_px: Floats
    widths_px: Floats
    length_px: float
    length_std_px: float
    length_interval_px: tuple[float, float]
    projected_length_px: float
    width_px: float
    width_std_px: float
    area_px2: float
    ends_px: Floats
    ends_std_px: Floats
    curl: float
    kink: float
    kinks: int
    orientation_deg: float
    grasp_points_px: Floats
    contrast: float
    lighter: bool
    certain: bool
    probability: float
    signs: tuple[float, ...]
    doubts: tuple[str, ...]
    uncertainties: Mapping[str, float | str]


SHIFT_BITS = 4


def fibre_mask(fibre: Fibre, shape: tuple[int, ...]) -> ByteMask:
    """Return ndarray of `shape` (rows, columns), uint8: 1 where the fibre lies, 0 elsewhere."""
    mask = np.zeros(shape[:2], np.uint8)
    paint(mask, fibre.centre_line_px, fibre.widths_px)
    return mask


def paint(mask: ByteMask, line: Floats, widths: Floats, value: int = 1) -> None:
    """Paint a strip of given widths along a line into a mask."""
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    # OpenCV paints the outline as well, half a pixel beyond the polygon.
    half = np.maximum(widths / 2.0 - 0.5, 0.25)[:, None]
    left, right = line + half * normal, line - half * normal
    corners = np.stack([left[:-1], left[1:], right[1:], right[:-1]], axis=1)
    for corner in np.round(corners * 2**SHIFT_BITS).astype(np.int32):
        cv2.fillConvexPoly(mask, corner, value, lineType=cv2.LINE_8, shift=SHIFT_BITS)
