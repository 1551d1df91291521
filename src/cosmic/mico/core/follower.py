"""`ChannelFollower`: what becomes of an order after it was sent; device thread only."""

import logging

from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, DeviceTimeout, MoveCancelled
from cosmic.mico.core.channel_speed import ChannelSpeed
from cosmic.mico.core.enquiry import Enquiry
from cosmic.mico.core.estimate import CountedTravel
from cosmic.mico.core.flight import Flight, PilotContext, counted_way, missed_target
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.orders import Grant, Jog
from cosmic.mico.core.positioner import Confidence, PositionerBase
from cosmic.mico.core.quietly import quietly
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


class ChannelFollower:
    """Asks, listens, and brings what was launched to its end."""

    def __init__(self, positioner: PositionerBase, context: PilotContext) -> None:
        self._positioner = positioner
        self._context = context
        self._address = positioner.state.address
        self._enquiry = Enquiry(positioner, context)
        self.speed = ChannelSpeed(positioner, context)
        self.flight: Flight | None = None
        self.next_poll_s = 0.0
        self.newest: Movement | None = None
        self.settled = False

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
        own = self.flight is not None and self.flight.has_own_speed
        self.speed.set_usual(frequency_hz, now=not own)

    # Stopping

    def halt(self, error: CosmicError) -> None:
        """Stop the channel; the movement under way will fail with `error`."""
        self.newest = None
        if self.flight is not None:
            self._context.gate.abandon(self.flight.grant)
            self.flight.error = self.flight.error or error
            self.flight.jog = None
            self.flight.awaiting = False
        self._stop()
        if self.flight is not None:
            self.flight.progress_s = self._context.clock.now_s()
            self.ask_activity()

    def lose(self, error: CosmicError) -> None:
        """Give up the movement of a channel that cannot be reached; its interval stays held."""
        flight, self.flight = self.flight, None
        if flight is not None:
            flight.error = flight.error or error
            self._context.gate.abandon(flight.grant)
            self._count(flight)
            flight.order.movement.fail(error)
            self._context.on_failed(self.name, error)

    def _stop(self) -> None:
        quietly(self.name, lambda: self._context.controller.stop(self._address))

    def _end_jog(self, error: CosmicError | None) -> None:
        flight = self.flight
        if flight is None:
            return
        flight.jog, flight.rests_seen = None, 0
        flight.error = flight.error or error
        if error is not None:
            logger.warning("%s: jogging ended: %s", self.name, error)
        self._stop()
        self.ask_activity()

    # Following

    def poll(self) -> None:
        """Ask what is due, and notice a movement that makes no progress."""
        flight, clock = self.flight, self._context.clock
        wall_s = clock.wall_s()
        if wall_s < self.next_poll_s:
            return
        watch = self._context.settings.watch
        period_s = watch.idle_poll_s if flight is None else self._context.poll_s
        self.next_poll_s = wall_s + period_s
        self.ask_position()
        self.ask_activity()
        if flight is not None:
            self._watch(flight, clock.now_s())

    def _watch(self, flight: Flight, now_s: float) -> None:
        """See that a movement makes progress, and that one to be stopped does stop."""
        if flight.error is not None and not flight.at_rest:
            self._stop()
        late = now_s - flight.progress_s
        if late <= flight.patience_s(self._context.settings, self._context.clock.rate):
            return
        if flight.error is None:
            text = f"{self.name}: no progress for {late:.1f} s, stopped"
            self._blame(DeviceTimeout(text, fault=DeviceFault.TIMEOUT))
        elif not flight.told:
            self._tell_failed(flight, flight.error)

    def _tell_failed(self, flight: Flight, error: CosmicError) -> None:
        """Fail the movement now, and go on following the axis until it stands somewhere known."""
        flight.told = True
        flight.error = flight.error or error
        if not flight.at_rest:
            self._note(DeviceError(f"{self.name}: it cannot be seen to stand ({error})"))
        self._context.container.update(self._address.channel, in_motion=False)
        self._announce()
        flight.order.movement.fail(error)
        self._context.on_failed(self.name, error)

    def ask_activity(self) -> None:
        """Ask what the channel is doing."""
        self._enquiry.ask_activity(self.flight)

    def ask_position(self) -> None:
        """Ask for the position, where there is a sensor."""
        self._enquiry.ask_position(self.flight)

    def ask_position_known(self) -> None:
        """Ask whether the position is referenced; old libraries cannot say."""
        if not self._enquiry.ask_position_known():
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
        number = self._enquiry.activity_answered()
        flight = self.flight
        if not self.settled:
            self._settle(event.activity)
        if flight is None or number != flight.order.number or flight.jog is not None:
            return
        if not event.activity.at_rest:
            flight.rests_seen = 0
            return
        flight.rests_seen += 1
        if flight.rests_seen == 1:
            # One answer may be too early. The position is asked for at once, and answered last.
            self.ask_activity()
            if flight.known_pending:
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
        number = self._enquiry.position_answered()
        flight = self.flight
        if flight is None:
            return
        flight.note_position(self._positioner.state.position, self._context.clock.now_s())
        if flight.at_rest and number == -flight.order.number and not flight.known_pending:
            self._land()

    def _on_known(self, event: PositionKnownRead) -> None:
        known = Confidence.KNOWN if event.known else Confidence.UNKNOWN
        self._context.container.update(self._address.channel, confidence=known)
        flight = self.flight
        if flight is not None and flight.asks_reference:
            flight.known_pending = False
            if not event.known and flight.error is None:
                text = f"{self.name}: it stopped without having found its reference"
                flight.error = DeviceError(text, fault=DeviceFault.REFERENCE)
        self._announce()

    def _on_failed(self, error: DeviceError) -> None:
        flight = self.flight
        if error.fault in (DeviceFault.NO_SENSOR, DeviceFault.WRONG_KIND):
            self._enquiry.position_answered()  # that is what the question got for an answer
        only_asked = flight is None or flight.asks_reference
        if error.fault is DeviceFault.UNSUPPORTED and only_asked:
            self._on_known(PositionKnownRead(self._address, known=self._found_reference))
        elif flight is None:
            self._note(error)
        elif flight.at_rest and not flight.told:
            self._note(error)
            self._tell_failed(flight, flight.error or error)  # it stands, and cannot say where
        elif flight.error is None:
            self._blame(error)

    @property
    def _found_reference(self) -> bool:
        return self.flight is not None and self.flight.found_reference

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
        flight = self.flight
        if flight is None:
            return
        state, context = self._positioner.state, self._context
        self._count(flight)
        jogged = isinstance(flight.order.motion, Jog)
        missed = None
        if flight.error is None and not jogged:
            missed = missed_target(flight, state, context.settings)
        if missed is not None:
            self._note(missed)
        self._give_back(flight.grant)
        self._conclude(flight.error or missed)

    def _count(self, flight: Flight) -> None:
        """Estimate where an axis without sensor is after `flight`."""
        if self._positioner.has_sensor:
            return
        travel = CountedTravel.of(self._positioner.settings, self._context.settings)
        way = counted_way(flight, travel.step_um, self._context.clock.now_s())
        state = self._positioner.state
        where, std = travel.after(state.position or 0.0, state.std, way)
        if where != (state.position or 0.0) + way:
            logger.info(
                "%s: counted to its end stop; the estimate stays at %g um", self.name, where
            )
        self._context.container.update(self._address.channel, position=where, std=std)

    def _conclude(self, error: CosmicError | None) -> None:
        """End the movement under way; its interval stays held unless it has landed."""
        flight, self.flight = self.flight, None
        if flight is None:
            return
        if flight.has_own_speed:
            self.speed.restore()
        in_motion = not flight.at_rest
        state = self._context.container.update(self._address.channel, in_motion=in_motion)
        position = state.position if state else None
        self._announce()
        if error is None:
            flight.order.movement.finish(state.shown_position if state else None)
            self._context.on_finished(self.name, position)
        elif not flight.told:
            flight.order.movement.fail(error)
            self._context.on_failed(self.name, error)

    def _give_back(self, grant: Grant | None) -> None:
        if grant is not None:
            self._context.gate.release(grant)

    def _announce(self) -> None:
        self._context.on_state(self._address.channel)
