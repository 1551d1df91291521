"""A fibre as a thin elastic rod, held at both ends and pushed sideways at one point; quasi-static.

Units that fit together without factors: um, uN, hence uN um2 for a bending stiffness, and uN/um,
the same number as N/m, for a spring. The beam is under axial tension (stability functions),
tension and deflection tied by the stretching of fibre and grippers; good for slopes below 0.2.
A fibre held at one end is in `cantilever`.
"""

import math
from bisect import bisect_right
from functools import lru_cache
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats

EI_UN_UM2_PER_N_M2: Final = 1e18
"""1e6 uN in a newton, 1e12 um2 in a square metre."""

UN_PER_N: Final = 1e6

HIGHEST_TENSION_UN: Final = 2e5
"""Tension up to which a curve is laid out: a dry fibre breaks at 50 to 200 mN."""


class PushCurve:
    """Force of a fibre on the probe over its way, for one grasp and one abscissa.

    Parameters
    ----------
    deflections_um, forces_un : ndarray, shape (n,), float64
        Of the fibre at the probe; both begin at 0.
    sensor_un_um : float
        Stiffness of the sensor behind the probe, which takes its part of the way.

    Attributes
    ----------
    travels_um : list of float
        How far the probe's holder went since contact; rises from 0.
    forces_un : list of float
    alongs_un : list of float
        Force along the fibre on the probe at each, outwards; empty where there is none.
    slids_um : list of float
        Where along the fibre the probe touches at each; empty where that is not known.
    reach_um : float
        Way at which the fibre slides off, or the end of what is laid out.
    """

    __slots__ = ("_asked", "alongs_un", "forces_un", "reach_um", "slids_um", "travels_um")

    def __init__(
        self,
        deflections_um: Floats,
        forces_un: Floats,
        sensor_un_um: float,
        alongs_un: Floats | None = None,
        slids_um: Floats | None = None,
    ) -> None:
        travels = deflections_um + forces_un / sensor_un_um
        rises = travels[1:] > np.maximum.accumulate(travels)[:-1]
        if not rises.all():
            kept = np.concatenate([[True], rises])
            travels, forces_un = travels[kept], forces_un[kept]
            alongs_un = None if alongs_un is None else alongs_un[kept]
            slids_um = None if slids_um is None else slids_um[kept]
        self.travels_um: list[float] = travels.tolist()
        self.forces_un: list[float] = forces_un.tolist()
        self.alongs_un: list[float] = [] if alongs_un is None else alongs_un.tolist()
        self.slids_um: list[float] = [] if slids_um is None else slids_um.tolist()
        self.reach_um: float = self.travels_um[-1]
        self._asked = math.nan, (0.0, 0.0)

    def force_un(self, travel_um: float) -> float:
        """Return the force after a travel; the same with the opposite sign on the other side."""
        return self.both_un(travel_um)[0]

    def along_un(self, travel_um: float) -> float:
        """Return the force along the fibre on the probe, outwards."""
        return self.both_un(travel_um)[1]

    def both_un(self, travel_um: float) -> tuple[float, float]:
        """Return the force across and the force along, as a look needs both."""
        asked_um, found = self._asked
        if travel_um == asked_um:  # a look asks several times for one travel
            return found
        travels, forces, alongs = self.travels_um, self.forces_un, self.alongs_un
        pushed_um = abs(travel_um)
        if pushed_um >= self.reach_um:
            force, along = forces[-1], alongs[-1] if alongs else 0.0
        else:
            # A curve is used for few points, one after another: no array is worth its call.
            after = bisect_right(travels, pushed_um)
            low = after - 1
            part = (pushed_um - travels[low]) / (travels[after] - travels[low])
            force = forces[low] + part * (forces[after] - forces[low])
            along = alongs[low] + part * (alongs[after] - alongs[low]) if alongs else 0.0
        found = (force, along) if travel_um >= 0.0 else (-force, -along)
        self._asked = travel_um, found
        return found

    def slid_um(self, travel_um: float) -> float:
        """Return where along the fibre a probe that is stiff along it touches after a travel.

        Of the length from the jaws' tip only what slides counts: a round edge that rolls on the
        fibre stays where it is. Where the probe gives way by a force along, it touches farther out
        by so much.
        """
        travels, slids = self.travels_um, self.slids_um
        if not slids or travel_um <= 0.0:
            return slids[0] if slids else 0.0
        if travel_um >= self.reach_um:
            return slids[-1]
        after = bisect_right(travels, travel_um)
        low = after - 1
        part = (travel_um - travels[low]) / (travels[after] - travels[low])
        return slids[low] + part * (slids[after] - slids[low])


