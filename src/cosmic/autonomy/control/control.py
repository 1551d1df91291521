"""The control loops of the scripted API: ``rig.control``."""

import math
from threading import Lock
from typing import Final

from cosmic.autonomy.control.force_servo import ForceGoal, ForceServo
from cosmic.autonomy.control.handle import ControlHandle, check_inside
from cosmic.autonomy.control.law import Law, PidLaw
from cosmic.autonomy.control.loop import ControlLoop
from cosmic.autonomy.control.pid import PidGains
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.autonomy.control.sink import AxisSink
from cosmic.autonomy.control.sources import ChannelSource, PositionSource, Source
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.errors import (
    ConfigError,
    NotAvailable,
    UnknownAxisError,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.mico import Mico

MARGIN: Final = 0.5
CYCLES: Final = 3.0
"""From a move until its force is seen it takes so many cycles at least."""
RESPONSE: Final = 4.0
LEAST_MARGIN_UN: Final = 20.0
"""Where nobody gives a limit: so far beyond the set point, as a part of it and at least."""


class Control:
    """Makes control loops and knows those that run; any thread.

    Parameters
    ----------
    rate : float
        Of the platform's clock.
    """

    def __init__(
        self,
        mico: Mico,
        daqco: Daqco | None,
        settings: ControlSettings,
        policy: FailurePolicy,
        *,
        rate: float = 1.0,
    ) -> None:
        self._mico, self._daqco = mico, daqco
        self.settings = settings
        self._policy = policy
        self._rate = rate
        self._lock = Lock()
        self._loops: dict[str, ControlHandle] = {}
        self._newest: ControlHandle | None = None
        self._closed = False

    @property
    def loops(self) -> tuple[ControlHandle, ...]:
        """The loops that run."""
        with self._lock:
            return tuple(each for each in self._loops.values() if each.running)

    @property
    def newest(self) -> ControlHandle | None:
        """The loop begun last, also when it has ended; None before the first."""
        return self._newest

    @property
    def channels(self) -> dict[str, str]:
        """Channels that can be held, with their units."""
        return dict(self._daqco.units) if self._daqco is not None else {}

    @property
    def axes(self) -> dict[str, str]:
        """Axes that a loop can move, with their units; those without sensor are left out."""
        return {axis.name: axis.unit for axis in self._mico if axis.limits is not None}

    def hold_force(
        self,
        channel: str,
        axis: str,
        setpoint_un: float,
        *,
        direction: int,
        limit_un: float | None = None,
        travel_um: float | None = None,
        ramp_un_s: float | None = None,
        tolerance_un: float | None = None,
        gains: PidGains | None = None,
    ) -> ControlHandle:
        """Approach until something is touched, then hold a force on it.

        Returns at once; the axis is stopped when the loop ends, whatever ends it.

        Parameters
        ----------
        channel : str
            A channel in uN.
        axis : str
            A linear axis with sensor.
        setpoint_un : float
            The force.
        direction : int
            1 or -1: which way of the axis makes the force rise.
        limit_un : float
            A force of that size, either sign, ends the loop; the channel's limit if None.
        travel_um : float
            How far the axis may go from where it stands, either way.
        ramp_un_s : float
            How fast the set point moves.
        tolerance_un : float
            How far off the force may be and count as held.
        gains : PidGains
            Fixed gains, kp in (um/s)/uN; None: they follow the stiffness.

        Raises
        ------
        ConfigError, UnknownAxisError
            No such channel or axis, or numbers that make no sense.
        LimitError
            The set point does not lie inside the limits.
        NotAvailable
            Nothing is acquired, the axis moves, or a loop has it already.
        StoppedError
            Motion is stopped.
        """
        daqco = self._acquisition()
        if direction not in (1, -1):
            raise ConfigError(f"direction must be 1 or -1, got {direction!r}")
        settings = self._changed(travel_um=travel_um, ramp_un_s=ramp_un_s)
        low, high = self._limits(channel, setpoint_un, limit_un)
        check_inside(channel, "uN", setpoint_un, (low, high))
        source = self._channel(daqco, channel, settings, (low, high))
        if source.unit != "uN":
            raise ConfigError(f"{channel} is measured in {source.unit}; a force must be in uN")
        sink = self._sink(axis, "um", settings, settings.travel_um)
        wanted = settings.tolerance(setpoint_un) if tolerance_un is None else tolerance_un
        if not 0.0 < wanted < math.inf:
            raise ConfigError(f"tolerance_un must be a number above 0, got {tolerance_un!r}")
        goal = ForceGoal(setpoint_un, low, high, direction, wanted)
        servo = ForceServo(goal, settings, gains)
        return self._begin(
            source, servo, sink, setpoint_un, settings, tolerance=wanted, limits=(low, high)
        )

    def hold(
        self,
        source: str,
        axis: str,
        set_point: float,
        gains: PidGains,
        *,
        direction: int = 1,
        speed: float,
        travel: float,
        tolerance: float,
        limits: tuple[float, float] = (-math.inf, math.inf),
        ramp_per_s: float = 0.0,
        dead_band: float = 0.0,
    ) -> ControlHandle:
        """Hold any channel, or a position, by moving an axis; a plain PID without approach.

        Parameters
        ----------
        source : str
            A channel, or an axis whose position (gate coordinates) is held.
        set_point, tolerance, limits, dead_band : float
            In the unit of the source; within `dead_band` of the set point the axis rests.
        gains : PidGains
            From an error in the unit of the source to a velocity of the axis.
        direction : int
            -1 where the measurement falls while the axis moves forward.
        speed, travel : float
            The most, in the unit of the axis (a second).
        ramp_per_s : float
            How fast the set point moves; 0 jumps.

        Raises
        ------
        ConfigError, UnknownAxisError, LimitError, NotAvailable, StoppedError
            As `hold_force`.
        """
        settings = self._changed()
        check_inside(source, "", set_point, limits)
        if not 0.0 < tolerance < math.inf:
            raise ConfigError(f"tolerance must be a number above 0, got {tolerance!r}")
        origin = self._source(source, settings, limits)
        sink = AxisSink(self._mico, axis, speed=speed, travel=travel, interval_s=settings.latency_s)
        law = PidLaw(
            set_point,
            gains,
            speed=speed,
            sign=direction,
            ramp_per_s=ramp_per_s,
            dead_band=dead_band,
        )
        return self._begin(
            origin, law, sink, set_point, settings, tolerance=tolerance, limits=limits
        )

    def stop(self) -> None:
        """End all loops; each stops its axis. Returns at once."""
        for handle in self.loops:
            handle.stop()

    def close(self) -> None:
        """End all loops for good and wait for their threads."""
        with self._lock:
            self._closed = True
            handles = list(self._loops.values())
        for handle in handles:
            handle.stop()
        for handle in handles:
            handle.join()

    # Making

    def _acquisition(self) -> Daqco:
        if self._daqco is None:
            raise NotAvailable("daqco is not hosted here; a loop has no channels")
        return self._daqco

    def _changed(self, **changes: float | None) -> ControlSettings:
        fields = {name: value for name, value in changes.items() if value is not None}
        try:
            settings = ControlSettings.model_validate(self.settings.model_dump() | fields)
        except ValueError as exc:
            raise ConfigError(f"a loop cannot be made: {exc}") from None
        # On a fast clock the same cycles are longer: the force comes later, and all goes slower.
        latency_s = max(settings.latency_s, CYCLES * self._rate / settings.rate_hz)
        response_s = max(settings.response_s, RESPONSE * latency_s)
        return settings.model_copy(update={"latency_s": latency_s, "response_s": response_s})

    def _channel(
        self, daqco: Daqco, name: str, settings: ControlSettings, limits: tuple[float, float]
    ) -> ChannelSource:
        low, high = limits
        return ChannelSource(
            daqco,
            name,
            stale_s=settings.stale_s,
            pause_s=self.settings.latency_s,
            low=low,
            high=high,
        )

    def _source(self, name: str, settings: ControlSettings, limits: tuple[float, float]) -> Source:
        if name in self.channels:
            return self._channel(self._acquisition(), name, settings, limits)
        if name in self._mico:
            return PositionSource(self._mico, name, stale_s=settings.stale_s)
        known = [*self.channels, *self._mico.names]
        raise ConfigError(f"there is no channel or axis {name!r}; there are {', '.join(known)}")

    def _sink(self, axis: str, unit: str, settings: ControlSettings, travel: float) -> AxisSink:
        if axis not in self._mico:
            raise UnknownAxisError(axis, self._mico.names)
        sink = AxisSink(
            self._mico,
            axis,
            speed=settings.speed_um_s,
            travel=travel,
            interval_s=settings.latency_s,
        )
        if sink.unit != unit:
            raise ConfigError(f"{axis} moves in {sink.unit}; a force is held by a linear axis")
        return sink

    def _limits(
        self, channel: str, set_point: float, limit_un: float | None
    ) -> tuple[float, float]:
        if limit_un is not None:
            if not 0.0 < limit_un < math.inf:
                raise ConfigError(f"limit_un must be a number above 0, got {limit_un!r}")
            return -limit_un, limit_un
        beyond = max(LEAST_MARGIN_UN, MARGIN * abs(set_point))
        low, high = min(set_point, 0.0) - beyond, max(set_point, 0.0) + beyond
        daqco = self._acquisition()
        for each in daqco.settings.limit:
            if each.channel == channel:
                low = max(low, each.low) if each.low is not None else low
                high = min(high, each.high) if each.high is not None else high
        return low, high

    def _begin(
        self,
        source: Source,
        law: Law,
        sink: AxisSink,
        set_point: float,
        settings: ControlSettings,
        *,
        tolerance: float,
        limits: tuple[float, float],
    ) -> ControlHandle:
        loop = ControlLoop(source, law, sink, settings, rate=self._rate, policy=self._policy)
        handle = ControlHandle(
            loop,
            set_point,
            tolerance=tolerance,
            limits=limits,
            settle_s=settings.settle_s,
        )
        with self._lock:
            if self._closed:
                raise NotAvailable("the platform is closed")
            other = self._loops.get(sink.name)
            if other is not None and other.running:
                raise NotAvailable(f"{sink.name}: a control loop has it already; stop that first")
            if other is not None:
                other.join()
            loop.begin()
            self._loops[sink.name] = self._newest = handle
        return handle
