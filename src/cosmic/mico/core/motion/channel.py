"""`ChannelController`: takes one channel from order to standstill; device thread only."""

import logging
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    MoveCancelled,
    refusal,
)
from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import ALLOWED, MoveVerdict, Reason, refuse
from cosmic.mico.core.motion.checks import Request, malformed
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.gate import Gate, Question
from cosmic.mico.core.motion.group_start import Departure
from cosmic.mico.core.motion.jog import SLOWER, JogRun, SteerRun
from cosmic.mico.core.motion.lease import Guard
from cosmic.mico.core.motion.messages import Departed, MovementBegun
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import (
    Grant,
    Jog,
    Motion,
    MoveBy,
    MoveTo,
    Order,
    Reference,
    Steer,
    Step,
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
    Controller,
    Event,
    Failed,
    PositionKnownRead,
    PositionRead,
)

logger = logging.getLogger(__name__)


def quietly(name: str, call: Callable[[], None]) -> bool:
    """Make a call and say whether it was taken; a device out of reach is another's matter."""
    try:
        call()
    except DeviceError as exc:
        if exc.fault in (DeviceFault.COMMUNICATION, DeviceFault.TIMEOUT):
            raise
        logger.warning("%s: %s", name, exc)
        return False
    return True


@dataclass(slots=True)
class ActiveMove:
    """One order that was sent to the controller.

    Attributes
    ----------
    grant : Grant
        The gate's leave, given back when the movement ends; of a jog, that of the last packet.
    rests_seen : int
        How many answers, asked after the start, said that the channel stands.
    known_pending : bool
        The controller still has to say whether the reference was found.
    error : CosmicError or None
        Why the movement will fail once it stands.
    asking : bool
        The gate was asked for the next packet of a jog and has not answered yet.
    awaiting : bool
        It waits for others to start together with, and was not sent yet.
    replaced : bool
        A newer order took its place.
    told : bool
        Its movement has been failed already; it is only followed until it stands.
    progress_s : float
        Platform time of the last sign of life.
    progress_position : float or None
        Where it was then.
    """

    order: Order
    grant: Grant
    started_s: float
    progress_s: float
    progress_position: float | None = None
    rests_seen: int = 0
    known_pending: bool = False
    error: CosmicError | None = None
    jog: JogRun | None = None
    asking: bool = False
    told: bool = False
    awaiting: bool = False
    replaced: bool = False

    @property
    def has_own_speed(self) -> bool:
        """True when the channel has another closed-loop speed than the usual one meanwhile."""
        return isinstance(self.order.motion, Jog) or self.order.frequency_hz is not None

    @property
    def found_reference(self) -> bool:
        """True of a reference run without error: the word of libraries that have none."""
        return self.error is None and isinstance(self.order.motion, Reference)

    @property
    def asks_reference(self) -> bool:
        """True while it stands and the controller was asked whether the reference was found."""
        return self.known_pending and self.rests_seen > 0

    @property
    def withdrawn(self) -> bool:
        """True when it must not be sent any more."""
        return self.replaced or self.error is not None

    @property
    def at_rest(self) -> bool:
        """True when the channel was twice said to stand; one answer may be too early."""
        return self.rests_seen >= 2

    def note_position(self, position: float | None, now_s: float) -> None:
        """Take a new position as a sign of life, the same one as none."""
        if position != self.progress_position:
            self.progress_position, self.progress_s = position, now_s

    def patience_s(self, settings: MicoSettings, rate: float) -> float:
        """Return how long it may go without a sign of life, in platform seconds.

        A fast clock must not turn the jitter of the wall into a time-out.
        """
        patience_s = max(settings.watch.stall_s, rate)
        motion = self.order.motion
        if isinstance(motion, Step):
            patience_s += abs(motion.steps) / motion.frequency_hz
        return patience_s


def _nobody(_what: object) -> None:
    """Hear of a movement where nobody listens."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What the gate says to an order, or to the next packet of a jog.

    Attributes
    ----------
    motion : Motion or None
        What may be sent; None where a jog has come to its end.
    slowed : bool
        The jog goes at another speed from now on.
    """

    order: Order
    motion: Motion | None
    verdict: MoveVerdict = ALLOWED
    grant: Grant | None = None
    jog: JogRun | None = None
    slowed: bool = False


