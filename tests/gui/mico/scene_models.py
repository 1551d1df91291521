"""A small platform made by hand for the tests of the scene: two arms and a plate that turns."""

import numpy as np

from cosmic.mico.core.collision.model import (
    Drive,
    Joint,
    JointKind,
    SceneModel,
    Shape,
)

GLASS = (0.7, 0.85, 0.9, 0.4)


def box(name, body, low_um, high_um, colour=(0.7, 0.7, 0.7, 1.0)):
    """A box from corner to corner, in the frame of its body."""
    ends = np.array([low_um, high_um], dtype=float)
    vertices = np.array(
        [[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    faces = [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    return Shape(name, body, vertices, np.array(faces, dtype=np.int32), colour)


def joint(parent, child, kind=JointKind.FIXED, axis=(1.0, 0.0, 0.0), at_um=(0.0, 0.0, 0.0)):
    place = np.eye(4)
    place[:3, 3] = at_um
    return Joint(child, kind, parent, child, place, np.array(axis), -1e5, 1e5)


def two_arms():
    """A frame, a plate that turns at the origin, and two arms of three axes with a jaw each.

    The jaws end 4 mm left and right of the origin, 2 mm above the plate.
    """
    bodies, joints, views = ["frame", "plate"], [], []
    views.append(box("frame", "frame", (-90e3, 60e3, -50e3), (90e3, 80e3, 50e3)))
    joints.append(joint("frame", "plate", JointKind.REVOLUTE, (0.0, 0.0, 1.0)))
    views.append(box("plate", "plate", (-12e3, -8e3, -1e3), (12e3, 8e3, 0.0), GLASS))
    drives = [Drive("table.rotation", "plate", np.pi / 180.0, 0.0)]
    for arm, sign in (("left", -1.0), ("right", 1.0)):
        parent = "frame"
        for letter, axis in zip("xyz", np.eye(3), strict=True):
            child = f"{arm}_{letter}"
            at_um = (sign * 30e3, 0.0, 0.0) if letter == "x" else (0.0, 0.0, 0.0)
            joints.append(joint(parent, child, JointKind.PRISMATIC, tuple(axis), at_um))
            drives.append(Drive(f"{arm}.{letter}", child, 1.0, 0.0))
            bodies.append(child)
            parent = child
        views.append(box("carriage", parent, (-5e3, -5e3, -5e3), (5e3, 5e3, 5e3)))
        ends = sorted((-sign * 5e3, -sign * 26e3))
        jaw = f"{arm}_jaw"
        joints.append(joint(parent, jaw))
        bodies.append(jaw)
        views.append(box("jaw", jaw, (ends[0], -250.0, 2e3), (ends[1], 250.0, 2.5e3)))
    order = {name: number for number, name in enumerate(bodies)}
    joints.sort(key=lambda each: order[each.child])
    return SceneModel("two arms", tuple(bodies), tuple(joints), (), tuple(views), tuple(drives), ())
