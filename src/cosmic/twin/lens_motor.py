"""One motor of the twin's lens: what its controller counts, and where the lens truly is."""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from cosmic.twin.lens_settings import LensMotorSettings


@dataclass(frozen=True, slots=True)
class Ramp:
    """Stretches of even acceleration, one after the other, from standing to standing.

    Attributes
    ----------
    stretches : tuple of (float, float, float)
        Duration in seconds, and speed at its beginning and end in counts per second.
    """

    stretches: tuple[tuple[float, float, float], ...] = ()

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return sum(duration_s for duration_s, _, _ in self.stretches)

    @property
    def travel_counts(self) -> float:
        """How far it leads."""
        return sum(duration_s * (v0 + v1) / 2.0 for duration_s, v0, v1 in self.stretches)

    def gone(self, time_s: float) -> float:
        """Return the way gone `time_s` after the beginning, counts."""
        distance = 0.0
        for duration_s, v0, v1 in self.stretches:
            if time_s < duration_s:
                part_s = max(time_s, 0.0)
                return distance + part_s * (v0 + (v1 - v0) * part_s / duration_s / 2.0)
            distance += duration_s * (v0 + v1) / 2.0
            time_s -= duration_s
        return distance

    def speed(self, time_s: float) -> tuple[float, bool]:
        """Return the speed at `time_s`, counts per second, and whether it is falling."""
        for duration_s, v0, v1 in self.stretches:
            if 0.0 <= time_s < duration_s:
                return v0 + (v1 - v0) * time_s / duration_s, v1 < v0
            time_s -= duration_s
        return 0.0, False


def ramp_over(travel_counts: float, motor: LensMotorSettings) -> Ramp:
    """Return the ramp that leads `travel_counts` far, which is not negative."""
    if travel_counts <= 0.0:
        return Ramp()
    slow, fast = motor.initial_speed_counts_s, motor.top_speed_counts_s
    rate = motor.acceleration_counts_s2
    peak = min(fast, math.sqrt(slow * slow + rate * travel_counts))
    rise_s = (peak - slow) / rate
    cruise_s = max(travel_counts - rise_s * (slow + peak), 0.0) / peak
    return Ramp(((rise_s, slow, peak), (cruise_s, peak, peak), (rise_s, peak, slow)))


def ramp_down(speed_counts_s: float, motor: LensMotorSettings) -> Ramp:
    """Return the ramp that comes to a stand from `speed_counts_s`."""
    slow = motor.initial_speed_counts_s
    if speed_counts_s <= slow:
        return Ramp()
    return Ramp((((speed_counts_s - slow) / motor.acceleration_counts_s2, speed_counts_s, slow),))


LEGS_KEPT: Final = 64
"""So many legs back, instruments that report late still see where the lens was."""


class LensPhase(StrEnum):
    """What the controller of a motor is about."""

    IDLE = "idle"
    TO_HOME = "to home"
    OFF_HOME = "off home"
    TO_LIMIT = "to limit"
    SEEK = "seek"
    BACKLASH = "backlash"
    ABORT = "abort"


@dataclass(frozen=True, slots=True)
class Leg:
    """A movement in one direction, and the rest after it.

    Attributes
    ----------
    counter, motor, lens : float
        At its beginning: steps as counted, where the motor is, where the lens is.
    share : float
        Part of the steps sent that the motor makes; less than 1 when it loses some.
    run : int
        How many runs had begun, with this one.
    """

    phase: LensPhase
    start_s: float
    direction: int
    ramp: Ramp
    counter: float
    motor: float
    lens: float
    share: float
    travel: tuple[float, float]
    play: float
    run: int = 0

    @property
    def end_s(self) -> float:
        """When it stands."""
        return self.start_s + self.ramp.duration_s

    def counter_at(self, time_s: float) -> float:
        """Return the steps as the controller counts them: it knows nothing of lost ones."""
        return self.counter + self.direction * self.ramp.gone(time_s - self.start_s)

    def motor_at(self, time_s: float) -> float:
        """Return where the motor is: at a stop it clicks and stays."""
        gone = self.ramp.gone(time_s - self.start_s) * self.share
        low, high = self.travel
        half = self.play / 2.0
        return min(max(self.motor + self.direction * gone, low - half), high + half)

    def lens_at(self, time_s: float) -> float:
        """Return where the lens is: the motor takes it along once the play is used up."""
        motor, half = self.motor_at(time_s), self.play / 2.0
        return min(max(self.lens, motor - half), motor + half)