@lru_cache(maxsize=128)
def held_at_both_ends(
    *,
    ei_un_um2: float,
    ea_un: float,
    span_um: float,
    distance_um: float,
    slack_um: float,
    gripper_un_um: float,
    sensor_un_um: float,
) -> PushCurve:
    """Return the curve of a fibre clamped at both ends.

    Parameters
    ----------
    ea_un : float
        Axial stiffness of the fibre.
    span_um, distance_um : float
        From the first clamp to the probe, and to the other clamp.
    slack_um : float
        Length of fibre between the clamps beyond their distance; negative: it is stretched.
        A slack fibre bends as if straight until the slack is used up.
    gripper_un_um : float
        Stiffness of each gripper along the fibre; inf: rigid.
    """
    axial_un_um = 1.0 / (distance_um / ea_un + 2.0 / gripper_un_um)
    lowest = max(0.0, -slack_um * axial_un_um)
    tension = np.concatenate([[0.0], np.geomspace(1e-3, HIGHEST_TENSION_UN, 240)]) + lowest
    stiffness = _stiffness_un_um(tension, ei_un_um2, span_um, distance_um - span_um)
    # Half of d(stiffness)/d(tension) is the lengthening for a deflection of one.
    change = 1e-4 * tension + 1e-6
    slope = (
        _stiffness_un_um(tension + change, ei_un_um2, span_um, distance_um - span_um) - stiffness
    ) / change
    stretch = np.maximum(tension / axial_un_um + slack_um, 0.0)
    deflections = np.sqrt(2.0 * stretch / slope)
    if deflections[0] > 0.0:  # slack: the linear part before any tension
        deflections = np.concatenate([[0.0], deflections])
        stiffness = np.concatenate([stiffness[:1], stiffness])
    return PushCurve(deflections, stiffness * deflections, sensor_un_um)


def tension_un(*, ea_un: float, distance_um: float, slack_um: float, gripper_un_um: float) -> float:
    """Return the tension of a straight fibre held at both ends; 0 while it is slack."""
    return max(0.0, -slack_um / (distance_um / ea_un + 2.0 / gripper_un_um))


def _stiffness_un_um(tension_un: Floats, ei: float, left_um: float, right_um: float) -> Floats:
    """Return force per deflection at the probe of a beam under tension, clamped at both ends.

    Each side is one exact element of the beam-column; the slope at the probe is free.
    """
    left = _element(tension_un, ei, left_um)
    right = _element(tension_un, ei, right_um)
    across = left[0] + right[0]
    mixed = right[1] - left[1]
    turning = left[2] + right[2]
    return np.asarray(across - mixed * mixed / turning)


def _element(tension_un: Floats, ei: float, length_um: float) -> tuple[Floats, Floats, Floats]:
    """Return force/way, moment/way (= force/turn) and moment/turn at the end of one element."""
    root = length_um * np.sqrt(tension_un / ei)
    x = np.clip(root, 0.3, None)  # the closed form cancels below; a series serves there
    e1, e2 = np.exp(-x), np.exp(-2.0 * x)
    cosh, sinh = 0.5 * (1.0 + e2), 0.5 * (1.0 - e2)  # times exp(-x), so that nothing overflows
    phi = 2.0 * e1 - 2.0 * cosh + x * sinh
    small = root < 0.3
    square = root * root
    across = np.where(small, 12.0 + 1.2 * square, x**3 * sinh / phi)
    mixed = np.where(small, 6.0 + 0.1 * square, x * x * (cosh - e1) / phi)
    turning = np.where(small, 4.0 + 2.0 / 15.0 * square, x * (x * cosh - sinh) / phi)
    return across * (ei / length_um**3), mixed * (ei / length_um**2), turning * (ei / length_um)
