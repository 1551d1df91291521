"""Images of fibres whose shape is known, drawn without any of CoSMic's own code.

A fibre is a curve of given curvature with a constant width and flat ends. Each pixel's share of
fibre follows from its distance to the curve; light, blur, dirt and noise come on top.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

STEP_PX = 0.25


@dataclass(frozen=True, slots=True)
class Recipe:
    """How an image is drawn; ranges are drawn from evenly."""

    shape: tuple[int, int] = (1200, 1600)
    length_px: tuple[float, float] = (450.0, 1300.0)
    width_px: tuple[float, float] = (8.0, 20.0)
    contrast: float = 60.0
    ground: float = 150.0
    noise: float = 4.0
    blur_px: float = 1.2
    uneven: float = 0.3
    specks: int = 25
    turns: float = 2.0
    fibres: int = 1
    crossing: bool = False
    lumen: float = 0.0
    bits: int = 8
    margin_px: float = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """One fibre as it was drawn."""

    line_px: np.ndarray
    width_px: float

    @property
    def length_px(self) -> float:
        """Length of the centre line."""
        return float(np.linalg.norm(np.diff(self.line_px, axis=0), axis=1).sum())

    @property
    def ends_px(self) -> np.ndarray:
        """Both ends."""
        return self.line_px[[0, -1]]


def self_crossings(line: np.ndarray, step: int = 16) -> list[tuple[int, int]]:
    """Return pairs of indices at which the line crosses itself."""
    points = line[::step]
    first, last = points[:-1], points[1:]
    side = last - first
    offset = first[None] - first[:, None]
    cross = side[:, None, 0] * side[None, :, 1] - side[:, None, 1] * side[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (offset[..., 0] * side[None, :, 1] - offset[..., 1] * side[None, :, 0]) / cross
        u = (offset[..., 0] * side[:, None, 1] - offset[..., 1] * side[:, None, 0]) / cross
    hit = (t >= 0) & (t < 1) & (u >= 0) & (u < 1)
    i, j = np.nonzero(np.triu(hit, 2))
    return [(int(a) * step, int(b) * step) for a, b in zip(i, j, strict=True)]


def clearance_px(line: np.ndarray, apart_px: float) -> float:
    """Return the least distance between parts of a line more than `apart_px` apart along it."""
    points = line[::8]
    gap = int(apart_px / (8 * STEP_PX)) + 1
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    rows, columns = np.triu_indices(len(points), gap)
    return float(distance[rows, columns].min()) if len(rows) else np.inf


def curve(rng: np.random.Generator, recipe: Recipe, length: float, width: float) -> np.ndarray:
    """Return a curve with smooth random curvature, anywhere."""
    count = int(length / STEP_PX) + 1
    s = np.linspace(0.0, 1.0, count)
    bend = np.zeros(count)
    for wave in range(1, 5):
        phase = rng.uniform(0, 2 * np.pi)
        bend += rng.normal(0, recipe.turns / wave) * np.sin(np.pi * wave * s + phase)
    if recipe.crossing:
        bend += rng.choice([-1, 1]) * rng.uniform(4.0, 7.0)
    limit = length / (2.5 * width)
    bend = np.clip(bend, -limit, limit)
    angle = rng.uniform(0, 2 * np.pi) + np.concatenate([[0], np.cumsum(bend[1:] / (count - 1))])
    steps = np.column_stack([np.cos(angle), np.sin(angle)])[:-1] * (length / (count - 1))
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def placed(rng: np.random.Generator, recipe: Recipe, width: float) -> np.ndarray | None:
    """Return one try at a curve within the image, or None."""
    line = curve(rng, recipe, rng.uniform(*recipe.length_px), width)
    height, across = recipe.shape
    room = np.array([across, height]) - 2 * recipe.margin_px - np.ptp(line, axis=0)
    if room.min() < 0:
        return None
    line = line - line.min(axis=0) + recipe.margin_px + rng.uniform(0, 1, 2) * room
    crossings = self_crossings(line)
    if recipe.crossing:
        return line if good_crossings(line, crossings, width) else None
    if crossings or clearance_px(line, 6 * width) < 2.5 * width + 6:
        return None
    return line


def good_crossings(line: np.ndarray, crossings: list[tuple[int, int]], width: float) -> bool:
    """Return whether a curve crosses itself once to three times, with free ends."""
    if not 1 <= len(crossings) <= 3:
        return False
    far = int(3 * width / STEP_PX)
    for first, last in crossings:
        if first < far or last > len(line) - far:
            return False
    body = line[far:-far:8]
    apart = [float(np.linalg.norm(body - end, axis=1).min()) for end in (line[0], line[-1])]
    return min(apart) >= 2 * width


def truths(rng: np.random.Generator, recipe: Recipe) -> list[Truth]:
    """Return the fibres of one image; several keep apart unless asked to cross."""
    found: list[Truth] = []
    for _ in range(20_000):
        if len(found) == recipe.fibres:
            break
        width = rng.uniform(*recipe.width_px)
        line = placed(rng, recipe, width)
        if line is None:
            continue
        others = np.concatenate([each.line_px for each in found]) if found else None
        if others is not None:
            gap = cKDTree(others).query(line[::4])[0].min()
            if gap < 4 * width:
                continue
        found.append(Truth(line, width))
    return found


def coverage(shape: tuple[int, int], truth: Truth, width: float) -> np.ndarray:
    """Return each pixel's share of fibre, 0 to 1."""
    line = truth.line_px
    near = np.zeros(shape, np.uint8)
    points = np.round(line[::4]).astype(np.int32).reshape(-1, 1, 2)
    cv2.polylines(near, [points], False, 1, int(width) + 8)
    rows, columns = np.nonzero(near)
    pixels = np.column_stack([columns, rows]).astype(float)
    distance, nearest = cKDTree(line).query(pixels)
    share = np.clip(width / 2 - distance + 0.5, 0, 1)
    for index, inner in ((0, 4), (len(line) - 1, len(line) - 5)):
        out = line[index] - line[inner]
        out /= np.linalg.norm(out)
        at_end = np.abs(nearest - index) <= 4
        away = pixels[at_end] - line[index]
        axial = away @ out
        lateral = np.abs(away @ np.array([-out[1], out[0]]))
        share[at_end] = np.clip(0.5 - axial, 0, 1) * np.clip(width / 2 - lateral + 0.5, 0, 1)
    image = np.zeros(shape, np.float32)
    image[rows, columns] = share
    return image


