"""What there is to be seen at a moment: fibres, tools, the plate."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.felt import Moment, Push
from cosmic.twin.fibre_state import FibreState
from cosmic.twin.force_side import ForceSide
from cosmic.twin.kinematics import Point, Slide
from cosmic.twin.optics.bent import Compliance, bent
from cosmic.twin.optics.ground import on_plate
from cosmic.twin.optics.shapes import bridge
from cosmic.twin.optics.solids import read_solids
from cosmic.twin.settings import TwinSettings
from cosmic.twin.stage import Stage
from cosmic.twin.tools import added

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
class Lying:
    """One fibre on the plate: its centre line in the frame of the plate, shape (n, 2), um."""

    line_um: Floats
    height_um: float
    width_um: float

    def in_world(self, plate: Floats) -> Strand:
        """Return it where the plate is, `world_from_plate`."""
        return Strand(on_plate(self.line_um, plate, self.height_um), self.width_um)


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
    """Everything to be seen at one moment; plain data.

    Attributes
    ----------
    plate : ndarray, shape (4, 4), float64
        `world_from_plate`, um.
    lying : tuple of Lying
        Fibres on the plate.
    lying_key : tuple
        Differs when a fibre lies elsewhere on the plate.
    held : tuple of Strand
        Fibres in the grippers.
    """

    plate: Floats
    lying: tuple[Lying, ...]
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
        self._flats: dict[int, tuple[tuple[float, ...], Lying]] = {}
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
        values = self._force_side.positions(at_s)
        moment = self._force_side.timeline.moment(at_s)
        plate = self._force_side.skeleton.pose(self._settings.geometry.plate, values)
        lying = tuple(each for each in moment.fibres if each.where == "plate")
        carried = tuple(each for each in moment.fibres if each.anchor)
        tips = self._force_side.tips(at_s)
        return Subject(
            plate=plate,
            lying=tuple(self._flat(state) for state in lying),
            lying_key=tuple(_pose_key(state) for state in lying),
            held=tuple(self._carried(moment, state, tips) for state in carried),
            solids=self._solids(values, at_s),
        )

    def _solids(self, values: Mapping[str, float], at_s: float) -> tuple[Solid, ...]:
        offsets = self._force_side.offsets
        found = []
        for link, slide, parts in self._bodies:
            position = slide.at(values)
            if not offsets.still:
                position = added(position, offsets.at(link.partition("_")[0], at_s))
            found += [Solid(link, part + position) for part in parts]
        return tuple(found)

    def _flat(self, state: FibreState) -> Lying:
        """Return a fibre on the plate; one that stays is reckoned once."""
        key = _pose_key(state)
        before = self._flats.get(state.number)
        if before is None or before[0] != key:
            fibre = state.settings
            line = state.shape.placed(*state.plate_pose)
            before = key, Lying(line, 0.5 * fibre.thickness_um, fibre.width_um)
            self._flats[state.number] = before
        return before[1]

    # ------------------------------------------------------------------ held

    def _carried(self, moment: Moment, state: FibreState, tips: Mapping[str, Point]) -> Strand:
        width = state.seen_um
        push = next((each for each in moment.pushes if each.fibre == state.number), None)
        if state.where != "held":
            return Strand(state.relative_um + tips[state.anchor], width)
        towards = self._forward[state.held_by[0]]
        start = np.array(tips[state.anchor])
        line = _outwards(state.relative_um, towards)
        span: float | None = None
        if len(state.held_by) == 2:
            line, span = self._between(state, line, tips, towards)
        if push is not None:
            ahead = self._ahead(moment, push, tips, state.anchor, towards)
            line = _pushed(line, ahead, span if state.compliance is None else state.compliance)
        line = line * (towards, 1.0, 1.0)
        return Strand(line + start, width)

    def _between(
        self, state: FibreState, line: Floats, tips: Mapping[str, Point], towards: int
    ) -> tuple[Floats, float]:
        """Return a fibre between two grippers, straight, and how far they are apart."""
        other = np.array(tips[f"{state.held_by[1]}.hold"]) - tips[state.anchor]
        span = max(float(other[0]) * towards, 1.0)
        u = np.array([line[0, 0], 0.0, line[-1, 0]])
        return np.column_stack([u, other[1] / span * u, other[2] / span * u]), span

    def _ahead(
        self, moment: Moment, push: Push, tips: Mapping[str, Point], first: str, towards: int
    ) -> tuple[float, float]:
        """Return where the probe is along the fibre, and by how much it bends it, in the image.

        What the probe went since the force side looked last shows in the image too.
        """
        ahead = [
            (now[first][1] - now["probe"][1], (now["probe"][0] - now[first][0]) * towards)
            for now in (moment.tips_um, tips)
        ]
        deflection = push.deflection_um + ahead[1][0] - ahead[0][0]
        return push.abscissa_um + ahead[1][1] - ahead[0][1], deflection


def _pushed(line: Floats, push: tuple[float, float], held: Compliance | float | None) -> Floats:
    """Return a fibre, first the part in the jaws, as the probe bends it.

    Parameters
    ----------
    held : Compliance or float or None
        By one gripper, or how far two are apart.
    """
    along, deflection = push
    inside, free = line[:1], line[1:]
    reach = float(free[-1, 0])
    if isinstance(held, float):
        return _bridged(line, push, held)
    rises = bool((np.diff(free[:, 0]) > 0.0).all())
    if held is None or not (rises and NEAREST_UM < along < reach):
        return line  # where it turns back the probe hardly gets there
    plane = bent(free[:, :2], held, along, deflection)
    return np.concatenate([inside, np.column_stack([plane, _at(free, plane[:, 0])[:, 1]])])


def _bridged(line: Floats, push: tuple[float, float], span: float) -> Floats:
    along, deflection = push
    inside, free = line[:1], line[1:]
    reach = float(free[-1, 0])
    if not NEAREST_UM < along < span - NEAREST_UM:
        return line
    shape = np.concatenate([bridge(along, deflection, span), [[max(reach, span), 0.0]]])
    found = np.column_stack([shape[:, 0], _at(free, shape[:, 0])])
    # The probe pushes towards -y.
    found[:, 1] -= shape[:, 1]
    return np.concatenate([inside, found])


def _pose_key(state: FibreState) -> tuple[float, ...]:
    x, y, angle = state.plate_pose
    return float(state.number), round(x, 3), round(y, 3), round(angle, 6), state.shape.length_um


def _outwards(relative_um: Floats, towards: int) -> Floats:
    """Return a fibre in a gripper's frame, x out of the jaws, from inside outwards."""
    line = relative_um * (towards, 1.0, 1.0)
    return line if line[0, 0] <= line[-1, 0] else line[::-1]


def _at(line: Floats, u: Floats) -> Floats:
    """Return y and z of a line at points along x, shape (n, 2); beyond its end as at its end."""
    slope = (line[-1, 1:] - line[-2, 1:]) / max(float(line[-1, 0] - line[-2, 0]), 1e-9)
    beyond = np.maximum(u - line[-1, 0], 0.0)[:, None]
    inner = [np.interp(u, line[:, 0], column) for column in line[:, 1:].T]
    return np.asarray(np.column_stack(inner) + beyond * slope)