class LensMotor:
    """A stepper without switches, its controller and the lens it turns.

    Parameters
    ----------
    start_counts : float
        Where the lens stands.
    counter : float
        What the controller believes then.

    Notes
    -----
    Any thread may read; one at a time may command. Legs are never changed, only replaced.
    """

    def __init__(self, settings: LensMotorSettings, *, start_counts: float, counter: float) -> None:
        self.settings = settings
        self.lost_share = 0.0
        play = float(settings.backlash_counts)
        rest = Leg(
            LensPhase.IDLE,
            start_s=0.0,
            direction=1,
            ramp=Ramp(),
            counter=counter,
            motor=start_counts + play / 2.0,
            lens=start_counts,
            share=1.0,
            travel=(0.0, float(settings.limit_counts)),
            play=play,
        )
        self._legs: tuple[Leg, ...] = (rest,)

    def leg(self, time_s: float) -> Leg:
        """Return the leg that `time_s` falls into; before the first, the first."""
        for leg in reversed(self._legs):
            if leg.start_s <= time_s:
                return leg
        return self._legs[0]

    def begin(self, time_s: float, distances: tuple[tuple[LensPhase, float], ...]) -> None:
        """Go signed ways one after the other from `time_s` on; what was planned is dropped."""
        standing = self._standing(time_s)
        leg = replace(standing, run=standing.run + 1)
        legs = []
        for phase, distance in distances:
            leg = self._next(leg, phase, distance)
            legs.append(leg)
        self._follow(time_s, *legs, self._rest(leg))

    def zero(self) -> None:
        """Have counting begin anew where the last leg planned ends."""
        *kept, last = self._legs
        self._legs = (*kept, replace(last, counter=0.0))

    def abort(self, time_s: float) -> None:
        """Come to a stand as fast as the ramp allows."""
        leg = self.leg(time_s)
        speed, _ = leg.ramp.speed(time_s - leg.start_s)
        if speed <= 0.0:
            if leg.end_s > time_s:
                self._follow(time_s, self._standing(time_s))
            return
        down = replace(
            self._standing(time_s),
            phase=LensPhase.ABORT,
            direction=leg.direction,
            ramp=ramp_down(speed, self.settings),
            share=leg.share,
        )
        self._follow(time_s, down, self._rest(down))

    def turn(self, time_s: float, distance: float) -> None:
        """Turn the lens by hand; the controller does not notice."""
        leg = self._standing(time_s)
        low, high = leg.travel
        lens = min(max(leg.lens + distance, low), high)
        motor = leg.motor + lens - leg.lens
        self._follow(time_s, replace(leg, lens=lens, motor=motor, run=leg.run + 1))

    def _standing(self, time_s: float) -> Leg:
        leg = self.leg(time_s)
        return replace(
            leg,
            phase=LensPhase.IDLE,
            start_s=time_s,
            ramp=Ramp(),
            counter=leg.counter_at(time_s),
            motor=leg.motor_at(time_s),
            lens=leg.lens_at(time_s),
        )

    def _next(self, before: Leg, phase: LensPhase, distance: float) -> Leg:
        leg = self._rest(before)
        direction = 1 if distance >= 0.0 else -1
        ramp = ramp_over(abs(distance), self.settings)
        return replace(
            leg, phase=phase, direction=direction, ramp=ramp, share=1.0 - self.lost_share
        )

    def _rest(self, leg: Leg) -> Leg:
        end_s = leg.end_s
        return replace(
            leg,
            phase=LensPhase.IDLE,
            start_s=end_s,
            ramp=Ramp(),
            # A ramp is a sum of floats, a stepper makes whole steps.
            counter=float(round(leg.counter_at(end_s))),
            motor=leg.motor_at(end_s),
            lens=leg.lens_at(end_s),
        )

    def _follow(self, time_s: float, *legs: Leg) -> None:
        past = [leg for leg in self._legs if leg.start_s <= time_s]
        self._legs = (*past[-LEGS_KEPT:], *legs)
