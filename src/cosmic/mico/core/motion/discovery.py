"""`ChannelDiscovery`: what is connected to a device, found when its thread begins."""

import logging
from collections.abc import Set

from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout
from cosmic.frame.operation import Task
from cosmic.mico.core.motion.channel_context import ChannelContext
from cosmic.mico.core.motion.positioner import PositionerBase, PositionerState
from cosmic.mico.hw.interface import Event, PositionerKind, SensorPresentRead, TypeRead

logger = logging.getLogger(__name__)


class ChannelDiscovery:
    """Asks each channel of a device what it has; device thread.

    It is over when every channel has answered, and those that have an axis are located.

    Attributes
    ----------
    over : bool
        Everything is known; any thread may look.
    """

    def __init__(self, context: ChannelContext) -> None:
        self._context = context
        self._search = Task(f"finding the axes of device {context.container.device}")
        self.over = False

    def wait(self, timeout_s: float) -> bool:
        """Wait until it is over; False after `timeout_s` of wall time. Any thread."""
        try:
            self._search.wait(timeout_s)
        except DeviceTimeout:
            return False
        return True

    def give_up(self) -> None:
        """End it, as of a device that is gone."""
        self.over = True
        self._search.finish()

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
        self.look(frozenset())

    def take(self, event: Event, channel: int) -> PositionerBase | None:
        """Take an event of a channel that is not known yet; return the axis found by it."""
        if isinstance(event, SensorPresentRead) and event.present:
            self._context.controller.ask_type(event.channel)
        elif isinstance(event, (SensorPresentRead, TypeRead)):
            positioner = self._context.container.positioner(channel)
            if positioner is not None and self._is_usable(positioner.state, channel):
                return positioner
        else:
            logger.debug("device %d: %s", self._context.container.device, event)
        return None

    def _is_usable(self, state: PositionerState, channel: int) -> bool:
        """Refuse an axis whose controller cannot be set to the speed that is configured."""
        if not state.present:
            return False
        usual_hz = self._context.settings.defaults.closed_loop_frequency_hz
        low, high = state.frequency_range_hz
        if state.kind is PositionerKind.OPEN_LOOP or low <= usual_hz <= high:
            return True
        text = (
            f"its controller takes {low} to {high} Hz, and closed_loop_frequency_hz of "
            f"[mico.defaults] is {usual_hz}: change it, then rescan"
        )
        logger.error("%s: %s", state.name, text)
        self._context.container.update(channel, present=False, error=text)
        return False

    def look(self, located: Set[int]) -> None:
        """See whether it is over, now that the axes of some channels are located."""
        container = self._context.container
        if self._search.done or not container.clear:
            return
        # The listener settles a channel before its answer gets here, so that a controller may lack.
        present = {
            channel
            for channel in container.channels()
            if (state := container.state(channel)) is not None and state.present
        }
        if present <= located:
            self.over = True
            self._search.finish()
