"""Small scenes of boxes, made without any file."""

import math
from collections.abc import Iterable

import numpy as np

from cosmic.mico.core.collision.model import (
    Drive,
    Joint,
    JointKind,
    SceneModel,
    Shape,
    WatchedPair,
    pair_of,
)

_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ],
    dtype=np.int32,
)  # fmt: skip


def box(body: str, low: Iterable[float], high: Iterable[float], name: str = "") -> Shape:
    """A box between two corners in the frame of `body`, um."""
    corners = np.array(
        [
            [x, y, z]
            for x, y, z in np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij"))
            .reshape(3, -1)
            .T
        ]
    )
    return Shape(name or body, body, corners, _FACES)


def joint(
    child: str,
    parent: str = "base",
    way: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    turns: bool = False,
    travel: tuple[float, float] = (-6000.0, 6000.0),
) -> Joint:
    """A joint named after its child; fixed where no way is given."""
    origin = np.eye(4)
    origin[:3, 3] = place
    kind = JointKind.REVOLUTE if turns else JointKind.PRISMATIC if any(way) else JointKind.FIXED
    axis = np.array(way, dtype=float)
    low, high = travel if any(way) else (0.0, 0.0)
    return Joint(child, kind, parent, child, origin, axis, low, high)


def drive(axis: str, joint_name: str, *, turns: bool = False, **more: float) -> Drive:
    """The axis drives the joint one to one; degrees to radians where it turns."""
    return Drive(axis, joint_name, math.radians(1.0) if turns else 1.0, 0.0, **more)


def scene(
    joints: list[Joint],
    pieces: list[Shape],
    drives: list[Drive],
    pairs: list[tuple[str, str]],
    margin_um: float = 5.0,
) -> SceneModel:
    """A scene whose bodies are the base and the children of `joints`."""
    return SceneModel(
        name="small",
        bodies=("base", *(each.child for each in joints)),
        joints=tuple(joints),
        pieces=tuple(pieces),
        views=tuple(pieces),
        drives=tuple(drives),
        pairs=tuple(WatchedPair(pair_of(*pair), margin_um) for pair in pairs),
    )


def arm(
    name: str, tip: Iterable[float], size: Iterable[float]
) -> tuple[list[Joint], Shape, list[Drive]]:
    """Three stages in a row, x, y, z, that carry one box: `name.x` and so on."""
    ways = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    joints, parent = [], "base"
    for letter, way in ways.items():
        joints.append(joint(f"{name}_{letter}", parent, way))
        parent = f"{name}_{letter}"
    low = np.array(list(tip))
    piece = box(parent, low, low + np.array(list(size)), name)
    return joints, piece, [drive(f"{name}.{letter}", f"{name}_{letter}") for letter in ways]


def two_arms(margin_um: float = 5.0) -> SceneModel:
    """Two arms that face each other along x, tips 2000 um apart, a plate 1000 um below."""
    left_joints, left, left_drives = arm("left", (-4000.0, -50.0, 0.0), (3000.0, 100.0, 50.0))
    right_joints, right, right_drives = arm("right", (1000.0, -50.0, 0.0), (3000.0, 100.0, 50.0))
    plate = box("base", (-8000.0, -8000.0, -2000.0), (8000.0, 8000.0, -1000.0), "plate")
    return scene(
        [*left_joints, *right_joints],
        [left, right, plate],
        [*left_drives, *right_drives],
        [("left_z", "right_z"), ("left_z", "base"), ("right_z", "base")],
        margin_um,
    )


def turntable(margin_um: float = 5.0) -> SceneModel:
    """A bar that turns about the z axis under an arm that comes down beside it."""
    joints, piece, drives = arm("left", (2000.0, -50.0, 0.0), (3000.0, 100.0, 50.0))
    bar = box("bar", (-3000.0, -100.0, -500.0), (3000.0, 100.0, -100.0))
    turning = joint("bar", way=(0.0, 0.0, 1.0), turns=True, travel=(-math.pi, math.pi))
    return scene(
        [*joints, turning],
        [piece, bar],
        [*drives, drive("table.rotation", "bar", turns=True)],
        [("left_z", "bar")],
        margin_um,
    )
