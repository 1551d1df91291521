"""`MotionMonitor`: follows one channel from a call of the library until it is stationary."""

import logging
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    MoveCancelled,
)
from cosmic.frame.units import format_quantity
from cosmic.mico.core.motion.channel_context import ChannelContext
from cosmic.mico.core.motion.channel_speed import ChannelSpeed, quietly
from cosmic.mico.core.motion.jog import JogRun
from cosmic.mico.core.motion.messages import MovementBegun, Order
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import (
    Jog,
    Motion,
    Reference,
    Reservation,
    Step,
    motion_text,
)
from cosmic.mico.core.motion.positioner import (
    Confidence,
    CountedTravel,
    PositionerBase,
    PositionerState,
)
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Completed,
    Event,
    Failed,
    PositionKnownRead,
    PositionRead,
)

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class ActiveMove:
    """One order that was sent to the controller.

    Attributes
    ----------
    reservation : Reservation
        Released when the movement ends; of a jog, that of the last packet.
    rests_seen : int
        How many answers, asked after the start, said that the channel is stationary.
    known_pending : bool
        The controller still has to say whether the reference was found.
    error : CosmicError or None
        Why the movement will fail once the axis is stationary.
    asking : bool
        The gate was asked for the next packet of a jog and has not answered yet.
    awaiting : bool
        It waits for others to start together with, and was not sent yet.
    replaced : bool
        A newer order took its place.
    reported : bool
        Its movement has been failed already; the axis is only followed until it is stationary.
    progress_s : float
        Platform time of the last heartbeat.
    progress_position : float or None
        Where it was then.
    burst : Step or None
        Of a jog without sensor, the packet that was sent last, while it may be carried out.
    burst_s : float
        Platform time at which it was sent.
    counted : float
        Steps, as if at 100 V, of the packets before it.
    """

    order: Order
    reservation: Reservation
    started_s: float
    progress_s: float
    progress_position: float | None = None
    rests_seen: int = 0
    known_pending: bool = False
    error: CosmicError | None = None
    jog: JogRun | None = None
    asking: bool = False
    reported: bool = False
    awaiting: bool = False
    replaced: bool = False
    burst: Step | None = None
    burst_s: float = 0.0
    counted: float = 0.0

    def begin_burst(self, motion: Motion, now_s: float) -> None:
        """Count the steps of a packet that was sent."""
        self.end_burst(now_s)
        if isinstance(motion, Step):
            self.burst, self.burst_s = motion, now_s

    def end_burst(self, now_s: float) -> None:
        """Count no further steps: they were stopped, or others follow."""
        self.counted, self.burst = self.steps_made(now_s), None

    def steps_made(self, now_s: float) -> float:
        """Return how many steps of a jog were made, as if at 100 V, with their sign."""
        if self.burst is None:
            return self.counted
        return self.counted + _steps_in(self.burst, now_s - self.burst_s)

    @property
    def has_own_speed(self) -> bool:
        """True when the channel has another closed-loop speed than the usual one meanwhile."""
        return isinstance(self.order.motion, Jog) or self.order.frequency_hz is not None

    def leave_line(self, name: str) -> None:
        """Stop the axes that keep to a line with this one, if there are any."""
        start = self.order.start
        if start is not None and start.line is not None:
            start.line.leave(name)

    @property
    def found_reference(self) -> bool:
        """True of a reference run without error: the word of libraries that have none."""
        return self.error is None and isinstance(self.order.motion, Reference)

    @property
    def asks_reference(self) -> bool:
        """True once it is stationary and the reference that it found was asked for."""
        return self.known_pending and self.rests_seen > 0

    @property
    def withdrawn(self) -> bool:
        """True when it must not be sent any more."""
        return self.replaced or self.error is not None

    @property
    def at_rest(self) -> bool:
        """True when the channel was twice said to be stationary; one answer may be too early."""
        return self.rests_seen >= 2

    def note_position(self, position: float | None, now_s: float) -> None:
        """Take a new position as a heartbeat, the same one as none."""
        if position != self.progress_position:
            self.progress_position, self.progress_s = position, now_s

    def stall_s(self, settings: MicoSettings, rate: float) -> float:
        """Return how long it may go on without a heartbeat, in platform seconds.

        A fast clock must not turn the jitter of the wall into a time-out.
        """
        stall_s = max(settings.watch.stall_s, rate)
        motion = self.order.motion
        if isinstance(motion, Step):
            stall_s += abs(motion.steps) / motion.frequency_hz
        return stall_s


