"""One axis of the scripted API: ``rig.mico["left.x"]``."""

import math
from typing import Literal, overload

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable, refusal
from cosmic.frame.operation import wait_or_cancel
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.axis_facts import AxisFacts
from cosmic.mico.api.axis_shape import AxisMovable
from cosmic.mico.api.entry import Number, as_number, as_whole
from cosmic.mico.api.jogging import Jogging
from cosmic.mico.api.linked import linked_movement
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion, MoveBy, MoveTo
from cosmic.mico.core.motion.positioner import Confidence, class_for
from cosmic.mico.core.ports import ManagerPort
from cosmic.mico.hw.interface import Direction


@checked_class
class Axis(AxisFacts):
    """One positioner, as scripts and widgets command it; any thread.

    Positions are in `unit` from the user's zero (see `set_zero`). A number may be given as text
    with a unit of its own: ``axis.move_to("0.2 mm")``. It has the shape of a bluesky device
    without importing bluesky; give plans `movable`, which has a name that bluesky admits.
    """

    def __init__(self, name: str, manager: ManagerPort, commander: DeviceCommander) -> None:
        self._name = name
        self._manager = manager
        self._channel = manager.address(name).channel
        self.commander = commander
        self._halt = self.halt
        self._begin = lambda to: self.move_to(to, wait=False)
        self._movable = AxisMovable(name, manager, self._halt, self._begin)

    @override
    def __repr__(self) -> str:
        state = self.details
        shown = state.shown_position
        where = "position unknown" if shown is None else f"{shown:.4g} {self.unit}"
        return f"<Axis {self._name}: {where}, {state.status}, position {state.confidence}>"

    @property
    def movable(self) -> AxisMovable:
        """The axis for plans of bluesky, whose documents forbid the dot in its name."""
        return self._movable

    # Moving

    @overload
    def move_to(
        self, position: Number, *, wait: Literal[True] = True, consent: bool = False
    ) -> float: ...

    @overload
    def move_to(
        self, position: Number, *, wait: Literal[False], consent: bool = False
    ) -> Movement: ...

    def move_to(
        self, position: Number, *, wait: bool = True, consent: bool = False
    ) -> float | Movement | None:
        """Move to `position` and return the position reached, or the movement if not `wait`.

        Parameters
        ----------
        position : float or str
            In `unit`, from the user's zero.
        consent : bool
            Move although the position is not referenced.

        Raises
        ------
        MoveRefused
            The gate refused it; nothing moved. `LimitError`, `CollisionError`, `StoppedError`.
        DeviceError
            It failed at the hardware.
        MoveCancelled
            It was cancelled or replaced.
        """
        target = self._number(position) + self.details.zero
        movement = self._send(MoveTo(target, self.unit), consent=consent)
        return self._result(movement, wait=wait)

    def continue_to(self, position: Number, after: Movement, *, consent: bool = False) -> Movement:
        """Move to `position` unless another command, or a halt, came since `after`.

        For whoever makes a movement of several parts; returns at once. Where something came, the
        movement fails with `MoveCancelled`.
        """
        target = self._number(position) + self.details.zero
        return self._send(MoveTo(target, self.unit), consent=consent, follows=after)

    def _send(self, motion: Motion, *, consent: bool, follows: Movement | None = None) -> Movement:
        if self.linked_to:
            return linked_movement(
                self._manager,
                self._name,
                motion,
                source=self.commander.source,
                consent=consent,
                follows=follows,
            )
        return self.commander.send(self._channel, motion, consent=consent, follows=follows)

    @overload
    def move_by(
        self, distance: Number, *, wait: Literal[True] = True, consent: bool = False
    ) -> float: ...

    @overload
    def move_by(
        self, distance: Number, *, wait: Literal[False], consent: bool = False
    ) -> Movement: ...

    def move_by(
        self, distance: Number, *, wait: bool = True, consent: bool = False
    ) -> float | Movement | None:
        """Move by `distance` from where it stands or is going; otherwise as `move_to`."""
        motion = MoveBy(self._number(distance), self.unit)
        return self._result(self._send(motion, consent=consent), wait=wait)

    @overload
    def steps(
        self,
        steps: Number,
        *,
        amplitude_v: Number | None = None,
        frequency_hz: Number | None = None,
        wait: Literal[True] = True,
        consent: bool = False,
    ) -> float | None: ...

    @overload
    def steps(
        self,
        steps: Number,
        *,
        amplitude_v: Number | None = None,
        frequency_hz: Number | None = None,
        wait: Literal[False],
        consent: bool = False,
    ) -> Movement: ...

    def steps(
        self,
        steps: Number,
        *,
        amplitude_v: Number | None = None,
        frequency_hz: Number | None = None,
        wait: bool = True,
        consent: bool = False,
    ) -> float | Movement | None:
        """Make steps without looking at a sensor, up to what the controller takes.

        Otherwise as `move_to`.

        Parameters
        ----------
        amplitude_v : float
            Of an SCU 15 to 100 V; the configured default where it is not given.
        frequency_hz : int
            Of an SCU 1 to 18500 Hz; the configured default where it is not given.
        """
        defaults = self._manager.settings.defaults
        volts = defaults.amplitude_v if amplitude_v is None else amplitude_v
        hertz = defaults.frequency_hz if frequency_hz is None else frequency_hz
        movement = self.commander.move_steps(
            self._channel,
            as_whole(steps, "steps", self._name),
            amplitude_v=as_number(volts, "V", self._name),
            frequency_hz=as_whole(hertz, "Hz", self._name),
            consent=consent,
        )
        return self._result(movement, wait=wait)

    def jog(self, direction: int, speed: Number | None = None, *, consent: bool = False) -> Jogging:
        """Move on and on until it is let go, not renewed for a quarter second, or at a limit.

        Parameters
        ----------
        direction : int
            1 or -1.
        speed : float
            In `unit` per second; in Hz for an axis without sensor; configured default if None.

        Raises
        ------
        MoveRefused
            `direction` or `speed` is no sensible number.
        """
        jog = self._manager.settings.jog
        state = self.details
        by_steps = not class_for(state.kind, state.positioner).has_sensor
        unit = "Hz" if by_steps else state.unit
        usual = {"um": jog.speed_um_s, "deg": jog.speed_deg_s, "Hz": float(jog.frequency_hz)}
        wanted = usual[unit] if speed is None else as_number(speed, unit, self._name)
        if direction not in (1, -1) or not 0.0 < wanted <= state.frequency_range_hz[1]:
            text = f"{self._name}: jog in direction 1 or -1 with a speed above 0"
            raise refusal(refuse(Reason.NOT_FINITE, text, axis=self._name))
        order = self.commander.jog(self._channel, direction, wanted, consent=consent)
        return Jogging(order, self.commander)

    @overload
    def calibrate(self, *, wait: Literal[True] = True, consent: bool = False) -> float | None: ...

    @overload
    def calibrate(self, *, wait: Literal[False], consent: bool = False) -> Movement: ...

    def calibrate(self, *, wait: bool = True, consent: bool = False) -> float | Movement | None:
        """Calibrate the sensor: moves several millimetres both ways; otherwise as `move_to`."""
        movement = self.commander.calibrate(self._channel, consent=consent)
        return self._result(movement, wait=wait)

    @overload
    def reference(self, *, wait: Literal[True] = True, consent: bool = False) -> float | None: ...

    @overload
    def reference(self, *, wait: Literal[False], consent: bool = False) -> Movement: ...

    def reference(self, *, wait: bool = True, consent: bool = False) -> float | Movement | None:
        """Find the reference, which may sweep the whole travel; otherwise as `move_to`."""
        movement = self.commander.reference(self._channel, consent=consent)
        return self._result(movement, wait=wait)

    @overload
    def move_to_end_stop(
        self, direction: Direction | str, *, wait: Literal[True] = True, consent: bool = False
    ) -> float | None: ...

    @overload
    def move_to_end_stop(
        self, direction: Direction | str, *, wait: Literal[False], consent: bool = False
    ) -> Movement: ...

    def move_to_end_stop(
        self, direction: Direction | str, *, wait: bool = True, consent: bool = False
    ) -> float | Movement | None:
        """Drive "forward" or "backward" until the travel ends; otherwise as `move_to`."""
        if direction not in list(Direction):
            text = f"{self._name}: the end stop is 'forward' or 'backward', not {direction!r}"
            raise refusal(refuse(Reason.WRONG_KIND, text, axis=self._name))
        movement = self.commander.move_to_end_stop(
            self._channel, Direction(direction), consent=consent
        )
        return self._result(movement, wait=wait)

    def halt(self) -> None:
        """Stop this axis; nothing is latched and other axes go on."""
        self._manager.device(self._name).halt(self._channel, "stopped")

    @staticmethod
    def _result(movement: Movement, *, wait: bool) -> float | Movement | None:
        return wait_or_cancel(movement) if wait else movement

    def _number(self, value: Number) -> float:
        return as_number(value, self.unit, self._name)

    # Settings

    def set_zero(self) -> None:
        """Show positions from here on relative to where it stands; the gate does not change."""
        state = self.details
        if state.position is None:
            raise NotAvailable(f"{self._name}: no position has been read yet")
        if state.confidence is Confidence.UNKNOWN:
            raise NotAvailable(f"{self._name}: its position is unknown; initialise it first")
        self._set_zero(state.position)

    def clear_zero(self) -> None:
        """Show positions as the controller counts them."""
        self._set_zero(0.0)

    def _set_zero(self, zero: float) -> None:
        self._manager.device(self._name).set_zero(self._channel, zero)

    def set_estimate(self, position: Number, *, std_um: Number | None = 5.0) -> None:
        """Say where an axis without sensor stands, as seen or measured by hand; nothing moves.

        Parameters
        ----------
        position : float or str
            In um, from the user's zero; of a gripper the opening.
        std_um : float
            How well that is known, a standard deviation; None: nobody knows.

        Raises
        ------
        NotAvailable
            It has a sensor, or is moving.
        MoveRefused
            The numbers are none, or lie outside its travel.
        """
        where = self._number(position) + self.details.zero
        std = math.inf if std_um is None else as_number(std_um, "um", self._name)
        self._manager.device(self._name).set_estimate(self._channel, where, std)

    def set_closed_loop_frequency(self, frequency_hz: Number) -> None:
        """Limit the speed of movements to a position, of an SCU 1 to 18500 Hz.

        Raises
        ------
        MoveRefused
            `frequency_hz` is outside that range.
        """
        state = self.details
        if not class_for(state.kind, state.positioner).has_sensor:
            text = f"{self._name}: it has no sensor; give the frequency with the steps"
            raise refusal(refuse(Reason.WRONG_KIND, text, axis=self._name))
        hertz = as_whole(frequency_hz, "Hz", self._name)
        low, high = state.frequency_range_hz
        if not low <= hertz <= high:
            text = f"{self._name}: frequency {hertz} Hz is outside {low} to {high} Hz"
            limit = float(high if hertz > high else low)
            raise refusal(
                refuse(Reason.LIMIT, text, axis=self._name, value=hertz, limit=limit, unit="Hz")
            )
        self._manager.device(self._name).set_frequency(self._channel, hertz)
