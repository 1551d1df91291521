"""What the view shows at the moment: bodies at their poses, and what is drawn between them."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.model import Floats, SceneModel
from cosmic.mico.gui.scene.arms import Preset, moving_ends, presets, sight_of, tips_mm
from cosmic.mico.gui.scene.camera import Sight
from cosmic.mico.gui.scene.meshes import BodyMesh, body_meshes, poses_mm, to_mm

_SAME_MM = 1e-5
_MOST_POSES = 400

Path = Sequence[Mapping[str, float]]
Tracks = tuple[Floats, ...]


@dataclass(frozen=True, eq=False)
class Pair:
    """Two points in the world, mm, that belong together, and what is known of them."""

    points_mm: Floats
    approach: Approach

    @classmethod
    def of(cls, approach: Approach) -> "Pair":
        """Return the pair of an answer of the gate."""
        return cls(to_mm(approach.places_um), approach)


class SceneContent:
    """All that is shown, without a widget; GUI thread.

    `SceneWidget` changes it, the views read it.
    """

    def __init__(self) -> None:
        self.model: SceneModel | None = None
        self.meshes: Mapping[str, BodyMesh] = {}
        self.poses: dict[str, Floats] = {}
        self.ghosts: dict[str, Floats] = {}
        self.nearest: Pair | None = None
        self.refused: Pair | None = None
        self.planned: Tracks = ()
        self.recorded: Tracks = ()
        self.hidden: frozenset[str] = frozenset()
        self.unwatched: frozenset[str] = frozenset()
        self.presets: tuple[Preset, ...] = ()
        self._positions: dict[str, float] = {}
        self._tips: Mapping[str, Floats] = {}

    @property
    def triangles(self) -> int:
        """How many triangles the bodies have."""
        return sum(len(mesh.corners_mm) for mesh in self.meshes.values())

    @property
    def shown(self) -> dict[str, BodyMesh]:
        """The meshes that are not hidden."""
        return {name: mesh for name, mesh in self.meshes.items() if name not in self.hidden}

    def set_model(self, model: SceneModel | None) -> None:
        """Show another platform, or none; everything drawn before is gone."""
        self.model = model
        self.poses, self.ghosts, self.meshes, self._tips = {}, {}, {}, {}
        self.nearest = self.refused = None
        self.planned = self.recorded = ()
        self.unwatched, self.presets = frozenset(), ()
        self._positions = {}
        if model is None:
            return
        self.meshes = body_meshes(model)
        self.presets = presets(model)
        self._tips = tips_mm(model, self.meshes, model.bodies)
        self._place()

    def set_positions(self, positions: Mapping[str, float]) -> bool:
        """Note where axes are; tells whether a body moved.

        A position that is not finite is not known: its body stays where it was seen last.
        """
        known = {axis: value for axis, value in positions.items() if math.isfinite(value)}
        if self.model is None or known.items() <= self._positions.items():
            return False
        self._positions.update(known)
        return self._place()

    def _place(self) -> bool:
        before = self.poses
        self.poses = self._poses_at(self._positions)
        moved = any(
            body not in before or not np.array_equal(pose, before[body])
            for body, pose in self.poses.items()
        )
        if moved:
            self._place_ghosts()
        return moved

    def _poses_at(self, positions: Mapping[str, float]) -> dict[str, Floats]:
        if self.model is None:
            return {}
        return dict(zip(self.model.bodies, poses_mm(self.model, positions), strict=True))

    def set_nearest(self, approach: Approach | None) -> bool:
        """Note the nearest pair; tells whether it is another one."""
        if approach == (self.nearest.approach if self.nearest is not None else None):
            return False
        self.nearest = None if approach is None else Pair.of(approach)
        return True

    def set_refused(self, approach: Approach | None) -> None:
        """Note the movement that was refused."""
        self.refused = None if approach is None else Pair.of(approach)
        self._place_ghosts()

    def _place_ghosts(self) -> None:
        self.ghosts = {}
        if self.refused is None:
            return
        there = self._poses_at(self._positions | dict(self.refused.approach.pose))
        self.ghosts = {
            body: pose
            for body, pose in there.items()
            if body in self.meshes and not np.allclose(pose, self.poses[body], atol=_SAME_MM)
        }

    def tracks(self, path: Path | None, bodies: Iterable[str]) -> Tracks:
        """Return the way of the tip of each body along a path, each of shape (n, 3), mm.

        Parameters
        ----------
        path : sequence of mapping
            Positions of axes; axes that are not named stay where they are now. Of more than 400
            poses an even choice is shown.
        bodies : iterable of str
            Whose tips; none named: those at the ends that move on the way.
        """
        if path is None or self.model is None or not path:
            return ()
        chosen = np.unique(np.linspace(0, len(path) - 1, _MOST_POSES).round().astype(int))
        poses = [self._poses_at(self._positions | dict(path[number])) for number in chosen]
        named = tuple(bodies)
        wanted = named or tuple(end.body for end in moving_ends(self.model))
        tracks = [self._track(body, poses) for body in wanted if body in self._tips]
        return tuple(track for track in tracks if named or np.ptp(track, axis=0).max() > _SAME_MM)

    def _track(self, body: str, poses: Sequence[Mapping[str, Floats]]) -> Floats:
        tip = self._tips[body]
        return np.array([pose[body][:3, :3] @ tip + pose[body][:3, 3] for pose in poses])

    def sight(self, preset: Preset) -> Sight:
        """Return where to stand for `preset`, with the bodies where they are."""
        return sight_of(preset, self._tips, self.poses, self.meshes)
