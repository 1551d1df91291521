"""A PID controller for a fixed period, and nothing else.

Written here and not taken from a package: `simple-pid` reads the time itself, holds its integral
only within the whole range of the output, so that it winds up beside a large proportional part,
and keeps a value that is no number for ever.
"""

import math
from dataclasses import dataclass

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import ConfigError


@checked_class
@dataclass(frozen=True, slots=True)
class PidGains:
    """Gains; the output is in its own unit, which the names cannot know.

    Attributes
    ----------
    kp : float
        Output for an error of one.
    ki : float
        Output per second for an error of one.
    kd : float
        Output for a measurement that changes by one a second.
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0

    def __post_init__(self) -> None:
        for name in ("kp", "ki", "kd"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ConfigError(f"{name} must be a number from 0 on, got {value!r}")
        if not self.kp + self.ki + self.kd > 0.0:
            raise ConfigError("all gains are 0; the loop would do nothing")


class Pid:
    """PID with limits on its output, no windup, and no kick when the set point jumps.

    The derivative is taken of the measurement. Where the output is at a limit, the integral takes
    no part of an error that would push it further. `reset` begins without a bump.

    Parameters
    ----------
    low, high : float
        Limits of the output.
    sign : int
        -1 where the measurement falls while the output is positive.
    """

    def __init__(self, gains: PidGains, *, low: float, high: float, sign: int = 1) -> None:
        if not (low < high and sign in (1, -1)):
            raise ConfigError(f"an output from {low!r} to {high!r} with sign {sign!r} cannot be")
        self._gains = gains
        self._low, self._high, self._sign = low, high, sign
        self._integral = 0.0
        self._before: float | None = None

    @property
    def gains(self) -> PidGains:
        """The gains in force."""
        return self._gains

    def set_gains(self, gains: PidGains) -> None:
        """Go on with other gains; the integral part stays as it is."""
        self._gains = gains

    def set_limits(self, low: float, high: float) -> None:
        """Keep the output within other limits from now on."""
        if not low < high:
            raise ConfigError(f"an output from {low!r} to {high!r} cannot be")
        self._low, self._high = low, high

    def reset(self, *, set_point: float, measured: float, output: float = 0.0) -> None:
        """Begin so that the next output is `output` if nothing changes."""
        proportional = self._sign * self._gains.kp * (set_point - measured)
        inside = min(max(output, self._low), self._high)
        self._integral = inside - proportional if self._gains.ki > 0.0 else 0.0
        self._before = measured

    def step(self, set_point: float, measured: float, dt_s: float) -> float:
        """Return the output for a measurement taken `dt_s` after the one before.

        Raises
        ------
        ConfigError
            A number is not finite, or `dt_s` not above 0; the state stays as it was.
        """
        if not (math.isfinite(set_point) and math.isfinite(measured) and 0.0 < dt_s < math.inf):
            raise ConfigError(
                f"a controller cannot work with set point {set_point!r}, value {measured!r}, "
                f"period {dt_s!r}"
            )
        gains = self._gains
        error = self._sign * (set_point - measured)
        slope = 0.0 if self._before is None else self._sign * (measured - self._before) / dt_s
        self._before = measured
        rest = gains.kp * error - gains.kd * slope
        grown = self._integral + gains.ki * error * dt_s
        output = rest + grown
        too_high, too_low = output > self._high, output < self._low
        if not ((too_high and grown > self._integral) or (too_low and grown < self._integral)):
            self._integral = grown
        return min(max(rest + self._integral, self._low), self._high)
