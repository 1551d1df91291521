"""The scale of a force channel against known loads: what to do next, and what comes of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.handling.force import ForceWatch
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.scale import Scale
from cosmic.frame.errors import CosmicError

UN_PER_MG: Final = 9.80665
"""Weight of a milligram under standard gravity; that of a place differs by up to 0.3 %."""

GRAVITY_STD_PART: Final = 0.0015
CLEAR: Final = 5.0
"""Standard deviations by which a load must stand out from no load."""

MOST_OFF: Final = 0.3
"""A scale that is further off means another load, another unit or a broken sensor."""

LEFT_ON: Final = 0.3
"""Of the smallest load: a zero that changed by more means that something is still there."""

MOST_PERCENT: Final = 50.0
"""Expanded uncertainty of masses at which they say nothing."""

FORCE_UNIT: Final = "uN"

NOT_STRAIGHT: Final = 0.02
"""Departure from a straight line, of the largest load, that is reported."""


READ_S: Final = 2.0
SETTLE_S: Final = 0.5
BLOCKS: Final = 5
"""A reading is the mean of so many parts: their scatter holds a drift, that of samples does not."""


class CalibrationProblem(CosmicError):  # noqa: N818 - reads as what happened
    """A reading or a result cannot be used; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class KnownLoad:
    """A load whose force is certified.

    Attributes
    ----------
    words : str
        What a person puts there, such as "the weight of 2 mg".
    force_un : float
    std_part : float
        Standard uncertainty of it, as a part.
    """

    words: str
    force_un: float
    std_part: float


def weight(mass_mg: float, expanded_percent: float) -> KnownLoad:
    """Return the load of a weight with the expanded uncertainty (k = 2) of its mass.

    Raises
    ------
    CalibrationProblem
        The uncertainty is none.
    """
    if not 0.0 <= expanded_percent < MOST_PERCENT:
        raise CalibrationProblem(
            f"{expanded_percent:g} % is no uncertainty of a mass: give 0 to below "
            f"{MOST_PERCENT:g} %"
        )
    std = math.hypot(expanded_percent / 200.0, GRAVITY_STD_PART)
    return KnownLoad(f"the weight of {mass_mg:g} mg", mass_mg * UN_PER_MG, std)


@dataclass(frozen=True, slots=True)
class Reach:
    """The largest force that a channel may be given, either sign, and what sets it."""

    largest_un: float
    words: str


def reach_of(daqco: Daqco, channel: str) -> Reach:
    """Return how far a force channel goes: to the end of its input, or to its limit if nearer.

    The limit counts while it is disarmed too: it stands for what the sensor bears.

    Raises
    ------
    CalibrationProblem
        There is no such channel, or it is none of a force in µN.
    """
    settings = next((each for each in daqco.settings.channel if each.name == channel), None)
    if settings is None or channel not in daqco.channels:
        raise CalibrationProblem(f"there is no channel {channel!r} to calibrate")
    scale = daqco.scales[channel]
    if scale.unit != FORCE_UNIT:
        raise CalibrationProblem(
            f"{channel} reads {scale.unit}: give it a scale in µN, and calibrate then"
        )
    ends = np.abs(scale.apply([settings.low_v, settings.high_v]))
    reach = Reach(float(ends.max()), "its input ends there")
    for each in daqco.limits:
        if each.settings.channel == channel:
            sides = (each.settings.low, each.settings.high)
            nearest = min(abs(side) for side in sides if side is not None)
            if nearest < reach.largest_un:
                reach = Reach(nearest, "its limit lies there")
    return reach


@dataclass(frozen=True, slots=True)
class LoadReading:
    """What the channel read under a load; `load` is None where nothing was on it."""

    load: KnownLoad | None
    read_un: float
    std_un: float


