"""A capacitive force sensor: a force in, a voltage out, as an acquisition board sees it."""

import math
from collections.abc import Callable, Iterator
from threading import Lock
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.climate import STILL_AIR, Climate
from cosmic.twin.force_settings import ForceSensorSettings
from cosmic.twin.transducer import Flicker, Transducer

LONGEST_RUN: Final = 300.0
"""Time constants filtered in one go; exp of more than 700 would overflow."""

SAME_STEP: Final = 1e-8
"""Part by which steps between samples differ that are the same but for rounding."""


class ForceSensor:
    """One sensor and its amplifier: bandwidth, noise, drift, saturation.

    Parameters
    ----------
    name : str
        Its name in twin.toml.
    settings : ForceSensorSettings
        Constants.
    force_un : callable
        What its transducer makes of the loads at rising times, uN; None for a sensor that nothing
        touches.
    seed : int
        Of noise, drift, and how far it is from its data sheet.
    climate : Climate
        The air around it.

    Attributes
    ----------
    transducer : Transducer
    saturated : bool
        The output stands at the end of the range, whatever it feels.
    dead : bool
        It stands at its zero, and has no noise.
    running_un_s : float
        By how much the zero runs away.

    Notes
    -----
    Any thread may ask, for times that rise from call to call. The same times in other portions
    give the same volts, but for rounding.
    """

    def __init__(
        self,
        name: str,
        settings: ForceSensorSettings,
        force_un: Callable[[Floats], Floats] | None,
        seed: int,
        climate: Climate = STILL_AIR,
    ) -> None:
        self.name = name
        self.settings = settings
        self._force_un = force_un
        streams = np.random.SeedSequence([seed, *name.encode()]).spawn(6)
        mounting, self._noise, self._drift, load, room, slow = (
            np.random.default_rng(each) for each in streams
        )
        self.transducer = Transducer(settings, load)
        self._climate = climate
        self._gain_k = 1e-6 * settings.gain_ppm_k * float(room.standard_normal())
        self._zero_un_k = settings.zero_un_k * float(room.standard_normal())
        self._warm_up_un = settings.warm_up_un * float(room.standard_normal())
        self._flicker: Flicker | None = None
        if settings.corner_hz:
            density = settings.noise_un**2 / (0.5 * math.pi * settings.bandwidth_hz)
            self._flicker = Flicker(density, settings.corner_hz, slow)
        self.true_gain_v_un = settings.gain_v_un * (
            1.0 + settings.gain_error * float(mounting.standard_normal())
        )
        self.true_zero_v = settings.zero_v + settings.zero_error_v * float(
            mounting.standard_normal()
        )
        self.saturated = False
        self.dead = False
        self.running_un_s = 0.0
        self._lock = Lock()
        self._time_s = -math.inf
        self._state_un = 0.0
        self._walk_un = 0.0
        self._pace: _Pace | None = None

    def volts(self, times_s: Floats) -> Floats:
        """Return the output, shape (n,), float64, V.

        Parameters
        ----------
        times_s : ndarray, shape (n,), float64
            Times of the samples, rising.

        Raises
        ------
        ValueError
            The times are not finite or fall.
        """
        times_s = np.asarray(times_s, dtype=np.float64)
        if not times_s.size:
            return np.empty(0)
        with self._lock:
            pace = self._paced(times_s)
            force = None if self._force_un is None else self._force_un(times_s)
            felt = self._filtered(pace, force)
            felt += self._wandered(pace)
            self._time_s = max(self._time_s, float(times_s[-1]))
        half_v = self.settings.gain_v_un * self.settings.range_un
        if self.saturated:
            return np.full_like(times_s, self.settings.zero_v + half_v)
        if self.dead:
            return np.full_like(times_s, self.true_zero_v)
        gain: float | Floats = self.true_gain_v_un
        if self._flicker is not None:
            felt += self._flicker.at(times_s)
        if self._gain_k or self._zero_un_k or self._warm_up_un:
            warmer_k = self._climate.warmer_at_k(times_s)
            gain = gain * (1.0 + self._gain_k * warmer_k)
            felt += self._zero_un_k * warmer_k
            if self._warm_up_un:
                felt += self._warm_up_un * np.exp(-times_s / self.settings.warm_up_s)
        felt *= gain
        felt += self.true_zero_v
        np.maximum(felt, self.settings.zero_v - half_v, out=felt)
        return np.minimum(felt, self.settings.zero_v + half_v, out=felt)

    def _paced(self, times_s: Floats) -> "_Pace":
        """Return what depends on the times alone; the chunks of a board share it."""
        steps_s = np.empty_like(times_s)
        np.subtract(times_s[1:], times_s[:-1], out=steps_s[1:])
        # For ever before the very first.
        steps_s[0] = max(float(times_s[0]) - self._time_s, 0.0)
        pace = self._pace
        if pace is not None and pace.fits(steps_s):
            return pace
        # Written so that NaN is caught; an infinite time leaves one too.
        if not (np.minimum.reduce(steps_s) >= 0.0 and math.isfinite(float(times_s[-1]))):
            raise ValueError(f"sensor {self.name}: the times of samples must rise")
        pace = self._pace = _Pace(steps_s, 2.0 * math.pi * self.settings.bandwidth_hz)
        return pace

    def _filtered(self, pace: "_Pace", force_un: Floats | None) -> Floats:
        """Pass force and white noise through the one pole of the amplifier.

        x[k] = r[k] x[k-1] + (1 - r[k]) force[k] + sqrt(1 - r[k]^2) noise[k], r = exp(-step/tau)
        """
        drive = self._noise.standard_normal(pace.steps_s.size)
        drive *= self.settings.noise_un
        drive *= pace.fresh
        if force_un is not None:
            drive += pace.passed * force_un
        for start, end, growth in pace.runs:
            run = drive[start:end]
            # The first of a run may follow any pause: it is taken on its own.
            first = pace.kept[start] * self._state_un + float(run[0])
            run *= growth
            run[0] = first
            np.add.accumulate(run, out=run)
            run /= growth
            self._state_un = float(run[-1])
        return drive

    def _wandered(self, pace: "_Pace") -> Floats:
        """Return the zero's random walk, uN."""
        steps = self.settings.drift_un_sqrt_s * pace.roots
        steps *= self._drift.standard_normal(steps.size)
        if self.running_un_s:
            steps += self.running_un_s * pace.lasted_s
        walk = np.add.accumulate(steps)
        walk += self._walk_un
        self._walk_un = float(walk[-1])
        return walk


