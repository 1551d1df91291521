"""What grippers do to fibres: take, lift, lose, let go, and what sticks to them afterwards."""

import math
import random
from dataclasses import replace
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.bonds import Bonds
from cosmic.twin.centre_line import CentreLine
from cosmic.twin.climate import Climate
from cosmic.twin.falls import Falls
from cosmic.twin.fate import Fate, draw_fate
from cosmic.twin.fibre import Carried, Fibre
from cosmic.twin.force_settings import ContactSettings
from cosmic.twin.grip import make_hold
from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.kinematics import Point
from cosmic.twin.settings import TwinSettings
from cosmic.twin.surroundings import Record, Surroundings
from cosmic.twin.tools import Tool
from cosmic.twin.twin_faults import DRAUGHT, TwinFaults


class Clinging:
    """How a fibre sticks to a jaw, until it is shaken off or wiped off along the plate.

    Parameters
    ----------
    key : str
        Names seed, fibre and grasp: the same key, the same number of tries.
    position : (float, float, float)
        Of the jaw's tip, um, world.
    """

    def __init__(self, handling: HandlingSettings, key: str, position: Point) -> None:
        self._handling = handling
        self._chance = random.Random(f"free {key}")
        self._turns = list(position)
        self._headings = [0, 0, 0]
        self._last = position
        self._wiped_um = 0.0

    def look(self, position: Point, low_um: float) -> str:
        """Follow the jaw and return "shaken" or "wiped" once the fibre is free, else "".

        Parameters
        ----------
        low_um : float
            Below this height above the plate the fibre touches it.
        """
        if self._shaken(position):
            return "shaken"
        travelled = math.dist(position[:2], self._last[:2])
        self._last = position
        if position[2] >= low_um:
            return ""
        self._wiped_um += travelled
        if self._wiped_um < self._handling.wipe_um:
            return ""
        self._wiped_um = 0.0
        return "wiped" if self._chance.random() < self._handling.wipe_frees else ""

    def _shaken(self, position: Point) -> bool:
        for axis, now in enumerate(position):
            since = now - self._turns[axis]
            heading = self._headings[axis]
            if heading == 0:
                if abs(since) >= self._handling.shake_um:
                    self._headings[axis], self._turns[axis] = (1 if since > 0.0 else -1), now
            elif since * heading > 0.0:
                self._turns[axis] = now
            elif abs(since) >= self._handling.shake_um:
                self._headings[axis], self._turns[axis] = -heading, now
                if self._chance.random() < self._handling.shake_frees:
                    return True
        return False


def between_jaws(
    tool: Tool, line: Floats, widest_um: float, contact: ContactSettings
) -> tuple[float, int] | None:
    """Return where along a fibre the jaws' tip is and which end is outside.

    None where the jaws do not enclose it, or where a part of it lies under them.

    Parameters
    ----------
    line : ndarray, shape (n, 3), float64
        The fibre's middle, um, world.
    widest_um : float
        How far the jaws were open before they closed.
    """
    ahead = (line[:, 0] - tool.hold[0]) * tool.towards
    aside = line[:, 1] - tool.hold[1]
    half = widest_um / 2.0
    if (np.abs(aside[ahead < 0.0]) > half).any():
        return None
    steep = math.tan(math.radians(contact.grasp_angle_deg))
    arcs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
    for after in range(1, len(line)):
        a0, a1 = float(ahead[after - 1]), float(ahead[after])
        if (a0 < 0.0) == (a1 < 0.0):
            continue
        if abs(float(aside[after] - aside[after - 1])) > steep * abs(a1 - a0):
            continue
        part = a0 / (a0 - a1)
        there = line[after - 1] + part * (line[after] - line[after - 1])
        if abs(there[1] - tool.hold[1]) > half:
            continue
        if abs(there[2] - tool.hold[2]) > contact.grasp_height_um:
            continue
        at = float(arcs[after - 1] + part * (arcs[after] - arcs[after - 1]))
        return at, 1 if a1 > a0 else -1
    return None