OnAnswer = Callable[[Judged], None]


Asking = Callable[[Question], Judged]
"""Puts a question to the gate and waits for the answer; any thread."""


def _ask_here(_order: Order, ask: Asking, on_answer: OnAnswer) -> None:
    on_answer(ask(Question()))


@dataclass(slots=True)
class PilotContext:
    """What the pilots of one device share."""

    controller: Controller
    container: DeviceDataContainer
    gate: Gate
    clock: Clock
    settings: MicoSettings
    on_refused: Callable[[MoveVerdict], None]
    on_finished: Callable[[str, float | None], None]
    on_failed: Callable[[str, CosmicError], None]
    on_state: Callable[[int], None]
    on_begun: Callable[[MovementBegun], None] = _nobody
    on_departed: Callable[[Departed], None] = _nobody
    ask_gate: Callable[[Order, Asking, OnAnswer], None] = _ask_here
    on_unasked: Callable[[Order], None] = _nobody
    poll_s: float = 0.05


def missed_target(
    active: ActiveMove, state: PositionerState, settings: MicoSettings
) -> CosmicError | None:
    """Return the failure of a movement that stands somewhere else than asked."""
    if active.grant.target is None or state.position is None:
        return None
    watch = settings.watch
    tolerance = watch.tolerance_deg if state.unit == "deg" else watch.tolerance_um
    if abs(state.position - active.grant.target) <= tolerance:
        return None
    where = format_quantity(state.position - state.zero, state.unit)
    wanted = format_quantity(active.grant.target - state.zero, state.unit)
    return DeviceError(f"{state.name}: stopped at {where} instead of {wanted}")


def counted_way(active: ActiveMove, step_um: float, now_s: float) -> float:
    """Estimate how far an axis without sensor went during `active`, in um."""
    motion, made = active.order.motion, 0.0
    elapsed_s = now_s - active.started_s
    if isinstance(motion, Step):
        ran = min(float(abs(motion.steps)), elapsed_s * motion.frequency_hz)
        made = math.copysign(ran, motion.steps) * motion.amplitude_v / 100.0
    elif isinstance(motion, Jog):
        made = motion.direction * motion.speed * elapsed_s
    return made * step_um


MOST_OPEN: Final = 8
GIVEN_UP_S: Final = 2.0
"""Wall time after which an answer is taken for lost."""


class Questions:
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
        if WALL.now_s() - self._open[0][1] < GIVEN_UP_S:
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

    def __init__(self, positioner: PositionerBase, context: PilotContext) -> None:
        self._positioner = positioner
        self._controller = context.controller
        self._address = positioner.state.address
        self._activity = Questions()
        self._position = Questions()

    def ask_activity(self, active: ActiveMove | None) -> None:
        """Ask what the channel is doing, during `active`."""
        self._ask(
            self._activity,
            _number(active),
            lambda: self._controller.ask_activity(self._address),
        )

    def activity_answered(self) -> int:
        """Return the number of the order under way when the oldest question was asked."""
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
        """Return the number as `activity_answered`; below 0 when the channel stood already."""
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

    def _ask(self, questions: Questions, number: int, call: Callable[[], None]) -> None:
        if not questions.may_ask():
            return
        questions.asked(number)
        if not quietly(self._positioner.state.name, call):
            questions.withdrawn()


def _number(active: ActiveMove | None) -> int:
    """Return under which number to ask: 0 without an order under way, or before it is sent."""
    return 0 if active is None or active.awaiting else active.order.number


GLIDE: Final = 1.5
"""How much faster than the jog an axis may go, to make up for its slow last micrometres."""


