"""Branches joined to strands: through crossings by the way that bends least."""

from collections import defaultdict
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.vico.core.vision.graph import FREE, Branch, Graph
from cosmic.vico.core.vision.smoothing import arc_lengths


@dataclass(frozen=True, slots=True, eq=False)
class Exit:
    """How a branch leaves its crossing: point, direction and curvature."""

    branch: int
    point: Floats
    direction: Floats
    curvature: float


def leaving(branch: Branch, number: int, end: int, half_width: float) -> Exit:
    """Return how a branch leaves its crossing, where its skeleton is no longer bent by it."""
    points = branch.points if end == 0 else branch.points[::-1]
    s = arc_lengths(points)
    total = float(s[-1])
    near = min(2.0 * half_width + 1.0, 0.3 * total)
    far = min(near + max(12.0, 10.0 * half_width), 0.9 * total if total > 12 else total)
    chosen = (s >= near) & (s <= far)
    if chosen.sum() < 3:
        chosen[:] = True
    t = s[chosen] - near
    part = points[chosen]
    order = 2 if len(part) >= 10 else 1
    x, y = (np.polyfit(t, part[:, axis], order) for axis in (0, 1))
    slope = np.array([x[-2], y[-2]])
    speed = max(float(np.linalg.norm(slope)), 1e-6)
    bow = 2.0 * np.array([x[0], y[0]]) if order == 2 else np.zeros(2)
    curvature = float(slope[0] * bow[1] - slope[1] * bow[0]) / speed**3
    most = 0.3 / half_width
    point = np.array([x[-1], y[-1]])
    return Exit(number, point, slope / speed, float(np.clip(curvature, -most, most)))


def turn(first: Floats, last: Floats) -> float:
    """Return the angle from one direction to another, -pi to pi."""
    return float(np.arctan2(first[0] * last[1] - first[1] * last[0], first @ last))


def bending(first: Exit, last: Exit) -> float:
    """Return how much a curve must leave its bow to enter by one branch and leave by another."""
    pairing = last.point - first.point
    gap = float(np.linalg.norm(pairing))
    if gap < 1e-6 or first.branch == last.branch:
        # A fibre has ends: a branch is not joined to itself.
        return float(np.pi**2)
    bow = 0.5 * (last.curvature - first.curvature) * gap
    change = (last.curvature + first.curvature) * gap
    enter = turn(pairing, -first.direction) + 0.5 * bow
    leave = turn(pairing, last.direction) - 0.5 * bow
    return enter**2 + enter * leave + leave**2 + change**2 / 12.0


# Bending, in squared radians, that is worse than two loose ends in a crossing.
LOOSE = 0.7
# Radians, as `bending`. Where one ends on another, or a short end of a crossing is not seen, the
# second best way is as good up to this.
ODD = 0.6
# Two fibres that cross at a small angle lie on each other over so many widths.
LONGEST_BRIDGE = 14.0
EASY = 0.5
MOST_STUBS = 8
AMBIGUOUS = "a crossing can be read in two ways"
ON_ANOTHER = "an end lies on a fibre, so that it cannot be seen"
CLUSTER = "too many fibres meet in one place"
RING = "a closed ring has no ends"
FOLDED = "it folds back sharply at a crossing"

Stub = tuple[int, int]
Pairing = tuple[tuple[int, int], ...]


@dataclass(slots=True, eq=False)
class Strand:
    """One way through the skeleton, from end to end.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        In pixels of the reduced image.
    half_width : float
        Likewise.
    joints : list of ndarray
        Points of the crossings it goes through.
    """

    points: Floats
    half_width: float
    joints: list[Floats] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    closed: bool = False


@dataclass(slots=True, eq=False)
class Joint:
    """Nodes so near to each other that they are one crossing."""

    stubs: list[Stub]
    point: Floats
    partner: dict[Stub, Stub] = field(default_factory=dict)
    doubts: dict[Stub, list[str]] = field(default_factory=lambda: defaultdict(list))


