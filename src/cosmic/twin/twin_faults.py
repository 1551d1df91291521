"""Trouble of the scene itself, injected by name: fibres, tips, lamp, lens, force sensors."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Final

from cosmic.frame.arguments import check_fault
from cosmic.frame.errors import ArgumentError
from cosmic.twin.fate import Fate
from cosmic.twin.handling_settings import HandlingSettings

DRAUGHT: Final = "draught"
GRASP_NAMES: Final = (
    "missed_grasp",
    "slip_in_lift",
    "drop",
    "jaw_adhesion",
    "fibre_break",
    "loose_grip",
    "out_of_plane",
    DRAUGHT,
)
"""They come true at the next grasps, as many as asked for."""

LASTING_NAMES: Final = (
    "tip_bent",
    "light_dimmed",
    "zoom_lost_steps",
    "steps_lost",
    "sensor_drift",
    "sensor_saturated",
    "sensor_dead",
)
"""They hold until they are cleared."""

NAMES: Final = (*GRASP_NAMES, *LASTING_NAMES)


@dataclass(frozen=True, slots=True)
class TwinFault:
    """One fault in force.

    Attributes
    ----------
    tool : str
        Gripper, tool, axis or sensor that it concerns; "": all, or the only one.
    times : int
        How many grasps are left that it spoils.
    amount : float or None
        How much of it; None: as much as is usual.
    """

    name: str
    tool: str = ""
    times: int = 1
    amount: float | None = None


class TwinFaults:
    """Faults of the scene in force; any thread.

    Notes
    -----
    - `missed_grasp`, `slip_in_lift`, `drop`, `jaw_adhesion`, `fibre_break`, `loose_grip`,
      `out_of_plane`: spoil the next `times` grasps, of one gripper or of any, as `[handling]` has
      it. What they need comes later: a fibre breaks when it is bent.
    - `draught`: as a gripper comes down, at the next `times`, the fibre below it is blown `amount`
      (60) um aside, across the jaws.
    - `tip_bent`: the tip of "left", "right" or "probe" is `amount` (30) um off, along the jaws for
      a gripper, sideways for the probe, until cleared.
    - `light_dimmed`: the lamp gives only a part, `amount` (0.3), of its light.
    - `zoom_lost_steps`: the zoom loses `amount` (300) counts, once; homing finds them again.
    - `steps_lost`: a stage without a sensor, `tool`, makes only a part, `amount` (0.5), of each
      step.
    - `sensor_drift`: the zero of a force sensor wanders by `amount` (5) uN each second.
    - `sensor_saturated`: a force sensor stands at the end of its range.
    - `sensor_dead`: it stands at its zero, whatever is felt, and without noise.

    Attributes
    ----------
    begin : callable or None
        Called with the fault and whether it begins, whenever one of those that last does.
    """

    def __init__(self) -> None:
        self.begin: Callable[[TwinFault, bool], None] | None = None
        self._lock = Lock()
        self._active: tuple[TwinFault, ...] = ()

    @property
    def active(self) -> tuple[TwinFault, ...]:
        """The faults in force."""
        return self._active

    def inject(
        self, name: str, *, tool: str = "", times: int = 1, amount: float | None = None
    ) -> None:
        """Put a fault in force.

        Raises
        ------
        ArgumentError
            No such fault, or a number that makes no sense.
        """
        check_fault(name, NAMES)
        if not times >= 1:
            raise ArgumentError(f"fault {name!r}: times must be 1 or more, got {times!r}")
        if amount is not None and not math.isfinite(amount):
            raise ArgumentError(f"fault {name!r}: amount must be a finite number, got {amount!r}")
        fault = TwinFault(name, tool, times, amount)
        if self.begin is not None and name in LASTING_NAMES:
            self.begin(fault, True)
        with self._lock:
            self._active = (*self._active, fault)

    def clear(self, name: str | None = None, *, tool: str | None = None) -> None:
        """End the fault `name`, or all; with a tool only those there.

        Raises
        ------
        ArgumentError
            No such fault.
        """
        if name is not None:
            check_fault(name, NAMES)
        with self._lock:
            ended = [
                each
                for each in self._active
                if name in (None, each.name) and tool in (None, each.tool)
            ]
            self._active = tuple(each for each in self._active if each not in ended)
        for fault in ended:
            if self.begin is not None and fault.name in LASTING_NAMES:
                self.begin(fault, False)

    def foreseen(self, name: str, tool: str) -> TwinFault | None:
        """Return what the next grasp of `tool` is spoilt by, without counting it."""
        fitting = (each for each in self._active if each.name == name)
        return next((each for each in fitting if each.tool in ("", tool)), None)

    def take(self, name: str, tool: str) -> bool:
        """Return whether a grasp of `tool` is spoilt so, and count it."""
        with self._lock:
            for at, fault in enumerate(self._active):
                if fault.name == name and fault.tool in ("", tool):
                    left = replace(fault, times=fault.times - 1)
                    rest = (left,) if left.times else ()
                    self._active = (*self._active[:at], *rest, *self._active[at + 1 :])
                    return True
        return False

    def altered(self, fate: Fate, handling: HandlingSettings, tool: str, key: str) -> Fate:
        """Return the fate of a grasp with what was injected for it."""
        if not self._active:
            return fate
        if self.take("missed_grasp", tool):
            return replace(fate, missed=True)
        chance = random.Random(f"injected {key}")
        weak = chance.uniform(handling.weak_strain_low, handling.weak_strain_high)
        slip = chance.uniform(handling.slip_low_um, handling.slip_high_um)
        drop = chance.uniform(handling.drop_low_um, handling.drop_high_um)
        side = chance.choice((-1.0, 1.0))
        if self.take("slip_in_lift", tool):
            fate = replace(fate, slip_at_um=slip)
        if self.take("drop", tool):
            fate = replace(fate, drop_after_um=drop)
        if self.take("jaw_adhesion", tool):
            fate = replace(fate, sticks=True)
        if self.take("fibre_break", tool):
            fate = replace(fate, break_strain=weak)
        if self.take("loose_grip", tool):
            loosen = chance.uniform(handling.loosen_low_um, handling.loosen_high_um)
            fate = replace(fate, loosen_strain=weak, loosen_um=loosen)
        if self.take("out_of_plane", tool):
            rise = side * math.tan(math.radians(handling.out_of_plane_deg))
            fate = replace(fate, rise=rise)
        return fate
