"""A strand of the skeleton made exact on the full-size image."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.vico.core.vision.ends import End, EndKind, Level, find_end
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.joining import Strand
from cosmic.vico.core.vision.profiles import (
    Edges,
    Profiles,
    Scene,
    along,
    box_centres,
    cross_sections,
    find_edges,
)
from cosmic.vico.core.vision.smoothing import UndeterminedError, arc_lengths, resampled, smooth

STEP_PX = 2.0
# So far beyond the border a line may be smoothed.
STRAY_PX = 30.0
ROUNDS = 2
# So far apart, in pixels of the reduced image, the points of a strand are not beside each other.
GAP = 2.0
# Of an end that was drawn: how far off it may be, and over which length it falls, by its blur.
DRAWN_END_PX = 0.3
SOFT_OF_BLUR = 1.68


@dataclass(slots=True, eq=False)
class Course:
    """The exact course of a fibre while it is being found.

    Attributes
    ----------
    line : ndarray, shape (n, 2)
        Full-size pixels, evenly spaced.
    good : ndarray of bool, shape (n,)
        Where both edges were seen.
    free : ndarray of bool, shape (n,)
        Where nothing else known covers the cross section.
    cut : bool
        Its edges are not seen: other things cover what is beside it before it has fallen.
    alone : Scene or None
        Of a fibre of a bundle: the image without the others.
    widths : ndarray, shape (n,)
        NaN where they were not.
    """

    line: Floats
    width: float
    good: Mask
    widths: Floats
    contrast: Floats
    ends: list[End]
    noise: float = 0.0
    blur_px: float = 0.0
    scatter_px: float = 0.0
    across: Floats32 = field(default_factory=lambda: np.zeros(0, np.float32))
    mean: Floats = field(default_factory=lambda: np.zeros(0))
    ground: Floats = field(default_factory=lambda: np.zeros(0))
    tilt: Floats = field(default_factory=lambda: np.zeros(0))
    free: Mask = field(default_factory=lambda: np.zeros(0, bool))
    cut: bool = False
    alone: Scene | None = None

    @property
    def edge_blur_px(self) -> float:
        """Blur of its edges, at least a pixel, and at most what leaves something between them."""
        return max(1.0, min(self.blur_px, 0.4 * self.width))


@dataclass(frozen=True, slots=True, eq=False)
class Neighbours:
    """The other strands of the image, to keep out of the way of."""

    tree: cKDTree | None
    margins: Floats

    def near(self, line: Floats, width: float) -> Mask:
        """Return which points lie where another strand covers part of the cross section."""
        if self.tree is None:
            return np.zeros(len(line), bool)
        distance, index = self.tree.query(line)
        return np.asarray(distance < 0.5 * width + self.margins[index] + 1.5)


def neighbours_of(scene: Scene, kept: list[Strand], index: int) -> Neighbours:
    """Return all strands but one, as far as they come near it."""
    own = kept[index].points
    reach = 3.0 * kept[index].half_width + 12.0
    low, high = own.min(axis=0) - reach, own.max(axis=0) + reach
    others = []
    for n, each in enumerate(kept):
        points = without_gaps(each.points)
        inside = ((points > low) & (points < high)).all(axis=1)
        if n != index and inside.any():
            others.append((each, scene.full(points[inside])))
    if not others:
        return Neighbours(None, np.zeros(0))
    points = np.concatenate([line for _, line in others])
    margins = np.concatenate(
        [np.full(len(line), each.half_width * scene.factor) for each, line in others]
    )
    return Neighbours(cKDTree(points), margins)


def without_gaps(points: Floats) -> Floats:
    """Return the points of a strand and, where it goes through a crossing, those between.

    Without them what it covers there would be taken for free.
    """
    s = arc_lengths(points)
    if len(points) < 2 or not np.diff(s).max() > GAP:
        return points
    at = np.linspace(0.0, float(s[-1]), int(np.ceil(s[-1])) + 1)
    return np.column_stack([np.interp(at, s, points[:, axis]) for axis in (0, 1)])


def refine(scene: Scene, strand: Strand, neighbours: Neighbours) -> Course | None:
    """Return the exact course of a strand, or None where there is no fibre after all."""
    try:
        return _refined(scene, strand, neighbours)
    except UndeterminedError:
        return None  # wide as a tool out of focus, and covered by others: nothing to be measured


def _refined(scene: Scene, strand: Strand, neighbours: Neighbours) -> Course | None:
    width = max(2.0, (2.0 * strand.half_width - 0.5) * scene.factor)
    line = first_line(scene, strand, max(3.0 * width, 6.0 * scene.factor))
    if len(line) < 6:
        return None
    course = Course(
        line, width, np.ones(len(line), bool), np.full(len(line), width), np.ones(len(line)), []
    )
    if not centre_roughly(scene, course, neighbours):
        return None
    for number in range(ROUNDS):
        if not measure(scene, course, neighbours):
            return None
        course.ends = both_ends(scene, course, strand, 2.0 * scene.factor if number == 0 else 2.0)
        stretch(course)
        if len(course.line) < 6:
            return None
    return course if measure(scene, course, neighbours) else None


def lying(
    scene: Scene, line: Floats, width: float, blur_px: float, neighbours: Neighbours
) -> Course | None:
    """Return the course of a fibre of which it is known where it lies; `scene` has it alone."""
    line = resampled(line, STEP_PX)
    if len(line) < 6:
        return None
    course = Course(
        line, width, np.ones(len(line), bool), np.full(len(line), width), np.ones(len(line)), []
    )
    course.blur_px, course.alone = blur_px, scene
    course.ends = [End(EndKind.FREE, 0.0, DRAWN_END_PX, SOFT_OF_BLUR * blur_px)] * 2
    try:
        seen = measure(scene, course, neighbours)
    except UndeterminedError:
        return None
    # Where it is not seen a line that follows what is seen goes astray.
    course.line = line
    return course if seen else None


def first_line(scene: Scene, strand: Strand, wave_px: float) -> Floats:
    """Return the way of a strand, smooth, and through its crossings as its sides lead."""
    points = scene.full(strand.points)
    s = arc_lengths(points)
    at = np.arange(0.0, float(s[-1]), STEP_PX)
    line = np.column_stack([np.interp(at, s, points[:, axis]) for axis in (0, 1)])
    after = np.clip(np.searchsorted(s, at), 1, len(s) - 1)
    gap = s[after] - s[after - 1]
    weights = np.where(gap > 3.0 * scene.factor, 0.0, 1.0)
    if (weights > 0).sum() < 6:
        return line[:0]
    line = smooth(line, weights, wave_px / STEP_PX)
    width = 2.0 * strand.half_width * scene.factor
    return resampled(line, STEP_PX) if is_on_image(scene, line, width) else line[:0]


def excluded(course: Course, neighbours: Neighbours) -> Mask:
    """Return the points whose cross section another strand, or another part, covers."""
    near = neighbours.near(course.line, course.width)
    apart = int(2.5 * course.width / STEP_PX) + 3
    reach = 1.15 * course.width + 1.0
    tree = cKDTree(course.line)
    pairs = tree.query_pairs(reach, output_type="ndarray")
    if len(pairs):
        far = np.abs(pairs[:, 0] - pairs[:, 1]) > apart
        near[pairs[far].ravel()] = True
    return near


def centre_roughly(scene: Scene, course: Course, neighbours: Neighbours) -> bool:
    """Move a line onto its fibre, from where the skeleton of the reduced image lies.

    False where it did not stay on the image.
    """
    reach = 1.1 * course.width + 2 * scene.factor + 4
    profiles = cross_sections(scene, course.line, course.width, reach)
    most = scene.factor + 0.35 * course.width
    offset = box_centres(profiles, along(profiles, 2.0), course.width, most)
    weights = np.where(excluded(course, neighbours), 0.0, 1.0)
    move(course, profiles, offset, weights, max(24.0, 3.0 * course.width))
    if not is_on_image(scene, course.line, course.width):
        return False
    course.line = resampled(course.line, STEP_PX)
    return True


def move(
    course: Course, profiles: Profiles, offset: Floats, weights: Floats, wave_px: float
) -> None:
    """Shift a line along its normals, robustly, and space it evenly again."""
    target = course.line + offset[:, None] * profiles.normals
    wave = wave_px / STEP_PX
    line = smooth(target, weights, wave)
    rest = np.linalg.norm(target - line, axis=1)
    used = weights > 0
    if used.sum() > 8:
        typical = middle(rest[used])
        off = rest > 4.0 * 1.4826 * typical + 0.1
        if (off & used).any():
            line = smooth(target, np.where(off, 0.0, weights), wave)
        course.scatter_px = 1.2 * typical
    course.line = line


def measure(scene: Scene, course: Course, neighbours: Neighbours) -> bool:
    """Find edges, width and contrast along a line and move it to the middle; False: no fibre."""
    # The tail of a blurred edge is not ground yet.
    margin = 2.0 + 2.0 * min(course.blur_px, 0.3 * course.width)
    reach = 1.2 * course.width + 6.0 + margin
    profiles = cross_sections(scene, course.line, course.width, reach, margin)
    free = ~excluded(course, neighbours)
    typical = middle(profiles.height[::4, np.abs(profiles.across) < 0.4 * course.width])
    ratio = profiles.noise / max(typical, 1e-6)
    height = along(profiles, min(max(6 * ratio, 0.8), 4.0))
    if not free.any():
        return False
    edges = find_edges(profiles, height, free, course.width)
    widths = edges.right - edges.left
    # In noise an edge may be found beyond the other one.
    good = free & (widths > 0.0)
    if good.sum() < 4:
        return False
    take(course, edges, widths, good, profiles)
    course.free = free
    inner = good & ~near_ends(course)
    weights = np.where(inner if inner.sum() >= 4 else good, 1.0, 0.0)
    offset = np.where(good, 0.5 * (edges.left + edges.right), 0.0)
    wave = max(20.0, 2.0 * course.width) * (1.0 + 4.0 * min(ratio, 1.0))
    move(course, profiles, offset, weights, wave)
    return is_on_image(scene, course.line, course.width)


def is_on_image(scene: Scene, line: Floats, width: float) -> bool:
    """Return whether a line that was smoothed is still on the image: a bad start sends it away."""
    room = width + STRAY_PX
    return bool((line > -room).all() and (line < scene.corner + room).all())


def near_ends(course: Course) -> Mask:
    """Return the points so near to an end that the end's blur reaches them."""
    near = np.zeros(len(course.line), bool)
    if not course.ends:
        return near
    count = int(np.ceil((1.0 + 1.5 * course.blur_px) / STEP_PX))
    near[:count] = near[-count:] = True
    return near


