"""The strip along a bundle of fibres, straightened, and where on it they are seen apart."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.joining import Strand
from cosmic.vico.core.vision.profiles import Scene, sample, within
from cosmic.vico.core.vision.smoothing import directions, resampled, softened

ALONG_PX: Final = 3.0
AXIS_ORDER: Final = 3
MARGIN_PX: Final = 24.0
LEAST_LONG: Final = 3.0
"""So many times longer than half as wide is a bundle."""
LEAST_PIXELS: Final = 50
MOST_FIBRES: Final = 5
DEPTHS: Final = (0.5, 0.6, 0.7, 0.8)
"""Of what stands out: below, it is ground between two fibres; tried in turn."""
SEED_PX: Final = 50.0
"""So far along they are counted."""
SOFT_PX: Final = 4.0
MOST_SEEDS: Final = 2
SAME: Final = 0.5
"""Of the widest, and of the highest: what is less is not a fibre of the same bundle."""


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """What lies along a bundle, straightened.

    Attributes
    ----------
    axis, normals : ndarray, shape (n, 2)
        Full-size pixels, `ALONG_PX` apart.
    across : ndarray, shape (m,)
        Pixels along the normals, one apart.
    height : ndarray, shape (n, m)
        Grey levels above the ground; fibre positive.
    seen : ndarray of bool, shape (n, m)
        Whether that is on the image.
    """

    axis: Floats
    normals: Floats
    across: Floats32
    height: Floats32
    seen: Mask
    noise: float

    def line(self, at: Floats, off: Floats) -> Floats:
        """Return full-size points at rows `at`, `off` to the side."""
        rows = np.arange(len(self.axis))
        axis, normals = (
            np.column_stack([np.interp(at, rows, each[:, n]) for n in (0, 1)])
            for each in (self.axis, self.normals)
        )
        return np.asarray(axis + off[:, None] * normals)


def whole(scene: Scene, strand: Strand) -> Mask:
    """Return what hangs together with a strand, on the reduced image."""
    _, labels = cv2.connectedComponents((scene.taken > 0).view(np.uint8), connectivity=8)
    columns, rows = np.round(strand.points).astype(int).T
    limit = np.array(labels.shape) - 1
    on = labels[np.clip(rows, 0, limit[0]), np.clip(columns, 0, limit[1])]
    return np.asarray((labels == np.bincount(on).argmax()) & (labels > 0))


def strip_of(scene: Scene, own: Mask) -> Strip | None:
    """Return the strip of what hangs together, or None where it is none."""
    rows, columns = np.nonzero(own)
    if len(rows) < LEAST_PIXELS:
        return None
    points = scene.full(np.column_stack([columns, rows]).astype(np.float64))
    centre = points.mean(axis=0)
    _, _, main = np.linalg.svd(np.cov((points - centre).T))
    x, y = ((points - centre) @ main.T).T
    curve = np.polyfit(x, y, AXIS_ORDER)
    reach = float(np.abs(y - np.polyval(curve, x)).max()) + 3.0 * scene.factor + 8.0
    length = float(np.ptp(x))
    if length < LEAST_LONG * reach:
        return None
    at = np.arange(x.min() - MARGIN_PX, x.max() + MARGIN_PX, 1.0)
    # Beyond what it is fitted to a curve goes straight on.
    held = np.clip(at, x.min(), x.max())
    slope = np.polyval(np.polyder(curve), held)
    bent = np.column_stack([at, np.polyval(curve, held) + slope * (at - held)])
    return _sampled(scene, own, resampled(centre + bent @ main, ALONG_PX), reach)


def _sampled(scene: Scene, own: Mask, axis: Floats, reach: float) -> Strip | None:
    """Return the strip along an axis, its ground taken off, and nothing that is not its own."""
    tangent = directions(axis)
    normals = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    across = np.arange(-np.ceil(reach), np.ceil(reach) + 1.0, dtype=np.float32)
    x, y = (
        (axis[:, n, None] + across[None, :] * normals[:, n, None]).astype(np.float32)
        for n in (0, 1)
    )
    values = scene.sign * sample(scene.image, x, y)
    small = [scene.reduced_by_axis(each) for each in (x, y)]
    mine = cv2.dilate(own.astype(np.float32), np.ones((3, 3), np.uint8))
    strange = scene.taken * (1.0 - mine)
    around = np.ones((5, 9), np.uint8)
    seen = within(scene, x, y) & (cv2.dilate(sample(strange, *small), around) < 0.05)
    ground = seen & (cv2.dilate(sample(scene.taken, *small), around) < 0.05)
    if ground.sum() < 0.05 * ground.size:
        return None
    rows, columns = (each / max(each.max(), 1) - 0.5 for each in np.indices(values.shape))
    slopes = np.stack([np.ones(values.shape), rows, columns, rows * columns, rows**2], axis=-1)
    found, *_ = np.linalg.lstsq(slopes[ground], values[ground], rcond=None)
    height = values - slopes @ found
    noise = max(1.4826 * middle(np.abs(height[ground])), 1e-3)
    return Strip(axis, normals, across, (height * seen).astype(np.float32), seen, noise)


def _runs(row: Mask) -> Floats:
    """Return first and one past last of each run that is set, shape (n, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], row.view(np.int8), [0]])))
    return np.asarray(edges.reshape(-1, 2), dtype=np.float64)


def seeds(strip: Strip) -> Iterator[tuple[int, int, Floats, float]]:
    """Yield where fibres are seen apart: first and last row, their middles, and their width.

    The most fibres, and the longest stretch, first.
    """
    soft = softened(strip.height.T.astype(np.float64), SOFT_PX / ALONG_PX).T
    highest = soft.max(axis=1)
    most = float(np.percentile(highest, 90.0))
    if not most > 0.0:
        return
    typical = middle(highest[highest > 0.5 * most])
    found = []
    for depth in DEPTHS:
        rows = [_runs(row) for row in soft > depth * typical]
        rows = [each[np.ptp(each, axis=1) >= 2.0] for each in rows]
        counts = np.array([len(each) for each in rows])
        for count in range(2, MOST_FIBRES + 1):
            for first, last in _runs(counts == count).astype(int):
                if (last - first) * ALONG_PX < SEED_PX:
                    continue
                inner = np.array(rows[first:last])
                middles = inner.mean(axis=2) - 0.5 + strip.across[0]
                widths = np.median(np.ptp(inner, axis=2), axis=0)
                if widths.min() < 0.5 * SAME * widths.max():
                    continue
                found.append((count, last - first, depth, first, last, middles, widths.mean()))
    found.sort(key=lambda each: (-each[0], -each[1]))
    chosen: list[tuple[int, int, int]] = []
    for count, _, _, first, last, middles, width in found:
        if any(count == n and first < stop and last > start for n, start, stop in chosen):
            continue
        chosen.append((count, first, last))
        yield first, last, middles, float(width)
        if len(chosen) == MOST_SEEDS:
            return
