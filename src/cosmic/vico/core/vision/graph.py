"""A mask thinned to its skeleton, as branches between nodes."""

from dataclasses import dataclass, field
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import ByteMask, Floats, Floats32, Mask
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.smoothing import arc_lengths

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


def skeletonize(mask: ByteMask) -> ByteMask:
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


FREE = -1
NEIGHBOURS = ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))


@dataclass(slots=True, eq=False)
class Branch:
    """A piece of skeleton without forks.

    Attributes
    ----------
    points : ndarray, shape (n, 2), x and y
    nodes : list of int
        The node at its first and at its last point; FREE at a free end.
    """

    points: Floats
    nodes: list[int]

    @property
    def length(self) -> float:
        """Length along its points."""
        return float(arc_lengths(self.points)[-1])

    @property
    def closed(self) -> bool:
        """Whether it is a ring without any node."""
        return (
            self.nodes == [FREE, FREE]
            and len(self.points) > 8
            and bool(np.abs(self.points[0] - self.points[-1]).max() <= 1.5)
        )


@dataclass(slots=True, eq=False)
class Graph:
    """Branches and nodes of one image.

    Attributes
    ----------
    half_widths : ndarray, float32
        Distance of each pixel of the mask to the ground.
    """

    branches: list[Branch]
    nodes: list[Floats]
    half_widths: Floats32
    pruned: list[Branch] = field(default_factory=list)

    def half_width(self, points: Floats) -> float:
        """Return the typical half width along points."""
        columns, rows = np.round(points).astype(int).T
        return middle(self.half_widths[rows, columns])


def build_graph(mask: ByteMask, most: int) -> Graph | None:
    """Return the graph of a mask, or None where it has more than `most` forks."""
    framed = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    half_widths = cv2.distanceTransform(framed, cv2.DIST_L2, 5)[1:-1, 1:-1]
    skeleton = skeletonize(mask)
    around = cv2.boxFilter(skeleton, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    lines = skeleton != 0
    forks = lines & (around > 3)
    count, found = cv2.connectedComponents(forks.view(np.uint8), connectivity=8)
    labels = np.asarray(found, dtype=np.int32)
    if count - 1 > most:
        return None
    branches = [branch(pixels, labels) for pixels in paths(lines & ~forks)]
    nodes = centres(forks, labels)
    for each in branches:
        with_nodes(each, nodes)
    return Graph(branches, nodes, np.asarray(half_widths, dtype=np.float32))


def centres(forks: Mask, labels: npt.NDArray[np.int32]) -> list[Floats]:
    """Return the middle of each fork, x and y, by its label from 1 on."""
    rows, columns = np.nonzero(forks)
    of = labels[rows, columns]
    areas = np.bincount(of)[1:]
    x, y = (np.bincount(of, each)[1:] / areas for each in (columns, rows))
    return list(np.column_stack([x, y]))


def paths(pieces: Mask) -> list[list[tuple[int, int]]]:
    """Return the pixels (row, column) of each piece in order."""
    rows, columns = np.nonzero(pieces)
    left = set(zip(rows.tolist(), columns.tolist(), strict=True))
    found = []
    while left:
        start = next(iter(left))
        left.discard(start)
        ahead = walked(start, left)
        back = walked(start, left)
        found.append([*reversed(back), start, *ahead])
    return found


def walked(start: tuple[int, int], left: set[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the pixels after `start` as far as they go, and take them from `left`."""
    path = []
    row, column = start
    while True:
        for down, right in NEIGHBOURS:
            ahead = (row + down, column + right)
            if ahead in left:
                left.discard(ahead)
                path.append(ahead)
                row, column = ahead
                break
        else:
            return path


def branch(pixels: list[tuple[int, int]], labels: npt.NDArray[np.int32]) -> Branch:
    """Return a piece with the nodes it touches."""
    points = np.array(pixels, dtype=float)[:, ::-1]
    first = touched(pixels[0], labels)
    last = touched(pixels[-1], labels)
    if len(pixels) == 1:
        both = [*first, FREE, FREE]
        return Branch(points, both[:2])
    # The ends of a short piece may touch the same two nodes: each takes its own.
    start = first[0] if first else FREE
    end = next((node for node in last if node != start or len(pixels) > 3), FREE)
    return Branch(points, [start, end])


def touched(pixel: tuple[int, int], labels: npt.NDArray[np.int32]) -> list[int]:
    """Return the nodes next to a pixel, from zero."""
    row, column = pixel
    window = labels[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2]
    return [label - 1 for label in sorted(set(window.ravel().tolist())) if label > 0]


def with_nodes(each: Branch, nodes: list[Floats]) -> None:
    """Add the points of its nodes to a branch."""
    parts = [each.points]
    if each.nodes[0] != FREE:
        parts.insert(0, nodes[each.nodes[0]][None])
    if each.nodes[1] != FREE:
        parts.append(nodes[each.nodes[1]][None])
    each.points = np.concatenate(parts)


def prune(graph: Graph) -> None:
    """Take away the short side branches that a rough edge gives a skeleton."""
    for each in list(graph.branches):
        free = each.nodes.count(FREE)
        if free == 0:
            continue
        if free == 2:
            if len(each.points) < 3:
                graph.branches.remove(each)
            continue
        node = max(each.nodes)
        column, row = np.round(graph.nodes[node]).astype(int)
        if each.length <= 1.3 * float(graph.half_widths[row, column]) + 1.5:
            graph.branches.remove(each)
            graph.pruned.append(each)
