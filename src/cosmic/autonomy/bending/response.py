"""What each span of a fibre answers to what is not known of fibre, clamp and probe."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.result import BendingError
from cosmic.frame.arrays import Floats

CELLS: Final = 48
TURNED_RAD: Final = 0.01
MOVED_UM: Final = 2.0
ROUNDS: Final = 3
"""Until a direction by touch is found: a curled fibre answers by no straight line."""

BEYOND: Final = 1.5
LEAST_TOUCHES: Final = 3
DISAGREE_TIMES: Final = 4.0
"""Of what the image may be wrong by: beyond that both witnesses are doubted, and neither taken."""


@dataclass(frozen=True, slots=True, eq=False)
class LaidOut:
    """What n spans answer at several depths of the clamp.

    Attributes
    ----------
    log_stiffness : ndarray, shape (depths, n), float64
        As `Response.log_stiffness` returns it.
    variation : ndarray, shape (few, n, n), float64
        As `Response.variation` returns it for a few of the depths.
    nearest : ndarray, shape (depths,), int
        Which of the few stands for each depth.
    """

    log_stiffness: Floats
    variation: Floats
    nearest: npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """Logarithmic derivatives of the first stiffness of n spans.

    Attributes
    ----------
    shapes : tuple of NaturalShape
        Of each span.
    by_contact, by_direction, by_square : ndarray, shape (n,), float64
        To the place of contact (1/um), to the direction out of the jaws (1/rad), and one over the
        square of the lever (1/um2).
    slopes : ndarray, shape (n,), float64
        Tangent of the fibre's natural slope at the probe.
    """

    shapes: tuple[NaturalShape, ...]
    by_contact: Floats
    by_direction: Floats
    by_square: Floats
    slopes: Floats
    _last: dict[tuple[float | bytes, ...], LaidOut] = field(
        default_factory=dict, init=False, repr=False
    )

    def log_stiffness(self, depths_um: Floats) -> Floats:
        """Return ln(k / EI) of each span for depths of the clamp, shape (depths, n)."""
        levers = np.column_stack([each.levers_um(depths_um) for each in self.shapes])
        return np.asarray(math.log(3.0) - 3.0 * np.log(levers))

    def weights(self, depth_um: float) -> tuple[Floats, Floats]:
        """Return places along the fibre, and how much each counts in each span, shape (n, m)."""
        arms = [each.arms_um() for each in self.shapes]
        end = max(float(along[-1]) for along, _ in arms)
        edges = np.linspace(-depth_um, end, CELLS + 1)
        middles = 0.5 * (edges[1:] + edges[:-1])
        rows = []
        for along, arm in arms:
            inside = arm[0] - np.minimum(middles, 0.0)
            here = np.where(middles < 0.0, inside, np.interp(middles, along, arm, right=0.0)) ** 2
            rows.append(here / here.sum())
        return middles, np.array(rows)

    def variation(self, depth_um: float, length_um: float, reference: int) -> Floats:
        """Return the covariance of ln(k) for a stiffness that varies by 1 along the fibre.

        Counted from the mean over the span `reference`, as compliance weighs it; shape (n, n).
        """
        middles, weights = self.weights(depth_um)
        alike = np.exp(-np.abs(middles[:, None] - middles[None, :]) / length_um)
        off = weights - weights[reference]
        return np.asarray(off @ alike @ off.T)

    def laid_out(
        self, depths_um: Floats, length_um: float, reference: int, *, every: int
    ) -> LaidOut:
        """Return stiffness and variation at each depth; kept until it is asked for others.

        Parameters
        ----------
        every : int
            Of so many depths the variation is found for one: it changes little with depth.
        """
        asked = depths_um.tobytes(), length_um, reference, every
        found = self._last.get(asked)
        if found is None:
            few = depths_um[::every]
            coarse = np.array([self.variation(float(each), length_um, reference) for each in few])
            nearest = np.abs(np.log(depths_um[:, None] / few[None, :])).argmin(axis=1)
            found = LaidOut(self.log_stiffness(depths_um), coarse, nearest)
            self._last.clear()
            self._last[asked] = found
        return found


def straight(at_um: float) -> NaturalShape:
    """Return the shape of a straight fibre that is pushed so far from the jaws."""
    return NaturalShape(np.array([0.0, BEYOND * at_um]), np.zeros(2), at_um)


def response_of(shapes: Sequence[NaturalShape], *, depth_um: float) -> Response:
    """Return the answers of spans with these shapes."""
    depth = np.array([depth_um])

    def log_lever(shape: NaturalShape) -> float:
        return float(np.log(shape.levers_um(depth)[0]))

    def differs(shape: NaturalShape, **change: float) -> float:
        try:
            return -3.0 * (log_lever(shape.moved(**change)) - log_lever(shape))
        except BendingError:  # the shape ends just there
            return 0.0

    levers = np.array([math.exp(log_lever(each)) for each in shapes])
    contact = [-differs(each, ahead_um=-MOVED_UM) / MOVED_UM for each in shapes]
    turned = [differs(each, turned_rad=TURNED_RAD) / TURNED_RAD for each in shapes]
    return Response(
        shapes=tuple(shapes),
        by_contact=np.array(contact),
        by_direction=np.array(turned),
        by_square=levers**-2.0,
        slopes=np.array([math.tan(each.slope_rad) for each in shapes]),
    )


class Direction(NamedTuple):
    """By how much a fibre leaves the jaws in another direction than the image shows.

    Attributes
    ----------
    turned_rad, std_rad : float
        That, and its standard deviation.
    by_contact : float
        By how much less it would be for each um that all contacts lie farther out, rad/um: a fibre
        that is curled is touched elsewhere then.
    """

    turned_rad: float
    std_rad: float
    by_contact: float = 0.0


def direction_by_touch(
    shapes: Sequence[NaturalShape],
    hinges_um: Floats,
    *,
    radius_um: float,
    noise_um: float,
    prior_rad: float,
) -> Direction:
    """Return how the fibre leaves the jaws, beside what the image shows, by where it was touched.

    The probe meets the fibre where its natural shape is: a second witness to the image, and a much
    sharper one, as axes repeat better than pixels.

    Parameters
    ----------
    hinges_um : ndarray, shape (n,), float64
        Position of the probe's axis at the first contact of each span, growing as it pushes.
    noise_um, prior_rad : float
        How well a first contact repeats, and how well the image shows the direction.
    """
    if len(shapes) < LEAST_TOUCHES:
        return Direction(0.0, prior_rad)
    turned, weights = 0.0, np.zeros(len(shapes))
    information = prior_rad**-2
    try:
        for _ in range(ROUNDS):
            off = _apart(hinges_um + _touches_um(shapes, radius_um, turned))
            step = _touches_um(shapes, radius_um, turned + TURNED_RAD)
            weights = _apart(hinges_um + step) - off
            weights = weights / TURNED_RAD / noise_um**2
            information = float(weights @ weights) * noise_um**2 + prior_rad**-2
            turned -= (float(weights @ off) + turned * prior_rad**-2) / information
            if abs(turned) > DISAGREE_TIMES * prior_rad:
                return Direction(0.0, abs(turned))
        left = _apart(hinges_um + _touches_um(shapes, radius_um, turned))
        moved = [each.moved(ahead_um=MOVED_UM) for each in shapes]
        farther = _touches_um(moved, radius_um, turned)
    except BendingError:  # turned so far, or moved, the shape ends before the probe
        return Direction(0.0, prior_rad)
    excess = max(1.0, float(left @ left) / (len(shapes) - 2) / noise_um**2)
    by_contact = float(weights @ (_apart(hinges_um + farther) - left)) / MOVED_UM / information
    return Direction(turned, min(math.sqrt(excess / information), prior_rad), -by_contact)


def _apart(values: Floats) -> Floats:
    return np.asarray(values - values.mean())


def _touches_um(shapes: Sequence[NaturalShape], radius_um: float, turned_rad: float) -> Floats:
    """Return where across the jaws the probe stands when it touches shapes that are turned."""
    return np.array([_touch_um(each.moved(turned_rad=turned_rad), radius_um) for each in shapes])


def _touch_um(shape: NaturalShape, radius_um: float) -> float:
    """Return where across the jaws the middle of the probe stands when it touches."""
    slope = shape.slope_rad
    ahead = shape.at_um + radius_um * math.sin(slope)
    aside = float(np.interp(ahead, shape.ahead_um, shape.aside_um))
    return aside + radius_um * math.cos(slope)
