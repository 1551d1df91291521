"""Where a held fibre should be met: as its shape foresees, put right by where it was met before."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

FAR_UM: Final = 600.0
"""Span that the spreads below are stated for."""
SPREAD_UM: Final = (15.0, 25.0, 10.0)
"""What a fibre may lie off: all of it alike, in proportion to the span, and to its square."""
ROUGH_UM: Final = 1.0
STEEP_UM: Final = 4.0
"""What it lies off besides, from span to span; and that times its slope: where along it the probe
stands, and how its line runs, is known to some micrometres."""


@dataclass(frozen=True, slots=True)
class Contact:
    """Where the probe has met a fibre.

    Attributes
    ----------
    span_um : float
        From the jaws.
    off_um, std_um : float
        How far from where its shape foresees, along the push, and how well that is known.
    slope : float
        Of the fibre there.
    """

    span_um: float
    off_um: float
    std_um: float
    slope: float = 0.0


def foresee_off(
    contacts: Sequence[Contact], span_um: float, slope: float = 0.0
) -> tuple[float, float]:
    """Return how far from where its shape foresees a fibre lies at a span, and how sure that is.

    It lies elsewhere because of where it is held, how it leaves the jaws, and how it bows: each is
    as likely as its spread says, and every contact tells of all three.

    Returns
    -------
    off_um, std_um : float
        Mean and standard deviation.
    """
    prior = np.square(np.array(SPREAD_UM))
    here = _parts(np.array([span_um]))
    alone = float((here * prior @ here.T).item())
    if not contacts:
        return 0.0, math.hypot(math.sqrt(alone), _rough_um(slope))
    there = _parts(np.array([each.span_um for each in contacts]))
    noise = np.array([math.hypot(each.std_um, _rough_um(each.slope)) for each in contacts])
    among = (there * prior) @ there.T + np.diag(noise**2)
    shared = ((here * prior) @ there.T)[0]
    gain = np.linalg.solve(among, shared)
    left = max(alone - float(gain @ shared), 0.0)
    off = float(gain @ np.array([each.off_um for each in contacts]))
    return off, math.hypot(math.sqrt(left), _rough_um(slope))


def _rough_um(slope: float) -> float:
    return ROUGH_UM + STEEP_UM * abs(slope)


def _parts(spans_um: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    far = spans_um / FAR_UM
    return np.column_stack([np.ones_like(far), far, far**2])
