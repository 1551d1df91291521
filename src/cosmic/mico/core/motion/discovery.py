"""`ChannelDiscovery`: what is connected to a device, found when its thread begins."""

import logging

from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout
from cosmic.frame.operation import Task
from cosmic.mico.core.motion.channel import ChannelController
from cosmic.mico.core.motion.channel_context import ChannelContext
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.hw.interface import (
    Channel,
    Event,
    PositionerKind,
    ReferenceKind,
    SensorPresentRead,
    TypeRead,
)

logger = logging.getLogger(__name__)


class ChannelDiscovery:
    """Makes a `ChannelController` for each channel that says what it has; device thread.

    It is over when every channel has answered, is stationary, and its position was read.

    Attributes
    ----------
    over : bool
        Everything is known; any thread may look.
    """

    def __init__(self, context: ChannelContext) -> None:
        self._context = context
        self._search = Task(f"finding the axes of device {context.container.device}")
        self.channels: dict[int, ChannelController] = {}
        self.over = False

    def wait(self, timeout_s: float) -> bool:
        """Wait until it is over; False after `timeout_s` of wall time. Any thread."""
        try:
            self._search.wait(timeout_s)
        except DeviceTimeout:
            return False
        return True

    def give_up(self) -> dict[int, ChannelController]:
        """Part from all channels, as of a device that is gone."""
        channels, self.channels = self.channels, {}
        self.over = True
        self._search.finish()
        return channels

    def begin(self) -> None:
        """Ask every channel whether it has a sensor."""
        container, library = self._context.container, self._context.controller
        channels = container.possible_channels()
        for channel in channels:
            container.expect(channel)
        for channel in channels:
            address = container.address(channel)
            try:
                library.report_completion(address)
                library.ask_sensor_present(address)
            except DeviceError as exc:
                if exc.fault is not DeviceFault.NO_CHANNEL:
                    raise
                container.settle(channel, None, "no such channel")
        self.look()

    def take(self, event: Event, channel: int) -> None:
        """Take an event of a channel that is not known yet."""
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
        if self._is_too_fast(positioner.state, channel):
            return
        controller = ChannelController(positioner, self._context)
        self.channels[channel] = controller
        if positioner.state.kind is not PositionerKind.OPEN_LOOP:
            usual_hz = self._context.settings.defaults.closed_loop_frequency_hz
            controller.speed.set_usual(positioner.frequency_hz or usual_hz)
            controller.monitor.ask_position_known()
            found = positioner.state.positioner
            if found is not None and found.reference is ReferenceKind.END_STOP:
                self._ask_safe_direction(positioner.state.address)
        controller.monitor.ask_activity()
        controller.monitor.ask_position()

    def _is_too_fast(self, state: PositionerState, channel: int) -> bool:
        """Refuse an axis whose controller cannot be set to the speed that is configured."""
        usual_hz = self._context.settings.defaults.closed_loop_frequency_hz
        low, high = state.frequency_range_hz
        if state.kind is PositionerKind.OPEN_LOOP or low <= usual_hz <= high:
            return False
        text = (
            f"its controller takes {low} to {high} Hz, and closed_loop_frequency_hz of "
            f"[mico.defaults] is {usual_hz}: change it, then rescan"
        )
        logger.error("%s: %s", state.name, text)
        self._context.container.update(channel, present=False, error=text)
        return True

    def _ask_safe_direction(self, address: Channel) -> None:
        """Ask in which direction a reference is searched; where unknown, it may be either."""
        try:
            self._context.controller.ask_safe_direction(address)
        except DeviceError as exc:
            if exc.fault is not DeviceFault.UNSUPPORTED:
                raise

    def look(self) -> None:
        """See whether it is over."""
        container = self._context.container
        if self._search.done or not container.clear:
            return
        # The listener settles a channel before its answer gets here, so that a controller may lack.
        present = {
            channel
            for channel in container.channels()
            if (state := container.state(channel)) is not None and state.present
        }
        if present <= self.channels.keys() and all(
            each.monitor.located for each in self.channels.values()
        ):
            self.over = True
            self._search.finish()