def light(rng: np.random.Generator, recipe: Recipe) -> np.ndarray:
    """Return uneven light, 1 on average over its range."""
    height, width = recipe.shape
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    centre = rng.uniform(0.2, 0.8, 2) * (width, height)
    radius = np.hypot(x - centre[0], y - centre[1]) / np.hypot(width, height)
    return np.asarray(1.0 + recipe.uneven * (0.35 - radius), dtype=np.float32)


def dirt(rng: np.random.Generator, recipe: Recipe) -> np.ndarray:
    """Return the share of dust in each pixel."""
    image = np.zeros(recipe.shape, np.float32)
    height, width = recipe.shape
    for _ in range(recipe.specks):
        centre = (int(rng.integers(0, width)), int(rng.integers(0, height)))
        axes = (int(rng.integers(1, 6)), int(rng.integers(1, 6)))
        angle = float(rng.uniform(0, 180))
        cv2.ellipse(image, centre, axes, angle, 0, 360, float(rng.uniform(0.3, 1.0)), -1)
    return image


def finished(rng: np.random.Generator, recipe: Recipe, share: np.ndarray) -> np.ndarray:
    """Return an image of what covers the ground: with light, blur and noise."""
    dark = np.maximum(share, dirt(rng, recipe))
    image = (recipe.ground - recipe.contrast * dark) * light(rng, recipe)
    if recipe.blur_px > 0:
        image = cv2.GaussianBlur(image, (0, 0), recipe.blur_px)
    image = image + rng.normal(0, recipe.noise, recipe.shape)
    top, dtype = (255.0, np.uint8) if recipe.bits == 8 else (65535.0, np.uint16)
    if recipe.bits == 16:
        image = image * 200.0
    return np.clip(np.round(image), 0, top).astype(dtype)


def draw(recipe: Recipe, seed: int) -> tuple[np.ndarray, list[Truth]]:
    """Return one image and the fibres in it."""
    rng = np.random.default_rng(seed)
    found = truths(rng, recipe)
    share = np.zeros(recipe.shape, np.float32)
    for each in found:
        body = coverage(recipe.shape, each, each.width_px)
        if recipe.lumen > 0:
            hollow = coverage(recipe.shape, each, 0.5 * each.width_px)
            body = body - recipe.lumen * hollow
        share = np.maximum(share, body)
    return finished(rng, recipe, share), found


ROWS = {
    "plain": Recipe(),
    "lighter than the ground": Recipe(contrast=-60.0, ground=80.0),
    "16 bit": Recipe(bits=16),
    "hollow": Recipe(width_px=(12.0, 30.0), lumen=0.6),
    "thin": Recipe(width_px=(3.0, 6.0)),
    "thick": Recipe(width_px=(24.0, 40.0), length_px=(600.0, 1300.0)),
    "straight": Recipe(turns=0.1, length_px=(450.0, 1050.0)),
    "three fibres": Recipe(fibres=3, length_px=(300.0, 700.0)),
    "small image": Recipe(
        shape=(300, 400), length_px=(120.0, 320.0), width_px=(4.0, 9.0), specks=4, margin_px=14.0
    ),
    "contrast 20": Recipe(contrast=20.0),
    "noise 12": Recipe(noise=12.0),
    "blur 4": Recipe(blur_px=4.0),
    "uneven 60 %, 80 specks": Recipe(uneven=0.6, specks=80),
    "crossing itself": Recipe(crossing=True, turns=3.0, length_px=(900.0, 2000.0)),
}
