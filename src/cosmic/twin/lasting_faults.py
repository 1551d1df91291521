"""Does to the scene's parts what faults that last say, and undoes it."""

import math
from collections.abc import Mapping

from cosmic.frame.clock import Clock
from cosmic.frame.errors import ArgumentError
from cosmic.twin.force_side import ForceSide
from cosmic.twin.lens import TwinLens
from cosmic.twin.light import TwinLight
from cosmic.twin.stage import Stage
from cosmic.twin.twin_faults import TwinFault

BENT_UM = 30.0
DIMMED = 0.3
LOST_COUNTS = 300.0
STEPS_MADE = 0.5
DRIFT_UN_S = 5.0


class LastingFaults:
    """Called with each fault that begins or ends; any thread.

    Raises
    ------
    ArgumentError
        There is no such tool, axis or sensor, or too much was asked for.
    """

    def __init__(
        self,
        clock: Clock,
        stages: Mapping[str, Stage],
        force_side: ForceSide,
        lens: TwinLens,
        light: TwinLight,
    ) -> None:
        self._clock = clock
        self._stages = stages
        self._force_side = force_side
        self._lens = lens
        self._light = light

    def __call__(self, fault: TwinFault, begins: bool) -> None:
        """Put it in force, or end it."""
        if fault.name == "tip_bent":
            self._bend(fault, begins=begins)
        elif fault.name == "light_dimmed":
            self._light.dim(_part(fault, DIMMED) if begins else 1.0)
        elif fault.name == "steps_lost":
            self._lose_steps(fault, begins=begins)
        elif fault.name == "zoom_lost_steps":
            if begins:
                travel = LOST_COUNTS if fault.amount is None else fault.amount
                self._lens.turn_by_hand("zoom", -travel, self._clock.now_s())
        else:
            self._disturb(fault, begins=begins)

    def _bend(self, fault: TwinFault, *, begins: bool) -> None:
        tools = self._force_side.offsets.tools
        named = [fault.tool] if fault.tool else tools
        for name in named:
            if name not in tools:
                raise ArgumentError(
                    f"tip_bent: there is no tool {name!r}; known: {', '.join(tools)}"
                )
            amount = BENT_UM if fault.amount is None else fault.amount
            self._force_side.offsets.bend(name, (amount if begins else 0.0, 0.0, 0.0))

    def _lose_steps(self, fault: TwinFault, *, begins: bool) -> None:
        without = [name for name, stage in self._stages.items() if not stage.kind.sensor]
        named = [fault.tool] if fault.tool else without
        for name in named:
            if name not in without:
                raise ArgumentError(
                    f"steps_lost: {name!r} is not a stage without a sensor; known: "
                    f"{', '.join(without)}"
                )
            self._stages[name].step_share = _part(fault, STEPS_MADE) if begins else 1.0

    def _disturb(self, fault: TwinFault, *, begins: bool) -> None:
        sensors = self._force_side.sensors
        named = [fault.tool] if fault.tool else list(sensors)
        for name in named:
            if name not in sensors:
                known = ", ".join(sensors)
                raise ArgumentError(f"{fault.name}: there is no sensor {name!r}; known: {known}")
            if fault.name == "sensor_saturated":
                sensors[name].saturated = begins
            elif fault.name == "sensor_dead":
                sensors[name].dead = begins
            else:
                rate = DRIFT_UN_S if fault.amount is None else fault.amount
                sensors[name].running_un_s = rate if begins else 0.0


def _part(fault: TwinFault, usual: float) -> float:
    part = usual if fault.amount is None else fault.amount
    if not (math.isfinite(part) and 0.0 <= part <= 1.0):
        raise ArgumentError(f"{fault.name}: amount is a part, 0 to 1, got {part!r}")
    return part
