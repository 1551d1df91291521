"""Positioners: what is known of each, and what each kind can be asked to do (thesis 5.4)."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, ClassVar, Final, Self

from typing_extensions import override

from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotAvailable, refusal
from cosmic.frame.plugins import Backend, Kind, make
from cosmic.frame.units import AxisUnit, format_quantity
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.motion.orders import (
    AMPLITUDE_V,
    FREQUENCY_HZ,
    LARGEST_STEPS,
    MOTION_WORDS,
    Calibrate,
    Interval,
    Motion,
    MoveBy,
    MoveTo,
    Reference,
    Step,
    ToEndStop,
)
from cosmic.mico.core.motion.settings import MotionDefaults, PositionerSettings
from cosmic.mico.hw.interface import (
    Activity,
    Channel,
    Controller,
    Direction,
    PositionerKind,
    PositionerType,
)


class Confidence(StrEnum):
    """How well a position is known."""

    KNOWN = "known"
    ESTIMATED = "estimated"
    UNKNOWN = "unknown"


class Status(StrEnum):
    """The three states of fields MiCoOL.1 and MiCoCL.1, and the one for a lost device."""

    OK = "OK"
    BUSY = "BUSY"
    ERROR = "ERROR"
    UNKNOWN = "UNKNOWN"


@dataclass(frozen=True, slots=True)
class PositionerState:
    """All that is known of one positioner at a moment.

    Attributes
    ----------
    address : Channel
        Where the controller library finds it.
    position : float or None
        In gate coordinates and `unit`; None before the first reading. Never NaN.
    read_wall_s : float
        Wall time of that reading; two states that differ in nothing else are the same.
    zero : float
        The user's zero: positions are shown as `position - zero`.
    limits : tuple of float or None
        Soft limits in gate coordinates.
    in_motion : bool
        A command is under way.
    error : str
        What is wrong with it, empty when nothing is.
    present : bool
        Its device answers.
    safe_direction : Direction or None
        Which way a search for the reference begins; None where the controller did not say.
    std : float
        Standard deviation of an estimated position, in `unit`; infinite where nobody knows, 0 of a
        measured one.
    most_steps, frequency_range_hz, amplitude_range_v : int, tuple of int, tuple of float
        What its controller takes: steps of one command, steps a second, volts.
    """

    name: str
    address: Channel
    kind: PositionerKind
    unit: AxisUnit
    positioner: PositionerType | None = None
    limits: tuple[float, float] | None = None
    position: float | None = None
    read_wall_s: float = field(default=0.0, compare=False)
    confidence: Confidence = Confidence.UNKNOWN
    activity: Activity = Activity.STOPPED
    zero: float = 0.0
    in_motion: bool = False
    error: str = ""
    present: bool = True
    safe_direction: Direction | None = None
    std: float = 0.0
    most_steps: int = LARGEST_STEPS
    frequency_range_hz: tuple[int, int] = FREQUENCY_HZ
    amplitude_range_v: tuple[float, float] = AMPLITUDE_V

    @property
    def status(self) -> Status:
        """OK, BUSY, ERROR, or UNKNOWN while its device does not answer."""
        if not self.present:
            return Status.UNKNOWN
        if self.error:
            return Status.ERROR
        return Status.BUSY if self.in_motion or not self.activity.at_rest else Status.OK

    @property
    def shown_position(self) -> float | None:
        """Position from the user's zero, in `unit`."""
        return None if self.position is None else self.position - self.zero

    @property
    def shown_limits(self) -> tuple[float, float] | None:
        """Soft limits from the user's zero, in `unit`."""
        if self.limits is None:
            return None
        return self.limits[0] - self.zero, self.limits[1] - self.zero


def positions_of(states: Mapping[str, PositionerState]) -> dict[str, float]:
    """Return where the axes are, as far as that is known, in gate coordinates."""
    return {name: each.position for name, each in states.items() if each.position is not None}


