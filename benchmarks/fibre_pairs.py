"""Images of single fibres and of pairs end to end, drawn by polygons that take light away.

Nothing of CoSMic's and nothing of `fibre_images` is used: outlines are filled at four times the
size, each fibre lets a part of the light through, and light, blur, noise and JPEG come on top.
The certainty of fibres is calibrated on these, and checked on pairs of `fibre_images`.
"""

from dataclasses import dataclass, replace
from enum import StrEnum

import cv2
import numpy as np

FINE = 4
SHIFT = 4
OUTLINE_PX = 0.5 / FINE
STEP_PX = 2.0
DUST_PX2 = 25_000
"""One speck of dust at most on so many pixels."""
TOLD_APART = 12.0
"""Standard deviations of noise, summed over all pixels, from which a pair differs from one."""


class Kind(StrEnum):
    """What is drawn."""

    SINGLE = "single"
    TOUCHING = "touching"
    OVERLAPPING = "overlapping"
    GAP = "gap"
    GOES_ON = "goes on thinner"


@dataclass(frozen=True, slots=True)
class Piece:
    """One fibre: its line, its width along it and how much light it takes away along it.

    Attributes
    ----------
    line_px : ndarray, shape (n, 2)
    width_px, taken : ndarray, shape (n,)
    slants : (float, float)
        By how much, in widths, its two ends are cut askew.
    joint : ndarray, shape (2,), or None
        Where two were joined to this one.
    """

    line_px: np.ndarray
    width_px: np.ndarray
    taken: np.ndarray
    slants: tuple[float, float] = (0.0, 0.0)
    joint: np.ndarray | None = None

    @property
    def length_px(self) -> float:
        """Length of the centre line."""
        return float(np.linalg.norm(np.diff(self.line_px, axis=0), axis=1).sum())


@dataclass(frozen=True, slots=True)
class View:
    """How the image was taken."""

    shape: tuple[int, int]
    ground: float
    contrast: float
    blur_px: float
    noise: float
    uneven: float
    opaque: bool
    jpeg: int | None
    lumen: float
    shade: float = 0.0
    light_from: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """An image and what is on it.

    Attributes
    ----------
    apart : float
        By how many standard deviations of noise it differs from one fibre of the same course; NaN
        where it was not compared.
    gap_widths : float
        Between the two, in mean widths; negative where they overlap.
    """

    image: np.ndarray
    fibres: list[Piece]
    kind: Kind
    apart: float
    gap_widths: float
    view: View


def curved(rng: np.random.Generator, length: float, turns: float, width: float) -> np.ndarray:
    """Return a line from (0, 0) along x whose curvature wanders."""
    count = max(8, int(length / STEP_PX)) + 1
    s = np.linspace(0.0, 1.0, count)
    bend = sum(
        rng.normal(0.0, turns / wave) * np.cos(np.pi * wave * s + rng.uniform(0.0, 6.28))
        for wave in (1, 2, 3)
    )
    bend = np.clip(bend, -length / (4.0 * width), length / (4.0 * width))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]) / (count - 1))])
    middle = 0.5 * (angle[1:] + angle[:-1])
    steps = np.column_stack([np.cos(middle), np.sin(middle)]) * length / (count - 1)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def turned(line: np.ndarray, angle: float, to: np.ndarray) -> np.ndarray:
    """Return a line turned about (0, 0) and moved."""
    matrix = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return line @ matrix.T + to


def wandering(rng: np.random.Generator, count: int, spread: float, wave: float) -> np.ndarray:
    """Return a row around 1 that wanders slowly; `wave` points is what it takes to change."""
    rough = rng.normal(0.0, 1.0, count + 8 * int(wave))
    smooth = cv2.GaussianBlur(rough[None], (0, 0), wave)[0]
    return 1.0 + spread * (smooth / max(float(smooth.std()), 1e-9))[:count]


def piece(rng: np.random.Generator, length: float, width: float, rough: float) -> Piece:
    """Return a fibre from (0, 0) along x."""
    line = curved(rng, length, float(rng.uniform(0.0, 1.2)), width)
    return unevenness(rng, line, width, rough)


def unevenness(rng: np.random.Generator, line: np.ndarray, width: float, rough: float) -> Piece:
    """Return a fibre along a line, with a width and a darkness that wander."""
    wave = max(2.0, float(rng.uniform(1.0, 6.0)) * width / STEP_PX)
    return Piece(
        line,
        width * np.clip(wandering(rng, len(line), rough, wave), 0.7, 1.3),
        np.clip(wandering(rng, len(line), rough, wave), 0.6, 1.4),
        tuple(rng.uniform(-0.5, 0.5, 2) * float(rng.integers(0, 2))),
    )


