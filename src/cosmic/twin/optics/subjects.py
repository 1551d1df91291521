"""What there is to be seen at a moment: fibres, tools, the plate."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosmic.twin.force_side import ForceSide
from cosmic.twin.kinematics import Floats, Point, Slide
from cosmic.twin.optics.ground import on_plate
from cosmic.twin.optics.shapes import bridge, cantilever, lying
from cosmic.twin.optics.solids import read_solids
from cosmic.twin.settings import TwinSettings
from cosmic.twin.stage import Stage
from cosmic.twin.workplace import Moment, Push

NEAREST_UM = 5.0
"""A probe nearer to the jaws than this bends nothing that could be seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Strand:
    """One fibre: its centre line in the world, shape (n, 3), um."""

    line_um: Floats
    width_um: float

    @property
    def height_um(self) -> float:
        """Its mean height."""
        return float(self.line_um[:, 2].mean())


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """One convex body: its corners in the world, shape (n, 3), um."""

    link: str
    corners_um: Floats

    @property
    def height_um(self) -> float:
        """Height of its lowest face, where a tool meets the fibre."""
        return float(self.corners_um[:, 2].min())


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """Everything to be seen at one moment.

    Attributes
    ----------
    plate : ndarray, shape (4, 4), float64
        `world_from_plate`, um.
    lying : callable
        Returns the fibres on the plate; seldom needed, because their picture is kept.
    lying_key : tuple
        Differs when a fibre lies elsewhere on the plate.
    held : tuple of Strand
        Fibres in the grippers.
    """

    plate: Floats
    lying: Callable[[], tuple[Strand, ...]]
    lying_key: tuple[tuple[float, ...], ...]
    held: tuple[Strand, ...]
    solids: tuple[Solid, ...]


class Subjects:
    """The truth about what is to be seen; any thread.

    Raises
    ------
    ConfigError
        The URDF or a mesh is missing or broken.
    """

    def __init__(
        self,
        settings: TwinSettings,
        folder: Path,
        stages: Mapping[str, Stage],
        force_side: ForceSide,
    ) -> None:
        self._settings = settings
        self._stages = stages
        self._force_side = force_side
        skeleton = force_side.skeleton
        bodies = read_solids(folder / settings.geometry.urdf, settings.optics.picture.hidden)
        self._bodies: list[tuple[str, Slide, tuple[Floats, ...]]] = [
            (link, skeleton.slide(link), tuple(each @ skeleton.turn(link).T for each in parts))
            for link, parts in bodies.items()
        ]
        self._forward = {
            name: 1 if skeleton.direction(gripper.jaws[0], (1.0, 0.0, 0.0))[0] > 0.0 else -1
            for name, gripper in settings.geometry.grippers.items()
        }

    def at(self, at_s: float) -> Subject:
        """Return what is to be seen at `at_s`, not later than now and some seconds ago at most."""
        values = {name: each.position_then(at_s) for name, each in self._stages.items()}
        moment = self._force_side.moment(at_s)
        plate = self._force_side.skeleton.pose(self._settings.geometry.plate, values)
        poses = tuple(self._lying_pose(moment, number) for number in self._which(moment, False))
        tips = self._force_side.tips(at_s)
        return Subject(
            plate=plate,
            lying=lambda: tuple(self._lying(pose, plate) for pose in poses),
            lying_key=poses,
            held=tuple(self._held(moment, number, tips) for number in self._which(moment, True)),
            solids=tuple(
                Solid(link, part + slide.at(values))
                for link, slide, parts in self._bodies
                for part in parts
            ),
        )

    def _which(self, moment: Moment, held: bool) -> list[int]:
        return [n for n, state in enumerate(moment.fibres) if bool(state.held_by) is held]

    # ------------------------------------------------------------------ lying

    def _lying_pose(self, moment: Moment, number: int) -> tuple[float, ...]:
        """Return number, middle and angle of a fibre on the plate, as far as they can be seen."""
        # The force side may be ahead of the picture by some ms, with the table turned further.
        values = {n: each.position_then(moment.time_s) for n, each in self._stages.items()}
        plate = self._force_side.skeleton.pose(self._settings.geometry.plate, values)
        ends = np.column_stack([np.array(moment.fibres[number].ends_um), np.ones(2)])
        (x0, y0), (x1, y1) = np.linalg.solve(plate, ends.T).T[:, :2].tolist()
        angle = math.atan2(y1 - y0, x1 - x0)
        middle = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        return float(number), round(middle[0], 3), round(middle[1], 3), round(angle, 6)

    def _lying(self, pose: tuple[float, ...], plate: Floats) -> Strand:
        number, x, y, angle = pose
        fibre = self._settings.fibres[int(number)]
        line = lying(fibre.length_um, fibre.curl_deg, fibre.kink_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        turned = line @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
        return Strand(on_plate(turned, plate, 0.5 * fibre.thickness_um), fibre.width_um)

    # ------------------------------------------------------------------ held

    def _held(self, moment: Moment, number: int, tips: Mapping[str, Point]) -> Strand:
        state = moment.fibres[number]
        first = f"{state.held_by[0]}.hold"
        towards = self._forward[state.held_by[0]]
        start, start_then = np.array(tips[first]), np.array(moment.tips_um[first])
        ways = sorted((end[0] - start_then[0]) * towards for end in state.ends_um)
        slopes = np.zeros(2)
        span: float | None = None
        if len(state.held_by) == 2:
            other = np.array(tips[f"{state.held_by[1]}.hold"]) - start
            span = max(float(other[0]) * towards, 1.0)
            slopes = other[1:] / span
        push = next((each for each in moment.pushes if each.fibre == number), None)
        u, v = self._free(moment, push, tips, first, towards, ways[1], span)
        u, v = np.concatenate([[ways[0]], u]), np.concatenate([[0.0], v])
        line = np.empty((len(u), 3))
        line[:, 0] = start[0] + towards * u
        # The probe pushes towards -y.
        line[:, 1] = start[1] + slopes[0] * u - v
        line[:, 2] = start[2] + slopes[1] * u
        return Strand(line, self._settings.fibres[number].width_um)

    def _free(
        self,
        moment: Moment,
        push: Push | None,
        tips: Mapping[str, Point],
        first: str,
        towards: int,
        reach: float,
        span: float | None,
    ) -> tuple[Floats, Floats]:
        """Return abscissa and deflection of what stands out of the first jaws."""
        straight = np.array([0.0, reach])
        if push is None:
            return straight, np.zeros(2)
        # What the probe went since the force side looked last shows in the picture too.
        ahead = [
            (now[first][1] - now["probe"][1], (now["probe"][0] - now[first][0]) * towards)
            for now in (moment.tips_um, tips)
        ]
        deflection = push.deflection_um + ahead[1][0] - ahead[0][0]
        along = push.abscissa_um + ahead[1][1] - ahead[0][1]
        if not NEAREST_UM < along < (reach if span is None else span - NEAREST_UM):
            return straight, np.zeros(2)
        if span is None:
            line = cantilever(along, deflection, reach)
        else:
            line = np.concatenate([bridge(along, deflection, span), [[max(reach, span), 0.0]]])
        return line[:, 0], line[:, 1]
