"""What follows from a scene once and for all: chains of joints, ways, and where pieces reach."""

from functools import cached_property

import numpy as np

from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import Floats, JointKind, SceneModel
from cosmic.mico.core.collision.motion_box import Flags


class Arrangement:
    """Bodies that only slide, and those that turn, worked out from the joints of a scene.

    A body *slides* when no joint between the root and it turns: its pose is then linear in the
    joint values, and distances between two such bodies are convex functions of them.
    """

    def __init__(self, model: SceneModel) -> None:
        self.model = model
        self._start = body_poses(model, np.zeros(len(model.joints)))

    @cached_property
    def chains(self) -> Flags:
        """Which joints carry which body, shape (bodies, joints)."""
        model = self.model
        chains = np.zeros((len(model.bodies), len(model.joints)), dtype=bool)
        for number, joint in enumerate(model.joints):
            child = model.body_number[joint.child]
            chains[child] = chains[model.body_number[joint.parent]]
            chains[child, number] = True
        return chains

    @cached_property
    def turning(self) -> Flags:
        """Which joints turn, shape (joints,)."""
        return np.array([joint.kind is JointKind.REVOLUTE for joint in self.model.joints], bool)

    @cached_property
    def slides(self) -> Flags:
        """Which bodies slide, shape (bodies,)."""
        return np.asarray(~(self.chains & self.turning).any(axis=1))

    @cached_property
    def ways(self) -> Floats:
        """World direction of every joint at value 0, shape (joints, 3); zero for fixed ones."""
        ways = np.zeros((len(self.model.joints), 3))
        for number, joint in enumerate(self.model.joints):
            if joint.kind is not JointKind.FIXED:
                child = self.model.body_number[joint.child]
                ways[number] = self._start[child][:3, :3] @ joint.axis
        return ways

    @cached_property
    def steady(self) -> Flags:
        """Joints whose direction is the same whatever the others do, shape (joints,)."""
        parents = [self.model.body_number[joint.parent] for joint in self.model.joints]
        return np.asarray(self.slides[parents])

    @cached_property
    def shifts(self) -> Floats:
        """How the place of each body follows the sliding joints, shape (bodies, 3, joints)."""
        sliding = self.chains & ~self.turning
        return np.asarray(sliding[:, np.newaxis, :] * self.ways.T[np.newaxis, :, :])

    @cached_property
    def places(self) -> Floats:
        """Where the bodies stand with all joints at 0, shape (bodies, 3)."""
        return self._start[:, :3, 3].copy()

    @cached_property
    def rotations(self) -> list[Floats]:
        """How the bodies are turned with all joints at 0."""
        return [np.ascontiguousarray(pose[:3, :3]) for pose in self._start]

    def poses(self, values: Floats) -> tuple[list[Floats], Floats]:
        """Return rotations and places, shape (bodies, 3), of all bodies at joint `values`."""
        places = self.places + self.shifts @ values
        if self.slides.all():
            return self.rotations, places
        whole = body_poses(self.model, values)
        rotations = list(self.rotations)
        for body in np.flatnonzero(~self.slides):
            rotations[body] = np.ascontiguousarray(whole[body][:3, :3])
            places[body] = whole[body][:3, 3]
        return rotations, places
