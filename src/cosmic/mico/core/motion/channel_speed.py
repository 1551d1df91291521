"""`ChannelSpeed`: the frequency limit of one channel, which is its closed-loop speed."""

import logging
import math
from collections.abc import Callable
from typing import Final

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.core.motion.jog import JogRun, SteerRun
from cosmic.mico.core.motion.positioner import PositionerBase
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.hw.interface import Controller

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


GLIDE: Final = 1.5
"""How much faster than the jog an axis may go, to make up for its slow last micrometres."""


class ChannelSpeed:
    """Sets the frequency limit of one channel; device thread."""

    def __init__(
        self, positioner: PositionerBase, controller: Controller, defaults: MotionDefaults
    ) -> None:
        self._positioner = positioner
        self._controller = controller
        self._defaults = defaults
        self._usual_hz = defaults.closed_loop_frequency_hz

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
        lowest_hz, _ = self._positioner.state.frequency_range_hz
        self._limit(max(lowest_hz, min(wanted_hz, self._usual_hz)))

    @property
    def _nominal_step(self) -> float:
        defaults = self._defaults
        rotary = self._positioner.state.unit == "deg"
        return defaults.nominal_step_deg if rotary else defaults.nominal_step_um

    def _limit(self, frequency_hz: int) -> None:
        if self._positioner.has_sensor:
            self._controller.set_closed_loop_frequency(self._positioner.state.address, frequency_hz)
