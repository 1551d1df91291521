"""The position of an axis without sensor: counted from steps, with bounds and an uncertainty."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

from cosmic.frame.errors import NotAvailable, refusal
from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.orders import Interval
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings, PositionerSettings
from cosmic.mico.hw.interface import PositionerKind

TIMES_STD: Final = 3.0
"""So many standard deviations the gate allows for."""
STEP_STD: Final = 0.1
"""Default of `step_std`: a guess; loads, direction and temperature change a stick-slip step so."""
END_STD_UM: Final = 20.0
"""Default of `end_std_um`: a guess; a fibre of 20 to 50 um may keep the jaws from their stop."""
OVER: Final = 0.1
OVER_UM: Final = 10.0


@dataclass(frozen=True, slots=True)
class CountedTravel:
    """Counts the steps of one axis; pure.

    Attributes
    ----------
    low, high : float
        Its end stops, um; infinite where the configuration names none.
    step_um : float
        What a step at 100 V is taken to go.
    step_std : float
        Part of the way counted by which the true one may differ, a standard deviation.
    end_std_um : float
        How well a run against an end stop tells where the axis is.
    """

    low: float
    high: float
    step_um: float
    step_std: float
    end_std_um: float

    @classmethod
    def of(cls, axis: PositionerSettings, settings: MicoSettings) -> Self:
        """Return that of an axis without sensor."""
        low, high = axis.travel_um or (-math.inf, math.inf)
        return cls(
            low=low,
            high=high,
            step_um=axis.step_um or settings.defaults.nominal_step_um,
            step_std=STEP_STD if axis.step_std is None else axis.step_std,
            end_std_um=END_STD_UM if axis.end_std_um is None else axis.end_std_um,
        )

    def around(self, position: float, std: float) -> Interval:
        """Return where the axis can be that is believed to be at `position`."""
        off = TIMES_STD * std
        low, high = max(self.low, position - off), min(self.high, position + off)
        return Interval(min(low, self.high), max(high, self.low))

    def after(self, position: float, std: float, way: float) -> tuple[float, float]:
        """Return position and standard deviation after steps that count for `way`, um.

        Where they must have reached an end stop, the axis is there; otherwise the uncertainty
        grows by a part of the way.
        """
        place = self.around(position, std)
        least = abs(way) * (1.0 - TIMES_STD * self.step_std)
        if way < 0.0 and least >= place.high - self.low:
            return self.low, self.end_std_um
        if way > 0.0 and least >= self.high - place.low:
            return self.high, self.end_std_um
        return min(max(position + way, self.low), self.high), std + self.step_std * abs(way)

    def refuse_beyond(
        self, state: PositionerState, way: float, held: Interval | None
    ) -> MoveVerdict | None:
        """Return why steps that count for `way` must not be made, or None.

        They are refused when they drive against an end stop for longer than it takes to be there
        for sure, wherever in its uncertainty the axis stands. Towards the inside all may be made.
        """
        here = state.position or 0.0
        place = self.around(here, state.std)
        if held is not None:
            place = place.hull(Interval(max(self.low, held.low), min(self.high, held.high)))
        room = place.high - self.low if way < 0.0 else self.high - place.low
        least = abs(way) * (1.0 - TIMES_STD * self.step_std)
        if least <= (1.0 + OVER) * room + OVER_UM:
            return None
        limit = (self.low if way < 0.0 else self.high) - state.zero
        value = here + way - state.zero
        off = f" ± {format_quantity(state.std, 'um')}" if math.isfinite(state.std) else ", unsure"
        text = (
            f"{state.name}: estimated at {format_quantity(here - state.zero, 'um')}{off}; "
            f"the steps count to {format_quantity(value, 'um')}, beyond its end stop at "
            f"{format_quantity(limit, 'um')}. Make fewer steps, or set the estimate"
        )
        return refuse(
            Reason.LIMIT, text, axis=state.name, value=value, limit=limit, unit=state.unit
        )


def counted_travels(settings: MicoSettings) -> Mapping[str, CountedTravel]:
    """Return those of all axes without sensor, by name."""
    return {
        each.name: CountedTravel.of(each, settings)
        for each in settings.positioner
        if each.positioner_kind is PositionerKind.OPEN_LOOP
    }


def check_estimate(
    state: PositionerState, travel: CountedTravel | None, position: float, std: float
) -> None:
    """Raise unless an axis may be said to stand at `position`, in gate coordinates.

    Raises
    ------
    NotAvailable
        It has a sensor, or is moving.
    MoveRefused
        The numbers are none, or lie outside its travel.
    """
    if travel is None or state.kind is not PositionerKind.OPEN_LOOP:
        raise NotAvailable(f"{state.name}: it has a sensor; its position is measured")
    if state.in_motion or not state.activity.at_rest:
        raise NotAvailable(f"{state.name}: it is moving; set the estimate when it stands")
    if not (math.isfinite(position) and std >= 0.0):
        text = f"{state.name}: {position!r} ± {std!r} is no estimate"
        raise refusal(refuse(Reason.NOT_FINITE, text, axis=state.name))
    if not travel.low <= position <= travel.high:
        limit = (travel.low if position < travel.low else travel.high) - state.zero
        text = (
            f"{state.name}: an estimate of {format_quantity(position - state.zero, 'um')} "
            f"is beyond its end stop at {format_quantity(limit, 'um')}"
        )
        value = position - state.zero
        raise refusal(
            refuse(Reason.LIMIT, text, axis=state.name, value=value, limit=limit, unit="um")
        )