class PositionerBase:
    """What every positioner has; one subclass per kind, registered in `POSITIONER_CLASSES`.

    Objects belong to one `DeviceDataContainer`, which guards `state`. The methods that talk to
    the controller keep nothing and run in the device thread.
    """

    kind: ClassVar[PositionerKind]
    motions: ClassVar[tuple[type[Motion], ...]] = (Step,)
    advice: ClassVar[str] = ""
    has_sensor: ClassVar[bool] = False

    def __init__(
        self,
        settings: PositionerSettings,
        address: Channel,
        positioner: PositionerType | None = None,
        hold_s: float = math.inf,
    ) -> None:
        self.settings = settings
        self.hold_s = hold_s
        self.frequency_hz: int | None = None
        self.state = PositionerState(
            name=settings.name,
            address=address,
            kind=self.kind,
            unit=settings.unit,
            limits=settings.limits,
            positioner=positioner,
        )

    def update(self, **changes: Any) -> PositionerState:
        """Replace `state` by one with `changes`; under the container's lock."""
        self.state = replace(self.state, **changes)
        return self.state

    def send(self, controller: Controller, motion: Motion) -> None:
        """Send `motion` to the controller; device thread.

        Raises
        ------
        DeviceError
            The library did not take it, or this kind cannot do it.
        """
        if not isinstance(motion, Step):
            raise DeviceError(
                f"{self.state.name}: {MOTION_WORDS[type(motion)]} does not fit; {self.advice}",
                fault=DeviceFault.WRONG_KIND,
            )
        controller.step(
            self.state.address,
            motion.steps,
            amplitude_v=motion.amplitude_v,
            frequency_hz=motion.frequency_hz,
        )


class PositionerOL(PositionerBase):
    """A positioner without sensor: it makes steps, and its position is counted, not measured."""

    kind = PositionerKind.OPEN_LOOP
    advice = "it has no sensor; move it by steps"

    def __init__(
        self,
        settings: PositionerSettings,
        address: Channel,
        positioner: PositionerType | None = None,
        hold_s: float = math.inf,
    ) -> None:
        super().__init__(settings, address, positioner, hold_s)
        self.update(
            position=settings.start_um or 0.0, confidence=Confidence.ESTIMATED, std=math.inf
        )


class PositionerCL(PositionerBase):
    """A positioner with sensor, linear or rotary."""

    motions = (Step, MoveTo, MoveBy, Calibrate, Reference, ToEndStop)

    has_sensor = True

    @override
    def send(self, controller: Controller, motion: Motion) -> None:
        address = self.state.address
        match motion:
            case MoveTo():
                controller.move_to(address, motion.target, motion.unit, hold_s=self.hold_s)
            case Calibrate():
                controller.calibrate(address)
            case Reference():
                controller.reference(address, hold_s=self.hold_s)
            case ToEndStop():
                controller.move_to_end_stop(address, motion.direction, hold_s=self.hold_s)
            case _:
                super().send(controller, motion)


class LinearPositioner(PositionerCL):
    """A linear positioner with sensor."""

    kind = PositionerKind.LINEAR
    advice = "give micrometres"


class RotaryPositioner(PositionerCL):
    """A rotary positioner with sensor."""

    kind = PositionerKind.ROTARY
    advice = "give degrees"


POSITIONER_CLASSES: Final[dict[PositionerKind, type[PositionerBase]]] = {
    PositionerKind.OPEN_LOOP: PositionerOL,
    PositionerKind.LINEAR: LinearPositioner,
    PositionerKind.ROTARY: RotaryPositioner,
}

TYPE_CLASSES: Final[dict[int, type[PositionerBase]]] = {}
"""Positioner types, by the vendor's number, that need more than the class of their kind."""


@dataclass(frozen=True, slots=True)
class PositionerDriver:
    """A positioner type that the configuration names: ``type`` of a ``[[mico.positioner]]``.

    Attributes
    ----------
    positioner : type of PositionerBase
        What drives it; of the kind that the configuration says.
    card : str
        "module:class" of the card that shows it, loaded by windows only; empty: that of its kind.
    """

    positioner: type[PositionerBase]
    card: str = ""


PositionerBackend = Backend[None, PositionerDriver]
"""What an entry point of the group ``cosmic.positioners`` leads to."""


def positioner_driver(name: str) -> PositionerDriver:
    """Return the positioner type of that name.

    Raises
    ------
    ConfigError
        There is none, or it cannot be loaded.
    """
    driver: PositionerDriver = make(Kind.POSITIONER, name, None)
    return driver


