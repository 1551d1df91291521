"""What follows from a scene once and for all: chains of joints, ways, and where bodies stand."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import Floats, JointKind, SceneModel
from cosmic.mico.core.collision.motion_box import Flags


@dataclass(frozen=True, eq=False)
class Turned:
    """All bodies with the turning joints at certain angles.

    Attributes
    ----------
    rotations : list of ndarray, shape (3, 3)
        How the bodies are turned.
    places : ndarray, shape (bodies, 3), um
        Where they stand with all sliding joints at 0.
    shifts : ndarray, shape (bodies, 3, joints), um/um
        How the places follow the sliding joints.
    """

    rotations: list[Floats]
    places: Floats
    shifts: Floats

    def places_at(self, values: Floats) -> Floats:
        """Return the place of every body, shape (bodies, 3), at joint `values`."""
        return np.asarray(self.places + self.shifts @ values)


class Arrangement:
    """Bodies that only slide, and those that turn, worked out from the joints of a scene.

    A body *slides* when no joint between the root and it turns: its pose is then linear in the
    joint values, and distances between two such bodies are convex functions of them.
    """

    def __init__(self, model: SceneModel) -> None:
        self.model = model
        self._start = body_poses(model, np.zeros(len(model.joints)))
        self.child = [model.body_number[joint.child] for joint in model.joints]
        self._parent = [model.body_number[joint.parent] for joint in model.joints]
        self._step = [
            (np.ascontiguousarray(j.parent_from_child[:3, :3]), j.parent_from_child[:3, 3].copy())
            for j in model.joints
        ]
        self._cross = [cross_matrix(joint.axis) for joint in model.joints]
        self._squared = [cross @ cross for cross in self._cross]
        self._turning_joints = np.flatnonzero(self.turning)
        self._late_joints = [
            number for number, child in enumerate(self.child) if not self.slides[child]
        ]
        rotations = [np.ascontiguousarray(pose[:3, :3]) for pose in self._start]
        sliding = self.chains & ~self.turning
        shifts = sliding[:, np.newaxis, :] * self.slide_axes.T[np.newaxis, :, :]
        self._zero = Turned(rotations, self._start[:, :3, 3].copy(), np.asarray(shifts))
        self._last = (np.zeros(self._turning_joints.size).tobytes(), self._zero)

    @cached_property
    def chains(self) -> Flags:
        """Which joints carry which body, shape (bodies, joints)."""
        model = self.model
        chains = np.zeros((len(model.bodies), len(model.joints)), dtype=bool)
        for number, child in enumerate(self.child):
            chains[child] = chains[self._parent[number]]
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
    def slide_axes(self) -> Floats:
        """World direction of every joint at value 0, shape (joints, 3); zero for fixed ones."""
        slide_axes = np.zeros((len(self.model.joints), 3))
        for number, joint in enumerate(self.model.joints):
            if joint.kind is not JointKind.FIXED:
                slide_axes[number] = self._start[self.child[number]][:3, :3] @ joint.axis
        return slide_axes

    @cached_property
    def steady(self) -> Flags:
        """Joints whose direction is the same whatever the others do, shape (joints,)."""
        return np.asarray(self.slides[self._parent])

    @cached_property
    def swings(self) -> Flags:
        """Joints that turn, and those whose direction turns, shape (joints,)."""
        return np.asarray(self.turning | ~self.steady)

    @property
    def shifts(self) -> Floats:
        """How the places follow the sliding joints with the turning ones at 0."""
        return self._zero.shifts

    def turned(self, values: Floats) -> Turned:
        """Return all bodies with the turning joints at `values`; the last ones are kept."""
        key = values[self._turning_joints].tobytes()
        if key != self._last[0]:
            self._last = (key, self._turn(values))
        return self._last[1]

    def _turn(self, values: Floats) -> Turned:
        rotations = list(self._zero.rotations)
        places, shifts = self._zero.places.copy(), self._zero.shifts.copy()
        for number in self._late_joints:
            child, parent = self.child[number], self._parent[number]
            rotations[child], places[child] = self._onwards(
                number, float(values[number]), rotations[parent], places[parent], slides=False
            )
            shifts[child] = shifts[parent]
            if self.model.joints[number].kind is JointKind.PRISMATIC:
                shifts[child, :, number] = rotations[child] @ self.model.joints[number].axis
        return Turned(rotations, places, shifts)

    def _onwards(
        self, number: int, value: float, rotation: Floats, place: Floats, *, slides: bool
    ) -> tuple[Floats, Floats]:
        """Return where the child of a joint stands, from where its parent does."""
        turn, shift = self._step[number]
        kind = self.model.joints[number].kind
        place = place + rotation @ shift
        rotation = rotation @ turn
        if kind is JointKind.REVOLUTE:
            sine, cosine = np.sin(value), np.cos(value)
            motion = sine * self._cross[number] + (1.0 - cosine) * self._squared[number]
            rotation = rotation + rotation @ motion
        elif slides and kind is JointKind.PRISMATIC:
            place = place + rotation @ self.model.joints[number].axis * value
        return rotation, place

    @cached_property
    def _late_chain(self) -> list[tuple[int, list[int]]]:
        """Last sliding body on the way to every body, and the joints after it."""
        found = []
        for body in range(len(self.model.bodies)):
            joints = [n for n in self._late_joints if self.chains[body, n]]
            found.append((self._parent[joints[0]] if joints else body, joints))
        return found

    def pose(self, body: int, values: Floats) -> tuple[Floats, Floats]:
        """Return rotation and place of one body at joint `values`."""
        start, joints = self._late_chain[body]
        rotation = self._zero.rotations[start]
        place = self._zero.places[start] + self._zero.shifts[start] @ values
        for number in joints:
            rotation, place = self._onwards(
                number, float(values[number]), rotation, place, slides=True
            )
        return rotation, place


def cross_matrix(vector: Floats) -> Floats:
    """Return the matrix that gives the cross product of `vector` with what it is applied to."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
