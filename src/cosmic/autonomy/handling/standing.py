"""What stands on the plate beside samples, such as its clip: no jaw comes down over it."""

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from cosmic.frame.errors import NotAvailable
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import JointKind, SceneModel
from cosmic.vico.core.pixel_map import Floats

ROOM_UM: Final = 300.0
"""Jaws keep off by so much: a fibre is tested, shaken and wiped off some way beside its place."""


def standing_on_plate(mico: Mico) -> tuple[Floats, ...]:
    """Return the outline from above of all that stands on the plate, each of shape (n, 2), um.

    They are convex, and in the frame of the plate. Empty where the scene names no plate, or there
    is none.

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
    found = []
    for piece in scene.pieces:
        if piece.body in _firm_on_plate(scene):
            pose = poses[scene.body_number[piece.body]]
            corners = piece.vertices_um @ pose[:2, :3].T + pose[:2, 3]
            hull = cv2.convexHull(corners.astype(np.float32))
            found.append(np.asarray(hull[:, 0], dtype=np.float64))
    return tuple(found)


def _firm_on_plate(scene: SceneModel) -> set[str]:
    """Return the bodies that are firmly joined to the plate, without itself."""
    firm = {scene.plate}
    for joint in scene.joints:  # parents come before their children
        if joint.kind is JointKind.FIXED and joint.parent in firm:
            firm.add(joint.child)
    return firm - {scene.plate}


def any_under(outlines_um: Sequence[Floats], low_um: Floats, high_um: Floats) -> bool:
    """Return whether something lies under a rectangle along x and y.

    Parameters
    ----------
    outlines_um : sequence of ndarray, shape (n, 2)
        Convex, on the platform.
    low_um, high_um : ndarray, shape (2,)
        Corners of the rectangle.
    """
    corners = np.array([[x, y] for x in (low_um[0], high_um[0]) for y in (low_um[1], high_um[1])])
    return any(_overlap(each, corners) for each in outlines_um)


def _overlap(outline: Floats, corners: Floats) -> bool:
    """Return whether two convex shapes overlap: no line along a side of one is between them."""
    sides = np.roll(outline, -1, axis=0) - outline
    across = np.concatenate([np.column_stack([-sides[:, 1], sides[:, 0]]), np.eye(2)])
    one, other = outline @ across.T, corners @ across.T
    apart = (one.max(axis=0) < other.min(axis=0)) | (other.max(axis=0) < one.min(axis=0))
    return not apart.any()
