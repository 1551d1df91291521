"""How a curled fibre gives way to a round edge that pushes it: a weak form, by Ritz' method.

A probe without friction pushes along the fibre's normal at the contact. The turning of the fibre
against its natural shape is sought as a polynomial of the length; for each force it makes the
virtual work of bending and of the push equal. The slope of the curve at its begin is known in
closed form: with b the natural slope at the contact, and X and Y the distances of an element from
it, 1/k = 1/(EI cos^2 b) times the integral of (X cos b + Y sin b)^2 over the length.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from cosmic.autonomy.bending.result import BendingError, Floats

POWERS: Final = np.arange(1, 8)
"""Of the length, in the polynomial; the turning is nothing at the clamp."""

POINTS: Final = 24
LOADS: Final = 30
HEAVIEST: Final = 1.3
"""Load in units of EI/lever^2; the deflection reaches 0.4 of the lever."""

ROUNDS: Final = 12
TURNS: Final = 14
NUDGE: Final = 1e-5
DIRECTION_UM: Final = 40.0
"""Length to both sides of a place over which its direction is taken."""


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

    @property
    def slope_rad(self) -> float:
        """Natural direction at the probe, positive where the fibre runs towards it."""
        return float(self._headings(np.array([self._arc_at(self.at_um)]))[0])

    def lever_um(self, depth_um: float = 0.0) -> float:
        """Return the length of a straight fibre that gives way as much to a small push.

        Parameters
        ----------
        depth_um : float
            How far inside the jaws' tip it is clamped.
        """
        end, slope = self._arc_at(self.at_um), self.slope_rad
        along = np.unique(np.concatenate([[-depth_um, 0.0], self._arcs[self._arcs < end], [end]]))
        x, y = self._places(along)
        arms = (x[-1] - x) + (y[-1] - y) * math.tan(slope)
        first, second = arms[:-1], arms[1:]
        parts = (first * first + first * second + second * second) / 3.0 * np.diff(along)
        return float(np.cbrt(3.0 * parts.sum()))

    def curve(self, *, depth_um: float, radius_um: float) -> PushedCurve:
        """Return force over deflection for a round edge, counted from the first contact.

        Parameters
        ----------
        radius_um : float
            Of the probe's edge and half the fibre together.
        """
        lever = self.lever_um(depth_um)
        loads = np.linspace(0.0, 1.0, LOADS) ** 1.5 * (HEAVIEST / lever**2)
        ends = np.full(LOADS, self._arc_at(self.at_um))
        for _ in range(ROUNDS):
            x, _, _ = self._bent(ends, loads, depth_um, radius_um)
            later, _, _ = self._bent(ends + NUDGE * lever, loads, depth_um, radius_um)
            rise = (later - x) / (NUDGE * lever)
            ends = ends + np.clip(
                (self.at_um - x) / np.maximum(rise, 0.2), -0.1 * lever, 0.1 * lever
            )
        x, y, across = self._bent(ends, loads, depth_um, radius_um)
        deflection = y[0] - y
        good = np.abs(x - self.at_um) < 1e-3 * lever
        good[1:] &= (np.diff(deflection) > 0.0) & (np.diff(across) > 0.0)
        last = LOADS if good.all() else int(good.argmin())
        if last < 3:
            raise BendingError(
                f"the fibre lies at {math.degrees(self.slope_rad):.0f} deg to the jaws at the "
                "probe: it slides off instead of bending; push it nearer to the jaws"
            )
        return PushedCurve(deflection[:last] / lever, across[:last] * lever**2 / 3.0)

    def _bent(
        self, ends: Floats, loads: Floats, depth_um: float, radius_um: float
    ) -> tuple[Floats, Floats, Floats]:
        """Return the middle of the probe, x and y, and the force across over EI, by load."""
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        part, weight = 0.5 * (nodes + 1.0), 0.5 * weights
        lengths = (ends + depth_um)[:, None]
        natural = self._headings(lengths * part - depth_um)
        at_end = self._headings(ends)
        shapes = part[:, None] ** POWERS
        bending = POWERS[:, None] * POWERS / (POWERS[:, None] + POWERS - 1.0)
        given = np.linalg.inv(bending)
        factors = np.zeros((len(ends), len(POWERS)))
        for _ in range(TURNS):
            heading = natural + factors @ shapes.T
            contact = (at_end + factors.sum(axis=1))[:, None]
            work = (np.cos(contact - heading) * weight) @ shapes
            factors = -(loads[:, None] * lengths**2) * (work @ given)
        heading = natural + factors @ shapes.T
        contact = at_end + factors.sum(axis=1)
        x = (np.cos(heading) * weight).sum(axis=1) * lengths[:, 0] - depth_um
        y = (np.sin(heading) * weight).sum(axis=1) * lengths[:, 0]
        return (
            x - radius_um * np.sin(contact),
            y + radius_um * np.cos(contact),
            loads * np.cos(contact),
        )

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

    def _headings(self, along: Floats) -> Floats:
        before, after = self._places(along - DIRECTION_UM), self._places(along + DIRECTION_UM)
        return np.asarray(np.arctan2(after[1] - before[1], after[0] - before[0]))
