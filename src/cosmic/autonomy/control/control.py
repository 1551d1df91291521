"""The control loops of the scripted API: ``rig.control``."""

import math
from dataclasses import dataclass, field
from threading import Lock

from cosmic.autonomy.control.force_servo import ForceGoal, ForceServo
from cosmic.autonomy.control.handle import ControlHandle, check_inside, check_measurable
from cosmic.autonomy.control.law import Law, PidLaw
from cosmic.autonomy.control.loop import ControlLoop
from cosmic.autonomy.control.parts import LoopParts
from cosmic.autonomy.control.pid import PidGains
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.autonomy.control.sink import AxisSink
from cosmic.autonomy.control.sources import Source
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import (
    ConfigError,
    NotAvailable,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.mico import Mico


@dataclass(slots=True)
class RunningLoops:
    """The loops of a platform, whoever began them."""

    settings: ControlSettings
    by_axis: dict[str, ControlHandle] = field(default_factory=dict)
    newest: ControlHandle | None = None
    closed: bool = False
    lock: Lock = field(default_factory=Lock)


@checked_class
class Control:
    """Makes control loops and knows those that run; any thread.

    Parameters
    ----------
    rate : float
        Of the platform's clock.
    loops : RunningLoops or None
        Those that another one knows, and this one then too.
    """

    def __init__(
        self,
        mico: Mico,
        daqco: Daqco | None,
        settings: ControlSettings,
        policy: FailurePolicy,
        *,
        rate: float = 1.0,
        loops: RunningLoops | None = None,
    ) -> None:
        self._mico, self._daqco = mico, daqco
        self._policy = policy
        self._rate = rate
        self._all, self._first = loops or RunningLoops(settings), loops is None

    @property
    def settings(self) -> ControlSettings:
        """What a loop does where nothing else is said; the next loop has another one set here."""
        return self._all.settings

    @settings.setter
    def settings(self, settings: ControlSettings) -> None:
        self._all.settings = settings

    def commanding_by(self, mico: Mico) -> "Control":
        """Return the same loops; those begun by it move axes by the name of `mico`.

        They are closed by the first alone: closing this one does nothing.
        """
        return Control(
            mico, self._daqco, self.settings, self._policy, rate=self._rate, loops=self._all
        )

    @property
    def loops(self) -> tuple[ControlHandle, ...]:
        """The loops that run, also those that another source began."""
        with self._all.lock:
            return tuple(each for each in self._all.by_axis.values() if each.running)

    @property
    def newest(self) -> ControlHandle | None:
        """The loop begun last, also when it has ended; None before the first."""
        return self._all.newest

    @property
    def channels(self) -> dict[str, str]:
        """Channels that can be held, with their units."""
        return self._parts().channels

    @property
    def axes(self) -> dict[str, str]:
        """Axes that a loop can move, with their units; those without sensor are left out."""
        return {axis.key: axis.unit for axis in self._mico if axis.limits is not None}

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
            The set point does not lie inside the limits, or inside what the channel can measure.
        NotAvailable
            Nothing is acquired, the axis moves, or a loop has it already.
        StoppedError
            Motion is stopped.
        """
        parts = self._parts()
        parts.check_acquisition()
        check_inside(channel, "uN", setpoint_un, (-math.inf, math.inf))
        settings = parts.settings(travel_um=travel_um, ramp_un_s=ramp_un_s)
        limits = parts.force_limits(channel, setpoint_un, limit_un)
        source = parts.channel(channel, settings, limits)
        goal = _force_goal(source, setpoint_un, limits, direction, settings, tolerance_un)
        law, sink = ForceServo(goal, settings, gains), parts.force_sink(axis, settings)
        return self._begin(
            source, law, sink, setpoint_un, settings, tolerance=goal.tolerance_un, limits=limits
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
        parts = self._parts()
        settings = parts.settings()
        check_inside(source, "", set_point, limits)
        if not 0.0 < tolerance < math.inf:
            raise ConfigError(f"tolerance must be a number above 0, got {tolerance!r}")
        origin = parts.source(source, settings, limits)
        sink = AxisSink(self._mico, axis, speed=speed, travel=travel, interval_s=settings.latency_s)
        if origin.name == sink.name and direction == -1:
            text = "its own position rises while it moves forward; direction must be 1"
            raise ConfigError(f"{sink.name}: {text}")
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
        """End all loops; each stops its axis. One that just begins is waited for, and ended."""
        for handle in self._all.by_axis.values():
            handle.stop()
        for handle in self.loops:
            handle.stop()

    def close(self) -> None:
        """End all loops for good and wait for their threads."""
        if not self._first:
            return
        with self._all.lock:
            self._all.closed = True
            handles = list(self._all.by_axis.values())
        for handle in handles:
            handle.stop()
        for handle in handles:
            handle.join()

    # Making

    def _parts(self) -> LoopParts:
        return LoopParts(self._mico, self._daqco, self.settings, rate=self._rate)

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
        check_measurable(source, set_point)
        loop = ControlLoop(source, law, sink, settings, rate=self._rate, policy=self._policy)
        handle = ControlHandle(
            loop,
            set_point,
            tolerance=tolerance,
            limits=limits,
            settle_s=settings.settle_s,
        )
        with self._all.lock:
            if self._all.closed:
                raise NotAvailable("the platform is closed")
            other = self._all.by_axis.get(sink.name)
            if other is not None and other.running:
                raise NotAvailable(
                    f"{sink.name}: a control loop already uses it; stop that loop first"
                )
            if other is not None:
                other.join()
            loop.begin()
            # A copy, so that whoever stops all loops waits for none that begins.
            self._all.by_axis = {**self._all.by_axis, sink.name: handle}
            self._all.newest = handle
        return handle


def _force_goal(
    source: Source,
    setpoint_un: float,
    limits: tuple[float, float],
    direction: int,
    settings: ControlSettings,
    tolerance_un: float | None,
) -> ForceGoal:
    """Return what a loop shall hold.

    Raises
    ------
    ConfigError
        It is no force, or a number makes no sense.
    LimitError
        The set point does not lie inside the limits.
    """
    if source.unit != "uN":
        raise ConfigError(f"{source.name} is measured in {source.unit}; a force must be in uN")
    if direction not in (1, -1):
        raise ConfigError(f"direction must be 1 or -1, got {direction!r}")
    check_inside(source.name, "uN", setpoint_un, limits)
    wanted = settings.tolerance(setpoint_un) if tolerance_un is None else tolerance_un
    if not 0.0 < wanted < math.inf:
        raise ConfigError(f"tolerance_un must be a number above 0, got {tolerance_un!r}")
    return ForceGoal(setpoint_un, *limits, direction, wanted)
