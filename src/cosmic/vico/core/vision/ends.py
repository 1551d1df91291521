"""Where a fibre ends: half of its contrast along its axis."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from cosmic.frame.arrays import Floats, Mask
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.profiles import Scene, sample, within
from cosmic.vico.core.vision.smoothing import directions, softened

# Grey levels: below, there is nothing of which a half could be told.
LEAST_HEIGHT = 1e-3


class EndKind(StrEnum):
    """What an end of a fibre is."""

    FREE = "free"
    BORDER = "the image's border cuts it off"
    BODY = "it runs into something wider"
    LOST = "an end cannot be found"
    HIDDEN = "hidden"


@dataclass(frozen=True, slots=True)
class End:
    """One end of a fibre.

    Attributes
    ----------
    along_px : float
        Where it is beyond the line's last point (negative: before it).
    soft_px : float
        Over which length it falls from four fifths of its height to one fifth.
    """

    kind: EndKind
    along_px: float
    std_px: float
    soft_px: float = 0.0


@dataclass(frozen=True, slots=True)
class Level:
    """What is known of a fibre near its end."""

    width: float
    contrast: float
    ground: float
    noise: float
    search_px: float


def find_end(scene: Scene, line: Floats, level: Level) -> End:
    """Return where a fibre ends beyond, or shortly before, the last point of its line."""
    outward = leaving(line, level.width)
    normal = np.array([-outward[1], outward[0]])
    spacing = 0.5
    back = min(level.search_px, 0.45 * len(line) * 2.0)
    along = np.arange(-back, level.search_px + level.width, spacing)
    half = max(1.0, 0.45 * level.width)
    lateral = np.linspace(-half, half, max(3, 2 * round(half) + 1))
    axis = bent(line, outward, along)
    x, y = ((axis[:, n, None] + lateral[None, :] * normal[n]).astype(np.float32) for n in (0, 1))
    inside: Mask = np.all(within(scene, x, y), axis=1)
    values = scene.sign * (sample(scene.image, x, y) - level.ground)
    mean = values.mean(axis=1, dtype=np.float64)
    blur = max(1.0, min(4.0, 12.0 * level.noise / max(level.contrast, 1e-6) / np.sqrt(half)))
    mean = softened(mean, blur / spacing * 0.8)
    return crossing(along, mean, inside, plateau(mean), level)


def plateau(mean: Floats) -> float:
    """Return the height of the fibre before its end."""
    first = mean[: max(3, len(mean) // 5)]
    return middle(first)


def leaving(line: Floats, width: float) -> Floats:
    """Return the direction in which a line leaves its end."""
    count = min(max(round(0.6 * width), 3), max(3, len(line) // 3))
    return np.asarray(
        directions(line[-count - 1 :]).mean(axis=0) if len(line) > 3 else directions(line)[-1]
    )


def bent(line: Floats, outward: Floats, along: Floats) -> Floats:
    """Return points along a line, straight on beyond its last point."""
    outward = outward / max(float(np.linalg.norm(outward)), 1e-9)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(steps)])
    s = s - s[-1]
    inner = np.column_stack([np.interp(along, s, line[:, axis]) for axis in (0, 1)])
    return np.asarray(inner + np.maximum(along, 0.0)[:, None] * outward[None, :])


def crossing(along: Floats, mean: Floats, inside: Mask, height: float, level: Level) -> End:
    """Return the first point that stays below half of the height."""
    if not height > max(0.4 * level.contrast, LEAST_HEIGHT):
        return End(EndKind.LOST, 0.0, level.width)
    scaled = mean / height
    falls = np.nonzero((scaled[:-1] >= 0.5) & (scaled[1:] < 0.5))[0]
    outside = np.nonzero(~inside)[0]
    limit = int(outside[0]) if len(outside) else len(along)
    for index in falls:
        beyond = scaled[index + 1 : index + 1 + max(4, int(level.width))]
        if middle(beyond) > 0.45:
            continue
        if index + 1 >= limit:
            break
        share = (scaled[index] - 0.5) / (scaled[index] - scaled[index + 1])
        slope = max(float(scaled[index] - scaled[index + 1]) / (along[1] - along[0]), 1e-3)
        noise = level.noise / max(height, 1e-6) / np.sqrt(max(1.0, level.width)) / slope
        point = float(along[index] + share * (along[1] - along[0]))
        soft = softness(along, scaled, int(index), limit)
        return End(EndKind.FREE, point, float(np.hypot(0.15, 0.7 * noise)), soft)
    if limit < len(along):
        return End(EndKind.BORDER, float(along[max(0, limit - 1)]), 0.5)
    return End(EndKind.BODY, 0.0, level.width)


def softness(along: Floats, scaled: Floats, index: int, limit: int) -> float:
    """Return over which length a profile falls from 0.8 to 0.2 around `index`."""
    before = np.nonzero(scaled[: index + 1] >= 0.8)[0]
    after = np.nonzero(scaled[index + 1 : limit] <= 0.2)[0]
    start = int(before[-1]) if len(before) else 0
    stop = index + 1 + int(after[0]) if len(after) else limit - 1
    return float(along[stop] - along[start])