def missed_target(
    active: ActiveMove, state: PositionerState, settings: MicoSettings
) -> CosmicError | None:
    """Return the failure of a movement that ended somewhere else than asked."""
    if active.reservation.target is None or state.position is None:
        return None
    watch = settings.watch
    tolerance = watch.tolerance_deg if state.unit == "deg" else watch.tolerance_um
    if abs(state.position - active.reservation.target) <= tolerance:
        return None
    where = format_quantity(state.position - state.zero, state.unit)
    wanted = format_quantity(active.reservation.target - state.zero, state.unit)
    return DeviceError(f"{state.name}: stopped at {where} instead of {wanted}")


def counted_distance(active: ActiveMove, step_um: float, now_s: float) -> float:
    """Estimate how far an axis without sensor went during `active`, in um."""
    motion, made = active.order.motion, 0.0
    if isinstance(motion, Step):
        made = _steps_in(motion, now_s - active.started_s)
    elif isinstance(motion, Jog):
        made = active.steps_made(now_s)
    return made * step_um


def _steps_in(motion: Step, elapsed_s: float) -> float:
    """Return how many steps were made by then, as if at 100 V, with their sign."""
    ran = min(float(abs(motion.steps)), elapsed_s * motion.frequency_hz)
    return math.copysign(ran, motion.steps) * motion.amplitude_v / 100.0


MOST_OPEN: Final = 8
LOST_S: Final = 2.0
"""Wall time after which an answer is taken for lost."""


class OpenQuestions:
    """Order numbers that were current when each open question was asked.

    An answer says what was true when it was given: one asked for before a movement started says
    nothing about it. Each channel answers in order, so the oldest number belongs to the next
    answer. Lost answers make later ones look older than they are, which is safe, and are forgotten
    when nothing has come for long.
    """

    def __init__(self) -> None:
        self._open: deque[tuple[int, float]] = deque()

    def may_ask(self) -> bool:
        """Return False while enough questions wait for their answers."""
        if len(self._open) < MOST_OPEN:
            return True
        if WALL.now_s() - self._open[0][1] < LOST_S:
            return False
        self._open.clear()
        return True

    def asked(self, number: int) -> None:
        """Note a question."""
        self._open.append((number, WALL.now_s()))

    def withdrawn(self) -> None:
        """Forget the newest question, which could not be asked."""
        if self._open:
            self._open.pop()

    def answered(self) -> int:
        """Return the number under which the oldest open question was asked, 0 without one."""
        return self._open.popleft()[0] if self._open else 0


class StatusPoll:
    """Puts the questions about one channel to the controller; device thread only."""

    def __init__(self, positioner: PositionerBase, context: ChannelContext) -> None:
        self._positioner = positioner
        self._controller = context.controller
        self._address = positioner.state.address
        self._activity = OpenQuestions()
        self._position = OpenQuestions()

    def ask_activity(self, active: ActiveMove | None) -> None:
        """Ask what the channel is doing, during `active`."""
        self._ask(
            self._activity,
            _number(active),
            lambda: self._controller.ask_activity(self._address),
        )

    def activity_answered(self) -> int:
        """Return the number of the active order when the oldest question was asked."""
        return self._activity.answered()

    def ask_position(self, active: ActiveMove | None) -> None:
        """Ask for the position, where there is a sensor."""
        if not self._positioner.has_sensor:
            return
        final = active is not None and active.rests_seen > 0
        unit = self._positioner.state.unit
        self._ask(
            self._position,
            -_number(active) if final else _number(active),
            lambda: self._controller.ask_position(self._address, unit),
        )

    def position_answered(self) -> int:
        """Return the number as `activity_answered`; below 0 where the channel was at rest."""
        return self._position.answered()

    def ask_position_known(self) -> bool:
        """Ask whether the position is referenced; False where the library cannot say."""
        try:
            self._controller.ask_position_known(self._address)
        except DeviceError as exc:
            if exc.fault is not DeviceFault.UNSUPPORTED:
                raise
            return False
        return True

    def _ask(self, questions: OpenQuestions, number: int, call: Callable[[], None]) -> None:
        if not questions.may_ask():
            return
        questions.asked(number)
        if not quietly(self._positioner.state.name, call):
            questions.withdrawn()


