"""Where grippers, fibres and probe meet: who holds what, and what the probe feels."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import NotAvailable
from cosmic.twin.climate import Climate
from cosmic.twin.contacts import PLATE_HALF_UM, Contacts
from cosmic.twin.felt import Felt, Moment, Push
from cosmic.twin.fibre import Fibre, Line, ProbeShape
from cosmic.twin.fibre_state import state_of
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.gripper_contacts import GripperContacts
from cosmic.twin.kinematics import Point, Skeleton
from cosmic.twin.offsets import ToolOffsets
from cosmic.twin.probe_contact import ProbeContact
from cosmic.twin.probe_to_jaws import ProbeToJaws
from cosmic.twin.settings import TwinSettings
from cosmic.twin.tools import Gripper, Tool, added
from cosmic.twin.truth import NO_TRUTH, Truth, record_plate
from cosmic.twin.twin_faults import TwinFaults

NOTHING: Final = 0.0
PROBE: Final = "probe"


class Around:
    """Where everything is at one look; see `Surroundings`."""

    __slots__ = ("_plate", "_values", "_workspace", "time_s", "tools")

    def __init__(
        self,
        workspace: "Workspace",
        values: Mapping[str, float],
        tools: dict[str, Tool],
        time_s: float,
    ) -> None:
        self.tools: Mapping[str, Tool] = tools
        self._workspace = workspace
        self._values = values
        self.time_s = time_s
        self._plate: Floats | None = None

    def plate(self) -> Floats:
        """Return `world_from_plate`, shape (4, 4), um."""
        if self._plate is None:
            self._plate = self._workspace.plate(self._values)
        return self._plate

    def anchor(self, name: str) -> Point:
        """Return a tip by name; see `Workspace.tips`."""
        return self._workspace.tip(name, self._values, self.time_s)


class Workspace:
    """Grippers, fibres, plate and probe; `look` takes them from one moment to the next.

    Parameters
    ----------
    settings : TwinSettings
        Constants.
    skeleton : Skeleton
        Geometry.
    sensor_un_um : float
        Stiffness of the sensor behind the probe.
    truth : Truth
        Told what happens.
    folder : Path or None
        Of twin.toml, when bodies that run into each other are to be told of too.

    Attributes
    ----------
    fibres : list of Fibre
        As twin.toml or the sample numbers them; pieces that broke off follow.
    faults : TwinFaults
        What was injected.
    gripper_stages : frozenset of str
        The stages that open and close jaws.
    offsets : ToolOffsets
        How far tools are from where the drawing has them.
    """

    def __init__(
        self,
        settings: TwinSettings,
        skeleton: Skeleton,
        *,
        sensor_un_um: float,
        seed: int,
        faults: TwinFaults | None = None,
        truth: Truth = NO_TRUTH,
        folder: Path | None = None,
    ) -> None:
        self._settings = settings
        self._seed = seed
        self._geometry = settings.geometry
        self._contact = settings.contact
        self._sensor = sensor_un_um
        self._skeleton = skeleton
        self._truth = truth
        self._time_s = 0.0
        self._probe = skeleton.slide(self._geometry.probe)
        self._probe_shape = ProbeShape(self._geometry.probe_edge_radius_um, sensor_un_um)
        self.climate = Climate(settings.climate, seed)
        self._grippers = {
            name: Gripper(skeleton, gripper.stage, gripper.jaws, self._geometry.hold_height_um)
            for name, gripper in self._geometry.grippers.items()
        }
        self.faults = faults or TwinFaults()
        wander = settings.handling.default_faults
        self.offsets = ToolOffsets((*self._grippers, PROBE), settings.handling, seed, wander=wander)
        self.fibres = [
            Fibre(number, fibre, settings.contact, settings.handling, seed, climate=self.climate)
            for number, fibre in enumerate(settings.fibres)
        ]
        self._gripper_contacts = GripperContacts(
            settings, self.fibres, seed, injected=self.faults, record=self._record, faults=wander
        )
        self._touches: dict[int, ProbeContact] = {}
        self._peaks_un: dict[int | str, float] = {}
        self._jaw_touches = {name: ProbeContact() for name in self._grippers}
        self._gaps: dict[str, float] = {}
        self.gripper_stages = frozenset(each.stage for each in self._geometry.grippers.values())
        self._jaw_stages = [(name, each.stage) for name, each in self._geometry.grippers.items()]
        jaws = [slide for each in self._grippers.values() for slide in each.slides]
        self._clear = ProbeToJaws([self._probe, *jaws], self.gripper_stages)
        self._clear_after_um = self._jaws_clear_um = 0.0
        self._slack_um = 0.0
        self._contacts: Contacts | None = None
        if folder is not None:
            self._contacts = Contacts(settings, folder, skeleton, self._record)

    @property
    def stages(self) -> frozenset[str]:
        """Names of the stages that anything here depends on."""
        geometry = self._geometry
        joints = {each.stage for each in geometry.joints.values()}
        return frozenset(joints | {each.stage for each in geometry.grippers.values()})

    # ------------------------------------------------------------------ seen from outside

    def tips(self, values: Mapping[str, float], time_s: float) -> dict[str, Point]:
        """Return where the tips of the tools are, um, world.

        Keys are "probe", and for each gripper "left.jaw_a" and "left.jaw_b", the inner lower
        edges of its jaws' tips, and "left.hold", where a fibre leaves the jaws.
        """
        found = {PROBE: added(self._probe.at(values), self.offsets.at(PROBE, time_s))}
        for name, gripper in self._grippers.items():
            offset = self.offsets.at(name, time_s)
            found[f"{name}.jaw_a"], found[f"{name}.jaw_b"] = gripper.jaws_at(values, offset)
            found[f"{name}.hold"] = gripper.tool(name, values, offset).hold
        return found

    def tip(self, name: str, values: Mapping[str, float], time_s: float) -> Point:
        """Return one of the tips."""
        return self.tips(values, time_s)[name]

    def plate(self, values: Mapping[str, float]) -> Floats:
        """Return `world_from_plate`, shape (4, 4), um."""
        return self._skeleton.pose(self._geometry.plate, values)

    def moment(self, time_s: float, values: Mapping[str, float], felt: Felt) -> Moment:
        """Return the truth at the moment looked at last."""
        tools = self._tools(values, time_s)
        tips, plate = self.tips(values, time_s), self.plate(values)
        there = (fibre for fibre in self.fibres if not fibre.removed)
        states = tuple(state_of(fibre, tools, tips, plate) for fibre in there)
        return Moment(time_s, felt.total_un, felt.pushes, felt.jaw_un, tips, states)

    # ------------------------------------------------------------------ going through time

    def look(self, values: Mapping[str, float], time_s: float) -> Felt:
        """Take everything to where the stages are now, and return what the probe feels."""
        self._time_s = time_s
        slack_um = self._without_jaws_um(values, time_s)
        if slack_um is not None and slack_um < self._clear_after_um:
            self._clear.pass_by()
            return Felt((), 0.0, slack_um, self._gripper_contacts.gap_um)
        if self._clear.passed:
            self._look_back()
        return self._look_at_all(values, time_s, slack_um)

    def _without_jaws_um(self, values: Mapping[str, float], time_s: float) -> float | None:
        """Return the slack of all bodies where jaws need not be asked, else None."""
        clear, drift_um_s = self._clear, self.offsets.fastest_um_s
        if self._contacts is None or clear.left_um <= 0.0 or drift_um_s is None:
            return None
        if self._gripper_contacts.windy:
            return None
        for name, stage in self._jaw_stages:
            if values[stage] != self._gaps[name]:
                return None
        self._clear_after_um = clear.after_um(values, time_s, drift_um_s)
        if self._clear_after_um <= 0.0:
            return None
        return self._contacts.look(values, time_s, self.offsets)

    def _look_back(self) -> None:
        """Have the jaws see the last look, which left them out: they know where they came from."""
        values, time_s = self._clear.before()
        probe = added(self._probe.at(values), self.offsets.at(PROBE, time_s))
        for name, tool in self._tools(values, time_s).items():
            self._jaw(name, tool, probe)

    def _look_at_all(
        self, values: Mapping[str, float], time_s: float, bodies_um: float | None
    ) -> Felt:
        """Return what the probe feels; `bodies_um` as of this look, None: not asked for yet."""
        tools = self._tools(values, time_s)
        around = Around(self, values, tools, time_s)
        grippers = self._gripper_contacts
        grippers.look(around)
        probe = added(self._probe.at(values), self.offsets.at(PROBE, time_s))
        self._slack_um = grippers.slack_um
        pushes: tuple[Push, ...] = ()
        for fibre in grippers.held:
            push = self._push(fibre, tools, probe, around)
            if push is not None:
                pushes += (push,)
        if bodies_um is None and self._contacts is not None:
            bodies_um = self._contacts.look(values, time_s, self.offsets)
        if bodies_um is not None:
            self._nothing_before(bodies_um)
        self._jaws_clear_um = math.inf
        on_jaws: dict[str, float] = {}
        for name, tool in tools.items():
            self._gaps[name] = tool.gap_um
            force = self._jaw(name, tool, probe)
            if force:
                on_jaws[name] = force
        if pushes or on_jaws or self._peaks_un:
            self._note(pushes, on_jaws)
        steady = self.offsets.fastest_um_s is not None
        if steady and grippers.idle and self._jaws_clear_um > self._slack_um:
            self._clear.begin(values, time_s, self._jaws_clear_um)
        else:
            self._clear.end()
        return Felt(pushes, sum(on_jaws.values(), 0.0), self._slack_um, grippers.gap_um)

    def change_plate(
        self, values: Mapping[str, float], number: int, fibres: tuple[FibreSettings, ...]
    ) -> None:
        """Take everything off the plate, and put another with other fibres there.

        Raises
        ------
        NotAvailable
            As for `check_plate_change`.
        """
        self.check_plate_change(values)
        for fibre in self.fibres:
            fibre.gone = fibre.removed = True
        begin = len(self.fibres)
        self.fibres += [
            Fibre(
                begin + place,
                each,
                self._contact,
                self._settings.handling,
                self._seed,
                climate=self.climate,
            )
            for place, each in enumerate(fibres)
        ]
        self._gripper_contacts.plate_changed(begin)
        self._clear.left_um = 0.0
        record_plate(self._truth, self._time_s, number, begin, fibres)

    def check_plate_change(self, values: Mapping[str, float]) -> None:
        """Check that the plate can be taken away.

        Raises
        ------
        NotAvailable
            A gripper holds something, something sticks to a jaw, or jaws stand too low.
        """
        if any(fibre.holds or fibre.carried for fibre in self.fibres):
            raise NotAvailable("a fibre is in the jaws or sticks to them; put it away first")
        top = float(self.plate(values)[2, 3])
        clear = self._settings.plate.clear_um
        for name, (x, y, z) in self.tips(values, self._time_s).items():
            if ".jaw_" in name and z - top < clear and max(abs(x), abs(y)) < PLATE_HALF_UM:
                raise NotAvailable(
                    f"{name} stands {z - top:.0f} um above the plate; lift it to {clear:g} um"
                )

    def _nothing_before(self, slack_um: float) -> None:
        """Take note that something may happen after so much way."""
        if slack_um < self._slack_um:
            self._slack_um = max(slack_um, 0.0)

    def _tools(self, values: Mapping[str, float], time_s: float) -> dict[str, Tool]:
        at, before = self.offsets.at, self._gaps.get
        return {
            name: each.tool(name, values, at(name, time_s), before(name))
            for name, each in self._grippers.items()
        }

    def finish(self) -> None:
        """Tell what lasts until the end."""
        self._note((), {})
        if self._contacts is not None:
            self._contacts.finish()

    def _record(self, event: str, **facts: object) -> None:
        self._truth.record(self._time_s, event, **facts)

    # ------------------------------------------------------------------ probe

    def _push(
        self, fibre: Fibre, tools: dict[str, Tool], probe: Point, around: Around
    ) -> Push | None:
        line = fibre.line(tools)
        if line.free is None:
            fibre.slip(line.reach_um)
            line = fibre.line(tools)
        touch = self._touches.get(fibre.number)
        if touch is None:
            touch = self._touches[fibre.number] = ProbeContact()
        along = line.abscissa_um(probe[0] + self._geometry.probe_contact_um)
        back = fibre.back_um(along)
        travel = line.y_um(along) + fibre.seen_um / 2.0 - probe[1] - back
        higher = line.z_um(along) - probe[2]
        reach = self._reach(fibre, line, along, higher)
        jump = fibre.jump_um(along, self._time_s) if line.free is not None else 0.0
        if not touch.look(reach, travel + jump):
            self._nothing_before(max(-reach, -travel - jump))
            fibre.follow(self._time_s, 0.0, along)
            return None
        self._slack_um = 0.0
        curve = fibre.push(
            line,
            along,
            travel,
            self._probe_shape,
            self._time_s,
            back_um=back,
            height_um=higher,
        )
        force, along_un = curve.both_un(travel)
        if travel > curve.reach_um:
            touch.lose()
            return None
        if force < -self._contact.pull_off_un:
            touch.come_off()
            return None
        deflection = travel + back - force / self._sensor
        if line.free is None:
            return Push(fibre.number, force, along, deflection)
        if not self._bears(fibre, along, force, around):
            touch.lose()
            return None
        fibre.follow(self._time_s, force, along)
        outwards = line.towards * along_un
        return Push(fibre.number, force, along, deflection, outwards, fibre.up_part * force)

    def _bears(self, fibre: Fibre, along: float, force_un: float, around: Around) -> bool:
        """Return whether the fibre bears the bending; a grip that gives way shows later."""
        (hold,) = fibre.holds.values()
        strain = fibre.strain(along, force_un)
        if strain > hold.fate.loosen_strain:
            self._gripper_contacts.loosen(fibre)
        if strain > hold.fate.break_strain:
            self._gripper_contacts.snap(fibre, around, strain)
            return False
        return True

    def _reach(self, fibre: Fibre, line: Line, along_um: float, higher_um: float) -> float:
        thick = self._geometry.probe_half_width_um + fibre.settings.thickness_um / 2.0
        return min(along_um, line.reach_um - along_um, thick - abs(higher_um))

    def _note(self, pushes: tuple[Push, ...], on_jaws: Mapping[str, float]) -> None:
        """Tell when the probe comes to a fibre or a jaw, and the highest force once it has left."""
        forces: dict[int | str, float] = {push.fibre: push.force_un for push in pushes}
        forces.update(on_jaws.items())
        along = {push.fibre: push.abscissa_um for push in pushes}
        for what, force in forces.items():
            if what not in self._peaks_un:
                at = self._of_span(what, along[what]) if isinstance(what, int) else {}
                self._record("touched", **_named(what), **at)
            self._peaks_un[what] = max(self._peaks_un.get(what, 0.0), abs(force))
        for what in [each for each in self._peaks_un if each not in forces]:
            self._record("left", **_named(what), peak_un=self._peaks_un.pop(what))

    def _of_span(self, number: int, abscissa_um: float) -> dict[str, float]:
        """Return what is true of a push that begins."""
        fibre = self.fibres[number]
        found = {"abscissa_um": abscissa_um}
        if len(fibre.holds) == 1:
            found["ei_n_m2"] = fibre.span_ei_n_m2(abscissa_um, self._time_s)
            found["orientation_deg"] = fibre.orientation_deg
            found["rh_percent"] = self.climate.rh_percent(self._time_s)
        return found

    @property
    def restless_s(self) -> float:
        """For how long nothing changes that the probe feels, though all stages stand."""
        restless_s = math.inf
        for each in self._gripper_contacts.held:
            restless_s = min(restless_s, each.restless_s)
        return restless_s

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
        travel = face - probe[1]
        touch = self._jaw_touches[name]
        if not touch.look(reach, travel):
            clear_um = max(-reach, -travel)
            self._jaws_clear_um = min(self._jaws_clear_um, clear_um)
            self._nothing_before(clear_um)
            return NOTHING
        self._slack_um = self._jaws_clear_um = 0.0
        if travel < 0.0:
            touch.come_off()
            return NOTHING
        return self._sensor * travel


def _named(what: int | str) -> dict[str, int | str]:
    return {"fibre": what} if isinstance(what, int) else {"tool": what}
