"""What moves in a scene, where it ends, and from where that is looked at best."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.mico.core.collision.model import Floats, JointKind, SceneModel
from cosmic.mico.gui.scene.camera import Sight
from cosmic.mico.gui.scene.meshes import BodyMesh, poses_mm

_FOREMOST: Final = 0.02


@dataclass(frozen=True)
class End:
    """A body at the end of a chain of driven joints.

    Attributes
    ----------
    arm : str
        What the axis that moves it is called up to the dot, such as "left".
    travels : bool
        It is carried somewhere, not only turned about itself.
    """

    body: str
    arm: str
    travels: bool


def moving_ends(model: SceneModel) -> tuple[End, ...]:
    """Return the last bodies of every chain of driven joints: jaws, probes, plates."""
    axis_of = {drive.joint: drive.axis for drive in model.drives}
    chains: dict[str, tuple[str, ...]] = {model.bodies[0]: ()}
    kinds: dict[str, frozenset[JointKind]] = {model.bodies[0]: frozenset()}
    for joint in model.joints:
        own = (joint.name,) if joint.name in axis_of else ()
        chains[joint.child] = chains[joint.parent] + own
        kinds[joint.child] = kinds[joint.parent] | ({joint.kind} if own else set())
    goes_on = {joint.parent for joint in model.joints}
    return tuple(
        End(body, axis_of[chain[-1]].split(".")[0], JointKind.PRISMATIC in kinds[body])
        for body, chain in chains.items()
        if chain and body not in goes_on
    )


def tips_mm(
    model: SceneModel, meshes: Mapping[str, BodyMesh], bodies: Sequence[str]
) -> dict[str, Floats]:
    """Return the tip of each body that has a mesh, shape (3,), mm, in the frame of the body.

    The tip is the centroid of its vertices that lie farthest from the body that carries it (the
    nearest one before it that is drawn), within 2 % of its length that way, all axes at 0.
    """
    poses = dict(zip(model.bodies, poses_mm(model, {}), strict=True))
    parent = {joint.child: joint.parent for joint in model.joints}
    found: dict[str, Floats] = {}
    for body in bodies:
        if body not in meshes:
            continue
        carrier = parent.get(body)
        while carrier is not None and carrier not in meshes:
            carrier = parent.get(carrier)
        away = _middle(meshes[body], poses[body])
        away -= poses[body][:3, 3] if carrier is None else _middle(meshes[carrier], poses[carrier])
        found[body] = _foremost(meshes[body], away @ poses[body][:3, :3])
    return found


def _middle(mesh: BodyMesh, pose: Floats) -> Floats:
    low, high = mesh.bounds_mm
    return np.asarray(pose[:3, :3] @ ((low + high) / 2.0) + pose[:3, 3])


def _foremost(mesh: BodyMesh, heading: Floats) -> Floats:
    along = mesh.vertices_mm @ heading
    reach = float(along.max() - along.min())
    return np.asarray(mesh.vertices_mm[along >= along.max() - _FOREMOST * reach].mean(axis=0))


@dataclass(frozen=True)
class Preset:
    """A place to look from.

    Attributes
    ----------
    bodies : tuple of str
        Whose tips are to be seen.
    close : bool
        Nearer than it takes to see all of the bodies.
    """

    name: str
    text: str
    tip: str
    bodies: tuple[str, ...]
    azimuth_deg: float
    elevation_deg: float
    close: bool = False


def presets(model: SceneModel) -> tuple[Preset, ...]:
    """Return the places to look from: the working area from four sides, and each tip."""
    ends = moving_ends(model)
    travelling = tuple(end.body for end in ends if end.travels)
    bodies = travelling or tuple(end.body for end in ends) or model.bodies
    found = [
        Preset("home", "Home", "The working area at an angle", bodies, -62.0, 30.0),
        Preset("top", "Top", "The working area from above", bodies, -90.0, 90.0),
        Preset("front", "Front", "The working area from the front", bodies, -90.0, 0.0),
        Preset("side", "Side", "The working area from the right", bodies, 0.0, 0.0),
    ]
    for arm in dict.fromkeys(end.arm for end in ends if end.travels):
        own = tuple(end.body for end in ends if end.arm == arm)
        text, tip = arm.capitalize(), f"Close-up of the tips: {', '.join(own)}"
        found.append(Preset(arm, text, tip, own, -62.0, 25.0, close=True))
    return tuple(found)


def sight_of(
    preset: Preset,
    tips: Mapping[str, Floats],
    poses: Mapping[str, Floats],
    meshes: Mapping[str, BodyMesh],
) -> Sight:
    """Return where the camera of `preset` stands with the bodies at `poses` (mm)."""
    points = [
        poses[body][:3, :3] @ tips[body] + poses[body][:3, 3]
        for body in preset.bodies
        if body in tips
    ]
    if not points:
        points = [
            poses[mesh.body][:3, :3] @ corner + poses[mesh.body][:3, 3]
            for mesh in meshes.values()
            for corner in mesh.bounds_mm
        ] or [np.zeros(3)]
    cloud = np.array(points)
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    spread = float(np.linalg.norm(high - low)) / 2.0
    radius = max(2.0 * spread, _size(preset, meshes))
    x, y, z = (float(value) for value in (low + high) / 2.0)
    return Sight((x, y, z), radius, preset.azimuth_deg, preset.elevation_deg)


def _size(preset: Preset, meshes: Mapping[str, BodyMesh]) -> float:
    """Return the least radius in which a tip is recognised: a share of the bodies' sizes."""
    sizes = [
        float(np.linalg.norm(np.subtract(*reversed(meshes[body].bounds_mm))))
        for body in preset.bodies
        if body in meshes
    ]
    if not sizes:
        return 1.0
    return max((0.35 if preset.close else 2.0) * float(np.median(sizes)), 0.5)