def strands(graph: Graph) -> list[Strand]:
    """Return the strands of a graph."""
    half_width = component_half_widths(graph)
    bridges, group = merged(graph, half_width)
    joints = make_joints(graph, bridges, group)
    for joint in joints.values():
        pair(graph, joint, half_width)
    at = {stub: joint for joint in joints.values() for stub in joint.stubs}
    used: set[int] = set(bridges)
    found = []
    starts = [
        (index, end)
        for index in range(len(graph.branches))
        for end in (0, 1)
        if index not in bridges
        and ((index, end) not in at or (index, end) not in at[index, end].partner)
    ]
    rest = [(index, 0) for index in range(len(graph.branches))]
    for number, start in enumerate([*starts, *rest]):
        if start[0] not in used:
            found.append(follow(graph, at, start, used, half_width))
            found[-1].closed = found[-1].closed or number >= len(starts)
    for each in found:
        if each.closed:
            each.doubts.append(RING)
    return found


def component_half_widths(graph: Graph) -> list[float]:
    """Return the typical half width for each branch, from all that hangs together with it."""
    parent = list(range(len(graph.nodes)))

    def root(node: int) -> int:
        while parent[node] != node:
            node = parent[node]
        return node

    for each in graph.branches:
        if FREE not in each.nodes:
            parent[root(each.nodes[0])] = root(each.nodes[1])
    groups: dict[int, list[int]] = defaultdict(list)
    for index, each in enumerate(graph.branches):
        node = max(each.nodes)
        groups[root(node) if node != FREE else -1 - index].append(index)
    widths = [1.0] * len(graph.branches)
    for members in groups.values():
        points = np.concatenate([graph.branches[index].points for index in members])
        typical = max(1.0, graph.half_width(points))
        for index in members:
            widths[index] = typical
    return widths


def merged(graph: Graph, half_width: list[float]) -> tuple[set[int], list[int]]:
    """Return the branches inside a crossing, and the group of each node."""
    group = list(range(len(graph.nodes)))
    bridges = set()
    for index, each in enumerate(graph.branches):
        if FREE in each.nodes:
            continue
        width = 2.0 * half_width[index]
        short = each.length < 1.3 * width + 1.0
        inner = each.points[1:-1] if len(each.points) > 2 else each.points
        wide = each.length < 8.0 * width and graph.half_width(inner) > 0.62 * width
        through = each.length < LONGEST_BRIDGE * width and crosses(graph, index, half_width)
        if (short or wide or through) and each.nodes[0] != each.nodes[1]:
            bridges.add(index)
            old, new = group[each.nodes[0]], group[each.nodes[1]]
            group = [new if label == old else label for label in group]
    return bridges, group


def crosses(graph: Graph, bridge: int, half_width: list[float]) -> bool:
    """Return whether two smooth curves could share a branch: a crossing at a small angle."""
    sides = []
    for node in graph.branches[bridge].nodes:
        stubs = [
            (index, end)
            for index, each in enumerate(graph.branches)
            if index != bridge
            for end in (0, 1)
            if each.nodes[end] == node
        ]
        if len(stubs) != 2:
            return False
        sides.append([leaving(graph.branches[i], i, end, half_width[i]) for i, end in stubs])
    (a, b), (c, d) = sides
    return min(max(bending(a, c), bending(b, d)), max(bending(a, d), bending(b, c))) < EASY


def make_joints(graph: Graph, bridges: set[int], group: list[int]) -> dict[int, Joint]:
    """Return the crossings with the branches that meet there."""
    stubs: dict[int, list[Stub]] = defaultdict(list)
    for index, each in enumerate(graph.branches):
        if index in bridges:
            continue
        for end, node in enumerate(each.nodes):
            if node != FREE:
                stubs[group[node]].append((index, end))
    points: dict[int, list[Floats]] = defaultdict(list)
    for node, label in enumerate(group):
        points[label].append(graph.nodes[node])
    return {label: Joint(found, np.mean(points[label], axis=0)) for label, found in stubs.items()}


@cache
def pairings(count: int, loose: int) -> tuple[Pairing, ...]:
    """Return every way to pair `count` stubs with at most `loose` left over."""

    def rest(left: tuple[int, ...], spare: int) -> list[Pairing]:
        if not left:
            return [()]
        first, others = left[0], left[1:]
        found = []
        if spare > 0:
            found += rest(others, spare - 1)
        for index, other in enumerate(others):
            remaining = others[:index] + others[index + 1 :]
            found += [((first, other), *more) for more in rest(remaining, spare)]
        return found

    return tuple(rest(tuple(range(count)), loose))


