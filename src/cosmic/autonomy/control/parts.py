"""What control loops are made of: settings, sources and sinks that fit together."""

import math
from typing import Final

from pydantic import ValidationError

from cosmic.autonomy.control.settings import ControlSettings
from cosmic.autonomy.control.sink import AxisSink
from cosmic.autonomy.control.sources import ChannelSource, PositionSource, Source
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.guarded import measurable
from cosmic.frame.config import wrong_values
from cosmic.frame.errors import ConfigError, NotAvailable, UnknownAxisError
from cosmic.mico.api.mico import Mico

MARGIN: Final = 0.5
CYCLES: Final = 3.0
"""From a move until its force is seen it takes so many cycles at least."""
RESPONSE: Final = 4.0
LEAST_MARGIN_UN: Final = 20.0
"""Where nobody gives a limit: so far beyond the set point, as a part of it and at least."""


class LoopParts:
    """Makes what a loop needs, and refuses what makes no sense; any thread.

    Parameters
    ----------
    rate : float
        Of the platform's clock.
    """

    def __init__(
        self, mico: Mico, daqco: Daqco | None, settings: ControlSettings, *, rate: float
    ) -> None:
        self._mico, self._daqco = mico, daqco
        self._settings = settings
        self._rate = rate

    @property
    def channels(self) -> dict[str, str]:
        """Channels that can be held, with their units."""
        return dict(self._daqco.units) if self._daqco is not None else {}

    def check_acquisition(self) -> None:
        """Raise `NotAvailable` where nothing can be measured."""
        self._acquisition()

    def _acquisition(self) -> Daqco:
        if self._daqco is None:
            raise NotAvailable("daqco is not hosted here; a loop has no channels")
        return self._daqco

    def settings(self, **changes: float | None) -> ControlSettings:
        """Return the settings of a loop, with `changes` where they are not None."""
        fields = {name: value for name, value in changes.items() if value is not None}
        try:
            settings = ControlSettings.model_validate(self._settings.model_dump() | fields)
        except ValidationError as exc:
            raise ConfigError(f"a loop cannot be made: {wrong_values(exc)}") from None
        # On a fast clock the same cycles are longer: the force comes later, and all goes slower.
        latency_s = max(settings.latency_s, CYCLES * self._rate / settings.rate_hz)
        response_s = max(settings.response_s, RESPONSE * latency_s)
        return settings.model_copy(update={"latency_s": latency_s, "response_s": response_s})

    def channel(
        self, name: str, settings: ControlSettings, limits: tuple[float, float]
    ) -> ChannelSource:
        """Return a channel as what a loop measures, which ends it outside `limits`."""
        low, high = limits
        return ChannelSource(
            self._acquisition(),
            name,
            stale_s=settings.stale_s,
            pause_s=self._settings.latency_s,
            low=low,
            high=high,
        )

    def source(self, name: str, settings: ControlSettings, limits: tuple[float, float]) -> Source:
        """Return a channel, or the position of an axis, as what a loop measures."""
        if name in self.channels:
            return self.channel(name, settings, limits)
        if name in self._mico:
            low, high = limits
            return PositionSource(self._mico, name, stale_s=settings.stale_s, low=low, high=high)
        known = [*self.channels, *self._mico.names]
        raise ConfigError(f"there is no channel or axis {name!r}; there are {', '.join(known)}")

    def force_sink(self, axis: str, settings: ControlSettings) -> AxisSink:
        """Return what moves a linear axis for a force."""
        if axis not in self._mico:
            raise UnknownAxisError(axis, self._mico.names)
        sink = AxisSink(
            self._mico,
            axis,
            speed=settings.speed_um_s,
            travel=settings.travel_um,
            interval_s=settings.latency_s,
        )
        if sink.unit != "um":
            raise ConfigError(f"{axis} moves in {sink.unit}; a force is held by a linear axis")
        return sink

    def force_limits(
        self, channel: str, set_point: float, limit_un: float | None
    ) -> tuple[float, float]:
        """Return the least and the most force that a loop goes on with."""
        daqco = self._acquisition()
        least, most = measurable(channel, daqco.settings)
        if limit_un is not None:
            if not 0.0 < limit_un < math.inf:
                raise ConfigError(f"limit_un must be a number above 0, got {limit_un!r}")
            if not limit_un <= (most if set_point >= 0.0 else -least):
                raise ConfigError(
                    f"{channel}: a limit of {limit_un:g} uN can never be crossed: the channel "
                    f"measures from {least:g} to {most:g} uN; give a lower limit_un"
                )
            return -limit_un, limit_un
        beyond = max(LEAST_MARGIN_UN, MARGIN * abs(set_point))
        low, high = min(set_point, 0.0) - beyond, max(set_point, 0.0) + beyond
        low, high = max(low, least), min(high, most)
        for each in daqco.settings.limit:
            if each.channel == channel:
                low = max(low, each.low) if each.low is not None else low
                high = min(high, each.high) if each.high is not None else high
        return low, high
