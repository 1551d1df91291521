"""A fibre's cross-section along it: how stiff it bends, and how thick it is in the plane."""

import math
import random
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.force_settings import FibreSettings

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


HINGE_UM: Final = 12.0
"""Half width of a weak place."""

SHEAR_FACTOR: Final = 0.83
"""Part of a rectangular section that carries the shear."""


class Section:
    """A ribbon with two bending planes, twisted, uneven, and weak in places; never changed.

    Parameters
    ----------
    key : str
        Names seed and fibre: the same key, the same places.

    Notes
    -----
    A force across bends a ribbon that stands askew out of its own plane too. What it gives way in
    the direction of the force is cos^2 / EI flat way + sin^2 / EI edge way.
    """

    def __init__(self, settings: FibreSettings, key: str) -> None:
        self._settings = settings
        self._profile: StiffnessProfile | None = None
        if settings.ei_variation:
            self._profile = StiffnessProfile(
                settings.length_um, settings.ei_variation, settings.ei_length_um, key
            )
        self._hinges_um = _places(settings, key)
        self._turned = (math.nan, math.nan), (1.0, 0.0)

    @property
    def even(self) -> bool:
        """Whether it is the same everywhere and in every plane."""
        ribbon = self._settings.plane_ratio > 1.0
        return self._profile is None and not ribbon and not self._hinges_um.size

    def angle_rad(self, along_um: Floats, roll_rad: float) -> Floats:
        """Return by how much it is turned in the plane of bending; 0 bends flat way."""
        turn = self._settings.orientation_deg + 1e-3 * self._settings.twist_deg_mm * along_um
        return np.asarray(np.radians(turn) + roll_rad)

    def _turn_at(self, at_um: float, roll_rad: float) -> tuple[float, float]:
        """Return cosine and sine of that at one place; each look asks, mostly for the same."""
        each, at = self._settings, (at_um, roll_rad)
        key, found = self._turned
        if at != key:
            turn_deg = each.orientation_deg + 1e-3 * each.twist_deg_mm * at_um
            angle = math.radians(turn_deg) + roll_rad
            found = math.cos(angle), math.sin(angle)
            self._turned = at, found
        return found

    def flexibility(self, along_um: Floats, roll_rad: float) -> tuple[Floats, Floats, Floats]:
        """Return across, askew and up by how much it gives way more than an even flat one.

        Parameters
        ----------
        along_um : ndarray, any shape
            Places from its first end.
        roll_rad : float
            By how much it is rolled in the jaws.
        """
        stiff = np.ones_like(along_um) if self._profile is None else self._profile(along_um)
        for place in self._hinges_um:
            left = 1.0 - self._settings.hinge_part
            stiff = stiff * (1.0 - left * np.exp(-(((along_um - place) / HINGE_UM) ** 2)))
        angle = self.angle_rad(along_um, roll_rad)
        cos, sin = np.cos(angle), np.sin(angle)
        edge = 1.0 / self._settings.plane_ratio
        across = (cos * cos + edge * sin * sin) / stiff
        askew = cos * sin * (1.0 - edge) / stiff
        up = (sin * sin + edge * cos * cos) / stiff
        return across, askew, up

    def thickness_um(self, at_um: float, roll_rad: float) -> float:
        """Return how far it reaches in the plane of bending."""
        width, thick = self._settings.width_um, self._settings.thickness_um
        if self._settings.plane_ratio <= 1.0:
            return width if self._settings.thick_as_wide else thick
        cos, sin = self._turn_at(at_um, roll_rad)
        return math.hypot(thick * cos, width * sin)

    def seen_um(self, at_um: float, roll_rad: float) -> float:
        """Return how wide it looks from above."""
        width, thick = self._settings.width_um, self._settings.thickness_um
        if self._settings.plane_ratio <= 1.0:
            return width
        cos, sin = self._turn_at(at_um, roll_rad)
        return math.hypot(width * sin, thick * cos)

    def shear_um_un(self, length_um: float, thickness_um: float, ei_un_um2: float) -> float:
        """Return by how much it gives way in shear over a length, um/uN."""
        ratio = self._settings.shear_ratio
        return ratio * thickness_um**2 * length_um / (12.0 * SHEAR_FACTOR * ei_un_um2)


def _places(settings: FibreSettings, key: str) -> Floats:
    """Return where its weak places are: as often as the settings say, at random."""
    chance = random.Random(f"hinges {key}")
    places: list[float] = []
    at = 0.0
    while settings.hinges_per_mm > 0.0:
        at += chance.expovariate(settings.hinges_per_mm / 1000.0)
        if at > settings.length_um:
            break
        places.append(at)
    return np.array(places)