def known_driver(found: PositionerType | None) -> PositionerDriver | None:
    """Return the driver that is named for what was found; None where none is, or is not here."""
    if found is None or not found.driver:
        return None
    try:
        return positioner_driver(found.driver)
    except ConfigError:  # named at a station that has the package, which this process lacks
        return None


def class_for(kind: PositionerKind, found: PositionerType | None) -> type[PositionerBase]:
    """Return the class that drives a positioner: that of its type, or else of its kind."""
    driver = known_driver(found)
    if driver is not None:
        return driver.positioner
    fallback = POSITIONER_CLASSES[kind]
    return fallback if found is None else TYPE_CLASSES.get(found.code, fallback)


def _own(positioner: type[PositionerBase]) -> PositionerBackend:
    return PositionerBackend(lambda _options, _context: PositionerDriver(positioner))


LINEAR: Final = _own(LinearPositioner)
ROTARY: Final = _own(RotaryPositioner)
OPEN_LOOP: Final = _own(PositionerOL)


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
        How well a run against an end stop locates the axis.
    """

    low: float
    high: float
    step_um: float
    step_std: float
    end_std_um: float

    @classmethod
    def of(cls, axis: PositionerSettings, defaults: MotionDefaults) -> Self:
        """Return that of an axis without sensor."""
        low, high = axis.travel_um or (-math.inf, math.inf)
        return cls(
            low=low,
            high=high,
            step_um=axis.step_um or defaults.nominal_step_um,
            step_std=STEP_STD if axis.step_std is None else axis.step_std,
            end_std_um=END_STD_UM if axis.end_std_um is None else axis.end_std_um,
        )

    def around(self, position: float, std: float) -> Interval:
        """Return where the axis can be that is believed to be at `position`."""
        off = TIMES_STD * std
        low, high = max(self.low, position - off), min(self.high, position + off)
        return Interval(min(low, self.high), max(high, self.low))

    def after(self, position: float, std: float, distance: float) -> tuple[float, float]:
        """Return position and standard deviation after steps that count for `distance`, um.

        Where they must have reached an end stop, the axis is there; otherwise the uncertainty
        grows by a part of the way.
        """
        place = self.around(position, std)
        least = abs(distance) * (1.0 - TIMES_STD * self.step_std)
        if distance < 0.0 and least >= place.high - self.low:
            return self.low, self.end_std_um
        if distance > 0.0 and least >= self.high - place.low:
            return self.high, self.end_std_um
        return min(max(position + distance, self.low), self.high), std + self.step_std * abs(
            distance
        )

    def refuse_beyond(
        self, state: PositionerState, distance: float, held: Interval | None
    ) -> MoveVerdict | None:
        """Return why steps that count for `distance` must not be made, or None.

        They are refused when they drive against an end stop for longer than it takes to be there
        for sure, wherever in its uncertainty the axis stands. Towards the inside all may be made.
        """
        here = state.position or 0.0
        place = self.around(here, state.std)
        if held is not None:
            place = place.union(Interval(max(self.low, held.low), min(self.high, held.high)))
        room = place.high - self.low if distance < 0.0 else self.high - place.low
        least = abs(distance) * (1.0 - TIMES_STD * self.step_std)
        if least <= (1.0 + OVER) * room + OVER_UM:
            return None
        limit = (self.low if distance < 0.0 else self.high) - state.zero
        value = here + distance - state.zero
        off = f" ± {format_quantity(state.std, 'um')}" if math.isfinite(state.std) else ", unsure"
        text = (
            f"{state.name}: estimated at {format_quantity(here - state.zero, 'um')}{off}; "
            f"the steps count to {format_quantity(value, 'um')}, beyond its end stop at "
            f"{format_quantity(limit, 'um')}. Make fewer steps, or set the estimate"
        )
        return refuse(
            Reason.LIMIT, text, axis=state.name, value=value, limit=limit, unit=state.unit
        )


def counted_travels(
    axes: Iterable[PositionerSettings], defaults: MotionDefaults
) -> Mapping[str, CountedTravel]:
    """Return those of all axes without sensor, by name."""
    return {
        each.name: CountedTravel.of(each, defaults)
        for each in axes
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
        raise NotAvailable(f"{state.name}: it is moving; set the estimate when it is stationary")
    if not (math.isfinite(position) and std >= 0.0):
        text = f"{state.name}: {position!r} ± {std!r} is not an estimate"
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
