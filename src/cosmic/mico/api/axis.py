"""One axis of the scripted API: ``rig.mico["left.x"]``."""

import math
import secrets
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal, overload

from PySide6.QtCore import QObject, Qt
from typing_extensions import override

from cosmic.frame.arguments import checked_class, reason_of
from cosmic.frame.declaration import Declared, command, state
from cosmic.frame.errors import (
    ArgumentError,
    CosmicError,
    MoveRefused,
    NotAvailable,
    refusal,
)
from cosmic.frame.events import notify
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import JOG_LIMIT_S, MOVE_LIMIT_S, one_line, source_of
from cosmic.frame.operation import wait_or_cancel
from cosmic.frame.threads import may_wait_here
from cosmic.frame.units import AxisUnit
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.api.axis_numbers import Number, as_number, as_whole, finite
from cosmic.mico.api.axis_orders import AxisOrders
from cosmic.mico.api.jogging import Jogging
from cosmic.mico.api.news import SentMotion
from cosmic.mico.api.plan_movable import PlanMovable
from cosmic.mico.api.remote_axis import RemoteAxisState
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.messages import PositionChanged
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import (
    Calibrate,
    Jog,
    MoveBy,
    MoveTo,
    Reference,
    Steer,
    Step,
    ToEndStop,
)
from cosmic.mico.core.motion.positioner import Confidence, PositionerState, Status, class_for
from cosmic.mico.core.motion.settings import PositionerSettings
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Activity, Direction, PositionerKind


