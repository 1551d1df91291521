"""Whether convex solids overlap, by planes between them; independent of the gate's library."""

from typing import Final

import numpy as np

from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import BodyPair, Floats, SceneModel

_NEAR: Final = 1e-12


def solid_gap_um(one_um: Floats, other_um: Floats) -> float:
    """Return a gap that is surely between two convex solids; 0 or less where they overlap.

    Parameters
    ----------
    one_um, other_um : ndarray, shape (n, 3), float64, um
        Corners of the two, in one frame.

    Notes
    -----
    The plane is looked for by a linear programme; the gap along its normal is then measured at
    the corners themselves, so that no tolerance of the solver can make a gap. The gap is not the
    distance, but at least 0.57 of it.
    """
    middle = (one_um.mean(axis=0) + other_um.mean(axis=0)) / 2.0
    one, other = one_um - middle, other_um - middle
    size = max(float(np.abs(one).max()), float(np.abs(other).max()))
    best = _gap_of_boxes(one, other)
    if best > 0.0:
        # Far apart along an axis of the world: seldom much more along any other direction.
        found = _normal(one / size, other / size)
        return best if found is None else max(best, _gap(one, other, found))
    found = _normal(one / size, other / size)
    return 0.0 if found is None else _gap(one, other, found)


def solids_overlap(one_um: Floats, other_um: Floats) -> bool:
    """Return True where no plane is found between two convex solids, given by their corners."""
    if _gap_of_boxes(one_um, other_um) > 0.0:
        return False
    return not solid_gap_um(one_um, other_um) > 0.0


def placed_corners(model: SceneModel, positions: dict[str, float]) -> list[Floats]:
    """Return the corners of every piece of `model` in the world, um, with the axes somewhere."""
    poses = body_poses(model, model.joint_values(positions))
    corners = []
    for piece in model.pieces:
        pose = poses[model.body_number[piece.body]]
        corners.append(np.asarray(piece.vertices_um @ pose[:3, :3].T + pose[:3, 3]))
    return corners


def overlapping_pairs(model: SceneModel, positions: dict[str, float]) -> list[BodyPair]:
    """Return the watched pairs that overlap or touch with the axes at `positions`."""
    return [pair for pair, gap_um in close_pairs(model, positions, 0.0) if not gap_um > 0.0]


def close_pairs(
    model: SceneModel, positions: dict[str, float], within_um: float | None = None
) -> list[tuple[BodyPair, float]]:
    """Return the watched pairs whose gap may be within `within_um`, and a gap that is sure.

    Without `within_um` each pair is asked for its own margin.
    """
    if not model.pieces:
        return []
    corners = placed_corners(model, positions)
    lows = np.array([each.min(axis=0) for each in corners])
    highs = np.array([each.max(axis=0) for each in corners])
    of_body: dict[str, list[int]] = {}
    for number, piece in enumerate(model.pieces):
        of_body.setdefault(piece.body, []).append(number)
    found = []
    for watched in model.pairs:
        near_um = watched.margin_um if within_um is None else within_um
        ones, others = (of_body.get(body, []) for body in watched.bodies)
        gaps = [
            solid_gap_um(corners[one], corners[other])
            for one in ones
            for other in others
            if (lows[one] - near_um <= highs[other]).all()
            and (lows[other] - near_um <= highs[one]).all()
        ]
        if gaps and min(gaps) <= near_um:
            found.append((watched.bodies, min(gaps)))
    return found


def _gap(one: Floats, other: Floats, normal: Floats) -> float:
    return float((other @ normal).min() - (one @ normal).max())


def _gap_of_boxes(one: Floats, other: Floats) -> float:
    below = other.min(axis=0) - one.max(axis=0)
    above = one.min(axis=0) - other.max(axis=0)
    return float(np.maximum(below, above).max())


def _normal(one: Floats, other: Floats) -> Floats | None:
    """Return the unit normal with the widest gap, measured by its largest component."""
    # Half a second to load, and bodies that stand well apart never need it.
    from scipy.optimize import linprog

    # Unknowns: normal (3), a level, the gap. Maximise the gap with
    # one @ normal <= level and other @ normal >= level + gap.
    above = np.hstack((one, np.full((len(one), 1), -1.0), np.zeros((len(one), 1))))
    below = np.hstack((-other, np.ones((len(other), 1)), np.ones((len(other), 1))))
    rows = np.vstack((above, below))
    answer = linprog(
        [0.0, 0.0, 0.0, 0.0, -1.0],
        A_ub=rows,
        b_ub=np.zeros(len(rows)),
        bounds=[(-1.0, 1.0)] * 3 + [(None, None), (0.0, None)],
        method="highs",
    )
    if not answer.success:
        return None
    length = float(np.linalg.norm(answer.x[:3]))
    return np.asarray(answer.x[:3] / length) if length > _NEAR else None
