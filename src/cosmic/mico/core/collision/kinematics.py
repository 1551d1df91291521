"""Forward kinematics of the scene in numpy."""

import numpy as np

from cosmic.mico.core.collision.model import Floats, Joint, JointKind, SceneModel


def rotation(axis: Floats, angle_rad: float) -> Floats:
    """Return the rotation matrix, shape (3, 3), of a turn about the unit vector `axis`."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(
        np.eye(3) + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * cross @ cross
    )


def joint_motion(joint: Joint, value: float) -> Floats:
    """Return how far `joint` carries its child from where it stands at 0, shape (4, 4)."""
    motion = np.eye(4)
    if joint.kind is JointKind.PRISMATIC:
        motion[:3, 3] = joint.axis * value
    elif joint.kind is JointKind.REVOLUTE:
        motion[:3, :3] = rotation(joint.axis, value)
    return motion


def body_poses(model: SceneModel, values: Floats) -> Floats:
    """Return `world_from_body` of every body, shape (bodies, 4, 4), um.

    Parameters
    ----------
    values : ndarray, shape (joints,), float64
        Joint values, um or rad; see `SceneModel.joint_values`.
    """
    poses = np.empty((len(model.bodies), 4, 4))
    poses[0] = np.eye(4)
    for number, joint in enumerate(model.joints):
        parent = poses[model.body_number[joint.parent]]
        poses[number + 1] = parent @ joint.parent_from_child @ joint_motion(joint, values[number])
    return poses
