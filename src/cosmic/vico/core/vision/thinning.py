"""Thinning of a mask to lines one pixel wide, after Zhang and Suen."""

from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.vico.core.vision.grey import Mask

FIRST, SECOND, BOTH = 1, 2, 3

# The neighbours of a pixel count 1, 2, 4, ... clockwise from the upper left one.
_WEIGHTS: Final = np.array([[1, 2, 4], [128, 0, 8], [64, 32, 16]], dtype=np.float32)
_WHOLE: Final = 255

# Where the published rule is not followed. Two neighbours side by side leave in one step only, so
# that a line two pixels wide does not vanish from both sides; the corner of a staircase leaves too,
# which makes the line one pixel wide at slopes as well.
_SIDE_BY_SIDE: Final = {
    **dict.fromkeys((3, 6, 12, 14, 131), FIRST),
    **dict.fromkeys((24, 56, 96, 192, 224), SECOND),
    **dict.fromkeys((48, 129), 0),
}
_STAIRS: Final = {
    **dict.fromkeys((11, 134, 161, 194, 198), FIRST),
    **dict.fromkeys((26, 104, 108, 176), SECOND),
    **dict.fromkeys((10, 40, 130, 160), BOTH),
}


def _leaves(code: int) -> int:
    """Return the steps in which a pixel with these neighbours leaves, after Zhang and Suen."""
    ring = [code >> bit & 1 for bit in range(8)]
    rises = sum(ring[bit] < ring[(bit + 1) % 8] for bit in range(8))
    if rises != 1 or not 2 <= sum(ring) <= 6:
        return 0
    _, north, _, east, _, south, _, west = ring
    first = not (north and east and south) and not (east and south and west)
    second = not (north and east and west) and not (north and south and west)
    return FIRST * first | SECOND * second


_STEPS: Final[npt.NDArray[np.uint8]] = np.array(
    [{**_SIDE_BY_SIDE, **_STAIRS}.get(code, _leaves(code)) for code in range(256)], dtype=np.uint8
)


def skeletonize(mask: Mask) -> Mask:
    """Return the skeleton of what is not zero in `mask`, shape (height, width), uint8, 0 and 1.

    Lines stay connected where the mask is; ends stay where they are, up to half a width.

    Notes
    -----
    T. Y. Zhang and C. Y. Suen, "A fast parallel algorithm for thinning digital patterns",
    Communications of the ACM 27 (1984) 236-239. The result is that of scikit-image's function of
    this name, for every mask.
    """
    framed = cv2.copyMakeBorder(
        (np.asarray(mask) != 0).astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0
    )
    width = framed.shape[1]
    around = np.array(
        [-width - 1, -width, -width + 1, 1, width + 1, width, width - 1, -1], dtype=np.intp
    )
    flat = np.ascontiguousarray(framed).reshape(-1)
    # Of each pixel its neighbours as one number, kept up as pixels leave.
    codes: npt.NDArray[np.uint8] = np.ascontiguousarray(
        cv2.filter2D(framed, cv2.CV_8U, _WEIGHTS, borderType=cv2.BORDER_CONSTANT), dtype=np.uint8
    ).reshape(-1)
    rim = np.flatnonzero((flat != 0) & (codes != _WHOLE))
    # What each step has yet to look at: a pixel whose neighbours stay is not looked at again.
    ahead = {FIRST: [rim], SECOND: [rim]}
    while any(ahead.values()):
        for step in (FIRST, SECOND):
            if not ahead[step]:
                continue
            rim = np.concatenate(ahead[step])
            ahead[step].clear()
            gone = np.unique(rim[(flat[rim] != 0) & (_STEPS[codes[rim]] & step != 0)])
            if not gone.size:
                continue
            flat[gone] = 0
            beside = gone[:, None] + around
            for bit in range(8):
                # What lies in direction `bit` of a pixel gone has that pixel opposite.
                codes[beside[:, bit]] &= np.uint8(_WHOLE - (1 << (bit + 4) % 8))
            fresh = beside[flat[beside] != 0]
            ahead[FIRST].append(fresh)
            ahead[SECOND].append(fresh)
    return flat.reshape(framed.shape)[1:-1, 1:-1].copy()
