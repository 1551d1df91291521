"""Where round edges that push curled fibres stand in balance: a weak form, by Ritz' method.

A probe without friction pushes along the fibre's normal at the contact. The turning of the fibre
against its natural shape is sought as a polynomial of the length; for each force it makes the
virtual work of bending and of the push equal. All loads on all fibres are sought together.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats, Mask

TERMS: Final = 7
"""Of the polynomial; the turning is nothing at the clamp."""

POINTS: Final = 20
LOADS: Final = 40
HEAVIEST: Final = 1.3
"""Load in units of EI/lever^2; the deflection reaches 0.4 of the lever."""

FRICTION_SIGNS: Final = (1.0, 0.0, -1.0)
"""Of the friction there may be: what equilibria are sought with."""

ROUNDS: Final = 40
MET_PART: Final = 1e-6
"""Of the lever: how near the contact must come to the probe."""

STILL_PART: Final = 1e-12
"""Of the lever, and of 1 rad: what moves less is in balance; more rounds would only round it."""

LONGEST_STEP_UM: Final = 20.0
LEAST_COS: Final = 0.2
TURNS: Final = 3

Chords = tuple[Floats, npt.NDArray[np.complex128]]
"""Places along a fibre between which its chords change evenly, and the chords there.

A chord joins the places as far before as behind, ahead and i times aside; it tells the direction.
"""


@dataclass(frozen=True, slots=True, eq=False)
class PushedFibre:
    """A fibre and where probes push it.

    Attributes
    ----------
    at_um, arc_um : float
        Where the middle of the probe is, along the jaws, and where that is along the fibre.
    gives_um3 : sequence of float
        How far each probe gives way along the jaws for a force along them that is EI times 1/um2.
    """

    chords: Chords
    at_um: float
    arc_um: float
    lever_um: float
    gives_um3: Sequence[float]


@dataclass(frozen=True, slots=True, eq=False)
class Balance:
    """Equilibria of pushed fibres.

    Attributes
    ----------
    ends_um, contact_rad, off_um, across_um, pushed : ndarray, shape (fibres, probes, 3, LOADS)
        The length up to the contact, the direction there, how far ahead of the contact the probe
        is, its place across, and the force across over EI (1/um2); with friction one way, without
        any, and the other way.
    """

    ends_um: Floats
    contact_rad: Floats
    off_um: Floats
    across_um: Floats
    pushed: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Pushes:
    """Loads one by one, those on a fibre side by side.

    Attributes
    ----------
    fibre : ndarray, shape (n,), int
        Which it is on.
    given : ndarray, shape (5, n), float64
        Place of the probe (um), lever (um), force over EI (1/um2), its angle by friction (rad), and
        how far the probe gives way along the jaws (um3).
    """

    chords: Sequence[Chords]
    fibre: npt.NDArray[np.intp]
    given: Floats

    def of(self, chosen: Mask) -> "_Pushes":
        return _Pushes(self.chords, self.fibre[chosen], self.given[:, chosen])

    def headings(self, along: Floats) -> Floats:
        """Return natural directions at places along the fibres, shape (places, n)."""
        bounds = np.searchsorted(self.fibre, range(len(self.chords) + 1))
        parts = zip(self.chords, bounds[:-1], bounds[1:], strict=True)
        chords = [np.interp(along[:, begin:end], *each) for each, begin, end in parts]
        chord = np.concatenate(chords, axis=1)
        return np.asarray(np.arctan2(chord.imag, chord.real))


@cache
def _quadrature() -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return points of the unit length and its end, their weights, and what each term turns there.

    That once as it is, once as what is left of it until the end, and once weighed.

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


def balanced(
    fibres: Sequence[PushedFibre], *, friction: float, depth_um: float, radius_um: float
) -> Balance:
    """Return the equilibria of fibres, each pushed by as many probes one after the other.

    Parameters
    ----------
    friction : float
        Part of the normal force that acts along the fibre.
    depth_um : float
        How far inside the jaws' tip fibres are clamped.
    radius_um : float
        Of the probe's edge and half the fibre together.
    """
    pushes, starts, shape = _pushes(fibres, friction)
    count = len(starts)
    found, rows = np.zeros((5, count)), np.zeros((5, count))
    rows[0] = starts
    factors, moving = np.zeros((TERMS, count)), np.arange(count)
    for _ in range(ROUNDS):
        ends, contact, off, _, _ = rows
        steps = off / np.maximum(np.cos(contact), LEAST_COS)
        ends = ends + np.minimum(np.maximum(steps, -LONGEST_STEP_UM), LONGEST_STEP_UM)
        rows, turned = _bent(ends, factors, pushes, depth_um, radius_um)
        found[:, moving] = rows
        away, turns = np.abs(rows[2]), np.abs(turned - factors).max(axis=0)
        # Each probe is tried until all its loads are met, or none of the rest moves any more.
        probes, lever = moving // (len(FRICTION_SIGNS) * LOADS), pushes.given[1]
        unmet = np.bincount(probes[away >= MET_PART * lever], minlength=count) > 0
        on = unmet[probes] & ((away >= STILL_PART * lever) | (turns >= STILL_PART))
        factors = turned
        if not on.all():
            rows, factors, moving, pushes = rows[:, on], factors[:, on], moving[on], pushes.of(on)
        if not len(moving):
            break
    return Balance(*found.reshape(5, *shape))


def _pushes(
    fibres: Sequence[PushedFibre], friction: float
) -> tuple[_Pushes, Floats, tuple[int, ...]]:
    """Return all loads, where their contacts are sought first, and the shape of `Balance`."""
    gives = np.array([each.gives_um3 for each in fibres], dtype=np.float64)[:, :, None, None]
    shape = (*gives.shape[:2], len(FRICTION_SIGNS), LOADS)

    def spread(values: Floats) -> Floats:
        return np.broadcast_to(values, shape).ravel()

    def of_fibres(values: Sequence[float]) -> Floats:
        return np.array(values)[:, None, None, None]

    levers = of_fibres([each.lever_um for each in fibres])
    loads = np.linspace(0.0, 1.0, LOADS) ** 1.5 * (HEAVIEST / levers**2)
    rub = math.atan(friction) * np.array(FRICTION_SIGNS)[:, None]
    places = of_fibres([each.at_um for each in fibres])
    given = np.array([spread(each) for each in (places, levers, loads, rub, gives)])
    fibre = np.repeat(np.arange(len(fibres)), given.shape[1] // len(fibres))
    starts = spread(of_fibres([each.arc_um for each in fibres]))
    return _Pushes([each.chords for each in fibres], fibre, given), starts, shape


def _bent(
    ends: Floats, factors: Floats, pushes: _Pushes, depth_um: float, radius_um: float
) -> tuple[Floats, Floats]:
    """Take one step towards equilibrium, with the contacts at `ends`.

    Returns what is in `Balance`, a row for each, and the polynomials, by load.
    """
    part, weight, terms, before_end, weighed = _quadrature()
    at_um, _, loads, rub, gives = pushes.given
    lengths = ends + depth_um
    headings = pushes.headings(part * lengths - depth_um)
    natural, at_end = headings[:-1], headings[-1]
    to_push, bends = at_end + rub - natural, -loads * (lengths * lengths)
    for _ in range(TURNS):
        factors = bends * (weighed @ np.cos(to_push + before_end @ factors))
    heading, contact = natural + terms @ factors, at_end + factors[0]
    pushed = contact + rub
    x = (weight @ np.cos(heading)) * lengths - depth_um
    y = (weight @ np.sin(heading)) * lengths
    off = at_um - gives * loads * np.sin(pushed) - (x - radius_um * np.sin(contact))
    across = y + radius_um * np.cos(contact)
    return np.array([ends, contact, off, across, loads * np.cos(pushed)]), factors