class ChannelSpeed:
    """Tells the controller the frequency limit of one channel; device thread only."""

    def __init__(self, positioner: PositionerBase, context: PilotContext) -> None:
        self._positioner = positioner
        self._context = context
        self._usual_hz = context.settings.defaults.closed_loop_frequency_hz

    def set_usual(self, frequency_hz: int, *, now: bool = True) -> None:
        """Limit the closed-loop speed, from `now` on or from the next movement."""
        self._usual_hz = frequency_hz
        self._positioner.frequency_hz = frequency_hz
        if now:
            self._limit(frequency_hz)

    def limit(self, frequency_hz: int) -> None:
        """Limit the speed of one movement."""
        quietly(self._positioner.state.name, lambda: self._limit(frequency_hz))

    def restore(self) -> None:
        """Give the channel its usual speed back."""
        self.limit(self._usual_hz)

    @property
    def top_speed(self) -> float:
        """What the axis can do at its frequency limit, a second; without a sensor, in Hz."""
        if not self._positioner.has_sensor:
            return float(self._positioner.state.frequency_range_hz[1])
        return self._usual_hz * self._nominal_step

    def limit_jog(self, jog: JogRun) -> None:
        """Have the axis glide from packet to packet, not leap and wait; raises `DeviceError`."""
        step = self._nominal_step
        glide = jog.glide(step) if isinstance(jog, SteerRun) else GLIDE
        wanted_hz = math.ceil(glide * jog.speed / step)
        self._limit(
            max(self._positioner.state.frequency_range_hz[0], min(wanted_hz, self._usual_hz))
        )

    @property
    def _nominal_step(self) -> float:
        defaults = self._context.settings.defaults
        rotary = self._positioner.state.unit == "deg"
        return defaults.nominal_step_deg if rotary else defaults.nominal_step_um

    def _limit(self, frequency_hz: int) -> None:
        if self._positioner.has_sensor:
            self._context.controller.set_closed_loop_frequency(
                self._positioner.state.address, frequency_hz
            )


class ChannelDeparture(Departure):
    """Sends one prepared order to the controller, in whatever thread starts the group.

    Whoever withdraws the order sets that first and stops the channel then; here it is looked at
    before and after the call. So either the call is not made, or one of the two stops the channel.
    """

    def __init__(
        self, positioner: PositionerBase, context: PilotContext, active: ActiveMove
    ) -> None:
        self._positioner = positioner
        self._context = context
        self._active = active
        self._error: CosmicError | None = None

    @property
    @override
    def name(self) -> str:
        return self._positioner.state.name

    @property
    def _void(self) -> bool:
        active = self._active
        return active.withdrawn or not self._context.gate.still_valid(active.grant)

    @override
    def go(self) -> bool:
        if self._void:
            return False
        motion, grant = self._active.order.motion, self._active.grant
        refused = self._context.gate.claim(grant, self.name, motion)
        if refused is not None:
            logger.warning("refused: %s", refused)
            self._error = refusal(refused)
            return False
        if isinstance(motion, MoveBy):
            motion = MoveTo(math.nan if grant.target is None else grant.target, motion.unit)
        try:
            self._positioner.send(self._context.controller, motion)
        except DeviceError as exc:
            self._error = exc
        if self._void:
            self._stop()
        return True

    def _stop(self) -> None:
        try:
            self._context.controller.stop(self._positioner.state.address)
        except DeviceError as exc:
            logger.warning("%s: %s", self.name, exc)

    @override
    def tell(self) -> None:
        self._context.on_departed(Departed(self._active.order, self._error))


