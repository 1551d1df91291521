"""The movements of one line of a trajectory, through the gate, at the speeds wanted."""

from collections.abc import Mapping
from dataclasses import replace
from threading import Lock

from cosmic.frame.errors import CosmicError, DeviceError, MoveCancelled, MoveRefused, refusal
from cosmic.frame.operation import Task
from cosmic.mico.api.group_movement import GroupMovement
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.trajectory_start import AwayFromStartError
from cosmic.mico.core.motion.orders import Motion, MoveTo, Step
from cosmic.mico.core.trajectory.binding import BoundLeg, BoundSpeed
from cosmic.mico.core.trajectory.timing import scaled_hz


class LegMover:
    """Makes movements and waits for them; one thread, except `halt`."""

    def __init__(self, site: TrajectorySite, source: str) -> None:
        self._site = site
        self._manager = site.manager
        self._source = source
        self._guard = Lock()
        self._group: GroupMovement | None = None
        self._usual: dict[str, int] = {}
        self._wanted: dict[str, int | None] = {}
        self._sent: dict[str, int] = {}
        self._counted: dict[str, float] = {}

    def halt(self) -> None:
        """Stop what is under way; any thread."""
        with self._guard:
            group = self._group
        if group is not None:
            group.cancel()

    def set_speed(self, step: BoundSpeed) -> None:
        """Have an axis go so fast from here on."""
        self._wanted[step.axis] = step.frequency_hz

    def begin_again(self) -> None:
        """Have the speeds that lines have set hold for the next pass no longer."""
        self._wanted.clear()

    def move(self, leg: BoundLeg, speed: float, task: Task) -> None:
        """Make the movements of a line, or what is left of them after a failure."""
        motions: dict[str, Motion] = {}
        for axis, motion in leg.motions.items():
            left = self._left_to_do(axis, motion)
            if isinstance(left, Step):
                state = self._manager.state(axis)
                hertz = scaled_hz(left.frequency_hz, speed, state.frequency_range_hz)
                self._counted.setdefault(axis, state.position or 0.0)
                motions[axis] = replace(left, frequency_hz=hertz)
            elif left is not None:
                self._set_frequency(axis, speed)
                motions[axis] = left
        if motions:
            self.go(motions, task)
        self._counted.clear()

    def _left_to_do(self, axis: str, motion: Motion) -> Motion | None:
        """Return what is left of steps that were cut short; positions are simply gone to again."""
        before = self._counted.get(axis)
        if before is None or not isinstance(motion, Step):
            return motion
        each = self._site.step_um(axis) * motion.amplitude_v / 100.0
        made = round(((self._manager.state(axis).position or 0.0) - before) / each)
        left = motion.steps - made
        return replace(motion, steps=left) if left * motion.steps > 0 else None

    def go_to(self, targets: Mapping[str, float], task: Task) -> None:
        """Go to positions together."""
        units = {axis: self._manager.state(axis).unit for axis in targets}
        self.go({axis: MoveTo(target, units[axis]) for axis, target in targets.items()}, task)

    def go(self, motions: Mapping[str, Motion], task: Task) -> None:
        """Start movements together and wait for all; the failure of one stops the others."""
        if task.cancel_requested:
            raise MoveCancelled("cancelled")
        orders = self._manager.groups.order_together(motions, source=self._source)
        group = GroupMovement({name: order.movement for name, order in orders.items()})
        with self._guard:
            self._group = group
        if task.cancel_requested:
            group.cancel()
        try:
            group.wait()
        except CosmicError as exc:
            raise self._blamed(group, exc) from exc
        finally:
            with self._guard:
                self._group = None

    def _blamed(self, group: GroupMovement, error: CosmicError) -> CosmicError:
        """Return what ended a group, with the device where one is to blame."""
        for name, movement in group.movements.items():
            found = movement.exception(None)
            if isinstance(found, DeviceError):
                text = f"{found} (device {self._manager.address(name).device})"
                return DeviceError(text, fault=found.fault)
        return error

    def _set_frequency(self, axis: str, speed: float) -> None:
        usual = self._usual.setdefault(axis, self._site.manager.usual_frequency_hz(axis))
        within_hz = self._manager.state(axis).frequency_range_hz
        hertz = scaled_hz(self._wanted.get(axis) or usual, speed, within_hz)
        if hertz != self._sent.get(axis, usual):
            self._send_frequency(axis, hertz)

    def _send_frequency(self, axis: str, hertz: int) -> None:
        channel = self._manager.address(axis).channel
        self._manager.device(axis).set_frequency(channel, hertz)
        self._sent[axis] = hertz

    def restore_speeds(self) -> None:
        """Have all axes go as fast as before."""
        for axis, hertz in self._usual.items():
            if self._sent.get(axis, hertz) != hertz:
                self._send_frequency(axis, hertz)
        self._usual.clear()
        self._sent.clear()


def at_line(error: CosmicError, line: int) -> CosmicError:
    """Return `error` with the line at which it happened."""
    text = f"line {line}: {error}"
    match error:
        case MoveRefused():
            return refusal(replace(error.verdict, text=text))
        case AwayFromStartError():
            return AwayFromStartError(text, error.targets)
        case DeviceError():
            return DeviceError(text, fault=error.fault)
        case MoveCancelled():
            return MoveCancelled(text)
        case _:
            return CosmicError(text)
