"""`ChannelSpeed`: how fast a channel may go in closed loop, usually and for one order."""

import math
from typing import Final

from cosmic.mico.core.flight import PilotContext
from cosmic.mico.core.jog import JogRun
from cosmic.mico.core.orders import FREQUENCY_HZ
from cosmic.mico.core.positioner import PositionerBase
from cosmic.mico.core.quietly import quietly
from cosmic.mico.core.steer import SteerRun

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
            return float(FREQUENCY_HZ[1])
        return self._usual_hz * self._nominal_step

    def limit_jog(self, jog: JogRun) -> None:
        """Have the axis glide from packet to packet, not leap and wait; raises `DeviceError`."""
        step = self._nominal_step
        glide = jog.glide(step) if isinstance(jog, SteerRun) else GLIDE
        wanted_hz = math.ceil(glide * jog.speed / step)
        self._limit(max(FREQUENCY_HZ[0], min(wanted_hz, self._usual_hz)))

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
