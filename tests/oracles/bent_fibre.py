"""A pushed cantilever integrated step by step, and a rig that measures it with all its errors."""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from cosmic.autonomy.bending.span import Span

UN_UM2 = 1e18
"""uN um2 in one N m2."""


@cache
def curve(radius_part: float) -> tuple[np.ndarray, np.ndarray]:
    """Return deflection/span and force span^2/EI of a fibre round an edge, by integration.

    From the contact, where there is no moment, the slope grows as psi'' = load cos(psi) towards
    the clamp; the length is found at which the probe's middle stands one span from the clamp.
    """
    deflections, forces = [0.0], [0.0]
    for load in np.linspace(0.05, 0.9, 18):
        bent = solve_ivp(
            lambda _, y, load=load: [y[1], load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])],
            (0.0, 1.3),
            [0.0, 0.0, 0.0, 0.0],
            dense_output=True,
            rtol=1e-9,
            atol=1e-11,
        )

        def middle(length: float, bent=bent) -> float:
            slope, _, along, across = bent.sol(length)
            lever = along * np.cos(slope) + across * np.sin(slope)
            return lever + radius_part * np.sin(slope) - 1.0

        length = brentq(middle, 0.3, 1.3)
        slope, _, along, across = bent.sol(length)
        bow = along * np.sin(slope) - across * np.cos(slope)
        deflections.append(bow + radius_part * (1.0 - np.cos(slope)))
        forces.append(load * np.cos(slope))
    return np.array(deflections), np.array(forces)


@dataclass
class Rig:
    """A fibre in a gripper before a probe, as the truth is; random where not told."""

    ei_n_m2: float
    rng: np.random.Generator
    clamp_um: float = 8.0
    bias_um: float = 0.0
    gain: float = 1.0
    radius_um: float = 25.0
    sensor_un_um: float = 800.0
    noise_un: float = 0.3
    averaged: int = 25
    drift_un_sqrt_s: float = 0.02
    contact_std_um: float = 1.0
    way_std_um: float = 0.05
    cling_un: float = 0.0
    towards: float = 1.0
    slipped_um: float = 0.0
    breaks_at: float | None = None
    hold_x_um: float = 1234.0
    probe_0_um: float = 700.0
    _level_un: float = field(default=0.4, init=False)
    _time_s: float = field(default=10.0, init=False)

    @classmethod
    def drawn(cls, ei_n_m2: float, rng: np.random.Generator, **more: float) -> "Rig":
        """Return a rig with errors as they are foreseen."""
        return cls(
            ei_n_m2,
            rng,
            clamp_um=8.0 + 4.0 * rng.standard_normal(),
            bias_um=2.0 * rng.standard_normal(),
            gain=1.0 + 0.01 * rng.standard_normal(),
            sensor_un_um=800.0 * (1.0 + 0.15 * rng.standard_normal()),
            cling_un=rng.choice([0.0, 1.0]),
            towards=rng.choice([-1.0, 1.0]),
            **more,
        )

    def force(self, probe_um: np.ndarray, span_um: float) -> np.ndarray:
        """Return the force at ways of the probe's axis since the contact, odd in the way."""
        deflections, forces = curve(round(self.radius_um / span_um / 0.005) * 0.005)
        fine = np.linspace(0.0, deflections[-1], 800)
        smooth = _smooth(deflections, forces, fine) * self.ei_n_m2 * UN_UM2 / span_um**2
        way = fine * span_um + smooth / self.sensor_un_um
        return np.sign(probe_um) * np.interp(np.abs(probe_um), way, smooth)

    def push(self, nominal_um: float, stroke_um: float, steps: int = 24) -> Span:
        """Return what a staircase out and back measures."""
        hinge = 100.0 + 3.0 * self.rng.standard_normal()
        span = nominal_um + self.clamp_um + self.bias_um
        span += self.contact_std_um * self.rng.standard_normal()
        first = hinge - 0.35 * stroke_um
        out = np.linspace(first, hinge + stroke_um, steps)
        way = np.concatenate([out, out[::-1]])
        loading = np.arange(2 * steps) < steps
        true_way = way + self.way_std_um * self.rng.standard_normal(2 * steps) - hinge
        force = self.force(true_way, span)
        force[loading & (true_way < 0.0)] = 0.0
        back = ~loading
        if self.slipped_um:
            force[back] = self.force(true_way[back] - self.slipped_um, span)
        force[back & (force < -self.cling_un)] = 0.0
        if self.cling_un:
            free = np.cumsum(back & (force == 0.0)) > 0
            force[back & free] = 0.0
        else:
            force[back & (force < 0.0)] = 0.0
        if self.breaks_at is not None:
            broken = int(np.argmax(true_way > self.breaks_at * stroke_um))
            force[broken:] = 0.0
        walk = self.drift_un_sqrt_s * np.sqrt(0.06) * self.rng.standard_normal(2 * steps)
        level = self._level_un + np.cumsum(walk)
        self._level_un = float(level[-1])
        std = self.noise_un / np.sqrt(self.averaged)
        read = self.gain * force + level + std * self.rng.standard_normal(2 * steps)
        times = self._time_s + 0.06 * np.arange(2 * steps)
        self._time_s = float(times[-1]) + 0.5
        return Span(
            nominal_um=nominal_um,
            probe_x_um=self.probe_0_um + self.towards * nominal_um,
            hold_x_um=self.hold_x_um,
            probe_um=way,
            force_un=read,
            force_std_un=np.full(2 * steps, std),
            time_s=times,
            loading=loading,
        )


def _smooth(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return values between the integrated ones, by a polynomial through zero."""
    powers = np.vander(x / x[-1], 8, increasing=True)[:, 1:]
    factors = np.linalg.lstsq(powers, y, rcond=None)[0]
    return np.vander(at / x[-1], 8, increasing=True)[:, 1:] @ factors
