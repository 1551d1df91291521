"""Finding out what is connected to the channels of a device (thesis Fig. 6.7)."""

import logging
from threading import Event as ThreadEvent
from typing import Final

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.core.flight import PilotContext
from cosmic.mico.core.pilot import ChannelPilot
from cosmic.mico.hw.interface import (
    Channel,
    Event,
    PositionerKind,
    ReferenceKind,
    SensorPresentRead,
    TypeRead,
)

logger = logging.getLogger(__name__)

CHANNELS: Final = range(3)


class Introduction:
    """Asks each channel what it has and makes a pilot for what answers; device thread.

    It is over when every channel has answered, stands, and has told its position.
    """

    def __init__(self, context: PilotContext) -> None:
        self._context = context
        self._over = ThreadEvent()
        self.pilots: dict[int, ChannelPilot] = {}

    @property
    def over(self) -> bool:
        """True when everything is known; any thread."""
        return self._over.is_set()

    def wait(self, timeout_s: float) -> bool:
        """Wait until it is over; False after `timeout_s` of wall time. Any thread."""
        return self._over.wait(timeout_s)

    def give_up(self) -> dict[int, ChannelPilot]:
        """Part from all pilots, as of a device that is gone."""
        pilots, self.pilots = self.pilots, {}
        self._over.set()
        return pilots

    def begin(self) -> None:
        """Ask every channel whether it has a sensor."""
        container, controller = self._context.container, self._context.controller
        for channel in CHANNELS:
            container.expect(channel)
        for channel in CHANNELS:
            address = container.address(channel)
            try:
                controller.report_completion(address)
                controller.ask_sensor_present(address)
            except DeviceError as exc:
                if exc.fault is not DeviceFault.NO_CHANNEL:
                    raise
                container.settle(channel, None, "no such channel")
        self.look()

    def take(self, event: Event, channel: int) -> None:
        """Take an event of a channel that has no pilot yet."""
        if isinstance(event, SensorPresentRead) and event.present:
            self._context.controller.ask_type(event.channel)
        elif isinstance(event, (SensorPresentRead, TypeRead)):
            self._welcome(channel)
        else:
            logger.debug("device %d: %s", self._context.container.device, event)

    def _welcome(self, channel: int) -> None:
        positioner = self._context.container.positioner(channel)
        if positioner is None or not positioner.state.present:
            return
        pilot = ChannelPilot(positioner, self._context)
        self.pilots[channel] = pilot
        if positioner.state.kind is not PositionerKind.OPEN_LOOP:
            usual_hz = self._context.settings.defaults.closed_loop_frequency_hz
            pilot.speed.set_usual(positioner.frequency_hz or usual_hz)
            pilot.ask_position_known()
            found = positioner.state.positioner
            if found is not None and found.reference is ReferenceKind.END_STOP:
                self._ask_safe_direction(positioner.state.address)
        pilot.ask_activity()
        pilot.ask_position()

    def _ask_safe_direction(self, address: Channel) -> None:
        """Ask which way a search for the reference goes; where unknown, it may go both."""
        try:
            self._context.controller.ask_safe_direction(address)
        except DeviceError as exc:
            if exc.fault is not DeviceFault.UNSUPPORTED:
                raise

    def look(self) -> None:
        """See whether it is over."""
        container = self._context.container
        if self._over.is_set() or not container.clear:
            return
        # The listener settles a channel before its answer gets here, so that a pilot may lack.
        present = {
            channel
            for channel in container.channels()
            if (state := container.state(channel)) is not None and state.present
        }
        if present <= self.pilots.keys() and all(each.located for each in self.pilots.values()):
            self._over.set()
