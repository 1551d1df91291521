"""How the bending stiffness of a fibre varies along it."""

import math
import random

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

MODES = 24


class StiffnessProfile:
    """A smooth random profile, always positive, as a part of the whole fibre's stiffness.

    Parameters
    ----------
    length_um : float
        Of the fibre.
    variation : float
        Standard deviation of the logarithm.
    over_um : float
        Length over which it changes.
    key : str
        What it is drawn from.

    Notes
    -----
    Waves of random phase, with wave numbers drawn from a normal distribution, have a correlation
    that falls like a bell curve over `over_um`. The mean of the inverse over the length is one.
    """

    def __init__(self, length_um: float, variation: float, over_um: float, key: str) -> None:
        chance = random.Random(f"stiffness {key}")
        self._waves = np.array([chance.gauss(0.0, 1.0 / over_um) for _ in range(MODES)])
        self._phases = np.array([chance.uniform(0.0, 2.0 * math.pi) for _ in range(MODES)])
        self._high = variation * math.sqrt(2.0 / MODES)
        self._whole = 1.0
        at = np.linspace(0.0, length_um, 400)
        self._whole = float(np.mean(1.0 / self(at)))

    def __call__(self, along_um: Floats) -> Floats:
        """Return the stiffness at places along the fibre, from its first end, any shape."""
        waves = np.cos(along_um[..., None] * self._waves + self._phases)
        return np.asarray(self._whole * np.exp(self._high * waves.sum(axis=-1)))
