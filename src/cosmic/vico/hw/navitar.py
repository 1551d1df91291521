"""The motorised lens behind a Navitar controller of either generation."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.plugins import NoOptions
from cosmic.vico.hw.navitar_protocol import (
    SECOND_AXIS,
    Found,
    MotorCommand,
    Product,
    Register,
    Registers,
    motor_status,
    open_line,
)
from cosmic.vico.hw.peripherals import (
    Lens,
    LensAxis,
    LensBackend,
    LensState,
    PeripheralContext,
)

logger = logging.getLogger(__name__)

START_S: Final = 0.5
"""A motor that was told to home has begun by then."""

NEAR_HOME_COUNTS: Final = 5
"""Homing ends this near to 0, or something came in between."""


@dataclass(slots=True)
class _Motor:
    """What the controller does not tell: whether its counting means anything."""

    first: int
    limit: int | None
    homed: bool
    homing_since_s: float | None = None
    begun: bool = False
    last_counts: int = 0
    target: int = 0


class NavitarLens(Lens):
    """Zoom on axis 1, focus on axis 2.

    Parameters
    ----------
    registers : Registers
        Closed with this object.
    homed : bool
        The controller has been homed and kept under power since; there is no way to ask it.
    limits_counts : mapping of LensAxis to int
        Far ends, where the controller's own are not to be used.
    """

    def __init__(
        self,
        registers: Registers,
        *,
        name: str,
        homed: bool = False,
        limits_counts: Mapping[LensAxis, int] | None = None,
    ) -> None:
        self._registers = registers
        self._name = name
        self._own_limits = dict(limits_counts or {})
        self._motors = {
            axis: _Motor(first, self._own_limits.get(axis), homed)
            for axis, first in ((LensAxis.ZOOM, 0), (LensAxis.FOCUS, SECOND_AXIS))
        }

    @property
    @override
    def name(self) -> str:
        return self._name

    @override
    def state(self, axis: LensAxis) -> LensState:
        motor = self._motors[axis]
        # First the status: a motor that stands now stands where it is asked next.
        status = motor_status(self._read(motor, Register.STATUS))
        counts = self._read(motor, Register.POSITION)
        self._learn(axis, motor, counts, moving=status.moving, at_home=status.at_home)
        return LensState(
            position_counts=counts,
            limit_counts=self._limit(motor),
            moving=status.moving,
            homed=motor.homed,
            at_home=status.at_home,
            at_limit=status.at_limit,
        )

    @override
    def home(self, axis: LensAxis) -> None:
        motor = self._motors[axis]
        motor.homed, motor.begun, motor.target = False, False, 0
        motor.limit = self._own_limits.get(axis)  # it may be counted anew
        logger.debug("%s: home %s", self.name, axis)
        motor.homing_since_s = None
        self._write(motor, Register.COMMAND, MotorCommand.HOME)
        motor.homing_since_s = WALL.now_s()

    @override
    def seek(self, axis: LensAxis, target_counts: int) -> None:
        motor = self._motors[axis]
        if not motor.homed:
            raise NotAvailable(
                f"{self.name}: {axis} has not been homed and its position is unknown; home it first"
            )
        limit = self._limit(motor)
        if not 0 <= target_counts <= limit:
            raise ConfigError(
                f"{self.name}: {axis} cannot go to {target_counts}: 0 to {limit} counts"
            )
        logger.debug("%s: %s to %d", self.name, axis, target_counts)
        motor.target = target_counts
        self._write(motor, Register.TARGET, target_counts)

    @override
    def abort(self) -> None:
        failure: CosmicError | None = None
        for axis, motor in self._motors.items():
            logger.debug("%s: abort %s", self.name, axis)
            motor.homing_since_s = None
            try:
                self._write(motor, Register.COMMAND, MotorCommand.ABORT)
            except CosmicError as exc:  # the other motor must hear of it all the same
                failure = failure or exc
        if failure is not None:
            raise failure

    @override
    def close(self) -> None:
        self._registers.close()

    def _learn(
        self, axis: LensAxis, motor: _Motor, counts: int, *, moving: bool, at_home: bool
    ) -> None:
        """Find out whether homing is over, and whether the controller forgot where it is."""
        if motor.homing_since_s is not None:
            motor.begun = motor.begun or moving
            waited = WALL.now_s() - motor.homing_since_s >= START_S
            if not moving and (motor.begun or waited):
                motor.homing_since_s = None
                motor.homed = at_home or abs(counts) <= NEAR_HOME_COUNTS
                logger.info("%s: %s %shomed", self.name, axis, "" if motor.homed else "NOT ")
        elif not moving and motor.homed and counts == 0 and motor.last_counts and motor.target:
            motor.homed = False
            logger.warning(
                "%s: %s lost its position (was it switched off?). Home it", self.name, axis
            )
        motor.last_counts = counts

    def _limit(self, motor: _Motor) -> int:
        if motor.limit is None:
            motor.limit = max(self._read(motor, Register.LIMIT), 0)
        return motor.limit

    def _read(self, motor: _Motor, register: Register) -> int:
        return self._registers.read(register + motor.first)

    def _write(self, motor: _Motor, register: Register, value: int) -> None:
        self._registers.write(register + motor.first, value)


def counts_anew(registers: Registers) -> bool:
    """Whether both motors count 0, as they do after the controller was switched on."""
    return not any(registers.read(Register.POSITION + first) for first in (0, SECOND_AXIS))


def lens_on(found: Found, kind: str, context: PeripheralContext) -> NavitarLens:
    """Return the lens of a line that answered.

    Raises
    ------
    NotConnectedError
        Something else is there.
    """
    found.expect("a lens controller", Product.MOTORS, Product.MOTORS_2)
    return NavitarLens(
        found.registers,
        name=f"{kind}, generation {found.generation}",
        homed=context.homed and _believable(found),
        limits_counts=context.limits_counts,
    )


def _believable(found: Found) -> bool:
    """Whether the counters can be those of a lens that was homed."""
    try:
        anew = counts_anew(found.registers)
    except CosmicError:
        found.registers.close()
        raise
    if anew:
        logger.warning(
            "%s: both motors report 0, as after power-up; home the lens", found.registers.name
        )
    return not anew


def _make(_options: NoOptions, context: PeripheralContext) -> Lens:
    return lens_on(open_line(context.port, "navitar"), "Navitar", context)


BACKEND: Final = LensBackend(_make)
