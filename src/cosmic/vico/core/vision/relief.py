"""Where an image is darker or lighter than its ground, found at a quarter of its size."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import ByteMask, Floats32
from cosmic.vico.core.vision.grey import middle, middles, quantile
from cosmic.vico.hw.interface import Pixels

# Wider bodies are tools, not fibres: the ground is what remains of them. Full-size pixels.
WIDEST_PX = 64
WIDEST_OF_IMAGE = 0.04
QUARTER = 4
SMALL_PX = 420
# Of 8-bit levels: less cannot be told from the steps of the converter.
LEAST_LEVELS = 1.5
NOISE_TIMES = 6.0
OF_STRONGEST = 0.05
# Of JPEG: its blocks, how many side by side tell it, lines that are looked at, and grey levels.
BLOCK_PX = 8
FEWEST_BLOCKS = 8
MOST_LINES = 120
LEAST_DIFFERENCE = 0.02
# Of a hollow fibre: its inside, and it with its walls.
HOLLOW_PX = 24
WIDEST_HOLLOW_PX = 48
LEAST_HOLLOW_AREA = 20
# Of what stands out: what is less between several is the ground.
GROUND_SHARE = 0.12
# What the ground is like around something: of the image, how wide that is, and how much of it must
# be ground.
GROUND_PARTS = ((16, 0.3), (8, 0.3), (4, 0.05))
# Of its height: by so much something differs from the ground elsewhere that is no ground itself.
NO_GROUND = 0.6
# A network fills the image, a fibre does not.
CROWDED = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """What stands out from the ground, at reduced size.

    Attributes
    ----------
    factor : int
        Full-size pixels for one of these.
    height : ndarray, shape (rows, columns), float32
        Grey levels above (`lighter`) or below the ground.
    mask : ndarray of uint8
        1 where something stands out.
    hollow : ndarray of uint8
        1 where the inside of a hollow fibre was filled in.
    crowded : bool
        So much stands out that no single fibre can be told.
    """

    factor: int
    lighter: bool
    height: Floats32
    mask: ByteMask
    hollow: ByteMask
    crowded: bool


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """The connected pieces of a mask.

    Attributes
    ----------
    order : ndarray of int
        Flat points of their pixels, piece after piece.
    firsts, areas : ndarray of int
        Where each piece begins in `order`, and its number of pixels.
    """

    order: npt.NDArray[np.intp]
    firsts: npt.NDArray[np.intp]
    areas: npt.NDArray[np.intp]

    @classmethod
    def of(cls, mask: ByteMask) -> "Pieces":
        """Return the pieces of a mask."""
        _, labels = cv2.connectedComponents(mask, connectivity=8)
        points = np.flatnonzero(mask != 0)  # of numbers it takes ten times as long as of flags
        found = labels.ravel()[points]
        order = points[np.argsort(found, kind="stable")]
        areas = np.bincount(found)[1:] if len(found) else np.zeros(0, np.intp)
        firsts = np.concatenate([[0], np.cumsum(areas)[:-1]]) if len(areas) else areas
        return cls(order, firsts.astype(np.intp), areas)

    def means(self, values: Floats32) -> Floats32:
        """Return the mean over each piece."""
        sums = np.add.reduceat(values.ravel()[self.order], self.firsts)
        return np.asarray(sums / self.areas, dtype=np.float32)

    def deepest(self, mask: ByteMask) -> Floats32:
        """Return the largest distance to the outside in each piece."""
        framed = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
        depth = cv2.distanceTransform(framed, cv2.DIST_L2, 3)[1:-1, 1:-1]
        return np.asarray(np.maximum.reduceat(depth.ravel()[self.order], self.firsts))


@dataclass(frozen=True, slots=True, eq=False)
class Raised:
    """What is darker than the ground, or what is lighter, and where it stands out.

    Attributes
    ----------
    height : ndarray, float32
        Grey levels.
    level : float
        Above it something stands out.
    mask : ndarray of uint8
        1 where it does; `pieces` are its pieces.
    """

    lighter: bool
    height: Floats32
    level: float
    mask: ByteMask
    pieces: Pieces

    @classmethod
    def of(cls, height: Floats32, floor: float, *, lighter: bool) -> "Raised":
        """Return what stands out from noise, and by more than `floor`."""
        level = threshold(height, floor)
        mask = (height > level).view(np.uint8)
        return cls(lighter, height, level, mask, Pieces.of(mask))


def reduction(shape: tuple[int, ...]) -> int:
    """Return by how much an image is reduced to look for fibres."""
    return int(np.clip(round(max(shape) / SMALL_PX), 1, QUARTER))


def reduced(image: Pixels, factor: int) -> Floats32:
    """Return an image at reduced size, smoothed where the reduction does not do it."""
    rows, columns = (side // factor for side in image.shape)
    part = image[: rows * factor, : columns * factor]
    small = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small.astype(np.float32), (3, 3), 0.7), dtype=np.float32)


def kernel(side: int) -> ByteMask:
    """Return a round kernel of odd size."""
    size = max(3, int(side) | 1)
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), dtype=np.uint8)


def find_relief(image: Pixels) -> Relief:
    """Return what stands out, choosing between darker and lighter by what looks like fibres."""
    factor = reduction(image.shape)
    small = reduced(image, factor)
    widest = max(WIDEST_PX, WIDEST_OF_IMAGE * max(image.shape))
    side = int(min(widest, 0.3 * min(image.shape)) / factor) | 1
    darker, brighter = (
        stands_out(each)
        for each in hats(small, max(3, side), (cv2.MORPH_BLACKHAT, cv2.MORPH_TOPHAT))
    )
    floor = LEAST_LEVELS if image.dtype == np.uint8 else LEAST_LEVELS * level_step(image)
    strongest = max(quantile(each[::2, ::2], 0.998) for each in (darker, brighter))
    floor = max(floor, OF_STRONGEST * strongest)
    raised = [Raised.of(darker, floor, lighter=False), Raised.of(brighter, floor, lighter=True)]
    ground = ground_around(small, [each.mask for each in raised])
    found = [(*fibre_like(each, from_ground(small, ground, each)), each) for each in raised]
    found.sort(key=lambda each: -each[0])
    chosen = found[0][2]
    mask = thresholded(chosen)
    if found[1][1] > NO_GROUND:
        walls = thresholded(found[1][2])
        if lined(mask, walls):
            chosen, mask = found[1][2], walls
    crowded = cv2.countNonZero(mask) > CROWDED * mask.size
    hollow = np.zeros_like(mask) if crowded else insides(mask, HOLLOW_PX / factor)
    if hollow.any():
        away = from_ground(small, ground, chosen)
        hollow &= ~ground_between(mask, hollow, np.nan_to_num(away, nan=np.inf), factor)
    return Relief(factor, chosen.lighter, chosen.height, mask | hollow, hollow, crowded)


def hats(small: Floats32, side: int, kinds: Sequence[int]) -> list[Floats32]:
    """Return what is narrower than `side`; light that falls off goes on beyond the border."""
    edge = min(side // 2 + 1, min(small.shape) - 1)
    framed = np.pad(small, edge, mode="reflect", reflect_type="odd")
    square = np.ones((side, side), np.uint8)
    found = (cv2.morphologyEx(framed, kind, square) for kind in kinds)
    return [np.asarray(each[edge:-edge, edge:-edge], dtype=np.float32) for each in found]


def level_step(image: Pixels) -> float:
    """Return how many levels of a 16-bit image make one of 256 over the range it uses."""
    low, high = (float(value) for value in np.percentile(image[::8, ::8], (0.5, 99.5)))
    return max(1.0, (high - low) / 256.0)


def blockiness(image: Pixels) -> float:
    """Return by how much more neighbours differ across borders of 8 x 8 pixels than elsewhere.

    JPEG rounds each of its blocks by itself: 0 where an image was never compressed, about 1 at
    quality 75 and 3 at 40. Wherever the first border lies is found.
    """
    found = 0.0
    for turned in (image, image.T):
        thin = cast("Pixels", np.ascontiguousarray(turned[:: 1 + len(turned) // MOST_LINES]))
        steps = cv2.absdiff(thin[:, 1:], thin[:, :-1])
        total = cv2.reduce(steps, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32F).ravel()
        across = (total / np.float64(len(thin))).astype(np.float32)
        count = len(across) // BLOCK_PX
        if count < FEWEST_BLOCKS:
            continue
        by_phase = middles(across[: count * BLOCK_PX].reshape(count, BLOCK_PX).T)
        usual = max(float(middles(by_phase[None])[0]), LEAST_DIFFERENCE)
        found += 0.5 * max(0.0, float(by_phase.max()) / usual - 1.0)
    return found


def stands_out(found: Floats32) -> Floats32:
    """Return a hat without the offset that noise gives it."""
    return np.asarray(found - np.float32(middle(found[::3, ::3])), dtype=np.float32)


def threshold(height: Floats32, floor: float) -> float:
    """Return above what something stands out from noise."""
    noise = 1.4826 * middle(np.abs(height[::3, ::3]))
    return max(NOISE_TIMES * noise, floor)


def ground_around(small: Floats32, covered: Sequence[ByteMask]) -> Floats32:
    """Return the ground where nothing stands out, carried on below what does; nan far from any.

    As near as enough of it is seen, and again of what the first time has left, so that light that
    falls off to the sides is followed.
    """
    free = ((covered[0] | covered[1]) == 0).astype(np.float32)
    seen = small * free
    ground, unknown = seen, np.ones(small.shape, np.bool_)
    for part, least in GROUND_PARTS:
        size = [side // part | 1 for side in small.shape[::-1]]
        share = cv2.blur(free, size)
        np.maximum(share, 1e-6, out=share)
        near = cv2.blur(seen, size)
        near /= share
        rest = small - near
        rest *= free
        near += cv2.blur(rest, size) / share
        ground = near if unknown.all() else np.where(unknown, near, ground)
        unknown &= share < least
        if not unknown.any():
            return np.asarray(ground, dtype=np.float32)
    return np.where(unknown, np.float32(np.nan), ground)


def from_ground(small: Floats32, ground: Floats32, raised: Raised) -> Floats32:
    """Return by how much each place is lighter, or darker, than the ground elsewhere."""
    return np.asarray(small - ground if raised.lighter else ground - small, dtype=np.float32)


def fibre_like(raised: Raised, away: Floats32) -> tuple[float, float]:
    """Return how much of what stands out is long and narrow, and what part of it is no ground.

    Length counts times strength, which is the height as far as a place differs from the ground
    elsewhere: what lies between dark fibres near each other is long and narrow, and lighter than
    these, but no lighter than other ground. Where no ground is seen the height counts.
    """
    pieces = raised.pieces
    if not len(pieces.areas):
        return 0.0, 0.0
    thickness = np.maximum(2.0 * pieces.deepest(raised.mask) - 1.0, 1.0)
    slender = np.maximum(pieces.areas / thickness - 4.0 * thickness - 4.0, 0.0)
    strength = np.maximum(np.fmin(raised.height, away), 0.0)
    strong, high = (
        float((slender * pieces.means(values)).sum()) for values in (strength, raised.height)
    )
    return strong, strong / high if high else 0.0


def lined(mask: ByteMask, other: ByteMask) -> bool:
    """Return whether a mask is but the inside of hollow fibres whose walls the other one has."""
    wide = np.ones((5, 5), np.uint8)
    rings = [(cv2.dilate(each, wide) > 0) & (each == 0) for each in (mask, other)]
    shares = [
        float((ring & (walls > 0)).sum()) / max(1, int(ring.sum()))
        for ring, walls in zip(rings, (other, mask), strict=True)
    ]
    return shares[0] > 0.5 and shares[0] > 1.2 * shares[1]


def thresholded(raised: Raised) -> ByteMask:
    """Return what stands out by half of its own strength, so that blur does not widen it."""
    mask, height, pieces = raised.mask, raised.height, raised.pieces
    if not len(pieces.areas):
        return mask
    values = height.ravel()[pieces.order]
    typical = ranked(pieces, height)[pieces.firsts + (3 * pieces.areas) // 4]
    strongest = cv2.dilate(height, np.ones((11, 11), np.uint8)).ravel()[pieces.order]
    asked = np.clip(0.4 * strongest, raised.level, 0.55 * np.repeat(typical, pieces.areas))
    found = np.zeros(mask.size, np.uint8)
    found[pieces.order[values > asked]] = 1
    return found.reshape(mask.shape)


def ranked(pieces: Pieces, height: Floats32) -> Floats32:
    """Return the values of each piece from its lowest to its highest, piece after piece."""
    values = height.ravel()[pieces.order]
    number = np.repeat(np.arange(len(pieces.areas)), pieces.areas)
    return np.asarray(values[np.lexsort((values, number))])


def insides(mask: ByteMask, widest: float) -> ByteMask:
    """Return the long narrow gaps between two walls: the inside of a hollow fibre."""
    edge = 16
    closed = cv2.morphologyEx(
        cv2.copyMakeBorder(mask, edge, edge, edge, edge, cv2.BORDER_CONSTANT, value=0),
        cv2.MORPH_CLOSE,
        kernel(int(widest)),
    )[edge:-edge, edge:-edge]
    gaps = ((closed > 0) & (mask == 0)).astype(np.uint8)
    found = np.zeros(mask.size, np.uint8)
    pieces = Pieces.of(gaps)
    large = pieces.areas > LEAST_HOLLOW_AREA
    if large.any():
        thickness = np.maximum(2.0 * pieces.deepest(gaps) - 1.0, 1.0)
        long = (pieces.areas > 10.0 * thickness**2) & large
        found[pieces.order[np.repeat(long, pieces.areas)]] = 1
    return found.reshape(mask.shape)


def ground_between(mask: ByteMask, hollow: ByteMask, away: Floats32, factor: int) -> ByteMask:
    """Return the gaps that are ground between fibres of a row, and not the inside of one.

    Parameters
    ----------
    away : ndarray, shape of the masks
        By how much each place differs from the ground, as what stands out does.
    """
    row = cv2.morphologyEx(mask | hollow, cv2.MORPH_OPEN, kernel(WIDEST_HOLLOW_PX // factor))
    found = np.zeros(mask.size, np.uint8)
    pieces = Pieces.of(hollow)
    typical = away[(mask > 0) & (row > 0) & np.isfinite(away)]
    if typical.size:
        levels = ranked(pieces, away)[pieces.firsts + pieces.areas // 4]  # not that of the edges
        wide = np.maximum.reduceat(row.ravel()[pieces.order], pieces.firsts) > 0
        ground = wide & (levels < GROUND_SHARE * float(np.median(typical)))
        found[pieces.order[np.repeat(ground, pieces.areas)]] = 1
    return found.reshape(mask.shape)