def pair(graph: Graph, joint: Joint, half_width: list[float]) -> None:
    """Pair the stubs of a crossing, and say where that is doubtful."""
    count = len(joint.stubs)
    if count < 2:
        return
    if count == 2:
        first, last = joint.stubs
        joint.partner = {first: last, last: first}
        return
    if count > MOST_STUBS:
        for stub in joint.stubs:
            joint.doubts[stub].append(CLUSTER)
        return
    exits = [
        leaving(graph.branches[index], index, end, half_width[index]) for index, end in joint.stubs
    ]
    costs = np.array([[bending(a, b) for b in exits] for a in exits])
    choices = pairings(count, count % 2 + (2 if count > 3 else 0))
    prices = np.array(
        [
            sum(costs[i, j] for i, j in pairing) + LOOSE * (count - 2 * len(pairing))
            for pairing in choices
        ]
    )
    order = np.argsort(prices)
    best = choices[int(order[0])]
    for i, j in best:
        joint.partner[joint.stubs[i]] = joint.stubs[j]
        joint.partner[joint.stubs[j]] = joint.stubs[i]
    base = LOOSE * (count % 2)
    worth, next_worth = (float(np.sqrt(max(0.0, prices[k] - base))) for k in order[:2])
    least = ODD if count % 2 else 0.0
    unclear = next_worth < max(1.6 * worth + 0.1, least) or ends_meet(graph, joint, half_width)
    note_doubt(joint, costs, best, unclear)


def ends_meet(graph: Graph, joint: Joint, half_width: list[float]) -> bool:
    """Return whether two fibres may just lie with their ends on each other, not cross.

    Short loose ends leave that open, unless what remains is one loop.
    """
    loose = [
        index
        for index, end in joint.stubs
        if graph.branches[index].nodes[1 - end] == FREE
        and graph.branches[index].length < 12.0 * half_width[index]
    ]
    others = [index for index, _ in joint.stubs if index not in loose]
    least = 1 if len(joint.stubs) == 3 else 2
    return len(loose) >= least and len(set(others)) == len(others)


def note_doubt(joint: Joint, costs: Floats, best: Pairing, unclear: bool) -> None:
    """Write down what is doubtful about a crossing."""
    paired = {index for both in best for index in both}
    for index, stub in enumerate(joint.stubs):
        if unclear:
            joint.doubts[stub].append(AMBIGUOUS)
        if index not in paired:
            joint.doubts[stub].append(ON_ANOTHER)
    for i, j in best:
        if costs[i, j] > 0.6:
            joint.doubts[joint.stubs[i]].append(FOLDED)


def follow(
    graph: Graph, at: dict[Stub, Joint], start: Stub, used: set[int], half_width: list[float]
) -> Strand:
    """Return the strand that begins at the end `start` of a branch."""
    parts: list[Floats] = []
    strand = Strand(np.zeros((0, 2)), half_width[start[0]])
    stub: Stub | None = start
    while stub is not None and stub[0] not in used:
        index, end = stub
        used.add(index)
        each = graph.branches[index]
        strand.closed = strand.closed or each.closed
        points = each.points if end == 0 else each.points[::-1]
        exit_stub = (index, 1 - end)
        for side in (stub, exit_stub):
            if side in at:
                strand.doubts += at[side].doubts[side]
        ahead = at[exit_stub].partner.get(exit_stub) if exit_stub in at else None
        if stub in at and stub in at[stub].partner and parts:
            points = trimmed(points, half_width[index], at[stub])
        if ahead is not None:
            points = trimmed(points[::-1], half_width[index], at[exit_stub])[::-1]
            if len(at[exit_stub].stubs) > 2:
                strand.joints.append(at[exit_stub].point)
        parts.append(points)
        stub = ahead
    strand.points = np.concatenate(parts)
    return strand


def trimmed(points: Floats, half_width: float, joint: Joint) -> Floats:
    """Return a branch without its start inside a crossing, where the skeleton is bent."""
    if len(joint.stubs) == 2:
        return points
    s = arc_lengths(points)
    keep = s >= min(1.2 * half_width + 1.0, 0.3 * float(s[-1]))
    return points[keep]
