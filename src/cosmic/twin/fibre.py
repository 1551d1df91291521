"""One fibre: where it is, who holds it, and what it does to a probe that pushes it."""

import math
import random
from dataclasses import dataclass
from typing import Final

from cosmic.twin.force_settings import ContactSettings, FibreSettings
from cosmic.twin.kinematics import Point
from cosmic.twin.rod import (
    EI_UN_UM2_PER_N_M2,
    UN_PER_N,
    PushCurve,
    clamped_at_one_end,
    held_at_both_ends,
    tension_un,
)
from cosmic.twin.tools import Tool

SPAN_STEP_UM: Final = 0.02
"""Spans closer than this share one curve; 0.01 % of the force at a span of 600 um."""

NEAREST_UM: Final = 5.0
"""Nearer to a clamp the jaws are in the way."""


@dataclass(slots=True)
class Hold:
    """One grip on a fibre.

    Attributes
    ----------
    at_um : float
        Place on the fibre, from its first end, where it leaves the jaws.
    outwards : int
        +1: the fibre's second end is the one outside the jaws.
    depth_um : float
        How far inside the jaws it is really held.
    """

    at_um: float
    outwards: int
    depth_um: float


@dataclass(frozen=True, slots=True)
class FibreState:
    """What is true of a fibre at one moment.

    Attributes
    ----------
    held_by : tuple of str
        Grippers; empty while it lies on the plate.
    ends_um : two points
        Its ends as if straight, um, world.
    tension_un : float
        Pull between two grippers.
    """

    held_by: tuple[str, ...]
    ends_um: tuple[Point, Point]
    tension_un: float


@dataclass(frozen=True, slots=True)
class Line:
    """The undeformed free part of a held fibre, as the probe meets it.

    Attributes
    ----------
    start : (float, float, float)
        Where it leaves the first gripper's jaws, um, world.
    towards : int
        +1 when it runs towards +x.
    slope, rise : float
        Change of y and of z per um of abscissa.
    free_um : float
        Its length, or the distance of the two grippers.
    """

    start: Point
    towards: int
    slope: float
    rise: float
    free_um: float

    def abscissa_um(self, x_um: float) -> float:
        """Return how far along the fibre a place in x is."""
        return (x_um - self.start[0]) * self.towards


class Fibre:
    """A straight fibre; changed by the workplace only."""

    def __init__(self, settings: FibreSettings, contact: ContactSettings, seed: str) -> None:
        self.settings = settings
        self.holds: dict[str, Hold] = {}
        self.plate_pose = settings.x_um, settings.y_um, math.radians(settings.angle_deg)
        self._contact = contact
        self._random = random.Random(f"fibre {seed}")

    # ------------------------------------------------------------------ grasp and release

    def grip(self, tool: str, *, at_um: float, outwards: int) -> None:
        """Have a gripper hold the fibre at a place along it."""
        depth = self._random.gauss(
            self._contact.clamp_depth_um, self._contact.clamp_depth_spread_um
        )
        self.holds[tool] = Hold(at_um, outwards, max(depth, 0.0))

    def free_of(self, hold: Hold) -> float:
        """Return the length that stands out of the jaws."""
        return self.settings.length_um - hold.at_um if hold.outwards > 0 else hold.at_um

    def slack_um(self, distance_um: float) -> float:
        """Return the length between both grippers beyond their distance."""
        first, second = self.holds.values()
        return abs(second.at_um - first.at_um) - distance_um

    def slip(self, distance_um: float) -> None:
        """Let the fibre slide through the second gripper where the pull is too much."""
        excess = self._tension_un(distance_um) - self._contact.grip_limit_un
        if excess > 0.0:
            first, second = self.holds.values()
            way = excess * self._axial_um_un(distance_um)
            second.at_um += math.copysign(way, second.at_um - first.at_um)

    def _axial_um_un(self, distance_um: float) -> float:
        ea_un = self.settings.ea_n * UN_PER_N
        return distance_um / ea_un + 2.0 / self._contact.gripper_un_um

    def _tension_un(self, distance_um: float) -> float:
        return tension_un(
            ea_un=self.settings.ea_n * UN_PER_N,
            distance_um=distance_um,
            slack_um=self.slack_um(distance_um),
            gripper_un_um=self._contact.gripper_un_um,
        )

    # ------------------------------------------------------------------ where it is

    def line(self, tools: dict[str, Tool]) -> Line:
        """Return the free part of the held fibre."""
        names = list(self.holds)
        first = tools[names[0]]
        towards = 1 if first.forward[0] > 0.0 else -1
        if len(names) == 1:
            free = self.free_of(self.holds[names[0]])
            return Line(first.hold, towards, 0.0, 0.0, free)
        second = tools[names[1]]
        span = max((second.hold[0] - first.hold[0]) * towards, 1.0)
        slope = (second.hold[1] - first.hold[1]) / span
        rise = (second.hold[2] - first.hold[2]) / span
        return Line(first.hold, towards, slope, rise, span)

    def state(self, tools: dict[str, Tool], lying: tuple[Point, Point]) -> FibreState:
        """Return what is true now; `lying`: its ends while it lies on the plate."""
        if not self.holds:
            return FibreState((), lying, 0.0)
        line = self.line(tools)
        (hold, *more) = self.holds.values()
        pull = self._tension_un(line.free_um) if more else 0.0
        x, y, z = line.start
        ends = []
        for end_um in (0.0, self.settings.length_um):
            way = (end_um - hold.at_um) * hold.outwards
            ends.append((x + line.towards * way, y + line.slope * way, z + line.rise * way))
        return FibreState(tuple(self.holds), (ends[0], ends[1]), pull)

    # ------------------------------------------------------------------ what the probe feels

    def curve(self, line: Line, abscissa_um: float, *, edge_um: float, sensor: float) -> PushCurve:
        """Return force over way for a probe at an abscissa.

        Parameters
        ----------
        edge_um : float
            Radius of the probe's edge.
        sensor : float
            Stiffness of the sensor, uN/um.
        """
        (hold, *more) = self.holds.values()
        ei = self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2
        span = _rounded(max(abscissa_um, NEAREST_UM) + hold.depth_um)
        if not more:
            return clamped_at_one_end(
                ei_un_um2=ei,
                span_um=span,
                free_um=_rounded(line.free_um + hold.depth_um),
                radius_um=edge_um + self.settings.width_um / 2.0,
                sensor_un_um=sensor,
            )
        distance = _rounded(line.free_um + hold.depth_um + more[0].depth_um)
        return held_at_both_ends(
            ei_un_um2=ei,
            ea_un=self.settings.ea_n * UN_PER_N,
            span_um=min(span, distance - NEAREST_UM),
            distance_um=distance,
            slack_um=_rounded(self.slack_um(line.free_um)),
            gripper_un_um=self._contact.gripper_un_um,
            sensor_un_um=sensor,
        )


def _rounded(length_um: float) -> float:
    return round(length_um / SPAN_STEP_UM) * SPAN_STEP_UM