def _number(active: ActiveMove | None) -> int:
    """Return under which number to ask: 0 without an active order, or before it is sent."""
    return 0 if active is None or active.awaiting else active.order.number


class MotionMonitor:
    """Follows the movement of one channel until it is stationary, and stops it; device thread.

    Attributes
    ----------
    active : ActiveMove or None
        The movement that was sent, or is about to start with others.
    newest : Movement or None
        The newest that was ordered, also while the gate is asked; None after a halt.
    begun : int
        Number of the last order that became the active movement.
    settled : bool
        The channel was seen at rest since it was found.
    """

    def __init__(
        self, positioner: PositionerBase, context: ChannelContext, speed: ChannelSpeed
    ) -> None:
        self._positioner = positioner
        self._context = context
        self._speed = speed
        self._address = positioner.state.address
        self._status = StatusPoll(positioner, context)
        self._next_poll_s = 0.0
        self.active: ActiveMove | None = None
        self.newest: Movement | None = None
        self.begun = 0
        self.settled = False

    @property
    def _name(self) -> str:
        return self._positioner.state.name

    @property
    def located(self) -> bool:
        """True once it is stationary and its position was read, where there is a sensor."""
        return self.settled and (
            not self._positioner.has_sensor or self._positioner.state.position is not None
        )

    # Begin

    def begin(
        self, order: Order, reservation: Reservation, jog: JogRun | None = None
    ) -> ActiveMove | None:
        """Make `order` the active movement and return the one that it replaces.

        Nothing here takes long, for the library waits: reports and the log come after the call.
        """
        now_s = self._context.clock.now_s()
        active = ActiveMove(order, reservation, started_s=now_s, progress_s=now_s, jog=jog)
        active.known_pending = isinstance(order.motion, Reference)
        replaced, self.active = self.active, active
        self.begun = order.number
        if replaced is not None:
            replaced.replaced = True
            replaced.leave_line(self._name)
            self._withdraw_query(replaced)
        return replaced

    def _text(self, motion: Motion) -> str:
        axis = self._positioner.settings
        directions = axis.forward_text, axis.backward_text
        unit = f"{axis.unit}/s" if self._positioner.has_sensor else "Hz"
        return motion_text(motion, directions=directions, speed_unit=unit)

    def report_begun(self, order: Order, replaced: ActiveMove | None) -> None:
        """Report that `order` was sent, and that it ended the one before."""
        self._next_poll_s = self._context.clock.wall_s() + self._context.poll_s
        state = self._positioner.state
        failed = self.active is not None and self.active.error is not None
        error = self._positioner.state.error if failed else ""
        self._context.container.update(self._address.channel, in_motion=True, error=error)
        if replaced is not None:
            self._count(replaced)
            self._release(replaced.reservation)
            if not replaced.reported:
                over = MoveCancelled(f"{self._name}: replaced by a newer command")
                replaced.order.movement.fail(over)
                self._context.reports.failed(self._name, over)
        # What goes on from an order reported already would fill the log.
        level = logging.INFO if order.follows is None else logging.DEBUG
        logger.log(level, "%s %s, by %s", self._name, self._text(order.motion), order.source)
        if self.active is not None:
            self._context.reports.begun(
                MovementBegun(
                    name=self._name,
                    motion=order.motion,
                    from_position=state.position,
                    target=self.active.reservation.target,
                    unit=state.unit,
                    time_s=self.active.started_s,
                    source=order.source,
                )
            )
        self._report_state()

    # Stop

    def halt(self, error: CosmicError) -> None:
        """Stop the channel; the active movement will fail with `error`."""
        self.newest = None
        if self.active is not None:
            self._context.gate.abandon(self.active.reservation)
            self.active.error = self.active.error or error
            self._withdraw_query(self.active)
            self.active.jog = None
            self.active.awaiting = False
        self._stop()
        if self.active is not None:
            self.active.leave_line(self._name)
            self.active.progress_s = self._context.clock.now_s()
            self.active.end_burst(self.active.progress_s)
            self.ask_activity()

    def lose(self, error: CosmicError) -> None:
        """Abandon the movement of a channel that cannot be reached; its interval stays held."""
        active, self.active = self.active, None
        if active is not None:
            self._withdraw_query(active)
            active.leave_line(self._name)
            active.error = active.error or error
            self._context.gate.abandon(active.reservation)
            self._count(active)
            active.order.movement.fail(error)
            self._context.reports.failed(self._name, error)

    def _withdraw_query(self, active: ActiveMove) -> None:
        """Withdraw the query about the next packet: what it holds would outlast the movement."""
        if active.asking:
            active.asking = False
            self._context.queries.withdraw(active.order)

    def _stop(self) -> None:
        quietly(self._name, lambda: self._context.controller.stop(self._address))

    def end_jog(self, error: CosmicError | None) -> None:
        """Stop a jog; its movement fails with `error`, or ends well without one."""
        active = self.active
        if active is None:
            return
        self._withdraw_query(active)
        active.jog, active.rests_seen = None, 0
        active.error = active.error or error
        if error is not None:
            logger.warning("%s: jogging ended: %s", self._name, error)
        self._stop()
        active.end_burst(self._context.clock.now_s())
        self.ask_activity()

    def fail(self, error: DeviceError) -> None:
        """Note why the movement fails, and leave nothing moving unwatched."""
        self._note(error)
        self.halt(error)

    # Watch

    def poll(self) -> None:
        """Ask what is due, and notice a movement that makes no progress."""
        active, clock = self.active, self._context.clock
        wall_s = clock.wall_s()
        if wall_s < self._next_poll_s:
            return
        watch = self._context.settings.watch
        period_s = watch.idle_poll_s if active is None else self._context.poll_s
        self._next_poll_s = wall_s + period_s
        self.ask_position()
        self.ask_activity()
        if active is not None:
            self._watch(active, clock.now_s())

    def _watch(self, active: ActiveMove, now_s: float) -> None:
        """See that a movement makes progress, and that one to be stopped does stop."""
        if active.error is not None and not active.at_rest:
            self._stop()
        late = now_s - active.progress_s
        if late <= active.stall_s(self._context.settings, self._context.clock.rate):
            return
        if active.error is None:
            text = f"{self._name}: no progress for {late:.1f} s, stopped"
            self.fail(DeviceTimeout(text, fault=DeviceFault.TIMEOUT))
        elif not active.reported:
            self._report_failed(active, active.error)

    def _report_failed(self, active: ActiveMove, error: CosmicError) -> None:
        """Fail the movement now, and follow the axis until it is stationary somewhere known."""
        active.leave_line(self._name)
        active.reported = True
        active.error = active.error or error
        if not active.at_rest:
            self._note(DeviceError(f"{self._name}: it cannot be seen to be stationary ({error})"))
        self._context.container.update(self._address.channel, in_motion=False)
        self._report_state()
        active.order.movement.fail(error)
        self._context.reports.failed(self._name, error)

    def ask_activity(self) -> None:
        """Ask what the channel is doing."""
        self._status.ask_activity(self.active)

    def ask_position(self) -> None:
        """Ask for the position, where there is a sensor."""
        self._status.ask_position(self.active)

    def ask_position_known(self) -> None:
        """Ask whether the position is referenced; old libraries cannot say."""
        if not self._status.ask_position_known():
            self._on_known(PositionKnownRead(self._address, known=self._found_reference))

    def take(self, event: Event) -> None:
        """Follow one event of this channel."""
        match event:
            case Completed():
                self.ask_activity()
                self.ask_position()
            case ActivityRead():
                self._on_activity(event)
            case PositionRead():
                self._on_position()
            case PositionKnownRead():
                self._on_known(event)
            case Failed():
                self._on_failed(event.error)

    def _on_activity(self, event: ActivityRead) -> None:
        number = self._status.activity_answered()
        active = self.active
        if not self.settled:
            self._settle(event.activity)
        elif active is None and number == 0 and not event.activity.at_rest:
            self._stop_unasked(event.activity)
        if active is None or number != active.order.number or active.jog is not None:
            return
        if not event.activity.at_rest:
            active.rests_seen = 0
            return
        active.rests_seen += 1
        if active.rests_seen == 1:
            # One answer may be too early. The position is asked for at once, and answered last.
            self.ask_activity()
            if active.known_pending:
                self.ask_position_known()
            self.ask_position()
        elif not self._positioner.has_sensor:
            self._land()

    def _settle(self, activity: Activity) -> None:
        """Bring to rest what was moving before anybody here could have asked for it."""
        if activity.at_rest:
            self.settled = True
            return
        logger.warning("%s: was %s when it was found; stopped", self._name, activity)
        self.halt(MoveCancelled(f"{self._name}: stopped"))
        self.ask_activity()
        self.ask_position()

    def _stop_unasked(self, activity: Activity) -> None:
        """Stop what moves although nobody here asked for it: no gate has seen that movement."""
        self._note(DeviceError(f"{self._name}: was {activity} without an order; stopped"))
        self._stop()

    def _on_position(self) -> None:
        number = self._status.position_answered()
        active = self.active
        if active is None:
            return
        position = self._positioner.state.position
        active.note_position(position, self._context.clock.now_s())
        self._keep_to_line(active, position)
        if active.at_rest and number == -active.order.number and not active.known_pending:
            self._land()

    def _keep_to_line(self, active: ActiveMove, position: float | None) -> None:
        """Stop everything when an axis falls behind those it keeps to a line with."""
        line = None if active.order.start is None else active.order.start.line
        if line is None or position is None or active.awaiting or active.error is not None:
            return
        behind = line.lags(self._name, position)
        if behind is not None:
            self.fail(DeviceError(behind))

    def _on_known(self, event: PositionKnownRead) -> None:
        known = Confidence.KNOWN if event.known else Confidence.UNKNOWN
        self._context.container.update(self._address.channel, confidence=known)
        active = self.active
        if active is not None and active.asks_reference:
            active.known_pending = False
            if not event.known and active.error is None:
                text = f"{self._name}: it stopped without having found its reference"
                active.error = DeviceError(text, fault=DeviceFault.REFERENCE)
        self._report_state()

    def _on_failed(self, error: DeviceError) -> None:
        active = self.active
        if error.fault in (DeviceFault.NO_SENSOR, DeviceFault.WRONG_KIND):
            self._status.position_answered()  # that is what the query got for an answer
        only_asked = active is None or active.asks_reference
        if error.fault is DeviceFault.UNSUPPORTED and only_asked:
            self._on_known(PositionKnownRead(self._address, known=self._found_reference))
        elif active is None:
            self._note(error)
        elif active.at_rest and not active.reported:
            self._note(error)
            self._report_failed(active, active.error or error)  # stationary, and cannot say where
        elif active.error is None:
            self.fail(error)

    @property
    def _found_reference(self) -> bool:
        return self.active is not None and self.active.found_reference

    def _note(self, error: CosmicError) -> None:
        """Mark the axis as faulty, and log it once."""
        if self._positioner.state.error != str(error):
            logger.error("%s: %s", self._name, error)
            self._context.container.update(self._address.channel, error=str(error))
            self._report_state()

    # End

    def _land(self) -> None:
        active = self.active
        if active is None:
            return
        state, context = self._positioner.state, self._context
        self._count(active)
        jogged = isinstance(active.order.motion, Jog)
        missed = None
        if active.error is None and not jogged:
            missed = missed_target(active, state, context.settings)
        if missed is not None:
            self._note(missed)
            self._stop()  # a device that says too early that it is stationary would go on
        self._release(active.reservation)
        self._conclude(active.error or missed)

    def _count(self, active: ActiveMove) -> None:
        """Estimate where an axis without sensor is after `active`."""
        if self._positioner.has_sensor:
            return
        travel = CountedTravel.of(self._positioner.settings, self._context.settings.defaults)
        distance = counted_distance(active, travel.step_um, self._context.clock.now_s())
        state = self._positioner.state
        where, std = travel.after(state.position or 0.0, state.std, distance)
        if where != (state.position or 0.0) + distance:
            logger.info(
                "%s: counted to its end stop; the estimate stays at %g um", self._name, where
            )
        self._context.container.update(self._address.channel, position=where, std=std)

    def _conclude(self, error: CosmicError | None) -> None:
        """End the active movement; its interval stays held unless it has landed."""
        active, self.active = self.active, None
        if active is None:
            return
        if error is not None:
            active.leave_line(self._name)
        if active.has_own_speed:
            self._speed.restore()
        in_motion = not active.at_rest
        state = self._context.container.update(self._address.channel, in_motion=in_motion)
        position = state.position if state else None
        self._report_state()
        if error is None:
            active.order.movement.finish(state.shown_position if state else None)
            self._context.reports.finished(self._name, position)
        elif not active.reported:
            active.order.movement.fail(error)
            self._context.reports.failed(self._name, error)

    def _release(self, reservation: Reservation | None) -> None:
        if reservation is not None:
            self._context.gate.release(reservation)

    def _report_state(self) -> None:
        self._context.reports.state(self._address.channel)
