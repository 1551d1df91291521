"""How a curled fibre gives way to a round edge that pushes it: a weak form, by Ritz' method.

A probe without friction pushes along the fibre's normal at the contact. The turning of the fibre
against its natural shape is sought as a polynomial of the length; for each force it makes the
virtual work of bending and of the push equal. The slope of the curve at its begin is known in
closed form: with b the natural slope at the contact, and X and Y the distances of an element from
it, 1/k = 1/(EI cos^2 b) times the integral of (X cos b + Y sin b)^2 over the length.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.autonomy.bending.result import BendingError, Floats

TERMS: Final = 7
"""Of the polynomial; the turning is nothing at the clamp."""

POINTS: Final = 20
LOADS: Final = 40
HEAVIEST: Final = 1.3
"""Load in units of EI/lever^2; the deflection reaches 0.4 of the lever."""

ROUNDS: Final = 40
MET_PART: Final = 1e-6
"""Of the lever: how near the contact must come to the probe."""

STILL_PART: Final = 1e-12
"""Of the lever, and of 1 rad: what moves less is in balance; more rounds would only round it."""

LONGEST_STEP_UM: Final = 20.0
LEAST_COS: Final = 0.2
TURNS: Final = 3
DIRECTION_UM: Final = 40.0
"""Length to both sides of a place over which its direction is taken."""


Mask = npt.NDArray[np.bool_]


@cache
def _quadrature() -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return points of the unit length and its end, weights, and turning by term.

    The turning at the points, from them to the end, and weighed.

    Terms are integrals of Legendre polynomials: bent by one, the fibre does no work on another,
    and 1 on itself. All but the first are nothing at the end of the length.
    """
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    bending = np.diag(np.sqrt(2.0 * np.arange(TERMS) + 1.0))
    turning = np.polynomial.legendre.legint(bending, lbnd=-1.0, scl=0.5)
    terms = np.asarray(np.polynomial.legendre.legval(nodes, turning), dtype=np.float64).T
    before_end = np.asarray((np.arange(TERMS) == 0) - terms)
    part, weight = 0.5 * (np.append(nodes, 1.0) + 1.0), 0.5 * weights
    return part[:, None], weight, terms, before_end, np.ascontiguousarray(terms.T * weight)