class _Pace:
    """What a filter makes of the times of samples, whatever they carry.

    Attributes
    ----------
    steps_s : ndarray, shape (n,), float64
        Time before each sample; inf before the very first.
    lasted_s : ndarray, shape (n,), float64
        The same, but none before the very first: the sensor was zeroed just then.
    kept : list of float
        Part of the state that is left at each sample.
    passed, fresh : ndarray, shape (n,), float64
        Parts of the force and of white noise that come in.
    roots : ndarray, shape (n,), float64
        Roots of `lasted_s`.
    runs : tuple of (int, int, ndarray)
        Begin and end of samples that are filtered in one go, and how their weights grow.
    """

    __slots__ = ("_tolerance_s", "fresh", "kept", "lasted_s", "passed", "roots", "runs", "steps_s")

    def __init__(self, steps_s: Floats, per_s: float) -> None:
        self.steps_s = steps_s
        self.lasted_s = np.where(np.isinf(steps_s), 0.0, steps_s)
        self._tolerance_s = SAME_STEP * float(np.minimum.reduce(self.lasted_s))
        self.roots = np.sqrt(self.lasted_s)
        decay = np.minimum(steps_s * per_s, LONGEST_RUN)
        kept = np.exp(-decay)
        self.kept: list[float] = kept.tolist()
        self.passed = 1.0 - kept
        self.fresh = np.sqrt(1.0 - kept * kept)
        self.runs = tuple(_runs(decay.cumsum()))

    def fits(self, steps_s: Floats) -> bool:
        """Return whether times are those of other samples but for rounding."""
        if steps_s.size != self.steps_s.size:
            return False
        off = steps_s - self.steps_s
        return bool(np.maximum.reduce(np.abs(off, out=off)) <= self._tolerance_s)


def _runs(age: Floats) -> Iterator[tuple[int, int, Floats]]:
    """Yield runs that a float can hold."""
    start = 0
    while start < age.size:
        base = float(age[start])
        end = age.size
        if age[-1] > base + LONGEST_RUN:
            end = max(int(age.searchsorted(base + LONGEST_RUN, side="right")), start + 1)
        yield start, end, np.exp(age[start:end] - base)
        start = end
