"""What is left of a force once the friction that holds a section askew was made to let go.

A ribbon that stands askew moves up or down as it is pushed, and the probe holds it. Held
altogether it is as stiff on the way out as on the way back, and too stiff on both: no push tells.
Slid up and down the probe and brought back it has as much friction one way as the other, and in
compliance the mean of both is that of the free fibre.
"""

import math
from typing import Final

import numpy as np

from cosmic.autonomy.bending.crept import NO_LOADS, Loads
from cosmic.autonomy.bending.span import Span
from cosmic.frame.arrays import Floats

UNKNOWN: Final = (math.nan, math.nan)
READ_S: Final = 0.1
"""About so long after its step the force before was read."""

STANDS_PART: Final = 0.6
"""How still axes stand that hold their place, by how well one comes back to it. In a slide the jaws
go up and down alone: across neither they nor the probe move, and piezo stages at rest wander by 5
to 20 nm each, beside 50 nm to which they are taken to come back."""

LEAST_PART: Final = 0.1
"""Of the force: what is less than this afterwards has lost the probe."""

CLEAR_SIGMAS: Final = 5.0


def freed_of(
    span: Span,
    baseline_un: Floats,
    relaxation_part: float,
    others: Loads = NO_LOADS,
    *,
    stage_std_un: float = 0.0,
) -> tuple[float, float]:
    """Return ln of the force after by that before, and its standard deviation; nan: unknown.

    Parameters
    ----------
    baseline_un : ndarray, shape (n,), float64
        At each point of the span.
    relaxation_part : float
        Part of the force that goes in a tenfold time: it fell by that meanwhile as well.
    others : Loads
        Of other spans, from which the fibre still comes back.
    stage_std_un : float
        What the force is off where the probe is as far off its place as its stages repeat; it does
        not move in a slide, and stands the stiller for that.
    """
    freed = span.freed
    if freed is None or not 0 <= freed.after < len(span.force_un):
        return UNKNOWN
    base = float(baseline_un[freed.after])
    before = float(span.force_un[freed.after]) - base
    up, down = float(np.mean(freed.up_un)) - base, float(np.mean(freed.down_un)) - base
    noise = math.hypot(
        float(span.force_std_un[freed.after]),
        freed.std_un / math.sqrt(len(freed.up_un) + len(freed.down_un)),
    )
    if not (before > CLEAR_SIGMAS * noise and min(up, down) > LEAST_PART * before):
        return UNKNOWN
    read_s = span.time_s[freed.after] + np.array([0.0, freed.wait_s])
    fell = relaxation_part * math.log10(1.0 + freed.wait_s / READ_S)
    came_back = relaxation_part * float(-np.diff(others.lost_un(read_s))[0]) / before
    after = 2.0 / (1.0 / up + 1.0 / down)
    stands_un = STANDS_PART * stage_std_un
    std = math.hypot(noise / before, stands_un / before, 0.5 * fell, 0.5 * came_back)
    return math.log(after / before) + fell - came_back, std
