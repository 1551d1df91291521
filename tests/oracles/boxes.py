"""Random joint boxes of two convex bodies on random chains of joints."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cosmic.mico.core.collision.model import JointKind, SceneModel, Shape

from .convex import distance, swept
from .kinematics import joint_values, place, world_pieces
from .scenes import Builder, X, Y, Z, box_points, hull_shape

MARGIN_UM = 5.0


@dataclass(frozen=True)
class BoxCase:
    """Two bodies, where every axis stands, and from where to where it may go."""

    model: SceneModel
    start: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]

    @property
    def slides(self) -> bool:
        """Whether no joint turns."""
        return all(joint.kind is JointKind.PRISMATIC for joint in self.model.joints)

    def shrunk(self, share: float) -> "BoxCase":
        """Return the case with `share` of the ways from the start."""
        low = {axis: here + share * (self.low[axis] - here) for axis, here in self.start.items()}
        high = {axis: here + share * (self.high[axis] - here) for axis, here in self.start.items()}
        return BoxCase(self.model, self.start, low, high)

    @property
    def still(self) -> bool:
        """Whether the box is a single pose."""
        return self.low == self.high

    @property
    def within_travel(self) -> bool:
        """Whether no axis would have to go beyond its stops."""
        travels = {axis: self.model.travel(axis) for axis in self.start}
        return all(
            low <= self.low[axis] and self.high[axis] <= high
            for axis, (low, high) in travels.items()
        )

    def gap_um(self, positions: dict[str, float]) -> float:
        """Return the exact distance with the axes at `positions`."""
        one, other = world_pieces(self.model, positions)
        return distance(one, other)

    def exact_um(self) -> float:
        """Return the least distance in the whole box; only where nothing turns."""
        one, other = world_pieces(self.model, self.low)
        ways = [np.zeros((3, 0)), np.zeros((3, 0))]
        widths: list[list[float]] = [[], []]
        for axis in self.low:
            there = world_pieces(self.model, {**self.low, axis: self.high[axis]})
            for number, at in enumerate((one, other)):
                shift = there[number][0] - at[0]
                if np.abs(shift).max() > 0.0:
                    ways[number] = np.column_stack((ways[number], shift))
                    widths[number].append(1.0)
        # The second against the first: only the difference of the two shifts counts.
        both = np.column_stack((-ways[0], ways[1]))
        count = both.shape[1]
        return distance(one, swept(other, both, np.zeros(count), np.ones(count)))

    def sampled_um(self, rng: np.random.Generator, count: int) -> float:
        """Return the least distance found at random places, at corners, and near the best."""
        axes = list(self.low)
        low = np.array([self.low[axis] for axis in axes])
        wide = np.array([self.high[axis] for axis in axes]) - low
        shares = rng.random((count, len(axes)))
        shares[: count // 4] = rng.integers(0, 2, (count // 4, len(axes)))
        best, where = math.inf, shares[0]
        for share in shares:
            gap = self.gap_um(dict(zip(axes, low + wide * share, strict=True)))
            if gap < best:
                best, where = gap, share
        size = 0.2
        for _ in range(count // 2):
            share = np.clip(where + size * rng.normal(size=len(axes)), 0.0, 1.0)
            gap = self.gap_um(dict(zip(axes, low + wide * share, strict=True)))
            if gap < best:
                best, where = gap, share
            else:
                size = max(1e-4, 0.93 * size)
        return best


def random_points(rng: np.random.Generator) -> np.ndarray:
    """Return the points of a needle, a sheet, a block, a crumb or a slanting one of them."""
    size = np.array(
        [
            (50.0, 100.0, 6000.0),
            (10.0, 10.0, 3000.0),
            (2000.0, 2000.0, 10.0),
            (1500.0, 1000.0, 800.0),
            (10.0, 10.0, 10.0),
        ][int(rng.integers(5))]
    )
    if rng.random() < 0.5:
        points = box_points(-size / 2.0, size / 2.0)
    else:
        points = rng.normal(size=(int(rng.choice((4, 8, 20))), 3)) * size / 3.0
    if rng.random() < 0.4:
        points = points @ Rotation.random(random_state=rng).as_matrix().T
    return points


def cases(
    seed: int, count: int, *, turning: float, axes: tuple[int, int] = (2, 8)
) -> Iterator[BoxCase]:
    """Yield random cases; `turning` is the share of joints that turn."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield _case(rng, turning, int(rng.integers(axes[0], axes[1] + 1)))


def _case(rng: np.random.Generator, turning: float, count: int) -> BoxCase:
    build = Builder()
    ends = {"one": "base", "other": "base"}
    start, low, high = {}, {}, {}
    width = float(rng.choice((30.0, 300.0, 1500.0)))
    for number in range(count):
        side = "other" if number % 2 else "one"
        turns = bool(rng.random() < turning)
        name, axis = f"{side}{number}", f"{side}.{number}"
        way = np.array((X, Y, Z)[int(rng.integers(3))])
        if rng.random() < 0.3:
            way = rng.normal(size=3)
            way /= np.linalg.norm(way)
        turned = Rotation.random(random_state=rng) if rng.random() < 0.3 else None
        offset = rng.uniform(-1.0, 1.0, 3) * (1500.0 if turns else 200.0)
        travel = (-math.pi, math.pi) if turns else (-9000.0, 9000.0)
        build.body(
            name, ends[side], way.tolist(), axis=axis, turns=turns, travel=travel,
            place=offset.tolist(), turned=turned,
        )  # fmt: skip
        ends[side] = name
        reach = 90.0 * width / 1500.0 if turns else width
        low[axis] = float(rng.uniform(-reach, 0.0))
        high[axis] = float(rng.uniform(0.0, reach)) if rng.random() < 0.9 else low[axis]
        start[axis] = float(rng.uniform(low[axis], high[axis]))
    build.piece(ends["one"], random_points(rng))
    build.piece(ends["other"], random_points(rng))
    pair = [(ends["one"], ends["other"])]
    model = build.model(pair, MARGIN_UM)
    apart = float(rng.choice((0.0, 2.0, 6.0, 50.0, 400.0)))
    build.pieces[1] = _beside(rng, model, start, apart)
    return BoxCase(build.model(pair, MARGIN_UM), start, low, high)


def _beside(
    rng: np.random.Generator, model: SceneModel, start: dict[str, float], apart_um: float
) -> Shape:
    """Return the second piece put `apart_um` beside the first, in a random direction."""
    one, other = world_pieces(model, start)
    other = other - other.mean(axis=0) + one.mean(axis=0)
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    near, far = 0.0, 20_000.0
    for _ in range(45):
        middle = (near + far) / 2.0
        if distance(one, other + middle * way) > apart_um:
            far = middle
        else:
            near = middle
    piece = model.pieces[1]
    turn, origin = place(model, joint_values(model, start))[piece.body]
    # Nothing between them: half of that is driven into each other.
    shift = 0.5 * near if apart_um == 0.0 else far
    return hull_shape(piece.name, piece.body, (other + shift * way - origin) @ turn)