def take(course: Course, edges: Edges, widths: Floats, good: Mask, profiles: Profiles) -> None:
    """Keep what the cross sections say."""
    typical = middle(widths[good])
    course.width = typical
    course.good = good & (np.abs(widths - typical) < 0.6 * typical + 1.0)
    course.widths = np.where(course.good, widths, np.nan)
    course.contrast = edges.contrast
    course.noise = profiles.noise
    course.ground = profiles.ground
    course.tilt = profiles.tilt
    course.blur_px = edges.steepness_px
    course.mean = edges.mean
    course.cut = edges.cut
    course.across = profiles.across


def both_ends(scene: Scene, course: Course, strand: Strand, extra: float) -> list[End]:
    """Return what the two ends are, the line's first one first."""
    if strand.closed:
        return [End(EndKind.HIDDEN, 0.0, course.width)] * 2
    found = []
    for line, contrast, ground in (
        (course.line[::-1], course.contrast[::-1], course.ground[::-1]),
        (course.line, course.contrast, course.ground),
    ):
        count = max(4, int(3 * course.width / STEP_PX))
        height = middle(contrast[-count:])
        level = Level(
            width=course.width,
            contrast=height,
            ground=middle(ground[-count:]),
            noise=course.noise,
            search_px=1.5 * course.width + 4.0 + extra,
        )
        found.append(find_end(scene, line, level))
    return found


def stretch(course: Course) -> None:
    """Cut or lengthen a line to its ends."""
    line = course.line
    for turn in (0, 1):
        end = course.ends[turn]
        line = line[::-1] if turn == 0 else line
        if end.kind in (EndKind.FREE, EndKind.BORDER):
            line = ended(line, end.along_px, course.width)
        line = line[::-1] if turn == 0 else line
    course.line = resampled(line, STEP_PX)


def ended(line: Floats, beyond: float, width: float) -> Floats:
    """Return a line that ends `beyond` its last point."""
    s = arc_lengths(line)
    if beyond <= 0:
        total = float(s[-1]) + beyond
        keep = s < total - 1e-6
        last = np.array([np.interp(total, s, line[:, axis]) for axis in (0, 1)])
        return np.concatenate([line[keep], last[None]])
    count = min(max(round(0.6 * width), 3), max(3, len(line) // 3))
    out = line[-1] - line[-1 - min(count, len(line) - 1)]
    out /= max(float(np.linalg.norm(out)), 1e-9)
    return np.concatenate([line, (line[-1] + beyond * out)[None]])
