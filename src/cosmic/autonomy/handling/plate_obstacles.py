"""What stands on the plate beside samples, such as its clip: no jaw comes down over it."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import NotAvailable
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import JointKind, SceneModel

ROOM_UM: Final = 300.0
"""Jaws keep off by so much: a fibre is tested, shaken and wiped off some way beside its place."""


def plate_obstacles(mico: Mico) -> tuple[Floats, ...]:
    """Return the corners, from above, of all that stands on the plate, each of shape (n, 2), um.

    Each is convex, and in the frame of the plate. Empty where the scene names no plate, or there is
    none.

    Raises
    ------
    CosmicError
        The station of the axes does not answer.
    """
    if not mico.checks_collisions:
        return ()
    try:
        scene = mico.collision.scene
    except NotAvailable:  # that of a station, which is on its way
        scene = mico.scene()
    poses = body_poses(scene, scene.joint_values({}))
    standing = _bodies_on_plate(scene)
    return tuple(
        np.unique(piece.vertices_um @ pose[:2, :3].T + pose[:2, 3], axis=0)
        for piece in scene.pieces
        if piece.body in standing
        for pose in (poses[scene.body_number[piece.body]],)
    )


def _bodies_on_plate(scene: SceneModel) -> set[str]:
    """Return the bodies that are firmly joined to the plate, without itself."""
    firm = {scene.plate}
    for joint in scene.joints:  # parents come before their children
        if joint.kind is JointKind.FIXED and joint.parent in firm:
            firm.add(joint.child)
    return firm - {scene.plate}


def any_under(obstacles_um: Sequence[Floats], low_um: Floats, high_um: Floats) -> bool:
    """Return whether an obstacle lies under a rectangle along x and y.

    Parameters
    ----------
    obstacles_um : sequence of ndarray, shape (n, 2)
        Corners of convex ones, on the platform.
    low_um, high_um : ndarray, shape (2,)
        Corners of the rectangle.
    """
    corners = np.array([[x, y] for x in (low_um[0], high_um[0]) for y in (low_um[1], high_um[1])])
    return any(_overlap(each, corners) for each in obstacles_um)


def _overlap(obstacle: Floats, corners: Floats) -> bool:
    """Return whether two convex shapes overlap: no line along a side of one is between them."""
    # Among all lines through two corners are those along the sides.
    between = (obstacle[:, None] - obstacle).reshape(-1, 2)
    across = np.concatenate([np.column_stack([-between[:, 1], between[:, 0]]), np.eye(2)])
    one, other = obstacle @ across.T, corners @ across.T
    apart = (one.max(axis=0) < other.min(axis=0)) | (other.max(axis=0) < one.min(axis=0))
    return not apart.any()