@dataclass(frozen=True, slots=True)
class ForceScaleResult:
    """What known loads say of a channel.

    Attributes
    ----------
    gain : float
        What is read for one of what is there: 1.02 reads 2 % too high.
    gain_std_part : float
        Combined standard uncertainty of it, as a part.
    scatter_part, loads_part, linearity_part, hysteresis_part : float
        Of that the scatter of readings (kind A) and the loads (B), both as standard uncertainties;
        the largest departure from a straight line and between up and down, of the largest load.
    readings : tuple of LoadReading
    """

    gain: float
    gain_std_part: float
    scatter_part: float
    loads_part: float
    linearity_part: float
    hysteresis_part: float
    readings: tuple[LoadReading, ...]

    def applied_to(self, scale: Scale) -> Scale:
        """Return the scale of the channel put right by this."""
        coefficients = tuple(each / self.gain for each in scale.coefficients)
        return Scale(scale.name, scale.unit, coefficients)

    @property
    def words(self) -> str:
        """The result in a sentence."""
        text = (
            f"the sensor reads {100.0 * (self.gain - 1.0):+.2f} % too high, "
            f"± {200.0 * self.gain_std_part:.2f} % (k = 2): "
            f"scatter {100.0 * self.scatter_part:.2f} %, loads {100.0 * self.loads_part:.2f} %, "
            f"not straight by {100.0 * self.linearity_part:.2f} %, up and down differ by "
            f"{100.0 * self.hysteresis_part:.2f} % of the largest load"
        )
        if len({each.load.force_un for each in self.readings if each.load is not None}) < 2:
            text += "; one load does not show whether it is straight: use another one too"
        if max(self.linearity_part, self.hysteresis_part) > NOT_STRAIGHT:
            text += "; that is much: look for something that touches, and repeat"
        return text


class RestingForce:
    """A reading under way: the mean of a channel over `READ_S` from a time on.

    Parameters
    ----------
    watch : ForceWatch
        Of the channel, open.
    begin_s : float
        On the clock of its samples.
    """

    def __init__(self, watch: ForceWatch, begin_s: float) -> None:
        self._watch = watch
        self._ends_s = np.linspace(begin_s + SETTLE_S, begin_s + SETTLE_S + READ_S, BLOCKS + 1)

    def taken(self) -> tuple[float, float] | None:
        """Return mean and standard deviation of the mean; None while it goes on."""
        parts = [
            self._watch.between(float(low), float(high))
            for low, high in zip(self._ends_s[:-1], self._ends_s[1:], strict=True)
        ]
        means = np.array([each.mean_un for each in parts if each is not None])
        if len(means) < BLOCKS:
            return None
        return float(means.mean()), float(means.std(ddof=1)) / math.sqrt(BLOCKS)


