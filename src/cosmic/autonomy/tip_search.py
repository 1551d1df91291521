"""Find a tool on the picture with nothing known beforehand: by what changes when it moves."""

from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.vico.hw.interface import Pixels

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.uint8]

LEAST_CHANGE: Final = 15.0
"""Grey levels of 255 that count as a change at least."""
CHANGE_SHARE: Final = 0.5
"""Of the largest change."""
BROAD: Final = 0.6
"""Narrower than this part of the tool's width is no tool: fibres, edges, noise."""


def uncovered(before: Pixels, after: Pixels, width_px: float) -> Mask:
    """Return where a dark tool stood before and does not afterwards, without what is narrow."""
    scale = 1.0 if before.dtype == np.uint8 else 255.0 / max(1.0, float(before.max()))
    change = cv2.blur(scale * (after.astype(np.float32) - before.astype(np.float32)), (3, 3))
    level = max(LEAST_CHANGE, CHANGE_SHARE * float(np.percentile(change, 99.99)))
    size = max(3, round(BROAD * width_px))
    mask = (change > level).astype(np.uint8)
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    return np.asarray(opened, dtype=np.uint8)


def middle(mask: Mask) -> Floats | None:
    """Return the middle of what is marked, x and y; None where nothing is.

    Of a gripper the jaws' ends are marked, each as a patch: what lies between their middles counts.
    """
    count, _, stats, centres = cv2.connectedComponentsWithStats(mask)
    areas = stats[1:count, cv2.CC_STAT_AREA]
    if not areas.size:
        return None
    large = centres[1:count][areas > 0.5 * areas.max()]
    return np.asarray(large.mean(axis=0), dtype=np.float64)