DRAUGHT_UM: Final = 60.0
DRAUGHT_FROM_UM: Final = 400.0
DRAUGHT_TO_UM: Final = 80.0
"""Heights of a gripper between which it blows a fibre aside."""
BELOW_UM: Final = 200.0
"""How far from the tip a fibre is below it."""

CARRYING_UM: Final = 8.0
"""Way within which something may happen to a fibre that is lifted or will be lost."""


class GripperContacts:
    """The grippers' side of the workplace.

    Parameters
    ----------
    fibres : list of Fibre
        Shared with the workplace; pieces that break off are appended.
    record : callable
        Told each event by name, with facts.
    faults : bool
        Whether anything goes wrong by chance.

    Attributes
    ----------
    gap_um : float
        How far jaws may open or close before they take or let go; as of the last look.
    slack_um : float
        How far tools may go before anything can happen to a fibre; as of the last look.
    held : tuple of Fibre
        Those in grippers, each once; as of the last look.
    """

    def __init__(
        self,
        settings: TwinSettings,
        fibres: list[Fibre],
        seed: int,
        *,
        injected: TwinFaults,
        record: Record,
        faults: bool,
    ) -> None:
        self._contact, self._handling = settings.contact, settings.handling
        self._climate = Climate(settings.climate, seed)
        self.fibres = fibres
        self._seed = seed
        self._injected = injected
        self._record = record
        self._faults = faults
        self._bonds = Bonds(fibres, settings.handling.partner_un, record)
        self._falls = Falls(settings.handling, self._bonds, record, scatter=faults)
        self._in_hand: dict[str, Fibre] = {}
        self._clinging: dict[int, Clinging] = {}
        self._widest: dict[str, float] = {}
        self._came_um: dict[int, tuple[Point, float]] = {}
        self._blown: dict[str, tuple[Fibre | None, float]] = {}
        self._narrowest = min((each.settings.width_um for each in fibres), default=0.0)
        self._thickest = max((each.settings.width_um for each in fibres), default=0.0)
        self.gap_um = self.slack_um = 0.0
        self.held: tuple[Fibre, ...] = ()
        self._begun = self._settled = False

    @property
    def idle(self) -> bool:
        """Whether nothing can happen as long as no jaws open or close."""
        return self._settled and not (self._in_hand or self._clinging or self.windy)

    @property
    def windy(self) -> bool:
        """Whether a fibre is blown aside when the next gripper comes down."""
        return any(each.name == DRAUGHT for each in self._injected.active)

    def plate_changed(self, begin: int) -> None:
        """Take note that the fibres from number `begin` on lie on a new plate."""
        self._settled = False
        widths = [each.settings.width_um for each in self.fibres[begin:]]
        self._narrowest = min(widths, default=0.0)
        self._thickest = max(widths, default=0.0)
        self._bonds.add(self.fibres[begin:], begin)

    def look(self, around: Surroundings) -> None:
        """Go on to where everything is now."""
        if not self._begun:
            self._begun = True
            self._begin(around)
        self.slack_um = CARRYING_UM if self._clinging or self.windy else math.inf
        if self.windy:
            self._blow(around)
        self._watch_all(around)
        if self._in_hand:
            for name, fibre in list(self._in_hand.items()):
                if len(fibre.holds) == 1:
                    self._carry(fibre, around.tools[name], around)
        if self._clinging:
            for number in list(self._clinging):
                self._shake(number, around)
        self.held = tuple(dict.fromkeys(self._in_hand.values())) if self._in_hand else ()

    def _watch_all(self, around: Surroundings) -> None:
        """Watch all jaws, unless they stand as they stood, with what they had."""
        tools = around.tools
        if self._settled:
            for tool in tools.values():
                if tool.gap_um != tool.before_um:
                    break
            else:
                return
        self._settled = all(each.gap_um == each.before_um for each in tools.values())
        self.gap_um = math.inf
        for name, tool in tools.items():
            self._watch(name, tool, around)

    def _watch(self, name: str, tool: Tool, around: Surroundings) -> None:
        """Take, keep or let go with one gripper, as its gap changes."""
        gap = tool.gap_um
        if gap > self._widest.get(name, -math.inf):
            self._widest[name] = gap
        held = self._in_hand.get(name)
        if held is not None:
            if gap > held.settings.width_um:
                self._open(held, tool, around)
            self.gap_um = min(self.gap_um, held.settings.width_um - gap)
        else:
            if gap < tool.before_um:
                self._close(tool, around)
            if gap > self._narrowest:
                self.gap_um = min(self.gap_um, gap - self._thickest)
        if gap <= self._narrowest:
            self._widest[name] = gap

    def _begin(self, around: Surroundings) -> None:
        """Put each fibre where it was left, at the first look."""
        for fibre in self.fibres:
            name, settings = fibre.settings.held_by, fibre.settings
            if name and around.tools[name].gap_um <= settings.width_um:
                tool = around.tools[name]
                inside = settings.length_um - settings.free_um
                at = inside if tool.towards > 0 else settings.free_um
                fate = draw_fate(self._handling, self._contact, f"{fibre.key} 0", faults=False)
                fibre.on_plate = False
                fibre.grip(tool, at_um=at, outwards=tool.towards, fate=fate)
                self._in_hand[name] = fibre

    # ------------------------------------------------------------------ coming down

    def _blow(self, around: Surroundings) -> None:
        """Have the fibre below a gripper that comes down go aside with it."""
        plate = around.plate()
        for name, tool in around.tools.items():
            fault = self._injected.foreseen(DRAUGHT, name)
            height = tool.hold[2] - float(plate[2, 3])
            part = min((DRAUGHT_FROM_UM - height) / (DRAUGHT_FROM_UM - DRAUGHT_TO_UM), 1.0)
            if fault is None or name in self._in_hand:
                continue
            if part <= 0.0:
                self._blown.setdefault(name, (None, 0.0))
            fibre, before = self._blown.get(name, (None, 1.0))  # one that is down comes from above
            if part <= before:
                continue
            fibre = fibre or self._below(tool, around)
            if fibre is None:
                continue
            amount = DRAUGHT_UM if fault.amount is None else fault.amount
            x, y = (plate[:2, :2].T @ np.array([0.0, amount * (part - before)])).tolist()
            x0, y0, angle = fibre.plate_pose
            fibre.plate_pose = x0 + x, y0 + y, angle
            self._blown[name] = fibre, part
            if part >= 1.0:
                del self._blown[name]
                self._injected.take(DRAUGHT, name)
                self._record("blown", fibre=fibre.number, tool=name, by_um=amount)

    def _below(self, tool: Tool, around: Surroundings) -> Fibre | None:
        """Return the lying fibre that is nearest to a gripper's tip, across its jaws."""
        x, y, _ = tool.hold
        near: list[tuple[float, Fibre]] = []
        for each in self.fibres:
            line = self.world_um(each, around)
            line = line[np.argsort(line[:, 0])]
            if each.lies and line[0, 0] <= x <= line[-1, 0]:
                near.append((abs(float(np.interp(x, line[:, 0], line[:, 1])) - y), each))
        away, fibre = min(near, key=lambda pair: pair[0], default=(math.inf, None))
        return fibre if away <= BELOW_UM else None

    # ------------------------------------------------------------------ closing

    def _close(self, tool: Tool, around: Surroundings) -> None:
        """Take the first fibre whose width the gap has just come down to."""
        for fibre in self.fibres:
            if fibre.gone or not tool.gap_um <= fibre.settings.width_um < tool.before_um:
                continue
            line = self.world_um(fibre, around)
            found = between_jaws(tool, line, self._widest[tool.name], self._contact)
            if found is not None:
                self._grasp(fibre, tool, *found)
                return

    def _grasp(self, fibre: Fibre, tool: Tool, at_um: float, outwards: int) -> None:
        fibre.grasps += 1
        fate = self._fate(fibre, tool)
        if fate.missed:
            self._record("missed", fibre=fibre.number, tool=tool.name)
            return
        self._clinging.pop(fibre.number, None)
        fibre.on_plate = fibre.lies
        fibre.grip(tool, at_um=at_um, outwards=outwards, fate=fate)
        self._in_hand[tool.name] = fibre
        self._came_um[fibre.number] = tool.hold, 0.0
        self._bonds.part(fibre)
        self._record(
            "grasped",
            fibre=fibre.number,
            tool=tool.name,
            at_um=at_um,
            free_um=fibre.holds[tool.name].free.length_um,
            depth_um=fate.depth_um,
        )

    def _fate(self, fibre: Fibre, tool: Tool) -> Fate:
        key = f"{fibre.key} {fibre.grasps}"
        fate = draw_fate(
            self._handling, self._contact, key, faults=self._faults, grasps=fibre.grasps - 1
        )
        return self._injected.altered(fate, self._handling, tool.name, key)

    # ------------------------------------------------------------------ carrying

    def _carry(self, fibre: Fibre, tool: Tool, around: Surroundings) -> None:
        fate = fibre.holds[tool.name].fate
        if fibre.on_plate or fate.slip_at_um < math.inf or fate.drop_after_um < math.inf:
            self.slack_um = min(self.slack_um, CARRYING_UM)
        if fibre.on_plate:
            height = max(fibre.height_um(tool), 0.0)
            pull = fibre.pull_un(height, around.time_s)
            if height > 0.0 and pull > fate.grip_un:
                self._record("pulled out", fibre=fibre.number, tool=tool.name, pull_un=pull)
                self._lose(fibre, tool, around, "slipped")
                return
            if fibre.peeled_um(height) >= fibre.holds[tool.name].free.length_um:
                fibre.on_plate = False
                self._record("lifted", fibre=fibre.number, tool=tool.name, height_um=height)
                self._bonds.drag(fibre, tool)
        if fate.slip_at_um < math.inf and fibre.height_um(tool) > fate.slip_at_um:
            self._lose(fibre, tool, around, "slipped")
        elif fate.drop_after_um < math.inf and not fibre.on_plate:
            position, travelled = self._came_um[fibre.number]
            travelled += math.dist(position, tool.hold)
            self._came_um[fibre.number] = tool.hold, travelled
            if travelled > fate.drop_after_um:
                self._lose(fibre, tool, around, "dropped")

    def loosen(self, fibre: Fibre) -> None:
        """Have a grip give way: the fibre is held further inside the jaws."""
        name, hold = next(iter(fibre.holds.items()))
        hold.depth_um += hold.fate.loosen_um
        hold.fate = replace(hold.fate, loosen_strain=math.inf)
        self._record("grip loosened", fibre=fibre.number, tool=name, by_um=hold.fate.loosen_um)

    def snap(self, fibre: Fibre, around: Surroundings, strain: float) -> None:
        """Break a fibre where it leaves the jaws; the outer piece falls."""
        name, hold = next(iter(fibre.holds.items()))
        tool = around.tools[name]
        whole = fibre.line_um.length_um
        low, high = (0.0, hold.at_um) if hold.outwards > 0 else (hold.at_um, whole)
        outer = (hold.at_um, whole) if hold.outwards > 0 else (0.0, hold.at_um)
        piece = self._piece(fibre, *outer)
        piece.carried = Carried(f"{name}.hold", np.zeros((2, 3)), hold.angle_rad, "hanging")
        self.fibres.append(piece)
        self._record("broken", fibre=fibre.number, tool=name, piece=piece.number, strain=strain)
        # The piece keeps the frame of the whole, so it is laid where that is.
        self._falls.fall(piece, hold.frame_um(fibre.line_um, tool.hold), tool, around)
        fibre.line_um = _part_of(fibre.line_um, low, high)
        fibre.settings = fibre.settings.model_copy(update={"length_um": high - low})
        at = high if hold.outwards > 0 else low
        fibre.holds[name] = make_hold(
            fibre.line_um, at - low, hold.outwards, hold.towards, hold.fate
        )

    def _piece(self, fibre: Fibre, low_um: float, high_um: float) -> Fibre:
        settings = fibre.settings.model_copy(
            update={
                "length_um": high_um - low_um,
                "held_by": "",
                "role": "debris",
                "bonded_to": None,
            }
        )
        line = _part_of(fibre.line_um, low_um, high_um)
        number = len(self.fibres)
        return Fibre(
            number, settings, self._contact, self._handling, self._seed, line, self._climate
        )

    # ------------------------------------------------------------------ letting go

    def _open(self, fibre: Fibre, tool: Tool, around: Surroundings) -> None:
        """Open the jaws around a fibre: the other gripper keeps it, or it falls, or it sticks."""
        name = tool.name
        self._settled = False
        self._widest[name] = tool.gap_um
        if len(fibre.holds) > 1:
            del self._in_hand[name], fibre.holds[name]
            self._record("released", fibre=fibre.number, tool=name, sticks=False)
            (other,) = fibre.holds
            self._came_um[fibre.number] = around.tools[other].hold, 0.0
            return
        sticks = fibre.holds[name].fate.sticks
        self._record("released", fibre=fibre.number, tool=name, sticks=sticks)
        if not sticks:
            self._fall(fibre, tool, around)
            return
        hold = fibre.holds[name]
        key = f"{fibre.key} {fibre.grasps}"
        side = random.Random(f"side {key}").choice("ab")
        anchor = f"{name}.jaw_{side}"
        origin = np.array(around.anchor(anchor))
        relative = np.array(tool.hold) + fibre.held_um(around.tools) - origin
        fibre.carried = Carried(anchor, relative, hold.angle_rad, "stuck")
        fibre.holds.clear()
        del self._in_hand[name]
        self._clinging[fibre.number] = Clinging(self._handling, key, around.anchor(anchor))

    def _lose(self, fibre: Fibre, tool: Tool, around: Surroundings, event: str) -> None:
        self._settled = False
        self._record(
            event, fibre=fibre.number, tool=tool.name, height_um=max(fibre.height_um(tool), 0.0)
        )
        self._fall(fibre, tool, around)

    def _shake(self, number: int, around: Surroundings) -> None:
        fibre = self.fibres[number]
        carried = fibre.carried
        if carried is None:
            del self._clinging[number]
            return
        position = around.anchor(carried.anchor)
        how = self._clinging[number].look(position, self._contact.grasp_height_um)
        if how:
            del self._clinging[number]
            tool = around.tools[carried.anchor.partition(".")[0]]
            self._record("came off", fibre=number, tool=tool.name, how=how)
            self._falls.come_down(fibre, tool, around)

    def _fall(self, fibre: Fibre, tool: Tool, around: Surroundings) -> None:
        hold = fibre.holds[tool.name]
        self._in_hand = {name: each for name, each in self._in_hand.items() if each is not fibre}
        self._came_um.pop(fibre.number, None)
        self._falls.fall(fibre, hold.frame_um(fibre.line_um, tool.hold), tool, around)

    # ------------------------------------------------------------------ where a fibre is

    def world_um(self, fibre: Fibre, around: Surroundings) -> Floats:
        """Return the undeformed fibre in the world, shape (n, 3), um."""
        if fibre.holds:
            first = next(iter(fibre.holds))
            return np.asarray(fibre.held_um(around.tools) + around.tools[first].hold)
        if fibre.carried is not None:
            return np.asarray(fibre.carried.line_um + around.anchor(fibre.carried.anchor))
        flat = fibre.line_um.placed(*fibre.plate_pose)
        height = np.full(len(flat), 0.5 * fibre.settings.thickness_um)
        whole = np.column_stack([flat, height, np.ones(len(flat))])
        return np.asarray((whole @ around.plate().T)[:, :3])


def _part_of(line: CentreLine, low_um: float, high_um: float) -> CentreLine:
    return CentreLine(line.part(low_um, high_um)[1])
