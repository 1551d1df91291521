"""How a cantilever of unit length pushes back when it is bent far, by a round edge that slides."""

from functools import cache, lru_cache
from typing import Final

import numpy as np

from cosmic.autonomy.bending.curved import PushedCurve
from cosmic.autonomy.bending.result import Floats

STEEPEST_RAD: Final = 1.0
POINTS: Final = 200


@cache
def _bare() -> tuple[Floats, Floats, Floats]:
    """Return slope at the contact, deflection over lever and force lever^2/EI, rising.

    The contact is free of friction, so its force N stands on the fibre there. With psi the slope
    still missing to that of the contact, the elastica's first integral is
    EI/2 (dpsi/ds)^2 = N sin(psi), and arc length and both coordinates are integrals over psi.
    """
    slope = np.linspace(0.0, np.sqrt(STEEPEST_RAD), POINTS)[1:] ** 2
    nodes, weights = np.polynomial.legendre.leggauss(20)
    # psi = slope u^2 takes the root out of the integrand at the contact.
    u, weight = 0.5 * (nodes + 1.0), 0.5 * weights
    psi = slope[:, None] * u * u
    # Twice slope u du over the root of 2 sin(psi), lengths in units of the root of EI/N.
    length = 2.0 * slope[:, None] * u / np.sqrt(2.0 * np.sin(psi)) * weight
    along, across = (np.cos(psi) * length).sum(axis=1), (np.sin(psi) * length).sum(axis=1)
    lever = along * np.cos(slope) + across * np.sin(slope)
    bow = along * np.sin(slope) - across * np.cos(slope)
    zero = np.zeros(1)
    return (
        np.concatenate([zero, slope]),
        np.concatenate([zero, bow / lever]),
        np.concatenate([zero, lever**2 * np.cos(slope)]),
    )


@lru_cache(maxsize=256)
def cantilever(radius_part: float) -> tuple[Floats, Floats]:
    """Return deflection/span and force span^2/(3 EI) of a cantilever, both rising from zero.

    Parameters
    ----------
    radius_part : float
        Radius of the rounding over the span, which is counted to the middle of the probe.
    """
    slope, bow, force = _bare()
    lever = 1.0 - radius_part * np.sin(slope)
    deflection = lever * bow + radius_part * (1.0 - np.cos(slope))
    pushed = force / (3.0 * lever**2)
    deflection.flags.writeable = pushed.flags.writeable = False
    return deflection, pushed


def force_un(
    way_um: Floats,
    *,
    k_un_um: float,
    span_um: float,
    radius_um: float,
    sensor_un_um: float,
    curved: PushedCurve | None = None,
) -> Floats:
    """Return the force of a fibre in front of a sensor that gives way; 0 before the contact.

    Parameters
    ----------
    way_um : ndarray
        Of the probe's axis since the first contact.
    k_un_um : float
        Stiffness of the fibre at the first contact, 3 EI/span^3.
    curved : PushedCurve, optional
        Of a fibre that is not straight by nature.
    """
    if curved is not None:
        deflection, pushed = curved.deflection, curved.pushed
    else:
        deflection, pushed = cantilever(round(radius_um / span_um, 3))
    force = k_un_um * span_um * pushed
    travel = span_um * deflection + force / sensor_un_um
    return np.asarray(np.interp(way_um, travel, force), dtype=np.float64)
