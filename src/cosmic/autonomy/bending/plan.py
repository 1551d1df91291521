"""Where to push a fibre, and how far."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import Field

from cosmic.autonomy.bending.result import UN_UM2_PER_N_M2, BendingError
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from cosmic.frame.config import StrictModel

DRY_EI_N_M2: Final = 5e-11
"""Of a dry fibre, from which to begin when nothing else is known."""

UPPER_PART: Final = 0.4
"""Of the force of a push: from there on its slope is that of the fibre, not of the first touch."""
TIMES_NOISE: Final = 5.0
LEAST_POINTS: Final = 4

LEAST_SPREAD: Final = 1.8
"""Longest over shortest span: spans close together do not tell the clamp from the stiffness."""


class SpanLimits(StrictModel):
    """What spans a procedure may choose.

    Attributes
    ----------
    count : int
        How many spans.
    shortest_um, longest_um : float
        From the tip of the jaws to the middle of the probe.
    shortest_part : float
        Shortest span as a part of the longest: a smaller part makes EI more certain, and takes
        longer, as stiff spans are approached in smaller steps.
    nearer : float
        How spans lie between both: 0 evenly, 1 each longer than the next by the same part, so that
        there are more of them near the jaws.
    shortest_stroke_um : float
        Spans so short that less than this reaches the highest force are left out.
    beyond_um : float
        Length of fibre that must remain beyond the probe.
    stroke_part : float
        Longest push as a part of the span.
    longest_stroke_um : float
        Longest push.
    highest_un, wanted_un : float
        Force that may be reached, and that is enough for a good fit.
    strain_percent : float
        Strain that the surface of a fibre may reach.
    """

    count: int = Field(5, ge=1, le=10)
    shortest_um: float = Field(110.0, gt=0.0)
    longest_um: float = Field(600.0, gt=0.0)
    shortest_part: float = Field(0.2, gt=0.0, lt=1.0)
    nearer: float = Field(0.0, ge=0.0, le=1.0)
    shortest_stroke_um: float = Field(3.0, gt=0.0)
    beyond_um: float = Field(80.0, ge=0.0)
    stroke_part: float = Field(0.1, gt=0.0, le=0.2)
    longest_stroke_um: float = Field(40.0, gt=0.0)
    highest_un: float = Field(80.0, gt=0.0)
    wanted_un: float = Field(3.0, gt=0.0)
    strain_percent: float = Field(0.5, gt=0.0)


FARTHER: Final = SpanLimits(
    longest_um=800.0, longest_stroke_um=70.0, shortest_part=0.15, nearer=1.0
)
"""For fibres of a millimetre and more that are not very soft: the farther out, the less depth and
compliance of the clamp count."""


@dataclass(frozen=True, slots=True)
class PlannedSpan:
    """One push to be made.

    Attributes
    ----------
    span_um : float
        From the tip of the jaws to the middle of the probe.
    stroke_um : float
        How far to push beyond the first contact.
    force_un : float
        What the fibre should push back with at the end.
    """

    span_um: float
    stroke_um: float
    force_un: float


def plan_spans(
    length_free_um: float,
    ei_guess_n_m2: float = DRY_EI_N_M2,
    limits: SpanLimits | None = None,
    *,
    done: Sequence[Span] = (),
    settings: FitSettings | None = None,
) -> tuple[PlannedSpan, ...]:
    """Return the pushes to be made, the longest and therefore gentlest first.

    Softer fibres get shorter spans. After the first span plan again with a better guess
    (`guess_ei`) and with what is `done`; what is returned is what remains. `settings` has the depth
    of the clamp, by which a span bends over more, and the fibre's width.

    Raises
    ------
    BendingError
        The fibre is too short for the shortest span.
    """
    limits, settings = limits or SpanLimits(), settings or FitSettings()
    room_um = min(limits.longest_um, length_free_um - limits.beyond_um)
    # Of the length as well: the smaller of a number and no number is the number.
    if not (room_um >= limits.shortest_um and length_free_um > 0.0):
        raise BendingError(
            f"{length_free_um:.0f} um of free fibre is too short: the shortest span is "
            f"{limits.shortest_um:g} um, and {limits.beyond_um:g} um must remain beyond the probe"
        )
    if not 0.0 < ei_guess_n_m2 < math.inf:
        raise BendingError(f"{ei_guess_n_m2:g} N m2 is not a bending stiffness to plan with")
    ei = ei_guess_n_m2 * UN_UM2_PER_N_M2
    # At a push of stroke_part * span the force is 3 EI stroke_part / span^2.
    enough = math.sqrt(3.0 * ei * limits.stroke_part / limits.wanted_un)
    longest = min(room_um, max(enough, LEAST_SPREAD * limits.shortest_um))
    clear = (3.0 * ei * limits.shortest_stroke_um / limits.highest_un) ** (1.0 / 3.0)
    clear -= settings.offset_um
    shortest = min(max(limits.shortest_um, limits.shortest_part * longest, clear), longest)
    remaining = limits.count - len(done)
    positions = _spread(shortest, longest, limits)
    left = _farthest(positions, [span.nominal_um for span in done], remaining)
    left.sort(reverse=True)
    return tuple(_planned(position, ei, limits, settings) for position in left)


def guess_ei(spans: Sequence[Span], *, settings: FitSettings | None = None) -> float | None:
    """Return the stiffness that the spans measured so far speak for, N m2; None: they do not.

    Good to some ten per cent, as plans need it, in less than a millisecond.
    """
    settings = settings or FitSettings()
    found = [ei for each in spans if (ei := _rough_ei(each, settings)) is not None]
    return math.exp(sum(math.log(each) for each in found) / len(found)) if found else None


def _rough_ei(span: Span, settings: FitSettings) -> float | None:
    """Return what the slope of the upper half of a push says; None: it does not rise."""
    force = span.force_un[span.loading]
    if len(force) < LEAST_POINTS:
        return None
    base, top = float(np.min(force)), float(np.max(force))
    # Not the dwell: the force falls there at one place.
    rising = np.arange(len(force)) <= int(np.argmax(force))
    upper = rising & (force >= base + UPPER_PART * (top - base))
    upper[max(int(np.argmax(force)) - 1, 0)] = True
    probe, force = span.probe_um[span.loading][upper], force[upper]
    apart = probe - probe.mean()
    square = float(apart @ apart)
    if not square > 0.0:
        return None
    slope = float(apart @ force) / square
    noise = float(np.median(span.force_std_un)) / math.sqrt(square)
    if not TIMES_NOISE * noise < slope < settings.sensor_un_um:
        return None
    k_un_um = 1.0 / (1.0 / slope - 1.0 / settings.sensor_un_um)
    if span.shape is not None:
        lever = span.shape.lever_um(settings.offset_um)
    else:
        lever = span.nominal_um + settings.offset_um
    ei = k_un_um * lever**3 / 3.0 / UN_UM2_PER_N_M2
    return ei if 0.0 < ei < math.inf else None


def _spread(shortest: float, longest: float, limits: SpanLimits) -> list[float]:
    if limits.count == 1:
        return [longest]
    parts = [n / (limits.count - 1) for n in range(limits.count)]
    even = [longest - (longest - shortest) * part for part in parts]
    by_part = [longest * (shortest / longest) ** part for part in parts]
    return [one + limits.nearer * (other - one) for one, other in zip(even, by_part, strict=True)]


def _farthest(positions: list[float], done: list[float], count: int) -> list[float]:
    """Return those of the positions that are farthest from what has been measured."""
    left = list(positions)
    for position in done:
        if len(left) > max(count, 0):
            left.remove(min(left, key=lambda each: abs(each - position)))
    return left[: max(count, 0)]


def _planned(
    span_um: float, ei_un_um2: float, limits: SpanLimits, settings: FitSettings
) -> PlannedSpan:
    lever_um, surface_um = span_um + settings.offset_um, max(settings.fibre_width_um, 1.0) / 2.0
    stiffness = 3.0 * ei_un_um2 / lever_um**3
    stroke = min(
        limits.stroke_part * span_um,
        limits.longest_stroke_um,
        limits.highest_un / stiffness,
        0.01 * limits.strain_percent * lever_um**2 / (3.0 * surface_um),
    )
    return PlannedSpan(span_um=span_um, stroke_um=stroke, force_un=stiffness * stroke)
