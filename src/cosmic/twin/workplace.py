"""Where grippers, fibres and probe meet: who holds what, and what the probe feels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.twin.fibre import Fibre, FibreState, Line
from cosmic.twin.kinematics import Point, Skeleton
from cosmic.twin.settings import TwinSettings
from cosmic.twin.tools import Gripper, Tool
from cosmic.twin.touch import Touch

NOTHING: Final = 0.0
_NOWHERE: Final = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class Push:
    """What one fibre does to the probe.

    Attributes
    ----------
    fibre : int
        Its number in twin.toml.
    abscissa_um : float
        From the jaws' tip to the probe.
    deflection_um : float
        Of the fibre at the probe.
    """

    fibre: int
    force_un: float
    abscissa_um: float
    deflection_um: float


@dataclass(frozen=True, slots=True)
class Felt:
    """What the probe feels at one moment."""

    pushes: tuple[Push, ...] = ()
    jaw_un: float = 0.0

    @property
    def total_un(self) -> float:
        """Force on the probe, positive when it is pushed back."""
        return sum((push.force_un for push in self.pushes), self.jaw_un)


@dataclass(frozen=True, slots=True)
class Moment:
    """The truth of the force side at one moment.

    Attributes
    ----------
    force_un : float
        On the probe; positive when it is pushed back.
    pushes : tuple of Push
        One for each fibre that touches the probe.
    jaw_un : float
        The part of the force that comes from a jaw.
    tips_um : mapping of str to point
        See `Workplace.tips`.
    """

    time_s: float
    force_un: float
    pushes: tuple[Push, ...]
    jaw_un: float
    tips_um: Mapping[str, Point]
    fibres: tuple[FibreState, ...]


class Workplace:
    """Grippers, fibres, plate and probe; `look` takes them from one moment to the next.

    Parameters
    ----------
    settings : TwinSettings
        Constants.
    skeleton : Skeleton
        Geometry.
    sensor_un_um : float
        Stiffness of the sensor behind the probe.
    """

    def __init__(
        self, settings: TwinSettings, skeleton: Skeleton, *, sensor_un_um: float, seed: int
    ) -> None:
        self._geometry = settings.geometry
        self._contact = settings.contact
        self._sensor = sensor_un_um
        self._skeleton = skeleton
        self._probe = skeleton.slide(self._geometry.probe)
        self._grippers = {
            name: Gripper(skeleton, gripper.stage, gripper.jaws, self._geometry.hold_height_um)
            for name, gripper in self._geometry.grippers.items()
        }
        self.fibres = tuple(
            Fibre(fibre, settings.contact, f"{number} {seed}")
            for number, fibre in enumerate(settings.fibres)
        )
        self._touches = [Touch() for _ in self.fibres]
        self._jaw_touches = {name: Touch() for name in self._grippers}
        self._gaps: dict[str, float] = {}
        self._widest = dict.fromkeys(self._grippers, 0.0)
        self._narrowest = min((each.settings.width_um for each in self.fibres), default=0.0)

    @property
    def stages(self) -> frozenset[str]:
        """Names of the stages that anything here depends on."""
        geometry = self._geometry
        joints = {each.stage for each in geometry.joints.values()}
        return frozenset(joints | {each.stage for each in geometry.grippers.values()})

    # ------------------------------------------------------------------ seen from outside

    def tips(self, values: Mapping[str, float]) -> dict[str, Point]:
        """Return where the tips of the tools are, um, world.

        Keys are "probe", and for each gripper "left.jaw_a" and "left.jaw_b", the inner lower
        edges of its jaws' tips, and "left.hold", where a fibre leaves the jaws.
        """
        found = {"probe": self._probe.at(values)}
        for name, gripper in self._grippers.items():
            found[f"{name}.jaw_a"], found[f"{name}.jaw_b"] = gripper.jaws_at(values)
            found[f"{name}.hold"] = gripper.tool(name, values).hold
        return found

    def moment(self, time_s: float, values: Mapping[str, float], felt: Felt) -> Moment:
        """Return the truth at the moment looked at last."""
        tools = self._tools(values)
        states = tuple(fibre.state(tools, self._lying(fibre, values)) for fibre in self.fibres)
        return Moment(time_s, felt.total_un, felt.pushes, felt.jaw_un, self.tips(values), states)

    # ------------------------------------------------------------------ going through time

    def look(self, values: Mapping[str, float]) -> Felt:
        """Take everything to where the stages are now, and return what the probe feels."""
        tools = self._tools(values)
        self._grasp_and_release(tools, values)
        probe = self._probe.at(values)
        pushes = tuple(
            push
            for number, fibre in enumerate(self.fibres)
            if fibre.holds and (push := self._push(number, fibre, tools, probe)) is not None
        )
        jaw_un = sum(self._jaw(name, tool, probe) for name, tool in tools.items())
        return Felt(pushes, jaw_un)

    def _tools(self, values: Mapping[str, float]) -> dict[str, Tool]:
        return {name: each.tool(name, values) for name, each in self._grippers.items()}

    # ------------------------------------------------------------------ probe

    def _push(self, number: int, fibre: Fibre, tools: dict[str, Tool], probe: Point) -> Push | None:
        if len(fibre.holds) == 2:
            fibre.slip(fibre.line(tools).free_um)
        line = fibre.line(tools)
        touch, along = self._touches[number], line.abscissa_um(probe[0])
        way = line.start[1] + line.slope * along + fibre.settings.width_um / 2.0 - probe[1]
        if not touch.look(self._reach(fibre, line, along, probe[2]), way):
            return None
        curve = fibre.curve(
            line, along, edge_um=self._geometry.probe_edge_radius_um, sensor=self._sensor
        )
        force = curve.force_un(way)
        if way > curve.reach_um or force < -self._contact.pull_off_un:
            touch.lose()
            return None
        return Push(number, force, along, way - force / self._sensor)

    def _reach(self, fibre: Fibre, line: Line, along_um: float, probe_z_um: float) -> float:
        height = line.start[2] + line.rise * along_um
        thick = self._geometry.probe_half_width_um + fibre.settings.thickness_um / 2.0
        return min(along_um, line.free_um - along_um, thick - abs(probe_z_um - height))

    def _jaw(self, name: str, tool: Tool, probe: Point) -> float:
        """Return the force of a jaw's outer face on the probe's tip."""
        geometry = self._geometry
        half = geometry.probe_half_width_um
        ahead = (probe[0] - tool.hold[0]) * tool.forward[0]
        above = probe[2] - (tool.hold[2] - geometry.hold_height_um)
        reach = min(
            half - ahead,
            ahead + geometry.jaw_length_um + half,
            above + half,
            geometry.jaw_height_um + half - above,
        )
        face = tool.hold[1] + tool.gap_um / 2.0 + geometry.jaw_thickness_um
        way = face - probe[1]
        touch = self._jaw_touches[name]
        if not touch.look(reach, way):
            return NOTHING
        if way < 0.0:
            touch.lose()
            return NOTHING
        return self._sensor * way

    # ------------------------------------------------------------------ grippers

    def _grasp_and_release(self, tools: dict[str, Tool], values: Mapping[str, float]) -> None:
        if not self._gaps:
            self._begin(tools)
        for name, tool in tools.items():
            before, gap = self._gaps.get(name, tool.gap_um), tool.gap_um
            self._gaps[name] = gap
            self._widest[name] = max(self._widest[name], gap)
            held = next((each for each in self.fibres if name in each.holds), None)
            if held is not None:
                if gap > held.settings.width_um:
                    self._release(held, name, tools, values)
            elif gap < before:
                self._try_to_grasp(tool, before, tools, values)
            if gap <= self._narrowest:
                self._widest[name] = gap

    def _begin(self, tools: dict[str, Tool]) -> None:
        """Put each fibre where it was left, at the first look."""
        for fibre in self.fibres:
            name, settings = fibre.settings.held_by, fibre.settings
            if name and tools[name].gap_um <= settings.width_um:
                outwards = 1 if tools[name].forward[0] > 0.0 else -1
                inside = settings.length_um - settings.free_um
                at = inside if outwards > 0 else settings.free_um
                fibre.grip(name, at_um=at, outwards=outwards)

    def _release(
        self, fibre: Fibre, name: str, tools: dict[str, Tool], values: Mapping[str, float]
    ) -> None:
        """Open the jaws around a fibre: the other gripper keeps it, or it falls on the plate."""
        if len(fibre.holds) == 1:
            (x0, y0, _), (x1, y1, _) = fibre.state(tools, _NOWHERE).ends_um
            plate = self._skeleton.pose(self._geometry.plate, values)
            middle = np.array([(x0 + x1) / 2.0, (y0 + y1) / 2.0, plate[2, 3], 1.0])
            there = np.linalg.solve(plate, middle)
            turned = math.atan2(plate[1, 0], plate[0, 0])
            angle = math.atan2(y1 - y0, x1 - x0) - turned
            fibre.plate_pose = float(there[0]), float(there[1]), angle
            self._touches[self.fibres.index(fibre)] = Touch()
        del fibre.holds[name]
        self._widest[name] = tools[name].gap_um

    def _try_to_grasp(
        self, tool: Tool, before_um: float, tools: dict[str, Tool], values: Mapping[str, float]
    ) -> None:
        """Take the first fibre whose width the gap has just come down to."""
        for fibre in self.fibres:
            if not tool.gap_um <= fibre.settings.width_um < before_um:
                continue
            first, second = fibre.state(tools, self._lying(fibre, values)).ends_um
            place = self._between_jaws(tool, first, second)
            if place is not None:
                along = 1 if (second[0] - first[0]) * tool.forward[0] > 0.0 else -1
                fibre.grip(tool.name, at_um=place, outwards=along)
                return

    def _between_jaws(self, tool: Tool, first: Point, second: Point) -> float | None:
        """Return where along a fibre the jaws' tip is, or None where they do not enclose it."""
        forward = tool.forward[0]
        ahead0, ahead1 = ((p[0] - tool.hold[0]) * forward for p in (first, second))
        low, high = sorted((ahead0, ahead1))
        run = abs(second[0] - first[0])
        steep = math.tan(math.radians(self._contact.grasp_angle_deg))
        if not (low < 0.0 < high and abs(second[1] - first[1]) <= steep * run):
            return None
        part = ahead0 / (ahead0 - ahead1)
        aside = first[1] + part * (second[1] - first[1]) - tool.hold[1]
        above = first[2] + part * (second[2] - first[2]) - tool.hold[2]
        if abs(aside) > self._widest[tool.name] / 2.0:
            return None
        if abs(above) > self._contact.grasp_height_um:
            return None
        return part * math.dist(first, second)

    def _lying(self, fibre: Fibre, values: Mapping[str, float]) -> tuple[Point, Point]:
        x, y, angle = fibre.plate_pose
        half = fibre.settings.length_um / 2.0
        dx, dy, z = half * math.cos(angle), half * math.sin(angle), fibre.settings.thickness_um / 2
        ends = np.array([[x - dx, y - dy, z, 1.0], [x + dx, y + dy, z, 1.0]])
        world = ends @ self._skeleton.pose(self._geometry.plate, values).T
        return tuple(world[0, :3].tolist()), tuple(world[1, :3].tolist())