class ForceCalibration:
    """Leads through readings of a channel: nothing, each load up and down, nothing, and again.

    Parameters
    ----------
    loads : sequence of KnownLoad
        At least one.
    rounds : int
        How often all of them are read.
    reach : Reach, optional
        No load may be larger.
    """

    def __init__(
        self, loads: Sequence[KnownLoad], rounds: int = 2, reach: Reach | None = None
    ) -> None:
        if not loads or any(not 0.0 < each.force_un < math.inf for each in loads):
            raise CalibrationProblem("name at least one load, each above zero and finite")
        for each in loads:
            if reach is not None and not each.force_un <= reach.largest_un:
                raise CalibrationProblem(
                    f"{each.words} is {each.force_un:.4g} µN, and the channel goes to "
                    f"{reach.largest_un:.4g} µN, as {reach.words}: take lighter ones"
                )
        if any(not 0.0 < each.std_part < 1.0 for each in loads):
            raise CalibrationProblem("the uncertainty of a load is above 0 and below 100 %")
        if rounds < 1:
            raise CalibrationProblem("read the loads at least once")
        up = sorted(loads, key=lambda each: each.force_un)
        one: list[KnownLoad | None] = [*up, *reversed(up), None]
        self._steps: tuple[KnownLoad | None, ...] = (None, *(one * rounds))
        self._readings: list[LoadReading] = []

    @property
    def readings(self) -> tuple[LoadReading, ...]:
        """Those taken so far."""
        return tuple(self._readings)

    @property
    def count(self) -> int:
        """How many readings there will be."""
        return len(self._steps)

    @property
    def done(self) -> bool:
        """Whether all were taken."""
        return len(self._readings) == len(self._steps)

    @property
    def instruction(self) -> str:
        """What a person does before the next reading; empty when all were taken."""
        if self.done:
            return ""
        load = self._steps[len(self._readings)]
        if load is None:
            return "Take everything off the sensor, and wait until it is at rest."
        before = self._steps[len(self._readings) - 1]
        again = " Lift it and put it there once more." if load is before else ""
        return (
            f"Put {load.words} ({load.force_un:.2f} µN) on the sensor, without touching it.{again}"
        )

    def take(self, read_un: float, std_un: float) -> None:
        """Take the reading that `instruction` asks for.

        Parameters
        ----------
        read_un, std_un : float
            Mean, and the standard deviation of the mean.

        Raises
        ------
        CalibrationProblem
            All were taken, or what is read is not the load asked for: it is to be read again.
        """
        if self.done:
            raise CalibrationProblem("all readings were taken")
        if not (math.isfinite(read_un) and math.isfinite(std_un) and std_un >= 0.0):
            raise CalibrationProblem("no force was read: start the acquisition, and read again")
        load = self._steps[len(self._readings)]
        zero = next((e.read_un for e in reversed(self._readings) if e.load is None), read_un)
        if load is not None:
            self._check_load(load, read_un - zero, std_un)
        else:
            self._check_nothing(read_un - zero, std_un)
        self._readings.append(LoadReading(load, read_un, std_un))

    def _check_load(self, load: KnownLoad, above_un: float, std_un: float) -> None:
        if not abs(above_un) > max(CLEAR * std_un, 0.3 * load.force_un):
            raise CalibrationProblem(
                f"{load.words} is not to be seen: {above_un:+.2f} µN instead of "
                f"{load.force_un:.2f} µN. Put it there, and read again"
            )
        if not abs(abs(above_un) - load.force_un) <= MOST_OFF * load.force_un + CLEAR * std_un:
            raise CalibrationProblem(
                f"{above_un:+.2f} µN is read instead of {load.force_un:.2f} µN of {load.words}: "
                "another load, another unit, or a broken sensor. Nothing was changed: put it "
                "there, and read again"
            )

    def _check_nothing(self, above_un: float, std_un: float) -> None:
        smallest = min(each.force_un for each in self._steps if each is not None)
        if not abs(above_un) <= max(CLEAR * std_un, LEFT_ON * smallest):
            raise CalibrationProblem(
                f"{above_un:+.2f} µN more than without a load before: take everything off, and "
                "read again. Where it stays so, something touches or the sensor was moved: begin "
                "anew"
            )

    def undo(self) -> None:
        """Take the last reading back; without effect before the first."""
        del self._readings[-1:]

    def result(self) -> ForceScaleResult:
        """Return what the readings say.

        Raises
        ------
        CalibrationProblem
            Not all were taken, or the scale is so far off that something else is wrong.
        """
        if not self.done:
            raise CalibrationProblem(f"{len(self._steps) - len(self._readings)} readings are left")
        order = np.arange(len(self._readings), dtype=np.float64)
        read = np.array([each.read_un for each in self._readings])
        empty = np.array([each.load is None for each in self._readings])
        force = np.array([e.load.force_un if e.load is not None else 0.0 for e in self._readings])
        above = (read - np.interp(order, order[empty], read[empty]))[~empty]
        force = force[~empty]
        gain = float(force @ above / (force @ force))
        if gain < 0.0:  # weights pull where fibres push
            gain, above = -gain, -above
        if not abs(gain - 1.0) <= MOST_OFF:
            raise CalibrationProblem(
                f"the sensor reads {gain:.2f} for 1: another load, another unit, or a broken "
                "sensor. Nothing was changed"
            )
        return self._result(gain, above, force)

    def _result(self, gain: float, above: np.ndarray, force: np.ndarray) -> ForceScaleResult:
        left = above - gain * force
        largest = gain * float(force.max())
        freedom = len(force) - 1
        spread = math.sqrt(float(left @ left) / freedom)
        noise = math.sqrt(2.0) * max(each.std_un for each in self._readings)
        scatter = max(spread, noise) / math.sqrt(float(force @ force)) / gain
        kinds = np.unique(force)
        bent = [float(left[force == each].mean()) for each in kinds]
        branches = [float(np.ptp(left[force == each])) for each in kinds]
        linearity = max(map(abs, bent)) / largest
        bow = self._bow(gain, left, force, noise)
        # Weights of one set come from one balance: their errors are taken to be the same.
        loads = max(each.load.std_part for each in self._readings if each.load is not None)
        return ForceScaleResult(
            gain=gain,
            gain_std_part=math.sqrt(scatter**2 + loads**2 + bow**2 / 3.0),
            scatter_part=scatter,
            loads_part=loads,
            linearity_part=linearity,
            hysteresis_part=max(branches) / largest,
            readings=self.readings,
        )

    @staticmethod
    def _bow(gain: float, left: np.ndarray, force: np.ndarray, noise: float) -> float:
        """Return by how much the gain of one load differs from that of all, noise taken off."""
        found = 0.0
        for kind in np.unique(force):
            mine = left[force == kind]
            excess = float(mine.mean()) ** 2 - noise**2 / len(mine)
            found = max(found, math.sqrt(max(0.0, excess)) / (gain * float(kind)))
        return found