def cover(shape: tuple[int, int], one: Piece, part: float = 1.0) -> np.ndarray:
    """Return how much light a fibre takes away in each pixel, before blur, 0 to 1."""
    big = np.zeros((shape[0] * FINE, shape[1] * FINE), np.uint8)
    tangent = np.gradient(one.line_px, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    # OpenCV paints the outline as well, half a fine pixel beyond the polygon.
    half = 0.5 * part * one.width_px[:, None] - OUTLINE_PX
    left, right = one.line_px + half * normal, one.line_px - half * normal
    for end, slant in zip((0, -1), one.slants, strict=True):
        inward = OUTLINE_PX * (tangent[0] if end == 0 else -tangent[-1])
        left[end] = left[end] + slant * half[end] * tangent[end] + inward
        right[end] = right[end] - slant * half[end] * tangent[end] + inward
    corners = np.stack([left[:-1], left[1:], right[1:], right[:-1]], axis=1)
    fixed = np.round(((corners + 0.5) * FINE - 0.5) * 2**SHIFT).astype(np.int32)
    level = np.clip(np.round(170.0 * 0.5 * (one.taken[1:] + one.taken[:-1])), 1, 255)
    for corner, value in zip(fixed, level, strict=True):
        cv2.fillConvexPoly(big, corner, float(value), shift=SHIFT)
    small = cv2.resize(big, shape[::-1], interpolation=cv2.INTER_AREA)
    return small.astype(np.float32) / 170.0


def without_noise(pieces: list[Piece], view: View, light: np.ndarray) -> np.ndarray:
    """Return the image before noise."""
    passed = np.ones(view.shape, np.float32)
    taken = np.zeros(view.shape, np.float32)
    for one in pieces:
        body = cover(view.shape, one)
        if view.lumen:
            body = body - view.lumen * cover(view.shape, one, 0.5)
        taken = np.maximum(taken, body)
        passed *= 1.0 - 0.45 * body
    # What is opaque takes no more where two lie on each other; the rest takes from what is left.
    depth = taken if view.opaque else (1.0 - passed) / 0.45
    image = (view.ground + view.contrast * depth) * light
    return np.asarray(cv2.GaussianBlur(image, (0, 0), view.blur_px), dtype=np.float32)


def taken_with(rng: np.random.Generator, view: View, clean: np.ndarray) -> np.ndarray:
    """Return what the camera makes of it."""
    noisy = clean + rng.normal(0.0, view.noise, view.shape)
    image = np.clip(np.round(noisy), 0, 255).astype(np.uint8)
    if view.jpeg is None:
        return image
    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, view.jpeg])
    decoded = cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)
    return np.asarray(decoded, dtype=np.uint8)


def view_of(rng: np.random.Generator, *, jpeg: bool, large: bool) -> View:
    """Return circumstances as laboratories have them."""
    lighter = bool(rng.integers(0, 4) == 0)
    contrast = float(rng.uniform(35.0, 90.0))
    return View(
        shape=(720, 960) if large else (320, 640),
        ground=60.0 if lighter else float(rng.uniform(130.0, 190.0)),
        contrast=contrast if lighter else -contrast,
        blur_px=float(rng.uniform(0.7, 1.8) if rng.integers(0, 5) else rng.uniform(1.8, 4.5)),
        noise=float(rng.uniform(1.0, 6.0)),
        uneven=float(rng.uniform(0.0, 0.3)),
        opaque=bool(rng.integers(0, 2)),
        jpeg=int(rng.integers(10, 96)) if jpeg else None,
        lumen=float(rng.choice([0.0, 0.0, 0.4])),
        shade=float(rng.integers(0, 2) * rng.uniform(0.0, 0.3)),
        light_from=float(rng.uniform(0.0, 6.28)),
    )


