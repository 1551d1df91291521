"""One order on its way through a channel, and what the pilots of a device share."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, DeviceError
from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.core.data_container import DeviceDataContainer
from cosmic.mico.core.gate import Gate
from cosmic.mico.core.jog import JogRun
from cosmic.mico.core.messages import Departed, MovementBegun
from cosmic.mico.core.orders import Grant, Jog, Order, Reference, Step
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Controller


@dataclass(slots=True)
class Flight:
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
    poll_s: float = 0.05


def missed_target(
    flight: Flight, state: PositionerState, settings: MicoSettings
) -> CosmicError | None:
    """Return the failure of a movement that stands somewhere else than asked."""
    if flight.grant.target is None or state.position is None:
        return None
    watch = settings.watch
    tolerance = watch.tolerance_deg if state.unit == "deg" else watch.tolerance_um
    if abs(state.position - flight.grant.target) <= tolerance:
        return None
    where = format_quantity(state.position - state.zero, state.unit)
    wanted = format_quantity(flight.grant.target - state.zero, state.unit)
    return DeviceError(f"{state.name}: stopped at {where} instead of {wanted}")


def counted_way(flight: Flight, step_um: float, now_s: float) -> float:
    """Estimate how far an axis without sensor went during `flight`, in um."""
    motion, made = flight.order.motion, 0.0
    elapsed_s = now_s - flight.started_s
    if isinstance(motion, Step):
        ran = min(float(abs(motion.steps)), elapsed_s * motion.frequency_hz)
        made = math.copysign(ran, motion.steps) * motion.amplitude_v / 100.0
    elif isinstance(motion, Jog):
        made = motion.direction * motion.speed * elapsed_s
    return made * step_um
