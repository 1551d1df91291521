"""Positioners: what is known of each, and what each kind can be asked to do (thesis 5.4)."""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, ClassVar, Final

from typing_extensions import override

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.units import AxisUnit
from cosmic.mico.core.orders import (
    MOTION_WORDS,
    Calibrate,
    Motion,
    MoveBy,
    MoveTo,
    Reference,
    Step,
    ToEndStop,
)
from cosmic.mico.core.settings import PositionerSettings
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
        Wall time of that reading.
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
        Which way a search for the reference begins; None where the controller has not told.
    std : float
        Standard deviation of an estimated position, in `unit`; infinite where nobody knows, 0 of a
        measured one.
    """

    name: str
    address: Channel
    kind: PositionerKind
    unit: AxisUnit
    positioner: PositionerType | None = None
    limits: tuple[float, float] | None = None
    position: float | None = None
    read_wall_s: float = 0.0
    confidence: Confidence = Confidence.UNKNOWN
    activity: Activity = Activity.STOPPED
    zero: float = 0.0
    in_motion: bool = False
    error: str = ""
    present: bool = True
    safe_direction: Direction | None = None
    std: float = 0.0

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


def class_for(kind: PositionerKind, found: PositionerType | None) -> type[PositionerBase]:
    """Return the class that drives a positioner: that of its type, or else of its kind."""
    fallback = POSITIONER_CLASSES[kind]
    return fallback if found is None else TYPE_CLASSES.get(found.code, fallback)
