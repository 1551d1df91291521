"""Where the output of a control loop goes: an axis, in small moves through the gate."""

import math
from threading import Lock
from typing import Final

from cosmic.frame.errors import (
    CosmicError,
    LimitError,
    MoveCancelled,
    NotAvailable,
    StoppedError,
    refusal,
)
from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.motion.positioner import class_for

PACKET_S: Final = 0.1
"""No packet is a longer way than that much time at the highest speed."""


class AxisSink:
    """Turns a velocity into moves to positions, each decided by the gate, none ever queued.

    A packet is sent once the one before has been taken by the device, and not sooner than
    `interval_s` after it, so that what it did can be felt first. Each is void if anything else was
    asked of the axis, or it was halted, since the one before. Positions are gate coordinates.

    Parameters
    ----------
    speed : float
        Highest speed, in the unit of the axis a second.
    travel : float
        How far it may go from where it stands at the begin, either way.
    interval_s : float
        Least time between packets, on the platform's clock.
    """

    def __init__(
        self, mico: Mico, axis: str, *, speed: float, travel: float, interval_s: float
    ) -> None:
        self._axis = mico[axis]
        self._mico = mico
        state = self._axis.details
        if not class_for(state.kind, state.positioner).has_sensor:
            raise NotAvailable(f"{axis}: it has no sensor; a loop needs a measured position")
        if not (0.0 < speed < math.inf and 0.0 < travel < math.inf):
            text = f"{axis}: speed and travel of a loop must be numbers above 0"
            raise refusal(refuse(Reason.NOT_FINITE, text, axis=axis))
        self._speed, self._travel, self._interval_s = speed, travel, interval_s
        self._lock = Lock()
        self._closed = False
        self._epoch = 0
        self._sent: Movement | None = None
        self._before: Movement | None = None
        self._since_s = math.inf
        self._smallest = 0.02 if state.unit == "um" else 1e-4
        self._home = self._target = self._wanted = 0.0
        self._braked = False
        self.packets = 0

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self._axis.key

    @property
    def unit(self) -> str:
        """Unit of its positions."""
        return self._axis.unit

    @property
    def target(self) -> float:
        """Where the last packet goes, in gate coordinates."""
        return self._target

    @property
    def zero(self) -> float:
        """The user's zero of the axis."""
        return self._axis.details.zero

    def begin(self) -> None:
        """Take the axis over where it stands.

        Raises
        ------
        NotAvailable
            It moves, or nobody knows where it is.
        StoppedError
            Motion is stopped.
        """
        stop = self._mico.stop_state
        self._epoch = stop.epoch
        if stop.latched:
            text = f"{self.name}: motion is stopped ({stop.reason}); reset the stop first"
            raise StoppedError(refuse(Reason.STOPPED, text, axis=self.name))
        state = self._axis.details
        if state.in_motion:
            raise NotAvailable(f"{self.name} is moving; wait until it is stationary")
        if state.position is None:
            raise NotAvailable(f"{self.name}: no position has been read yet")
        verdict = self._mico.verdict_on({self.name: MoveTo(state.position, state.unit)})
        if not verdict.allowed:
            raise refusal(verdict)
        self._home = self._target = self._wanted = state.position

    def move(self, velocity: float, dt_s: float) -> None:
        """Go on at `velocity` for `dt_s` of the platform's time; the loop's thread.

        Raises
        ------
        LimitError
            The travel allowed is used up.
        MoveRefused, StoppedError, DeviceError
            What became of the packet before.
        MoveCancelled
            Somebody else commanded the axis, or halted it.
        """
        self._look()
        self._since_s += dt_s
        most = self._speed * PACKET_S
        if self._sent is None and self._lags(most):
            raise self._taken()
        step = min(max(velocity, -self._speed), self._speed) * dt_s
        self._wanted = min(max(self._wanted + step, self._target - most), self._target + most)
        if abs(self._wanted - self._home) > self._travel:
            raise self._used_up()
        if abs(self._wanted - self._target) < self._smallest or self._since_s < self._interval_s:
            return
        if self._lags(most):
            self._wanted = self._target
        elif self._before is None or self._before.done:
            self._send(self._wanted)

    def rest(self, dt_s: float) -> None:
        """Send nothing for `dt_s`, and forget what was not sent yet; raises as `move`."""
        self._look()
        self._since_s += dt_s
        self._wanted = self._target

    def brake(self, dt_s: float) -> None:
        """Go no farther than the axis is by now: nobody knows what that does; else as `rest`."""
        self.rest(dt_s)
        position = self._axis.details.position
        moving = self._sent is not None and not self._sent.done
        taken = self._before is None or self._before.done
        if moving and taken and not self._braked and position is not None:
            self._send(position)
            self._wanted = position
            self._braked = True

    def _look(self) -> None:
        stop = self._mico.stop_state
        if stop.latched or stop.epoch != self._epoch:
            text = f"{self.name}: motion was stopped ({stop.reason or 'and reset since'})"
            raise StoppedError(refuse(Reason.STOPPED, text, axis=self.name))
        if self._sent is not None and not self._sent.done:
            return
        error = self._sent.exception() if self._sent is not None else None
        if error is not None:
            raise error
        if self._axis.details.in_motion:
            raise self._taken()

    def _lags(self, most: float) -> bool:
        """Return True while the axis is so slow that another packet would run ahead of it."""
        position = self._axis.details.position
        return position is None or not abs(self._target - position) <= most

    def _taken(self) -> MoveCancelled:
        return MoveCancelled(f"{self.name}: another command is moving it")

    def _send(self, target: float) -> None:
        with self._lock:
            if self._closed:
                return
            motion = MoveTo(target, self._axis.unit)
            movement = self._axis.send(motion, follows=self._sent, alone=True)
        self._before, self._sent = self._sent, movement
        self._target, self._since_s, self._braked = target, 0.0, False
        self.packets += 1

    def _used_up(self) -> LimitError:
        travel = format_quantity(self._travel, self._axis.unit)
        text = f"{self.name}: the loop's travel of {travel} is used up"
        return LimitError(
            refuse(
                Reason.LIMIT,
                text,
                axis=self.name,
                value=self._wanted,
                limit=self._home + math.copysign(self._travel, self._wanted - self._home),
                unit=self._axis.unit,
            )
        )

    def close(self, error: CosmicError | None) -> None:
        """Send nothing any more, and stop the axis unless somebody else has it; any thread."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        if not isinstance(error, MoveCancelled):
            self._axis.halt("its control loop ended")