@dataclass(frozen=True, slots=True, eq=False)
class PushedCurve:
    """Force over deflection, as parts of the first stiffness and of the lever.

    Attributes
    ----------
    deflection : ndarray, shape (n,), float64
        At the probe, over the lever; rises from 0.
    pushed : ndarray, shape (n,), float64
        Force across over the first stiffness times the lever; begins with the slope 1.
    """

    deflection: Floats
    pushed: Floats

    def force_un(
        self, probe_um: Floats, *, k_un_um: float, lever_um: float, sensor_un_um: float
    ) -> Floats:
        """Return the force in front of a sensor that gives way; 0 before the contact.

        Parameters
        ----------
        probe_um : ndarray
            Of the probe's axis since the first contact.
        k_un_um : float
            Stiffness of the fibre at the first contact, 3 EI/lever^3.
        """
        force = k_un_um * lever_um * self.pushed
        travel = lever_um * self.deflection + force / sensor_un_um
        return np.asarray(np.interp(probe_um, travel, force), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class _Pushes:
    """Loads that a fibre is bent by, one by one.

    Attributes
    ----------
    chords
        Of the fibre before.
    loads, rub, sides : ndarray, shape (n,), float64
        Force over EI (1/um2), its angle by friction (rad), and how far the probe gives way along
        the jaws for a load of 1 (um3).
    """

    chords: "_Chords"
    loads: Floats
    rub: Floats
    sides: Floats
    depth_um: float
    radius_um: float

    def of(self, chosen: Mask) -> "_Pushes":
        loads, rub, sides = self.loads[chosen], self.rub[chosen], self.sides[chosen]
        return _Pushes(self.chords, loads, rub, sides, self.depth_um, self.radius_um)


@dataclass(frozen=True, eq=False)
class NaturalShape:
    """The free part of a held fibre before it is pushed, and where the probe stands.

    Attributes
    ----------
    ahead_um, aside_um : ndarray, shape (n,), float64
        Places along the fibre from the jaws' tip, where it runs along the jaws: along them, rising,
        and across, positive towards the probe.
    at_um : float
        Where the middle of the probe is, along the jaws.
    """

    ahead_um: Floats
    aside_um: Floats
    at_um: float

    def __post_init__(self) -> None:
        ahead, aside = np.asarray(self.ahead_um), np.asarray(self.aside_um)
        if ahead.ndim != 1 or ahead.shape != aside.shape or len(ahead) < 2:
            raise BendingError(
                f"the fibre's shape has {ahead.shape} places ahead and {aside.shape} aside: one "
                "list of at least two of each is needed"
            )
        if not (np.isfinite(ahead).all() and np.isfinite(aside).all()):
            raise BendingError("the fibre's shape holds values that are no numbers")
        if not (np.diff(ahead) > 0.0).all() or not ahead[0] < self.at_um <= ahead[-1]:
            raise BendingError(
                f"the fibre's shape must rise along the jaws up to the probe at {self.at_um:g} um"
            )

    @cached_property
    def _arcs(self) -> Floats:
        steps = np.hypot(np.diff(self.ahead_um), np.diff(self.aside_um))
        return np.concatenate([[0.0], np.cumsum(steps)])

    @cached_property
    def slope_rad(self) -> float:
        """Natural direction at the probe, positive where the fibre runs towards it."""
        return float(np.angle(self._chord(np.array([self._arc_at(self.at_um)])))[0])

    def lever_um(self, depth_um: float = 0.0) -> float:
        """Return the length of a straight fibre that gives way as much to a small push.

        Parameters
        ----------
        depth_um : float
            How far inside the jaws' tip it is clamped.
        """
        return float(self.levers_um(np.array([depth_um]))[0])

    def levers_um(self, depths_um: Floats) -> Floats:
        """Return the lever for each of several depths of the clamp."""
        arm = self._arms[1][0]
        # Between the jaws the fibre is straight: its part of the integral is a cube.
        return np.asarray(np.cbrt(self._free_um3 + (arm + depths_um) ** 3 - arm**3))

    def arms_um(self) -> tuple[Floats, Floats]:
        """Return lengths from the jaws' tip to the contact, and the arm of a push about each."""
        return self._arms

    @cached_property
    def _free_um3(self) -> float:
        """Integral over the square of the arm from the jaws' tip on, three times."""
        along, arms = self._arms
        first, second = arms[:-1], arms[1:]
        return float(((first * first + first * second + second * second) * np.diff(along)).sum())

    @cached_property
    def _arms(self) -> tuple[Floats, Floats]:
        end = self._arc_at(self.at_um)
        along = np.unique(np.concatenate([[0.0], self._arcs[self._arcs < end], [end]]))
        x, y = self._places(along)
        return along, (x[-1] - x) + (y[-1] - y) * math.tan(self.slope_rad)

    def moved(self, *, ahead_um: float = 0.0, turned_rad: float = 0.0) -> "NaturalShape":
        """Return the shape with the probe farther ahead, and turned about the jaws' tip."""
        cos, sin = math.cos(turned_rad), math.sin(turned_rad)
        ahead = cos * self.ahead_um - sin * self.aside_um
        aside = sin * self.ahead_um + cos * self.aside_um
        last = len(ahead) if (rises := np.diff(ahead) > 0.0).all() else int(rises.argmin()) + 1
        return NaturalShape(ahead[:last], aside[:last], self.at_um + ahead_um)

    def curve(self, *, depth_um: float, radius_um: float) -> PushedCurve:
        """Return force over deflection for a round edge without friction."""
        return self.curves(depth_um=depth_um, radius_um=radius_um, friction=0.0)[0]

    def curves(
        self,
        *,
        depth_um: float,
        radius_um: float,
        friction: float,
        ei_un_um2: float = 0.0,
        side_um_un: float = 0.0,
    ) -> tuple[PushedCurve, PushedCurve]:
        """Return force over deflection from the first contact on, on the way out and back.

        The probe rubs the way the contact wanders along the fibre.

        Parameters
        ----------
        radius_um : float
            Of the probe's edge and half the fibre together.
        friction : float
            Part of the normal force that acts along the fibre.
        ei_un_um2, side_um_un : float
            Bending stiffness, about, and how far the probe gives way along the jaws for a force.

        Raises
        ------
        BendingError
            The fibre slides off.
        """
        (both,) = self.curves_by_side(
            depth_um=depth_um,
            radius_um=radius_um,
            friction=friction,
            ei_un_um2=ei_un_um2,
            sides_um_un=(side_um_un,),
        )
        return both

    def curves_by_side(
        self,
        *,
        depth_um: float,
        radius_um: float,
        friction: float,
        ei_un_um2: float,
        sides_um_un: Sequence[float],
    ) -> tuple[tuple[PushedCurve, PushedCurve], ...]:
        """Return what `curves` does, for each of several ways in which the probe gives way.

        Raises
        ------
        BendingError
            The fibre slides off.
        """
        lever = self.lever_um(depth_um)
        one = np.linspace(0.0, 1.0, LOADS) ** 1.5 * (HEAVIEST / lever**2)
        rub = np.repeat([math.atan(friction), -math.atan(friction)], LOADS)
        sides = ei_un_um2 * np.asarray(sides_um_un)
        pushes = _Pushes(
            self._chords(),
            np.tile(one, 2 * len(sides)),
            np.tile(rub, len(sides)),
            np.repeat(sides, 2 * LOADS),
            depth_um,
            radius_um,
        )
        found = self._balanced(pushes, lever)
        return tuple(self._both_ways(each, radius_um, lever) for each in found)

    def _balanced(self, pushes: "_Pushes", lever: float) -> list[Floats]:
        """Return equilibria of each probe, out and back.

        Rows are the length up to the contact, the direction there, how far ahead of the contact
        the probe is, its place across, and the force across over EI; columns the loads.
        """
        count = len(pushes.loads)
        found, rows = np.zeros((5, count)), np.zeros((5, count))
        rows[0] = self._arc_at(self.at_um)
        factors, moving = np.zeros((TERMS, count)), np.arange(count)
        for _ in range(ROUNDS):
            ends, contact, off, _, _ = rows
            steps = off / np.maximum(np.cos(contact), LEAST_COS)
            ends = ends + np.minimum(np.maximum(steps, -LONGEST_STEP_UM), LONGEST_STEP_UM)
            rows, turned = self._bent(ends, factors, pushes)
            found[:, moving] = rows
            away, turns = np.abs(rows[2]), np.abs(turned - factors).max(axis=0)
            # Each probe is tried until all its loads are met, or none of the rest moves any more.
            probes = moving // (2 * LOADS)
            unmet = np.bincount(probes[away >= MET_PART * lever], minlength=count) > 0
            on = unmet[probes] & ((away >= STILL_PART * lever) | (turns >= STILL_PART))
            factors = turned
            if not on.all():
                rows, factors, moving = rows[:, on], factors[:, on], moving[on]
                pushes = pushes.of(on)
            if not len(moving):
                break
        return np.split(found, count // (2 * LOADS), axis=1)

    def _both_ways(
        self, found: Floats, radius_um: float, lever: float
    ) -> tuple[PushedCurve, PushedCurve]:
        ends, contact, off, y, across = found
        wandered = (ends - radius_um * contact).reshape(2, LOADS).mean(axis=0)
        inwards = wandered < wandered[0]
        good = np.abs(off) < 1e-3 * lever
        both = []
        for first in (0, 1):
            chosen = np.where(inwards, 1 - first, first) * LOADS + np.arange(LOADS)
            both.append(self._pushed(y[chosen], across[chosen], good[chosen], lever=lever))
        return both[0], both[1]

    def _pushed(self, y: Floats, across: Floats, good: Mask, *, lever: float) -> PushedCurve:
        deflection = y[0] - y
        good = good.copy()
        good[1:] &= (np.diff(deflection) > 0.0) & (np.diff(across) > 0.0)
        last = LOADS if good.all() else int(good.argmin())
        if last < 3:
            raise BendingError(
                f"the fibre lies at {math.degrees(self.slope_rad):.0f} deg to the jaws at the "
                "probe: it slides off instead of bending; push it nearer to the jaws"
            )
        return PushedCurve(deflection[:last] / lever, across[:last] * lever**2 / 3.0)

    def _bent(self, ends: Floats, factors: Floats, pushes: "_Pushes") -> tuple[Floats, Floats]:
        """Take one step towards equilibrium, with the contact at `ends`.

        Returns the rows of `_balanced`, and the polynomials, by load.
        """
        part, weight, terms, before_end, weighed = _quadrature()
        lengths = ends + pushes.depth_um
        headings = _headings(part * lengths - pushes.depth_um, pushes.chords)
        natural, at_end = headings[:-1], headings[-1]
        to_push, gives = at_end + pushes.rub - natural, -pushes.loads * (lengths * lengths)
        for _ in range(TURNS):
            factors = gives * (weighed @ np.cos(to_push + before_end @ factors))
        heading, contact = natural + terms @ factors, at_end + factors[0]
        pushed = contact + pushes.rub
        x = (weight @ np.cos(heading)) * lengths - pushes.depth_um
        y = (weight @ np.sin(heading)) * lengths
        along = x - pushes.radius_um * np.sin(contact)
        gone = pushes.sides * pushes.loads * np.sin(pushed)
        off = self.at_um - gone - along
        across = y + pushes.radius_um * np.cos(contact)
        return np.array([ends, contact, off, across, pushes.loads * np.cos(pushed)]), factors

    def _arc_at(self, ahead_um: float) -> float:
        return float(np.interp(ahead_um, self.ahead_um, self._arcs))

    def _places(self, along: Floats) -> tuple[Floats, Floats]:
        """Return places along the fibre; straight on beyond its end, and between the jaws."""
        arcs = self._arcs
        over = np.maximum(along - arcs[-1], 0.0)
        last = self.ahead_um[-1] - self.ahead_um[-2], self.aside_um[-1] - self.aside_um[-2]
        step = arcs[-1] - arcs[-2]
        x = np.interp(along, arcs, self.ahead_um) + over * last[0] / step + np.minimum(along, 0.0)
        y = np.interp(along, arcs, self.aside_um) + over * last[1] / step
        return x, y

    def _chords(self) -> "_Chords":
        along = np.unique(np.concatenate([self._arcs - DIRECTION_UM, self._arcs + DIRECTION_UM]))
        return along, self._chord(along)

    def _chord(self, along: Floats) -> npt.NDArray[np.complex128]:
        before, after = self._places(along - DIRECTION_UM), self._places(along + DIRECTION_UM)
        return np.asarray((after[0] - before[0]) + 1j * (after[1] - before[1]))


_Chords = tuple[Floats, npt.NDArray[np.complex128]]
"""Places along a fibre between which its chords change evenly, and the chords there.

A chord goes over `DIRECTION_UM` to both sides, ahead and i times aside.
"""


def _headings(along: Floats, chords: _Chords) -> Floats:
    chord = np.interp(along, *chords)
    return np.asarray(np.arctan2(chord.imag, chord.real))