class ChannelController:
    """Takes one channel from order to standstill; device thread, but for `renew` and `steer`."""

    def __init__(self, positioner: PositionerBase, context: PilotContext) -> None:
        self._positioner = positioner
        self._context = context
        self._address = positioner.state.address
        self._status = StatusPoll(positioner, context)
        self.speed = ChannelSpeed(positioner, context)
        self.active: ActiveMove | None = None
        self.next_poll_s = 0.0
        self.newest: Movement | None = None
        self.settled = False
        self._starting: tuple[int, JogRun] | None = None

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self._positioner.state.name

    @property
    def located(self) -> bool:
        """True once it stands and its position was read, or there is no sensor to read it."""
        return self.settled and (
            not self._positioner.has_sensor or self._positioner.state.position is not None
        )

    def set_frequency(self, frequency_hz: int) -> None:
        """Limit the closed-loop speed; a jog, or one that arrives with others, keeps its own."""
        own = self.active is not None and self.active.has_own_speed
        self.speed.set_usual(frequency_hz, now=not own)

    # Starting

    def launch(self, order: Order) -> None:
        """Ask the gate, send `order` to the library, and begin to follow it."""
        gate = self._context.gate
        if order.movement.cancelled or (order.follows and order.follows is not self.newest):
            gate.withdraw(order.grant)
            why = "a newer command came first" if order.follows else "cancelled before it started"
            order.movement.fail(MoveCancelled(f"{self.name}: {why}"))
            return
        refused = self._void(order)
        if refused is not None:
            self.turn_away(order, refused)
            return
        self.newest = order.movement
        if isinstance(order.motion, Jog):
            self._start_jog(order, order.motion)
            return
        grant = order.grant
        if grant is not None and gate.superseded(grant):
            # The axis was sent elsewhere since this was decided: the volume is another one now.
            gate.withdraw(grant)
            grant = None
        if grant is not None:
            self._go(order, grant)
        elif self._has_origin(order):
            self._context.ask_gate(order, partial(self._ask, order, order.motion), self._on_judged)

    def _on_judged(self, judged: Judged) -> None:
        """Begin an order that the gate has decided; it may have waited for that for long."""
        order, grant = judged.order, judged.grant
        if not judged.verdict.allowed:
            self.turn_away(order, judged.verdict)
        elif grant is not None and self._still_wanted(order, grant):
            self._go(order, grant)

    def _still_wanted(self, order: Order, grant: Grant) -> bool:
        """See whether `order` may still begin; otherwise its end is told."""
        refused = self._outlived(order)
        if refused is None and not order.movement.cancelled:
            return True
        self._context.gate.withdraw(grant)
        if refused is not None:
            self.turn_away(order, refused)
        else:
            over = MoveCancelled(f"{self.name}: cancelled before it started")
            order.movement.fail(over)
        return False

    def _go(self, order: Order, grant: Grant) -> None:
        """Send `order`, or get it ready where it starts with others."""
        gate = self._context.gate
        if not gate.still_valid(grant):
            gate.withdraw(grant)
            self.turn_away(order, _stopped(self.name))
            return
        replaced = self._begin(order, grant)
        if order.start is not None:
            self._await_start(order, replaced)
            return
        try:
            self._set_speed_for(order, replaced)
            self._send(order.motion, grant)
        finally:
            self._tell_begun(order, replaced)
        self.ask_activity()

    def _void(self, order: Order) -> MoveVerdict | None:
        """Return why `order` must not be sent any more, or never was to be; None if it may."""
        gate, over = self._context.gate, self._outlived(order)
        if over is None and order.grant is not None:
            over = gate.objection(order.grant, self.name, order.motion)
            if over is not None and over.reason is not Reason.STOPPED:
                return over  # whoever it was given to may still use it
        if over is not None:
            gate.withdraw(order.grant)
        return over

    def _outlived(self, order: Order) -> MoveVerdict | None:
        """Return why `order` is over, whatever the gate says: who gave it is gone, or a stop."""
        guard = order.guard
        if guard is not None and guard.expired:
            return _unguarded(self.name, guard)
        if order.epoch is not None and order.epoch != self._context.gate.stop_state.epoch:
            return _stopped(self.name)
        return None

    def _set_speed_for(self, order: Order, replaced: ActiveMove | None) -> None:
        """Give the channel the speed of `order`, or its usual one back."""
        own_hz = order.frequency_hz
        if own_hz is not None:
            self.speed.limit(own_hz)
        elif replaced is not None and replaced.has_own_speed:
            self.speed.restore()

    def _await_start(self, order: Order, replaced: ActiveMove | None) -> None:
        """Get everything ready, and leave the call itself to the one that starts the group."""
        active, start = self.active, order.start
        if active is None or start is None:
            return
        active.awaiting = True
        try:
            self._set_speed_for(order, replaced)
        finally:
            self._tell_begun(order, replaced)
        start.arrive(ChannelDeparture(self._positioner, self._context, active))

    def depart(self, departed: Departed) -> None:
        """Follow an order that was sent together with others."""
        active = self.active
        if active is None or active.order is not departed.order:
            return
        active.awaiting = False
        active.progress_s = self._context.clock.now_s()
        if isinstance(departed.error, DeviceError):
            self._blame(departed.error)
        elif departed.error is not None:
            self.halt(departed.error)
        elif active.error is None and not self._context.gate.still_valid(active.grant):
            self.halt(refusal(_stopped(self.name)))
        self.ask_activity()

    def _has_origin(self, order: Order) -> bool:
        """See whether it is known where `order` goes from; otherwise it is refused."""
        active = self.active
        nowhere = active is not None and (active.error is not None or active.grant.target is None)
        if nowhere and isinstance(order.motion, MoveBy) and order.grant is None:
            text = f"{self.name}: it does not stand yet, so there is no place to go on from"
            self.turn_away(order, refuse(Reason.NO_ANSWER, text, axis=self.name))
            return False
        return True

    def _ask(
        self,
        order: Order,
        motion: Motion,
        question: Question,
        *,
        jog: JogRun | None = None,
        slowed: bool = False,
    ) -> Judged:
        """Ask the gate for one motion; any thread, for the answer may be long in coming."""
        request = Request(self.name, motion, order.token, order.consent, guard=order.guard)
        verdict, grants = self._context.gate.decide([request], question)
        return Judged(order, motion, verdict, grants.get(self.name), jog, slowed)

    def turn_away(self, order: Order, verdict: MoveVerdict) -> None:
        """Tell everybody that `order` was refused."""
        logger.warning("refused (%s): %s", order.source, verdict)
        order.movement.fail(refusal(verdict))
        self._context.on_refused(verdict)

    def _begin(self, order: Order, grant: Grant, jog: JogRun | None = None) -> ActiveMove | None:
        """Make `order` the movement under way and return the one that it replaces.

        Nothing here takes long, for the controller waits: telling and logging come after `_send`.
        """
        now_s = self._context.clock.now_s()
        active = ActiveMove(order, grant, started_s=now_s, progress_s=now_s, jog=jog)
        active.known_pending = isinstance(order.motion, Reference)
        replaced, self.active = self.active, active
        if replaced is not None:
            replaced.replaced = True
            self._unask(replaced)
        self.next_poll_s = self._context.clock.wall_s() + self._context.poll_s
        return replaced

    def _tell_begun(self, order: Order, replaced: ActiveMove | None) -> None:
        """Tell everybody that `order` was sent, and that it ended the one before."""
        state = self._positioner.state
        failed = self.active is not None and self.active.error is not None
        error = self._positioner.state.error if failed else ""
        self._context.container.update(self._address.channel, in_motion=True, error=error)
        if replaced is not None:
            self._count(replaced)
            self._give_back(replaced.grant)
            if not replaced.told:
                over = MoveCancelled(f"{self.name}: replaced by a newer command")
                replaced.order.movement.fail(over)
                self._context.on_failed(self.name, over)
        # What goes on from an order told already would fill the log.
        level = logging.INFO if order.follows is None else logging.DEBUG
        logger.log(level, "%s: %s (%s)", self.name, order.motion, order.source)
        if self.active is not None:
            self._context.on_begun(
                MovementBegun(
                    name=self.name,
                    motion=order.motion,
                    from_position=state.position,
                    target=self.active.grant.target,
                    unit=state.unit,
                    time_s=self.active.started_s,
                    source=order.source,
                )
            )
        self._announce()

    def _send(self, motion: Motion, grant: Grant) -> None:
        refused = self._context.gate.claim(grant, self.name, motion)
        if refused is not None:
            logger.warning("refused: %s", refused)
            self.halt(refusal(refused))
            self._context.on_refused(refused)
            return
        if isinstance(motion, MoveBy):
            motion = MoveTo(math.nan if grant.target is None else grant.target, motion.unit)
        try:
            self._positioner.send(self._context.controller, motion)
        except DeviceError as exc:
            self._blame(exc)
        if not self._context.gate.still_valid(grant):
            self.halt(refusal(_stopped(self.name)))

    # Jogging

    def renew(self, order_number: int) -> None:
        """Keep a jog alive; any thread."""
        jog = self._jog_of(order_number)
        if jog is not None:
            jog.renew()

    def steer(self, order_number: int, velocity: float) -> bool:
        """Say how fast a steered axis is to go; True if the thread should look. Any thread."""
        jog = self._jog_of(order_number)
        return isinstance(jog, SteerRun) and jog.steer(velocity)

    def _jog_of(self, order_number: int) -> JogRun | None:
        """Return the jog of an order, also while the gate is asked for its beginning."""
        active, starting = self.active, self._starting
        if active is not None and active.order.number == order_number:
            return active.jog
        return starting[1] if starting is not None and starting[0] == order_number else None

    def _jog_run(self, motion: Jog) -> JogRun:
        settings, top_speed = self._context.settings, self.speed.top_speed
        if isinstance(motion, Steer):
            return SteerRun(motion, settings, top_speed, self._context.clock.rate or 1.0)
        return JogRun(motion, settings, top_speed)

    def _start_jog(self, order: Order, motion: Jog) -> None:
        senseless = malformed(motion, self._positioner.state)
        if senseless is not None:
            self.turn_away(order, senseless)
            return
        jog = self._jog_run(motion)
        self._starting = order.number, jog
        self._context.ask_gate(order, partial(self._first_packet, order, jog), self._begin_jog)

    def _first_packet(self, order: Order, jog: JogRun, question: Question) -> Judged:
        """Work out how a jog may begin; any thread."""
        jog.slow_down(self._free_share(order, jog))
        return self._ask_packet(order, jog, question, slowed=True)

    def _ask_packet(self, order: Order, jog: JogRun, question: Question, *, slowed: bool) -> Judged:
        packet = jog.packet(self._positioner.state, self._context.clock.now_s())
        if packet is None:
            return Judged(order, None, jog=jog)
        return self._ask(order, packet, question, jog=jog, slowed=slowed)

    def _begin_jog(self, judged: Judged) -> None:
        """Begin a jog that the gate has decided, unless it was let go meanwhile."""
        order, grant, jog, packet = judged.order, judged.grant, judged.jog, judged.motion
        self._starting = None
        if not judged.verdict.allowed:
            self.turn_away(order, judged.verdict)
            return
        if packet is None or grant is None or jog is None or jog.let_go():
            self._context.gate.withdraw(grant)
            order.movement.finish(self._positioner.state.shown_position)
            return
        if not self._still_wanted(order, grant):
            return
        replaced = self._begin(order, grant, jog=jog)
        try:
            self.speed.limit_jog(jog)
            self._send(packet, grant)
        finally:
            self._tell_begun(order, replaced)

    def _free_share(self, order: Order, jog: JogRun) -> float:
        """Return how much of its speed a jog may keep with what is in its way."""
        for share in SLOWER:
            ahead = jog.look_ahead(self._positioner.state, share)
            request = Request(self.name, ahead, order.token, order.consent, guard=order.guard)
            verdict = self._context.gate.check([request], advice=False)
            if verdict.reason is not Reason.COLLISION:
                return share
        return SLOWER[-1]

    def poll(self) -> None:
        """Keep a jog going, ask what is due, and notice a movement that makes no progress."""
        active = self.active
        guard = active.order.guard if active is not None and active.error is None else None
        if guard is not None and guard.expired:
            logger.warning("%s: stopped, %s", self.name, guard.why)
            self.halt(MoveCancelled(f"{self.name}: stopped, {guard.why}"))
        jog = active.jog if active is not None else None
        if active is not None and jog is not None and jog.due(self._context.clock.now_s()):
            self._next_packet(active, jog)
        self._ask_due()

    def _next_packet(self, active: ActiveMove, jog: JogRun) -> None:
        if not self._context.gate.still_valid(active.grant):
            self.halt(refusal(_stopped(self.name)))
            return
        if active.asking:
            active.progress_s = self._context.clock.now_s()
            if jog.let_go():
                self._end_jog(jog.lost)
            return
        active.asking = True
        ask = partial(self._later_packet, active.order, jog)
        self._context.ask_gate(active.order, ask, partial(self._on_packet, active))

    def _later_packet(self, order: Order, jog: JogRun, question: Question) -> Judged:
        """Work out how a jog may go on; any thread."""
        jog.follow_hand()
        slowed = jog.must_look() and jog.slow_down(self._free_share(order, jog))
        return self._ask_packet(order, jog, question, slowed=slowed)

    def _on_packet(self, active: ActiveMove, judged: Judged) -> None:
        """Send the next packet of a jog, unless it has ended while the gate was asked."""
        grant, jog, packet = judged.grant, judged.jog, judged.motion
        active.asking = False
        if self.active is not active or jog is None or active.jog is not jog:
            self._context.gate.withdraw(grant)
        elif not judged.verdict.allowed:
            self._end_jog(refusal(judged.verdict))
            self._context.on_refused(judged.verdict)
        elif packet is None or grant is None or jog.let_go():
            self._context.gate.withdraw(grant)
            self._end_jog(jog.lost)
        else:
            if judged.slowed:
                quietly(self.name, lambda: self.speed.limit_jog(jog))
            before, active.grant = active.grant, grant
            self._give_back(before)
            self._send(packet, grant)
            active.progress_s = self._context.clock.now_s()
            if isinstance(jog, SteerRun) and jog.must_locate():
                self.ask_position()

    # Stopping

    def halt(self, error: CosmicError) -> None:
        """Stop the channel; the movement under way will fail with `error`."""
        self.newest = None
        if self.active is not None:
            self._context.gate.abandon(self.active.grant)
            self.active.error = self.active.error or error
            self._unask(self.active)
            self.active.jog = None
            self.active.awaiting = False
        self._stop()
        if self.active is not None:
            self.active.progress_s = self._context.clock.now_s()
            self.ask_activity()

    def lose(self, error: CosmicError) -> None:
        """Give up the movement of a channel that cannot be reached; its interval stays held."""
        active, self.active = self.active, None
        if active is not None:
            self._unask(active)
            active.error = active.error or error
            self._context.gate.abandon(active.grant)
            self._count(active)
            active.order.movement.fail(error)
            self._context.on_failed(self.name, error)

    def _unask(self, active: ActiveMove) -> None:
        """Take the question for the next packet back: what it holds would outlast the movement."""
        if active.asking:
            active.asking = False
            self._context.on_unasked(active.order)

    def _stop(self) -> None:
        quietly(self.name, lambda: self._context.controller.stop(self._address))

    def _end_jog(self, error: CosmicError | None) -> None:
        active = self.active
        if active is None:
            return
        self._unask(active)
        active.jog, active.rests_seen = None, 0
        active.error = active.error or error
        if error is not None:
            logger.warning("%s: jogging ended: %s", self.name, error)
        self._stop()
        self.ask_activity()

    # Following

    def _ask_due(self) -> None:
        """Ask what is due, and notice a movement that makes no progress."""
        active, clock = self.active, self._context.clock
        wall_s = clock.wall_s()
        if wall_s < self.next_poll_s:
            return
        watch = self._context.settings.watch
        period_s = watch.idle_poll_s if active is None else self._context.poll_s
        self.next_poll_s = wall_s + period_s
        self.ask_position()
        self.ask_activity()
        if active is not None:
            self._watch(active, clock.now_s())

    def _watch(self, active: ActiveMove, now_s: float) -> None:
        """See that a movement makes progress, and that one to be stopped does stop."""
        if active.error is not None and not active.at_rest:
            self._stop()
        late = now_s - active.progress_s
        if late <= active.patience_s(self._context.settings, self._context.clock.rate):
            return
        if active.error is None:
            text = f"{self.name}: no progress for {late:.1f} s, stopped"
            self._blame(DeviceTimeout(text, fault=DeviceFault.TIMEOUT))
        elif not active.told:
            self._tell_failed(active, active.error)

    def _tell_failed(self, active: ActiveMove, error: CosmicError) -> None:
        """Fail the movement now, and go on following the axis until it stands somewhere known."""
        active.told = True
        active.error = active.error or error
        if not active.at_rest:
            self._note(DeviceError(f"{self.name}: it cannot be seen to stand ({error})"))
        self._context.container.update(self._address.channel, in_motion=False)
        self._announce()
        active.order.movement.fail(error)
        self._context.on_failed(self.name, error)

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
        logger.warning("%s: was %s when it was found; stopped", self.name, activity)
        self.halt(MoveCancelled(f"{self.name}: stopped"))
        self.ask_activity()
        self.ask_position()

    def _on_position(self) -> None:
        number = self._status.position_answered()
        active = self.active
        if active is None:
            return
        active.note_position(self._positioner.state.position, self._context.clock.now_s())
        if active.at_rest and number == -active.order.number and not active.known_pending:
            self._land()

    def _on_known(self, event: PositionKnownRead) -> None:
        known = Confidence.KNOWN if event.known else Confidence.UNKNOWN
        self._context.container.update(self._address.channel, confidence=known)
        active = self.active
        if active is not None and active.asks_reference:
            active.known_pending = False
            if not event.known and active.error is None:
                text = f"{self.name}: it stopped without having found its reference"
                active.error = DeviceError(text, fault=DeviceFault.REFERENCE)
        self._announce()

    def _on_failed(self, error: DeviceError) -> None:
        active = self.active
        if error.fault in (DeviceFault.NO_SENSOR, DeviceFault.WRONG_KIND):
            self._status.position_answered()  # that is what the question got for an answer
        only_asked = active is None or active.asks_reference
        if error.fault is DeviceFault.UNSUPPORTED and only_asked:
            self._on_known(PositionKnownRead(self._address, known=self._found_reference))
        elif active is None:
            self._note(error)
        elif active.at_rest and not active.told:
            self._note(error)
            self._tell_failed(active, active.error or error)  # it stands, and cannot say where
        elif active.error is None:
            self._blame(error)

    @property
    def _found_reference(self) -> bool:
        return self.active is not None and self.active.found_reference

    def _blame(self, error: DeviceError) -> None:
        """Remember why the movement fails, and leave nothing moving unwatched."""
        self._note(error)
        self.halt(error)

    def _note(self, error: CosmicError) -> None:
        """Mark the axis as faulty, and log it once."""
        if self._positioner.state.error != str(error):
            logger.error("%s: %s", self.name, error)
            self._context.container.update(self._address.channel, error=str(error))
            self._announce()

    # Landing

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
        self._give_back(active.grant)
        self._conclude(active.error or missed)

    def _count(self, active: ActiveMove) -> None:
        """Estimate where an axis without sensor is after `active`."""
        if self._positioner.has_sensor:
            return
        travel = CountedTravel.of(self._positioner.settings, self._context.settings)
        way = counted_way(active, travel.step_um, self._context.clock.now_s())
        state = self._positioner.state
        where, std = travel.after(state.position or 0.0, state.std, way)
        if where != (state.position or 0.0) + way:
            logger.info(
                "%s: counted to its end stop; the estimate stays at %g um", self.name, where
            )
        self._context.container.update(self._address.channel, position=where, std=std)

    def _conclude(self, error: CosmicError | None) -> None:
        """End the movement under way; its interval stays held unless it has landed."""
        active, self.active = self.active, None
        if active is None:
            return
        if active.has_own_speed:
            self.speed.restore()
        in_motion = not active.at_rest
        state = self._context.container.update(self._address.channel, in_motion=in_motion)
        position = state.position if state else None
        self._announce()
        if error is None:
            active.order.movement.finish(state.shown_position if state else None)
            self._context.on_finished(self.name, position)
        elif not active.told:
            active.order.movement.fail(error)
            self._context.on_failed(self.name, error)

    def _give_back(self, grant: Grant | None) -> None:
        if grant is not None:
            self._context.gate.release(grant)

    def _announce(self) -> None:
        self._context.on_state(self._address.channel)


def _unguarded(name: str, guard: Guard) -> MoveVerdict:
    return refuse(Reason.NO_LEASE, f"{name}: {guard.why}", axis=name)


def _stopped(name: str) -> MoveVerdict:
    return refuse(Reason.STOPPED, f"{name}: stopped before it got there", axis=name)
