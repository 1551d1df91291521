"""One axis that is ready to start together with others."""

import logging
import math

from typing_extensions import override

from cosmic.frame.errors import CosmicError, DeviceError, refusal
from cosmic.mico.core.flight import Flight, PilotContext
from cosmic.mico.core.group_start import Departure
from cosmic.mico.core.messages import Departed
from cosmic.mico.core.orders import MoveBy, MoveTo
from cosmic.mico.core.positioner import PositionerBase

logger = logging.getLogger(__name__)


class ChannelDeparture(Departure):
    """Sends one prepared order to the controller, in whatever thread starts the group.

    Whoever withdraws the order sets that first and stops the channel then; here it is looked at
    before and after the call. So either the call is not made, or one of the two stops the channel.
    """

    def __init__(self, positioner: PositionerBase, context: PilotContext, flight: Flight) -> None:
        self._positioner = positioner
        self._context = context
        self._flight = flight
        self._error: CosmicError | None = None

    @property
    @override
    def name(self) -> str:
        return self._positioner.state.name

    @property
    def _void(self) -> bool:
        flight = self._flight
        return flight.withdrawn or not self._context.gate.still_valid(flight.grant)

    @override
    def go(self) -> bool:
        if self._void:
            return False
        motion, grant = self._flight.order.motion, self._flight.grant
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
        self._context.on_departed(Departed(self._flight.order, self._error))