@checked_class
class Axis(PlanMovable, Declared):
    """One positioner, as scripts and widgets command it, wherever it is; any thread.

    Positions are in `unit` from the user's zero (see `set_zero`). A number may be given as text
    with a unit of its own: ``axis.move_to("0.2 mm")``. It has the shape of a bluesky device
    without importing bluesky.
    """

    commander: DeviceCommander
    """Its signals tell what happens; where its device is here, it commands it as well."""
    _far: RemoteAxisState | None = None

    def __init__(self, name: str, manager: DeviceManager, commander: DeviceCommander) -> None:
        self._name = name
        self._manager = manager
        self._channel = manager.address(name).channel
        self.commander = commander
        self._orders = AxisOrders(name, manager, commander)

    @override
    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        if not isinstance(policy, FailurePolicy):
            raise TypeError(f"policy must be a FailurePolicy, not {str(policy)[:60]}")
        self._name = key
        self._far = RemoteAxisState(key)
        self.commander = DeviceCommander("")  # tells what the station does, and commands nothing
        self._far.changed.subscribe(self._on_far_changed)

    @property
    @override
    def key(self) -> str:
        return self._name

    @property
    def far(self) -> RemoteAxisState | None:
        """What is known here where the axis is at another station; None where it is here."""
        return self._far

    @override
    def __repr__(self) -> str:
        state = self.details
        shown = state.shown_position
        where = "position unknown" if shown is None else f"{shown:.4g} {self.unit}"
        return f"<Axis {self._name}: {where}, {state.status}, position {state.confidence}>"

    @property
    def movable(self) -> "Axis":
        """The axis itself: plans take it as it is."""
        return self

    # What is known

    @property
    @override
    def details(self) -> PositionerState:
        """Everything known of it, frozen; positions in gate coordinates."""
        far = self._far
        return self._manager.state(self._name) if far is None else far.state(self, self._latest)

    @property
    @state
    def _latest(self) -> PositionerState:
        return self._manager.state(self._name)

    @property
    @state
    def _linked(self) -> dict[str, float]:
        return dict(self._manager.links.companions(self._name))

    @property
    @state
    def _watched(self) -> bool:
        model = self._manager.exemptions
        return model is not None and self._name not in model.taken_out

    @property
    @state
    @override
    def closed_loop_frequency_hz(self) -> int | None:
        """What limits the speed of movements to a position, as it was set last; None before."""
        found = self._manager.device(self._name).container.positioner(self._channel)
        return found.frequency_hz if found is not None else None

    @property
    @state(fixed=True)
    @override
    def controller(self) -> str:
        """Name of the library that drives it."""
        return self._manager.controller.name

    @property
    @state(fixed=True)
    def settings(self) -> PositionerSettings:
        """What the platform file says of it, or what was found where it says nothing."""
        for each in self._manager.settings.positioner:
            if each.name == self._name:
                return each
        found = self._manager.device(self._name).container.positioner(self._channel)
        if found is None:
            raise NotAvailable(f"{self._name}: it went away just now; rescan")
        return found.settings

    @property
    def _commanded_by(self) -> str:
        """Who commands through this object, for the log."""
        return self.commander.source

    @property
    def _platform(self) -> MicoSettings:
        return self._manager.settings if self._far is None else self._far.platform()

    @property
    def kind(self) -> PositionerKind:
        """linear, rotary or open-loop."""
        return self.details.kind

    @property
    def unit(self) -> AxisUnit:
        """Unit of its positions: "um" or "deg"."""
        return self.details.unit

    @property
    def state(self) -> Status:
        """OK, BUSY, ERROR, or UNKNOWN when its device does not answer."""
        return self.details.status

    @property
    def activity(self) -> Activity:
        """What the controller says it is doing."""
        return self.details.activity

    @property
    def error(self) -> str:
        """What is wrong with it; empty when nothing is."""
        return self.details.error

    @property
    def confidence(self) -> Confidence:
        """How well its position is known: known, estimated (counted steps) or unknown."""
        return self.details.confidence

    @property
    def limits(self) -> tuple[float, float] | None:
        """Soft limits (low, high) in `unit` from the user's zero; None without a sensor."""
        return self.details.shown_limits

    @property
    def collision_detection(self) -> bool:
        """Whether its movements are checked for collisions; set it to take the axis out (CL.13).

        Raises
        ------
        NotAvailable
            It is set, and there is no collision model.
        """
        return self._watched

    @collision_detection.setter
    def collision_detection(self, on: bool) -> None:
        self.watch(on, source=self._commanded_by)

    @property
    def linked_to(self) -> dict[str, float]:
        """How far each axis linked to it goes when it goes 1; empty where it is linked to none."""
        return self._linked

    @property
    def position_um(self) -> float | None:
        """Position in um; counted from steps without a sensor; None before the first reading.

        Raises
        ------
        NotAvailable
            The axis is rotary: use `angle_deg`.
        """
        return self._position("um", "angle_deg")

    @property
    def position_std_um(self) -> float:
        """Standard deviation of the position in um: 0 where it is measured, inf where unknown.

        It grows with the steps of an axis without sensor, until its end stop or
        `set_estimate` says where it is.

        Raises
        ------
        NotAvailable
            The axis is rotary.
        """
        self._position("um", "angle_deg")
        return self.details.std

    @property
    def angle_deg(self) -> float | None:
        """Angle in degrees; None before the first reading.

        Raises
        ------
        NotAvailable
            The axis is not rotary: use `position_um`.
        """
        return self._position("deg", "position_um")

    def _position(self, unit: AxisUnit, other: str) -> float | None:
        state = self.details
        if state.unit != unit:
            raise NotAvailable(f"{self._name} is a {state.kind} axis: use {other}")
        return state.shown_position

    @override
    def _on_state(self, callback: Callable[[PositionerState], object]) -> Callable[[], None]:
        if self._far is not None:
            return self._far.changed.subscribe(callback)

        def on_state(state: PositionerState) -> None:
            if state.name == self._name:
                notify(callback, state)

        direct = Qt.ConnectionType.DirectConnection
        connection = self.commander.state_changed.connect(on_state, direct)

        def unsubscribe() -> None:
            QObject.disconnect(connection)

        return unsubscribe

    @override
    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()` when anything but its position has changed."""
        if self._far is not None:
            return super().on_change(listener)
        before: PositionerState | None = None

        def look(now: PositionerState) -> None:
            nonlocal before
            like = before is not None and replace(before, position=now.position, std=now.std) == now
            before = now
            if not like:
                listener()

        return self._on_state(look)

    @override
    def note_change(self) -> None:
        super().note_change()
        if self._far is not None:
            self._far.changed.emit(self.details)

    def _on_far_changed(self, state: PositionerState) -> None:
        self.commander.state_changed.emit(state)
        if state.position is not None:
            changed = PositionChanged(state.name, state.position, state.unit)
            self.commander.position_changed.emit(changed)

    @override
    def check(self, position: Number, *, consent: bool = False) -> MoveVerdict:
        """Return the gate's answer to `move_to(position)`, without moving."""
        try:
            target = self._number(position) + self.details.zero
        except MoveRefused as exc:
            return exc.verdict
        motion = MoveTo(target, self.unit)
        if self._far is None:
            return self._manager.groups.check({self._name: motion}, consent=consent)
        if not may_wait_here():
            return self._far.foresee({self._name: motion}, consent)
        try:
            return self.check_motion(motion, consent=consent)
        except MoveRefused as exc:
            return exc.verdict
        except CosmicError as exc:
            return refuse(Reason.NO_ANSWER, f"the station does not answer: {exc}")

    @command
    def check_motion(self, motion: SentMotion, *, consent: bool = False) -> MoveVerdict:
        """Return the gate's answer to a motion in gate coordinates, without moving."""
        return self._manager.groups.check({self._name: motion}, consent=consent)

    # Moving

    @overload
    def move_to(
        self, position: Number, *, wait: Literal[True] = True, consent: bool = False
    ) -> float: ...

    @overload
    def move_to(
        self, position: Number, *, wait: Literal[False], consent: bool = False
    ) -> Movement: ...

    @override
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
        movement = self.send(MoveTo(target, self.unit), consent=consent)
        return self._result(movement, wait=wait)

    def continue_to(self, position: Number, after: Movement, *, consent: bool = False) -> Movement:
        """Move to `position` unless another command, or a halt, came since `after`.

        For whoever makes a movement of several parts; returns at once. Where something came, the
        movement fails with `MoveCancelled`.
        """
        target = self._number(position) + self.details.zero
        return self.send(MoveTo(target, self.unit), consent=consent, follows=after)

    def send(
        self,
        motion: SentMotion,
        *,
        consent: bool = False,
        follows: Movement | None = None,
        alone: bool = False,
    ) -> Movement:
        """Begin a motion in gate coordinates; a refusal is how it ends.

        Parameters
        ----------
        follows : Movement
            It is void unless that is still the newest of this axis, and nothing was halted since.
        alone : bool
            Axes linked to it are not moved along: the gate refuses it while there are any.
        """
        far = self._far
        if far is None:
            return self._orders.begin(motion, consent=consent, follows=follows, alone=alone)
        key = secrets.token_hex(8)
        before = "" if follows is None else far.keys.get(follows, "forgotten")
        begun = self.begin(
            motion,
            consent=consent,
            key=key,
            follows=before,
            alone=alone,
            source=self._commanded_by,
        )
        far.keys[begun] = key
        return begun

    @command(moves=True)
    def begin(
        self,
        motion: SentMotion,
        *,
        consent: bool = False,
        key: str = "",
        follows: str = "",
        alone: bool = False,
        source: str = "script",
    ) -> Movement:
        """Begin a motion in gate coordinates; a refusal is how it ends.

        The result is where it arrived, counted from the user's zero.

        Parameters
        ----------
        key : str
            How whoever commands it will name it.
        follows : str
            Key of the movement that must still be the newest of this axis.
        alone : bool
            As `send`.
        """
        before = self._orders.kept_movement(follows) if follows else None
        begun = self._orders.begin(
            motion, consent=consent, follows=before, alone=alone, source=source
        )
        if key:
            self._orders.keep(key, begun)
        return begun

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
        return self._result(self.send(motion, consent=consent), wait=wait)

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
        defaults = self._platform.defaults
        volts = defaults.amplitude_v if amplitude_v is None else amplitude_v
        hertz = defaults.frequency_hz if frequency_hz is None else frequency_hz
        motion = Step(
            as_whole(steps, "steps", self._name),
            as_number(volts, "V", self._name),
            as_whole(hertz, "Hz", self._name),
        )
        return self._result(self._sent(motion, consent=consent), wait=wait)

    def jog(
        self,
        direction: int,
        speed: Number | None = None,
        *,
        consent: bool = False,
        source: str = "",
    ) -> Jogging:
        """Move on and on until it is let go, not renewed for a quarter second, or at a limit.

        Parameters
        ----------
        direction : int
            1 or -1.
        speed : float or str
            In `unit` per second, or such as "5 um/s"; in Hz for an axis without sensor; the
            configured one if None.
        source : str
            Who commands, for the log; who made this object where it is empty.

        Raises
        ------
        MoveRefused
            `direction` or `speed` is no sensible number.
        """
        jog = self._platform.jog
        state = self.details
        by_steps = not class_for(state.kind, state.positioner).has_sensor
        unit = "Hz" if by_steps else f"{state.unit}/s"
        usual = {"um/s": jog.speed_um_s, "deg/s": jog.speed_deg_s, "Hz": float(jog.frequency_hz)}
        wanted = usual[unit] if speed is None else as_number(speed, unit, self._name)
        if direction not in (1, -1) or not 0.0 < wanted <= state.frequency_range_hz[1]:
            fastest = f"{state.frequency_range_hz[1]:g} {unit}"
            text = (
                f"{self._name}: jog in direction 1 or -1 with a speed above 0 and up to {fastest}, "
                f"not {wanted:g} in direction {direction}"
            )
            raise refusal(refuse(Reason.NOT_FINITE, text, axis=self._name))
        return self._jogging(Jog(direction, wanted), consent=consent, source=source)

    def steer(
        self, velocity: Number, *, dead_man_s: float, consent: bool = False, source: str = ""
    ) -> Jogging:
        """Move at a signed speed that `Jogging.renew` changes, as a hand steers; does not wait.

        Parameters
        ----------
        velocity : float or str
            In `unit` per second, or such as "-5 um/s"; in Hz for an axis without sensor. Its sign
            is the direction.
        dead_man_s : float
            It stops when nobody renews it for so long, on the wall clock.
        source : str
            Who commands, for the log; who made this object where it is empty.

        Raises
        ------
        MoveRefused
            `velocity` is no sensible number, or `dead_man_s` is too long.
        """
        state = self.details
        by_steps = not class_for(state.kind, state.positioner).has_sensor
        wanted = as_number(velocity, "Hz" if by_steps else f"{state.unit}/s", self._name)
        if wanted == 0.0:
            text = f"{self._name}: steer at a speed other than 0; end it to stand still"
            raise refusal(refuse(Reason.NOT_FINITE, text, axis=self._name))
        _check_dead_man(self._name, dead_man_s)
        return self._jogging(Steer.at(wanted, dead_man_s), consent=consent, source=source)

    def _jogging(self, motion: Jog, *, consent: bool, source: str = "") -> Jogging:
        if self._far is not None:
            key, said = secrets.token_hex(8), source or self._commanded_by
            movement = self.begin_jog(motion, key, consent=consent, source=said)
            return Jogging(movement, partial(self.renew, key), self.halt)
        order = self._orders.give(motion, consent=consent, source=source)
        renew = partial(self._orders.renew, order)
        return Jogging(order.movement, renew, partial(self.commander.stop, self._channel))

    @command(moves=True, limit_s=JOG_LIMIT_S)
    def begin_jog(
        self, motion: Jog | Steer, key: str, *, consent: bool = False, source: str = "script"
    ) -> Movement:
        """Begin to move continuously, while `renew` comes with the same key."""
        if isinstance(motion, Steer):
            _check_dead_man(self._name, motion.dead_man_s)
        order = self._orders.give(motion, consent=consent, source=source)
        self._orders.keep(key, order)
        return order.movement

    @command(moves=True, renews=True, limit_s=JOG_LIMIT_S)
    def renew(self, key: str, velocity: float | None = None) -> None:
        """Keep a jog alive; one that is steered at another signed velocity."""
        order = self._orders.kept_jog(key)
        if order is not None:
            self._orders.renew(order, velocity)

    @overload
    def calibrate(self, *, wait: Literal[True] = True, consent: bool = False) -> float | None: ...

    @overload
    def calibrate(self, *, wait: Literal[False], consent: bool = False) -> Movement: ...

    def calibrate(self, *, wait: bool = True, consent: bool = False) -> float | Movement | None:
        """Calibrate the sensor: moves several millimetres both ways; otherwise as `move_to`."""
        return self._result(self._sent(Calibrate(), consent=consent), wait=wait)

    @overload
    def reference(self, *, wait: Literal[True] = True, consent: bool = False) -> float | None: ...

    @overload
    def reference(self, *, wait: Literal[False], consent: bool = False) -> Movement: ...

    def reference(self, *, wait: bool = True, consent: bool = False) -> float | Movement | None:
        """Find the reference, which may sweep the whole travel; otherwise as `move_to`."""
        return self._result(self._sent(Reference(), consent=consent), wait=wait)

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
        motion = ToEndStop(Direction(direction))
        return self._result(self._sent(motion, consent=consent), wait=wait)

    def _sent(self, motion: SentMotion, *, consent: bool) -> Movement:
        """Begin what an axis does alone; the gate refuses it while the axis is linked."""
        if self._far is None:
            return self._orders.give(motion, consent=consent).movement
        return self.send(motion, consent=consent)

    @command(at_once=True)
    @override
    def halt(self, why: str = "stopped") -> None:
        """Stop this axis; nothing is latched and other axes go on."""
        self._manager.device(self._name).halt(self._channel, one_line(reason_of(why)))

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
        self.show_from(state.position)

    def clear_zero(self) -> None:
        """Show positions as the controller counts them."""
        self.show_from(0.0)

    @command(moves=True, aside=True)
    def show_from(self, zero: float) -> None:
        """Show positions relative to `zero`, in gate coordinates."""
        finite(zero, f"{self._name}: a zero")
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
        self.place_at(where, std)

    @command(moves=True, aside=True)
    def place_at(self, position: float, std: float) -> None:
        """Say where an axis without sensor stands, in gate coordinates; see `set_estimate`."""
        self._manager.device(self._name).set_estimate(self._channel, position, std)

    @override
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
        self.limit_frequency(as_whole(frequency_hz, "Hz", self._name))

    def set_sensor_type(self, code: int, *, consent: bool = False) -> None:
        """Store in the controller which positioner is connected, by the vendor's number.

        Afterwards the position is unknown: press Rescan, then calibrate and reference it.

        Parameters
        ----------
        consent : bool
            The operator agreed: a wrong type makes every position wrong.

        Raises
        ------
        NotAvailable
            Nobody agreed, it is moving, or it is at another station.
        DeviceError
            The controller refuses.
        """
        self._set_up(as_whole(code, "", self._name), consent=consent)

    def set_safe_direction(self, direction: Direction | str, *, consent: bool = False) -> None:
        """Store in the controller where a search for the reference begins.

        Afterwards the position is unknown: calibrate and reference it.

        Parameters
        ----------
        direction : str
            "forward" or "backward".
        consent : bool
            The operator agreed.

        Raises
        ------
        ArgumentError
            `direction` is neither.
        CosmicError
            As `set_sensor_type`.
        """
        if direction not in list(Direction):
            text = f"{self._name}: direction must be 'forward' or 'backward'"
            raise ArgumentError(f"{text}, not {one_line(direction)!r}")
        self._set_up(Direction(direction), consent=consent)

    def _set_up(self, change: int | Direction, *, consent: bool) -> None:
        if not consent:
            raise NotAvailable(
                f"{self._name}: this changes what the controller stores, and where the axis goes "
                "to be referenced; say consent=True when nothing is in its way"
            )
        if self._far is not None:
            raise NotAvailable(f"{self._name}: it is set up at the station that has it")
        device = self._manager.device(self._name)
        device.set_up(self._channel, change).wait(self._manager.settings.watch.answer_s)

    @command(moves=True, aside=True)
    def limit_frequency(self, frequency_hz: int) -> None:
        """Limit the speed of movements to a position; raises as `set_closed_loop_frequency`."""
        low, high = self.details.frequency_range_hz
        frequency_hz = as_whole(frequency_hz, "Hz", self._name)
        if not low <= frequency_hz <= high:
            text = f"{self._name}: frequency {frequency_hz} Hz is outside {low} to {high} Hz"
            limit = float(high if frequency_hz > high else low)
            raise refusal(
                refuse(
                    Reason.LIMIT,
                    text,
                    axis=self._name,
                    value=float(frequency_hz),
                    limit=limit,
                    unit="Hz",
                )
            )
        self._manager.device(self._name).set_frequency(self._channel, frequency_hz)

    @command(moves=True, aside=True)
    def watch(self, on: bool, *, source: str = "script") -> None:
        """Check its movements for collisions, or no longer; raises as `collision_detection`."""
        model = self._manager.exemptions
        if model is None:
            raise NotAvailable(f"{NO_MODEL_TEXT}: name a scene in the platform file")
        change = model.take_in if on else model.take_out
        change(self._name, source=source_of(source))


def _check_dead_man(axis: str, dead_man_s: float) -> None:
    """Raise `MoveRefused` where nobody would notice for too long that a hand is gone."""
    if not 0.0 < dead_man_s <= MOVE_LIMIT_S:
        text = f"{axis}: a dead-man time is at most {MOVE_LIMIT_S:g} s, not {dead_man_s:g}"
        raise refusal(refuse(Reason.LIMIT, text, axis=axis, limit=MOVE_LIMIT_S, unit="s"))