def light_of(rng: np.random.Generator, view: View) -> np.ndarray:
    """Return light that falls off to a side, and is taken away by dust in half of the images."""
    rows, columns = view.shape
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32)
    angle = rng.uniform(0.0, 6.28)
    across = (x / columns - 0.5) * np.cos(angle) + (y / rows - 0.5) * np.sin(angle)
    light = np.asarray(1.0 + view.uneven * across, dtype=np.float32)
    for _ in range(int(rng.integers(0, 2) * rng.integers(1, 1 + rows * columns // DUST_PX2))):
        at = (int(rng.integers(0, columns)), int(rng.integers(0, rows)))
        axes = (int(rng.integers(1, 6)), int(rng.integers(1, 6)))
        speck = np.zeros(view.shape, np.float32)
        cv2.ellipse(speck, at, axes, float(rng.uniform(0.0, 180.0)), 0, 360, 1.0, -1)
        light *= 1.0 - float(rng.uniform(0.1, 0.4)) * speck
    return light


def together(
    rng: np.random.Generator, first: Piece, second: Piece, kind: Kind
) -> tuple[list, float]:
    """Return the second fibre at the end of the first one, and the gap in widths."""
    width = float(0.5 * (first.width_px[-1] + second.width_px[0]))
    gap = {
        Kind.TOUCHING: 0.0,
        Kind.OVERLAPPING: -float(rng.uniform(0.2, 2.0)),
        Kind.GAP: float(rng.uniform(0.1, 2.0)),
    }[kind]
    aside = width * float(rng.choice([0.0, rng.uniform(-0.4, 0.4)]))
    tangent = first.line_px[-1] - first.line_px[-2]
    tangent /= np.linalg.norm(tangent)
    normal = np.array([-tangent[1], tangent[0]])
    start = first.line_px[-1] + gap * width * tangent + aside * normal
    lean = float(rng.choice([0.0, rng.uniform(-0.5, 0.5), rng.uniform(-1.5, 1.5)]))
    angle = float(np.arctan2(tangent[1], tangent[0])) + lean
    return [first, replace(second, line_px=turned(second.line_px, angle, start))], gap


def shortened(one: Piece, by_px: float, *, at_end: bool) -> Piece:
    """Return a fibre without a part at its end or at its start."""
    count = min(round(by_px / STEP_PX), len(one.line_px) - 4)
    part = slice(None, -count or None) if at_end else slice(count, None)
    return Piece(one.line_px[part], one.width_px[part], one.taken[part], one.slants)


def as_one(first: Piece, second: Piece, gap_widths: float) -> Piece:
    """Return one fibre of the same course, thickness and darkness changing over three widths."""
    if gap_widths < 0:
        half = -0.5 * gap_widths * float(first.width_px[-1])
        first = shortened(first, half, at_end=True)
        second = shortened(second, half, at_end=False)
    line = np.concatenate([first.line_px, second.line_px])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(s) > 0.3 * STEP_PX])
    at = len(first.line_px)
    reach = max(2, int(1.5 * float(first.width_px.mean()) / STEP_PX))

    def eased(one: np.ndarray, other: np.ndarray) -> np.ndarray:
        values = np.concatenate([one, other])
        low, high = max(0, at - reach), min(len(values) - 1, at + reach)
        values[low:high] = np.linspace(values[low], values[high], high - low)
        return values[keep]

    return Piece(
        line[keep],
        eased(first.width_px, second.width_px),
        eased(first.taken, second.taken),
        (first.slants[0], second.slants[1]),
        0.5 * (first.line_px[-1] + second.line_px[0]),
    )


def rounded(one: Piece, part: float) -> Piece:
    """Return a fibre whose course is rounded over a part of its width."""
    sigma = part * float(one.width_px.mean()) / STEP_PX
    if not sigma:
        return one
    count = int(3.0 * sigma) + 1
    # Turned over at its ends, so that they stay where they are.
    before = 2.0 * one.line_px[0] - one.line_px[count:0:-1]
    after = 2.0 * one.line_px[-1] - one.line_px[-2 : -2 - count : -1]
    long = np.concatenate([before, one.line_px, after])
    smooth = cv2.GaussianBlur(long, (1, 2 * count + 1), sigmaX=0, sigmaY=sigma)
    return replace(one, line_px=smooth[count:-count])


def swollen(one: Piece, at: np.ndarray, part: float) -> Piece:
    """Return a fibre that is thicker by a part of its width around a point."""
    away = np.linalg.norm(one.line_px - at, axis=1) / float(one.width_px.mean())
    return replace(one, width_px=one.width_px * (1.0 + part * np.exp(-0.5 * away**2)))


def difference(
    joined: Piece, image: np.ndarray, clean: np.ndarray, view: View, light: np.ndarray
) -> float:
    """Return by how many standard deviations an image differs from that of any one fibre.

    Of the single fibres that are tried, rounded more or less at the joint, and thicker or thinner
    there by what single fibres of this population vary, the one counts that is most like it.
    """
    middle = joined.line_px[len(joined.line_px) // 2] if joined.joint is None else joined.joint
    half = int(5.0 * float(joined.width_px.mean()) + 12.0)
    low = np.maximum(np.round(middle).astype(int) - half, 0)
    high = np.minimum(np.round(middle).astype(int) + half, np.array(view.shape[::-1]))
    part = (slice(low[1], high[1]), slice(low[0], high[0]))
    small = replace(view, shape=(int(high[1] - low[1]), int(high[0] - low[0])))
    there = replace(joined, line_px=joined.line_px - low)
    error = cv2.blur((image[part].astype(np.float32) - clean[part]) ** 2, (9, 9))

    def off(one: Piece) -> float:
        rest = clean[part] - without_noise([one], small, light[part])
        # Blur at the window's own border is not that of the image.
        power = rest[8:-8, 8:-8].astype(np.float64) ** 2
        noise = float((power * error[8:-8, 8:-8]).sum())
        return float(power.sum() / np.sqrt(max(noise, 1e-12)))

    round_ones = [rounded(there, each) for each in (0.0, 0.5, 1.0, 2.0)]
    best = min(round_ones, key=off)
    return min(off(swollen(best, middle - low, each)) for each in (-0.08, 0.0, 0.08, 0.16))


def placed(rng: np.random.Generator, pieces: list[Piece], view: View) -> list[Piece] | None:
    """Return fibres turned and moved into the image, or None where they do not fit."""
    angle = float(rng.uniform(0.0, 6.28))
    lines = [turned(each.line_px, angle, np.zeros(2)) for each in pieces]
    whole = np.concatenate(lines)
    margin = 14.0 + max(float(each.width_px.max()) for each in pieces)
    room = np.array(view.shape[::-1]) - 2.0 * margin - np.ptp(whole, axis=0)
    if room.min() < 0:
        return None
    shift = margin - whole.min(axis=0) + rng.uniform(0.0, 1.0, 2) * room
    return [replace(each, line_px=line + shift) for each, line in zip(pieces, lines, strict=True)]


def shaded(one: Piece, view: View) -> Piece:
    """Return a fibre lit from a side: it is lighter or darker where it runs in some direction."""
    tangent = np.gradient(one.line_px, axis=0)
    angle = np.arctan2(tangent[:, 1], tangent[:, 0])
    taken = one.taken * (1.0 + view.shade * np.cos(2.0 * (angle - view.light_from)))
    return replace(one, taken=np.clip(taken, 0.5, 1.45))


def draw(
    kind: Kind, seed: int, *, jpeg: bool | None = None, large: bool = False, compare: bool = True
) -> Drawn:
    """Return an image of one kind; without `compare` it is not said how far it is from one fibre.

    Comparing takes most of the time.
    """
    rng = np.random.default_rng([seed, list(Kind).index(kind)])
    there, gap, view = composed(rng, kind, jpeg=jpeg, large=large)
    light = light_of(rng, view)
    clean = without_noise(there, view, light)
    image = taken_with(rng, view, clean)
    apart = np.inf
    if kind in (Kind.TOUCHING, Kind.OVERLAPPING, Kind.GAP):
        one = as_one(there[0], there[1], gap)
        apart = difference(one, image, clean, view, light) if compare else np.nan
    fibres = [as_one(there[0], there[1], 0.0)] if kind is Kind.GOES_ON else there
    return Drawn(image, fibres, kind, apart, gap, view)


def composed(
    rng: np.random.Generator, kind: Kind, *, jpeg: bool | None, large: bool
) -> tuple[list[Piece], float, View]:
    """Return what is on an image of one kind, the gap in widths, and how it is taken."""
    while True:
        view = view_of(
            rng, jpeg=bool(rng.integers(0, 3) == 0) if jpeg is None else jpeg, large=large
        )
        long = large and bool(rng.integers(0, 2))
        width = float(rng.uniform(5.0, 9.0) if long else rng.uniform(5.0, 18.0))
        rough = float(rng.choice([0.0, 0.02, 0.05, 0.08]))
        pieces, gap = _pieces(rng, kind, width, rough, 2.8 if long else 1.4 if large else 1.0)
        there = placed(rng, pieces, view)
        if there is not None:
            return [shaded(each, view) for each in there], gap, view


def _pieces(
    rng: np.random.Generator, kind: Kind, width: float, rough: float, scale: float
) -> tuple[list[Piece], float]:
    length = float(rng.uniform(12.0, 30.0)) * width * scale
    first = piece(rng, length, width, rough)
    if kind is Kind.SINGLE:
        return [first], 0.0
    if kind is Kind.GOES_ON:
        thin = piece(rng, float(rng.uniform(4.0, 15.0)) * width, width, rough)
        first, second = together(rng, first, thin, Kind.TOUCHING)[0]
        smaller, fainter = rng.uniform(0.2, 0.6), rng.uniform(0.3, 0.9)
        return [
            first,
            replace(second, width_px=second.width_px * smaller, taken=second.taken * fainter),
        ], 0.0
    other = piece(rng, float(rng.uniform(10.0, 24.0)) * width * scale, width, rough)
    if rng.integers(0, 5) < 2:
        wider, darker = rng.uniform(0.7, 1.4), rng.uniform(0.7, 1.3)
        other = replace(other, width_px=other.width_px * wider, taken=other.taken * darker)
    return together(rng, first, other, kind)
