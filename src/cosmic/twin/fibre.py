"""One fibre: where it is, who holds it, and what it does to a probe that pushes it."""

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, Literal, NamedTuple

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.cantilever import Cantilever
from cosmic.twin.centre_line import CentreLine
from cosmic.twin.climate import STANDARD_RH, STILL_AIR, Climate
from cosmic.twin.fate import Fate
from cosmic.twin.force_settings import ContactSettings, FibreSettings
from cosmic.twin.grip import Free, Hold, make_hold
from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.inelastic import Inelastic, crept_part
from cosmic.twin.kinematics import Point
from cosmic.twin.measurand import compliance_weights
from cosmic.twin.optics.bent import Compliance
from cosmic.twin.rod import (
    EI_UN_UM2_PER_N_M2,
    UN_PER_N,
    PushCurve,
    held_at_both_ends,
    tension_un,
)
from cosmic.twin.rubbing import (
    Askew,
    HeldPush,
    Lifting,
    Push,
    RubbedPush,
    Rubbing,
    given_um_un,
)
from cosmic.twin.section import Section
from cosmic.twin.tools import Tool

PlatePose = tuple[float, float, float]
Why = Literal["stuck", "hanging"]

SPAN_STEP_UM: Final = 0.02
"""Spans closer than this share one curve; 0.01 % of the force at a span of 600 um."""

NEAREST_UM: Final = 5.0
"""Nearer to a clamp the jaws are in the way."""

STALE_PART: Final = 0.003
"""A stiffness that changed by so much with the humidity is solved for anew."""

NEVER_YIELDS: Final = 1.0
JUMP_UM: Final = 0.35
"""From so far 1 uC/m2 has a fibre of 30 um and 1 uN/um jump: 9 um for 1 mm of 5e-11 N m2."""

IMAGE_UN_UM_MM: Final = 0.08
"""Pull of 1 uC/m2 on 1 mm that is 1 um above the plate, uN: its weight, 2 nN, at 40 um."""

MEASURED_AFTER_S: Final = 1.0
"""After a step: what a bending test is about changes with time."""

MOST_CREEP: Final = 0.3
COMPLIANCE_PLACES: Final = 120
MOST_HELD: Final = 0.95
"""Of what it gives way across: friction takes no more of it."""

NOT_INELASTIC: Final = Inelastic(1.0, slope=0.0, yield_curvature=math.inf)


