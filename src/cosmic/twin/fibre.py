"""One fibre: where it is, who holds it, and what it does to a probe that pushes it."""

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from cosmic.twin.cantilever import Cantilever
from cosmic.twin.centre_line import CentreLine
from cosmic.twin.fate import Fate
from cosmic.twin.force_settings import ContactSettings, FibreSettings
from cosmic.twin.grip import Free, Hold, make_hold
from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.kinematics import Point
from cosmic.twin.rod import (
    EI_UN_UM2_PER_N_M2,
    UN_PER_N,
    PushCurve,
    held_at_both_ends,
    tension_un,
)
from cosmic.twin.rubbing import RubbedPush, Rubbing
from cosmic.twin.stiffness import StiffnessProfile
from cosmic.twin.tools import Tool

Floats = npt.NDArray[np.float64]
PlatePose = tuple[float, float, float]
Why = Literal["stuck", "hanging"]

SPAN_STEP_UM: Final = 0.02
"""Spans closer than this share one curve; 0.01 % of the force at a span of 600 um."""

NEAREST_UM: Final = 5.0
"""Nearer to a clamp the jaws are in the way."""


@dataclass(frozen=True, slots=True)
class Carried:
    """A fibre that goes along with a tool without being held.

    Attributes
    ----------
    anchor : str
        The point it follows, a key of `Workplace.tips`.
    line_um : ndarray, shape (n, 3), float64
        Where it is relative to that.
    angle_rad : float
        By which its own frame is turned in the world.
    why : str
        "stuck" to a jaw that opened, or "hanging" on a held fibre.
    """

    anchor: str
    line_um: Floats
    angle_rad: float
    why: Why


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
    reach_um : float
        Abscissa as far as it goes, or the distance of the two grippers.
    free : Free or None
        Its shape where one gripper holds it.
    lifted_um, peeled_um : float
        While its far part still lies on the plate: how high the jaws are above it, and at which
        abscissa it comes down.
    """

    start: Point
    towards: int
    slope: float
    rise: float
    reach_um: float
    free: Free | None = None
    lifted_um: float = 0.0
    peeled_um: float = math.inf

    def abscissa_um(self, x_um: float) -> float:
        """Return how far along the fibre a position in x is."""
        return (x_um - self.start[0]) * self.towards

    def y_um(self, along_um: float) -> float:
        """Return where its middle is, across."""
        aside = 0.0 if self.free is None else self.free.aside_um(along_um)
        return self.start[1] + self.slope * along_um + aside

    def z_um(self, along_um: float) -> float:
        """Return how high it is."""
        height = self.start[2] + self.rise * along_um
        if self.lifted_um <= 0.0:
            return height
        part = min(max(along_um / self.peeled_um, 0.0), 1.0)
        return height - self.lifted_um * part * part * (3.0 - 2.0 * part)


class Fibre:
    """A fibre; changed by the workplace only.

    Parameters
    ----------
    number : int
        Its number in twin.toml or in the sample; pieces that broke off count on.
    seed : int
        Of everything that happens to it.
    line : CentreLine or None
        Its shape; None: as the settings have it.
    """

    def __init__(
        self,
        number: int,
        settings: FibreSettings,
        contact: ContactSettings,
        handling: HandlingSettings,
        seed: int,
        line: CentreLine | None = None,
    ) -> None:
        self.number = number
        self.settings = settings
        self.key = f"{number} {seed}"
        self.line_um = line or CentreLine.of(
            settings.length_um, settings.curl_deg, settings.kink_deg
        )
        self.holds: dict[str, Hold] = {}
        self.carried: Carried | None = None
        self.plate_pose: PlatePose = settings.x_um, settings.y_um, math.radians(settings.angle_deg)
        self.gone = self.removed = False
        self.on_plate = True
        self.grasps = 0
        self.falls = 0
        self._contact = contact
        self._rubbing = Rubbing(contact.friction_turn_um)
        self._profile: StiffnessProfile | None = None
        if settings.ei_variation:
            self._profile = StiffnessProfile(
                settings.length_um, settings.ei_variation, settings.ei_length_um, self.key
            )
        self._cantilevers: tuple[Free, float, tuple[Cantilever, ...]] | None = None
        self._curves: tuple[float, tuple[PushCurve, ...]] | None = None
        energy = handling.adhesion_un * math.exp(
            handling.adhesion_sigma_ln * random.Random(f"adhesion {self.key}").gauss(0.0, 1.0)
        )
        # A strip lifted by h at one end comes off over (18 EI h^2 / energy)^(1/4).
        self._peel_um2 = 18.0 * settings.ei_n_m2 * EI_UN_UM2_PER_N_M2 / energy

    # ------------------------------------------------------------------ grasp and release

    def grip(self, tool: Tool, *, at_um: float, outwards: int, fate: Fate) -> None:
        """Have a gripper hold the fibre at a position along it."""
        self.holds[tool.name] = make_hold(self.line_um, at_um, outwards, tool.towards, fate)
        self.carried = None

    def lay(self, pose: PlatePose) -> None:
        """Put it on the plate."""
        self.plate_pose = pose
        self.on_plate = True
        self.carried = None
        self.holds.clear()

    @property
    def lies(self) -> bool:
        """Whether nothing but the plate has it."""
        return not (self.holds or self.carried or self.gone)

    def height_um(self, tool: Tool) -> float:
        """Return how high the jaws that hold it are above where it would lie."""
        return tool.hold[2] - 0.5 * self.settings.thickness_um

    def peeled_um(self, height_um: float) -> float:
        """Return how much of it is off the plate once it is lifted so high at one end."""
        return math.sqrt(math.sqrt(self._peel_um2 * height_um * height_um))

    # ------------------------------------------------------------------ between two grippers

    def slack_um(self, distance_um: float) -> float:
        """Return the length between both grippers beyond their distance."""
        first, second = self.holds.values()
        return abs(second.at_um - first.at_um) - distance_um

    def slip(self, distance_um: float) -> None:
        """Let the fibre slide through the second gripper where the pull is too much."""
        excess = self.tension_un(distance_um) - self._contact.grip_limit_un
        if excess > 0.0:
            first, second = self.holds.values()
            shift = excess * self._axial_um_un(distance_um)
            second.at_um += math.copysign(shift, second.at_um - first.at_um)

    def _axial_um_un(self, distance_um: float) -> float:
        ea_un = self.settings.ea_n * UN_PER_N
        return distance_um / ea_un + 2.0 / self._contact.gripper_un_um

    def tension_un(self, distance_um: float) -> float:
        """Return the pull between both grippers, so far apart."""
        return tension_un(
            ea_un=self.settings.ea_n * UN_PER_N,
            distance_um=distance_um,
            slack_um=self.slack_um(distance_um),
            gripper_un_um=self._contact.gripper_un_um,
        )

    # ------------------------------------------------------------------ where it is

    def line(self, tools: Mapping[str, Tool]) -> Line:
        """Return the free part of the held fibre."""
        names = list(self.holds)
        first, hold = tools[names[0]], self.holds[names[0]]
        if len(names) == 1:
            reach = hold.free.reach_um
            if not self.on_plate:
                return Line(first.hold, hold.towards, 0.0, hold.fate.rise, reach, hold.free)
            height = max(self.height_um(first), 0.0)
            peeled = max(self.peeled_um(height), 1.0)
            return Line(
                first.hold, hold.towards, 0.0, 0.0, reach, hold.free, height, min(peeled, reach)
            )
        second = tools[names[1]]
        span = max((second.hold[0] - first.hold[0]) * hold.towards, 1.0)
        slope = (second.hold[1] - first.hold[1]) / span
        rise = (second.hold[2] - first.hold[2]) / span
        return Line(first.hold, hold.towards, slope, rise, span)

    def held_um(self, tools: Mapping[str, Tool]) -> Floats:
        """Return the undeformed held fibre relative to its first gripper's hold, shape (n, 3)."""
        hold = next(iter(self.holds.values()))
        line = self.line(tools)
        if line.free is None:
            ends = np.array([-hold.at_um, self.line_um.length_um - hold.at_um])
            along = ends * hold.outwards
            x = along * hold.towards
            return np.column_stack([x, line.slope * along, line.rise * along])
        x, y = hold.line_um.T
        z = [line.z_um(max(u, 0.0)) - line.start[2] for u in (hold.towards * x).tolist()]
        return np.column_stack([x, y, z])

    # ------------------------------------------------------------------ what the probe feels

    def strain(self, abscissa_um: float, force_un: float) -> float:
        """Return the strain at the clamp under a force there."""
        moment = abs(force_un) * self._arm_um(abscissa_um)
        stiffness = self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2
        return 0.5 * self.settings.thickness_um * moment / stiffness

    def push(
        self, line: Line, abscissa_um: float, travel_um: float, *, edge_um: float, sensor: float
    ) -> PushCurve | RubbedPush:
        """Return force over travel for a probe at an abscissa, which has come so far.

        Parameters
        ----------
        edge_um : float
            Radius of the probe's edge.
        sensor : float
            Stiffness of the sensor, uN/um.
        """
        (hold, *more) = self.holds.values()
        if line.free is not None:
            part = self._rubbing.follow(travel_um)
            growing, *falling = self._held_at_one_end(hold, line.free, abscissa_um, edge_um, sensor)
            return RubbedPush(growing, falling[0], part) if falling else growing
        distance = _rounded(line.reach_um + hold.depth_um + more[0].depth_um)
        return held_at_both_ends(
            ei_un_um2=self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2,
            ea_un=self.settings.ea_n * UN_PER_N,
            span_um=min(_rounded(self._arm_um(abscissa_um)), distance - NEAREST_UM),
            distance_um=distance,
            slack_um=_rounded(self.slack_um(line.reach_um)),
            gripper_un_um=self._contact.gripper_un_um,
            sensor_un_um=sensor,
        )

    def _arm_um(self, abscissa_um: float) -> float:
        """Return how far from the true clamp a place is, along the jaws."""
        return max(abscissa_um, NEAREST_UM) + next(iter(self.holds.values())).depth_um

    def _held_at_one_end(
        self, hold: Hold, free: Free, abscissa_um: float, edge_um: float, sensor: float
    ) -> tuple[PushCurve, ...]:
        """Return the curve, or with friction those of a growing and of a falling push."""
        solved = self._cantilevers
        if solved is None or solved[0] is not free or solved[1] != hold.depth_um:
            made = self._solved(hold, free, edge_um)
            solved = self._cantilevers = free, hold.depth_um, made
            self._curves = None
        place = _rounded(max(abscissa_um, NEAREST_UM))
        if self._curves is None or self._curves[0] != place:
            curves = tuple(each.curve(place, sensor_un_um=sensor) for each in solved[2])
            self._curves = place, curves
        return self._curves[1]

    def _solved(self, hold: Hold, free: Free, edge_um: float) -> tuple[Cantilever, ...]:
        friction, profile = self._contact.probe_friction, self._profile
        stiffness = None
        if profile is not None:
            begin, outwards = hold.at_um, hold.outwards

            def stiffness(along_um: Floats) -> Floats:
                return profile(begin + outwards * along_um)

        return tuple(
            Cantilever(
                free.abscissas_um,
                free.asides_um,
                ei_un_um2=self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2,
                depth_um=hold.depth_um,
                radius_um=edge_um + self.settings.width_um / 2.0,
                friction=rubbed,
                turn_rad_un_um=math.radians(self._contact.jaw_turn_deg) * 1e-3,
                side_un_um=self._contact.jaw_side_un_um,
                stiffness=stiffness,
            )
            for rubbed in ((friction, -friction) if friction else (0.0,))
        )


def _rounded(length_um: float) -> float:
    return round(length_um / SPAN_STEP_UM) * SPAN_STEP_UM
