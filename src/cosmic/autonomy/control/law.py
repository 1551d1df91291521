"""What a control loop asks of its control law, and the plain one: a PID."""

from abc import abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from typing_extensions import override

from cosmic.autonomy.control.pid import Pid, PidGains
from cosmic.frame.errors import ConfigError


class ControlState(StrEnum):
    """What a control loop is at."""

    STARTING = "starting"
    APPROACHING = "approaching"
    RAMPING = "ramping"
    HOLDING = "holding"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class Answer:
    """What a law makes of one measurement; the set point is the one in force now."""

    velocity: float
    set_point: float
    state: ControlState


class Law(Protocol):
    """A measurement in, a velocity out; used by one thread."""

    @abstractmethod
    def step(self, measured: float, position: float, dt_s: float) -> Answer:
        """Return what to do, `dt_s` of the platform's time after the last time."""

    @abstractmethod
    def aim(self, set_point: float) -> None:
        """Go for another set point from now on; any thread."""


class Ramp:
    """A set point that moves at a limited rate; 0 jumps."""

    def __init__(self, value: float, rate_per_s: float) -> None:
        self.value = value
        self._rate_per_s = rate_per_s

    def towards(self, goal: float, dt_s: float) -> float:
        """Go on towards `goal` and return the value now."""
        step = self._rate_per_s * dt_s
        gap = goal - self.value
        self.value = (
            goal if not step or abs(gap) <= step else self.value + (step if gap > 0.0 else -step)
        )
        return self.value


class PidLaw(Law):
    """A PID whose output is a velocity, with a set point that goes in a ramp."""

    def __init__(
        self,
        set_point: float,
        gains: PidGains,
        *,
        speed: float,
        sign: int = 1,
        ramp_per_s: float = 0.0,
        dead_band: float = 0.0,
    ) -> None:
        if not 0.0 <= dead_band < float("inf") or not 0.0 <= ramp_per_s < float("inf"):
            raise ConfigError("ramp and dead band must be numbers from 0 on")
        self._goal = set_point
        self._pid = Pid(gains, low=-speed, high=speed, sign=sign)
        self._ramp: Ramp | None = None
        self._rate_per_s = ramp_per_s
        self._dead_band = dead_band

    @override
    def aim(self, set_point: float) -> None:
        self._goal = set_point

    @override
    def step(self, measured: float, position: float, dt_s: float) -> Answer:
        goal = self._goal
        if self._ramp is None:
            self._ramp = Ramp(measured if self._rate_per_s else goal, self._rate_per_s)
            self._pid.reset(set_point=self._ramp.value, measured=measured)
        now = self._ramp.towards(goal, dt_s)
        state = ControlState.HOLDING if now == goal else ControlState.RAMPING
        velocity = self._pid.step(now, measured, dt_s)
        if state is ControlState.HOLDING and abs(goal - measured) <= self._dead_band:
            velocity = 0.0
        return Answer(velocity, now, state)