@dataclass(frozen=True, slots=True)
class Carried:
    """A fibre that goes along with a tool without being held.

    Attributes
    ----------
    anchor : str
        The point it follows, a key of `Workspace.tips`.
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


class Line(NamedTuple):
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
    climate : Climate
        The air around it.
    """

    def __init__(
        self,
        number: int,
        settings: FibreSettings,
        contact: ContactSettings,
        handling: HandlingSettings,
        seed: int,
        line: CentreLine | None = None,
        climate: Climate = STILL_AIR,
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
        self._rubbing = Rubbing(contact.probe_side_un_um, contact.friction_turn_um)
        self._lifting = Lifting()
        self._climate = climate
        self._section = Section(settings, self.key)
        self._solved: _Solved | None = None
        self._curves: _Curves | None = None
        self._inelastic: Inelastic | None = None
        self._clamped: tuple[tuple[float, float], float] | None = None
        self._compliance: tuple[tuple[float, float, float], Compliance] | None = None
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
        self._solved = self._inelastic = None
        self._lifting = Lifting()
        self._rubbing.leave()

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

    def ei_un_um2(self, time_s: float) -> float:
        """Return its bending stiffness flat way in the air of now."""
        dry = 1.0 + self.settings.ei_per_rh * (self._climate.rh_percent(time_s) - STANDARD_RH)
        return self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2 * max(dry, 0.05)

    def span_ei_n_m2(self, abscissa_um: float, time_s: float) -> float:
        """Return what a bending test at an abscissa is about.

        The flexural rigidity in the plane of bending, averaged from the clamp to the contact as
        compliance weighs it, in the air of now.
        """
        hold = next(iter(self.holds.values()))
        places, weights = compliance_weights(hold, abscissa_um)
        across, _, _ = self._section.flexibility(places, hold.fate.roll_rad)
        mean = float(weights @ across) / float(weights.sum())
        crept = 1.0 + crept_part(self._creep_slope(time_s), MEASURED_AFTER_S)
        return self.ei_un_um2(time_s) / (EI_UN_UM2_PER_N_M2 * mean * crept)

    @property
    def orientation_deg(self) -> float:
        """By how much its section is turned in the plane of bending where it is held."""
        hold = next(iter(self.holds.values()))
        angle = self._section.angle_rad(np.array(hold.at_um), hold.fate.roll_rad)
        return math.degrees(float(angle))

    @property
    def seen_um(self) -> float:
        """How wide it looks from above, and how far it reaches in the plane of bending."""
        if not self.holds:
            return self.settings.width_um
        hold = next(iter(self.holds.values()))
        return self._section.seen_um(hold.at_um, hold.fate.roll_rad)

    @property
    def compliance(self) -> Compliance | None:
        """How it gives way to the probe from its clamp on, where one gripper holds it."""
        if len(self.holds) != 1:
            return None
        (hold,) = self.holds.values()
        key = hold.at_um, hold.fate.roll_rad, hold.depth_um
        if self._compliance is None or self._compliance[0] != key:
            places = np.linspace(0.0, hold.free.length_um, COMPLIANCE_PLACES)
            across, _, _ = self._section.flexibility(
                hold.at_um + hold.outwards * places, hold.fate.roll_rad
            )
            turn = math.radians(self._contact.jaw_turn_deg) * 1e-3
            turn_um = turn * self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2 / float(across[0])
            self._compliance = key, Compliance(hold.depth_um, turn_um, places, across)
        return self._compliance[1]

    def strain(self, abscissa_um: float, force_un: float) -> float:
        """Return the strain at the clamp under a force there."""
        return abs(force_un) * self._arm_um(abscissa_um) * self._strain_un_um()

    def _strain_un_um(self) -> float:
        """Return the strain where it leaves the jaws for each uN um of moment there."""
        hold = next(iter(self.holds.values()))
        key = hold.at_um, hold.fate.roll_rad
        if self._clamped is None or self._clamped[0] != key:
            stiffness = self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2
            if not self._section.even:
                across, _, _ = self._section.flexibility(np.array([key[0]]), key[1])
                stiffness /= float(across[0])
            self._clamped = key, 0.5 * self._section.thickness_um(*key) / stiffness
        return self._clamped[1]

    def back_um(self, abscissa_um: float) -> float:
        """Return how far it stands back there by what crept or set."""
        return (
            0.0 if self._inelastic is None else self._inelastic.offset_um(self._arm_um(abscissa_um))
        )

    def follow(self, time_s: float, force_un: float, abscissa_um: float) -> None:
        """Take note of the probe's force from now on: it creeps, and may set."""
        if not force_un:
            self._rubbing.leave()
        inelastic = self._inelastic
        if inelastic is None and not force_un:
            return
        if inelastic is None:
            inelastic = self._inelastic = self._new_inelastic(time_s)
        if inelastic is not NOT_INELASTIC:
            ei = self.ei_un_um2(time_s) if self._solved is None else self._solved.in_plane_un_um2
            inelastic.follow(time_s, force_un, self._arm_um(abscissa_um), ei)

    @property
    def restless_s(self) -> float:
        """For how long nothing changes that the probe feels, though all stands still."""
        return math.inf if self._inelastic is None else self._inelastic.restless_s

    def _creep_slope(self, time_s: float) -> float:
        """Return which part of its force goes in each decade of time, in the air of now."""
        slope: float = self.settings.relaxation_per_decade * self._climate.creep(time_s)
        return min(slope, MOST_CREEP)

    def _new_inelastic(self, time_s: float) -> Inelastic:
        hold = next(iter(self.holds.values()))
        each = self.settings
        slope = self._creep_slope(time_s)
        if not slope and each.yield_strain >= NEVER_YIELDS:
            return NOT_INELASTIC
        thick = self._section.thickness_um(hold.at_um, hold.fate.roll_rad)
        curvature = 2.0 * each.yield_strain / thick
        length = hold.free.length_um + hold.depth_um
        made = Inelastic(length, slope=slope, yield_curvature=curvature)
        made.follow(time_s, 0.0, length, 1.0)
        return made

    def jump_um(self, abscissa_um: float, time_s: float) -> float:
        """Return from how far its charge has it jump to a probe there, and stay."""
        if not self.settings.charge_uc_m2:
            return 0.0
        charge = self.settings.charge_uc_m2 * self._climate.charge(time_s)
        stiffness = 3.0 * self.ei_un_um2(time_s) / self._arm_um(abscissa_um) ** 3
        from_um = JUMP_UM * abs(charge) * self.settings.width_um / 30.0 / math.sqrt(stiffness)
        return min(from_um, 0.9 * self._contact.pull_off_un / stiffness)

    def pull_un(self, height_um: float, time_s: float) -> float:
        """Return how hard the plate holds it back that is lifted so high at one end.

        It peels off with the force that bends a strip so far, and the pull-off of all of it is the
        most there is; its charge pulls it down besides.
        """
        each = self.settings
        if not (each.adhesion_un_mm or each.charge_uc_m2):
            return 0.0
        free_mm = 1e-3 * next(iter(self.holds.values())).free.length_um
        most = each.adhesion_un_mm * free_mm * self._climate.adhesion(time_s)
        height = max(height_um, 0.1)
        peeled = max(self.peeled_um(height), 1.0)
        bent = 12.0 * each.ei_n_m2 * EI_UN_UM2_PER_N_M2 * height / peeled**3
        charge = each.charge_uc_m2 * self._climate.charge(time_s)
        return min(bent, most) + IMAGE_UN_UM_MM * charge**2 * free_mm / max(height, 0.5)

    def push(
        self,
        line: Line,
        abscissa_um: float,
        travel_um: float,
        probe: "ProbeShape",
        time_s: float,
        *,
        back_um: float = 0.0,
        height_um: float = 0.0,
    ) -> PushCurve | Push:
        """Return force over travel for a probe at an abscissa, which has come so far.

        Parameters
        ----------
        travel_um, back_um : float
            From where it would stand without the probe, and how far that is back by now.
        height_um : float
            How high above the probe it would stand without it.
        """
        (hold, *more) = self.holds.values()
        if line.free is not None:
            found = self._held_at_one_end(hold, line.free, abscissa_um, probe, time_s)
            # What crept stands back: the contact itself does not slide while the probe stands.
            part, sides = 0.0, found.sides(self._lifting.part)
            if len(sides) > 1:
                part = self._rubbing.follow(sides[0], sides[-1], travel_um, back_um)
            if found.askew is not None:
                forces_un = partial(found.forces_un, part)
                self._lifting.follow(forces_un, travel_um, back_um, height_um, found.askew)
            return found.push(part, self._lifting.part)
        distance = _rounded(line.reach_um + hold.depth_um + more[0].depth_um)
        return held_at_both_ends(
            ei_un_um2=self.settings.ei_n_m2 * EI_UN_UM2_PER_N_M2,
            ea_un=self.settings.ea_n * UN_PER_N,
            span_um=min(_rounded(self._arm_um(abscissa_um)), distance - NEAREST_UM),
            distance_um=distance,
            slack_um=_rounded(self.slack_um(line.reach_um)),
            gripper_un_um=self._contact.gripper_un_um,
            sensor_un_um=probe.sensor_un_um,
        )

    def _arm_um(self, abscissa_um: float) -> float:
        """Return how far from the true clamp a place is, along the jaws."""
        return max(abscissa_um, NEAREST_UM) + next(iter(self.holds.values())).depth_um

    def _held_at_one_end(
        self, hold: Hold, free: Free, abscissa_um: float, probe: "ProbeShape", time_s: float
    ) -> "_Curves":
        """Return the curves of all that friction may do."""
        solved, ei = self._solved, self.ei_un_um2(time_s)
        if (
            solved is None
            or solved.free is not free
            or solved.depth_um != hold.depth_um
            or abs(ei / solved.ei_un_um2 - 1.0) > STALE_PART
        ):
            solved = self._solved = self._solve(hold, free, probe, ei)
            self._curves = None
        place = _rounded(max(abscissa_um, NEAREST_UM))
        if self._curves is None or self._curves.place_um != place:
            shear = self._section.shear_um_un(
                place + hold.depth_um, solved.thickness_um, solved.in_plane_un_um2
            )
            spring = 1.0 / (1.0 / probe.sensor_un_um + shear)
            askew = self._askew(hold, place, ei)
            held = 0.0 if askew is None else askew.most * askew.softer
            stiffer = [1.0 / (1.0 - held), 1.0 / (1.0 + held)] if askew else [1.0]
            curves = tuple(
                tuple(each.curve(place, sensor_un_um=spring, stiffer=times) for times in stiffer)
                for each in solved.cantilevers
            )
            self._curves = _Curves(place, curves, askew)
        return self._curves

    def _askew(self, hold: Hold, place_um: float, ei_un_um2: float) -> Askew | None:
        """Return how it gives way up or down for a push there; None: friction does not hold it."""
        if not self._contact.probe_friction or self.settings.plane_ratio <= 1.0:
            return None
        places, weights = compliance_weights(hold, place_um)
        across, askew, up = (
            float(weights @ each) for each in self._section.flexibility(places, hold.fate.roll_rad)
        )
        cell_um = abs(float(places[1] - places[0]))
        softer = askew / across
        most = min(self._contact.probe_friction, MOST_HELD / max(abs(softer), 1e-9))
        return Askew(softer, askew / up, up * cell_um / ei_un_um2, most)

    def _solve(self, hold: Hold, free: Free, probe: "ProbeShape", ei: float) -> "_Solved":
        friction, section, roll = self._contact.probe_friction, self._section, hold.fate.roll_rad
        rubbed = (friction, 0.0, -friction) if friction else (0.0,)
        begin, outwards = hold.at_um, hold.outwards
        near = begin + outwards * np.linspace(0.0, 0.5 * free.length_um, 40)
        across, _, _ = section.flexibility(near, roll)

        def stiffness(along_um: Floats) -> Floats:
            across, _, _ = section.flexibility(begin + outwards * along_um, roll)
            return np.asarray(1.0 / across)

        def cantilever(pulled: float) -> Cantilever:
            return Cantilever(
                free.abscissas_um,
                free.asides_um,
                ei_un_um2=ei,
                depth_um=hold.depth_um,
                radius_um=probe.edge_um + self.seen_um / 2.0,
                friction=pulled,
                turn_rad_un_um=math.radians(self._contact.jaw_turn_deg) * 1e-3,
                side_un_um=self._contact.jaw_side_un_um,
                probe_un_um=self._contact.probe_side_un_um,
                stiffness=None if section.even else stiffness,
            )

        return _Solved(
            free,
            hold.depth_um,
            ei,
            ei / float(across.mean()),
            section.thickness_um(hold.at_um, roll),
            tuple(cantilever(each) for each in rubbed),
        )

    @property
    def up_part(self) -> float:
        """Part of the force across that pushes the probe up or down."""
        return self._lifting.part


@dataclass(frozen=True, slots=True)
class ProbeShape:
    """What a fibre meets: radius of the edge, and stiffness of the sensor behind it."""

    edge_um: float
    sensor_un_um: float


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """All pushes of one grip, as they were solved for one air."""

    free: Free
    depth_um: float
    ei_un_um2: float
    in_plane_un_um2: float
    thickness_um: float
    cantilevers: tuple[Cantilever, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Curves:
    """All that friction may make of a push at one place.

    Attributes
    ----------
    curves : tuple of tuple of PushCurve
        With all friction that pulls the fibre outwards, none, and all inwards; each with all
        friction down, then up.
    """

    place_um: float
    curves: tuple[tuple[PushCurve, ...], ...]
    askew: Askew | None

    def forces_un(self, part: float, travel_um: float) -> Callable[[float], float]:
        """Return the force at a travel as it depends on the part of the force up.

        It is asked again and again at one travel, where the curves have one value each.
        """
        most = 1.0 if self.askew is None else self.askew.most
        (one, per_one), (other, per_other) = [
            given_um_un(each[0].force_un(travel_um), each[-1].force_un(travel_um))
            for each in (self.curves[0], self.curves[-1])
        ]
        per_one, per_other = per_one / most, per_other / most
        outer, inner = 0.5 + 0.5 * part, 0.5 - 0.5 * part
        return lambda held: outer / (one + per_one * held) + inner / (other + per_other * held)

    def push(self, part: float, held: float) -> PushCurve | Push:
        """Return the push for friction along the fibre, -1 to 1, and a part of the force up."""
        sides = self.sides(held)
        return sides[0] if len(sides) == 1 else RubbedPush(sides[0], sides[1], sides[2], part)

    def sides(self, held: float) -> list[PushCurve | HeldPush]:
        """Return the pushes with all friction along that pulls outwards, none, all inwards."""
        most = 1.0 if self.askew is None else self.askew.most
        return [
            each[0] if len(each) == 1 else HeldPush(each[0], each[1], held / most)
            for each in self.curves
        ]


def _rounded(length_um: float) -> float:
    return round(length_um / SPAN_STEP_UM) * SPAN_STEP_UM
