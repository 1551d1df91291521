"""Where bodies stand, worked out a second time with scipy's rotations."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from cosmic.mico.core.collision.model import JointKind, SceneModel


def joint_values(model: SceneModel, positions: Mapping[str, float]) -> dict[str, float]:
    """Return joint values with the axes at `positions`, 0 where none is told."""
    return {d.joint: d.offset + d.factor * positions.get(d.axis, 0.0) for d in model.drives}


def place(
    model: SceneModel, values: Mapping[str, float]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return rotation matrix and place of every body at joint values."""
    stands = {model.bodies[0]: (Rotation.identity(), np.zeros(3))}
    for joint in model.joints:
        turn, origin = stands[joint.parent]
        origin = turn.apply(joint.parent_from_child[:3, 3]) + origin
        turn = turn * Rotation.from_matrix(joint.parent_from_child[:3, :3])
        value = values.get(joint.name, 0.0)
        if joint.kind is JointKind.PRISMATIC:
            origin = origin + turn.apply(value * np.asarray(joint.axis))
        elif joint.kind is JointKind.REVOLUTE:
            turn = turn * Rotation.from_rotvec(value * np.asarray(joint.axis))
        stands[joint.child] = (turn, origin)
    return {name: (turn.as_matrix(), origin) for name, (turn, origin) in stands.items()}


def world_pieces(model: SceneModel, positions: Mapping[str, float]) -> list[np.ndarray]:
    """Return the vertices of all pieces in the world with the axes at `positions`."""
    stands = place(model, joint_values(model, positions))
    return [
        piece.vertices_um @ stands[piece.body][0].T + stands[piece.body][1]
        for piece in model.pieces
    ]
