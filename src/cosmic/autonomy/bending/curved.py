"""How a curled fibre gives way to a round edge that pushes it.

Force over deflection follows from the equilibria under many loads. The slope of the curve at its
begin is known in closed form: with b the natural slope at the contact, and X and Y the distances
of an element from it, 1/k = 1/(EI cos^2 b) times the integral of (X cos b + Y sin b)^2 over the
length.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.autonomy.bending.balance import FRICTION_SIGNS, LOADS, PushedFibre, balanced
from cosmic.autonomy.bending.friction import (
    Branches,
    Contact,
    pushed_out_and_back,
    slid_out_and_back,
)
from cosmic.autonomy.bending.result import BendingError
from cosmic.frame.arrays import Floats, Mask

DIRECTION_UM: Final = 40.0
"""Length to both sides of a place over which its direction is taken."""

MET_ENOUGH_PART: Final = 1e-3
"""Of the lever: where the contact stays farther from the probe, the fibre slides off."""

LEAST_SQUARE: Final = 0.2
"""Of what friction leaves of a push: with less the fibre is hardly pushed at all."""


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
            raise BendingError("the fibre's shape holds values that are not numbers")
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
        return float(np.angle(self._chords(np.array([self._arc_at(self.at_um)])))[0])

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

    def by_friction_both(
        self, friction: float, *, depth_um: float, turned_rad: float = 0.0
    ) -> float:
        """Return how ln(k) changes with friction on the way out and back alike.

        With a friction f, 1/k grows as the integral of a (a + f c) / (1 - f tan b), a and c the
        arms of normal force and friction over cos b; f has the opposite sign on the way back, and
        the mean of both is no straight line of it.

        Parameters
        ----------
        turned_rad : float
            By how much the push has turned the fibre away at the contact.
        """
        along, _ = self._arms
        slope = math.tan(self.slope_rad - turned_rad)
        x, y = self.places_um(along)
        arms = (x[-1] - x) + (y[-1] - y) * slope
        rubbed = (x[-1] - x) * slope - (y[-1] - y)
        # Between the jaws the fibre is straight.
        along = np.append(-depth_um, along)
        arms = np.append(arms[0] + depth_um, arms)
        rubbed = np.append(rubbed[0] + depth_um * slope, rubbed)
        ratio = _integral(along, arms, rubbed) / _integral(along, arms, arms)
        return sum(
            sign * friction * part**2 / max(1.0 - (friction * part) ** 2, LEAST_SQUARE)
            for sign, part in ((-1.0, slope), (1.0, ratio))
        )

    @cached_property
    def _arms(self) -> tuple[Floats, Floats]:
        end = self._arc_at(self.at_um)
        along = np.unique(np.concatenate([[0.0], self._arcs[self._arcs < end], [end]]))
        x, y = self.places_um(along)
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

        The contact sticks before it slides; it turns back where the curve ends.

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
        ((both,),) = curves_of(
            [(self, (ei_un_um2 * side_um_un,))],
            depth_um=depth_um,
            radius_um=radius_um,
            friction=friction,
        )
        return both

    def pushed_by(self, gives_um3: Sequence[float], depth_um: float) -> PushedFibre:
        """Return what its equilibria follow from; see `PushedFibre`."""
        along = np.unique(np.concatenate([self._arcs - DIRECTION_UM, self._arcs + DIRECTION_UM]))
        return PushedFibre(
            chords=(along, self._chords(along)),
            at_um=self.at_um,
            arc_um=self._arc_at(self.at_um),
            lever_um=self.lever_um(depth_um),
            gives_um3=gives_um3,
        )

    def _arc_at(self, ahead_um: float) -> float:
        return float(np.interp(ahead_um, self.ahead_um, self._arcs))

    def places_um(self, along: Floats) -> tuple[Floats, Floats]:
        """Return where places along the fibre lie, from the jaws' tip: ahead and aside.

        Straight on beyond its end, and between the jaws.
        """
        arcs = self._arcs
        over = np.maximum(along - arcs[-1], 0.0)
        last = self.ahead_um[-1] - self.ahead_um[-2], self.aside_um[-1] - self.aside_um[-2]
        step = arcs[-1] - arcs[-2]
        x = np.interp(along, arcs, self.ahead_um) + over * last[0] / step + np.minimum(along, 0.0)
        y = np.interp(along, arcs, self.aside_um) + over * last[1] / step
        return x, y

    def _chords(self, along: Floats) -> npt.NDArray[np.complex128]:
        before, after = self.places_um(along - DIRECTION_UM), self.places_um(along + DIRECTION_UM)
        return np.asarray((after[0] - before[0]) + 1j * (after[1] - before[1]))


def _integral(along: Floats, one: Floats, other: Floats) -> float:
    """Return the integral of a product of two that are straight between places."""
    mixed = 2.0 * (one[:-1] * other[:-1] + one[1:] * other[1:])
    mixed += one[:-1] * other[1:] + one[1:] * other[:-1]
    return float((mixed * np.diff(along)).sum()) / 6.0


OutAndBack = tuple[PushedCurve, PushedCurve]
"""Of the way out and the way back."""

Curves = tuple[tuple[OutAndBack, ...], ...]
"""By span and probe."""


@dataclass(frozen=True, slots=True, eq=False)
class Rubbed:
    """Several spans, each pushed by several probes, with all friction there may be.

    Attributes
    ----------
    contacts : tuple of Contact
        Of each span and probe, probe by probe; force over EI (1/um2).
    levers_um : tuple of float
        Of each span and probe.
    probes : int
        Of each span.
    """

    contacts: tuple[Contact, ...]
    levers_um: tuple[float, ...]
    probes: int

    def curves(
        self, tops_um: Sequence[float] | None = None, *, parts: Sequence[float] = (1.0,)
    ) -> tuple[Curves, ...]:
        """Return force over deflection out and back, for parts of the friction there may be.

        Parameters
        ----------
        tops_um : sequence of float, optional
            Travel at which each span turns back; where its curve ends if None.
        parts : sequence of float
            Of the friction that the equilibria were sought with.
        """
        tops = self._tops(tops_um)
        contacts = [each.with_top(top) for each, top in zip(self.contacts, tops, strict=True)]
        branches = pushed_out_and_back(contacts, tops, parts)
        return tuple(self._by_span(contacts, each) for each in branches)

    def sliding(
        self, tops_um: Sequence[float], *, parts: Sequence[float] = (1.0,)
    ) -> tuple[Curves, ...]:
        """Return what `curves` does for contacts that never stick."""
        tops = self._tops(tops_um)
        each = list(zip(self.contacts, tops, strict=True))
        return tuple(
            self._by_span(
                self.contacts, [slid_out_and_back(contact, top, part) for contact, top in each]
            )
            for part in parts
        )

    def _tops(self, tops_um: Sequence[float] | None) -> list[float]:
        ends = [float(each.travel_um[-1]) for each in self.contacts]
        if tops_um is None:
            return ends
        # What was hardly pushed turns back at the first place after the contact.
        begins = [float(each.travel_um[1]) for each in self.contacts]
        tops = np.repeat(np.asarray(tops_um, dtype=np.float64), self.probes)
        return [
            min(max(top, begin), end)
            for top, begin, end in zip(tops.tolist(), begins, ends, strict=True)
        ]

    def _by_span(self, contacts: Sequence[Contact], branches: Sequence[Branches]) -> Curves:
        every = zip(contacts, self.levers_um, branches, strict=True)
        found = [
            _curves(each.travel_um / lever, lever, out_back) for each, lever, out_back in every
        ]
        return tuple(tuple(found[n : n + self.probes]) for n in range(0, len(found), self.probes))


def _curves(deflection: Floats, lever_um: float, branches: Branches) -> OutAndBack:
    out, back = (PushedCurve(deflection, each * lever_um**2 / 3.0) for each in branches)
    return out, back


def curves_of(
    pushes: Sequence[tuple[NaturalShape, Sequence[float]]],
    *,
    depth_um: float,
    radius_um: float,
    friction: float,
) -> Curves:
    """Return what `NaturalShape.curves` does, for several shapes, each pushed by several probes.

    Parameters
    ----------
    pushes : sequence of (NaturalShape, sequence of float)
        See `rubbed_of`.
    """
    if not pushes:
        return ()
    found = rubbed_of(pushes, depth_um=depth_um, radius_um=radius_um, friction=friction)
    return found.curves()[0]


def rubbed_of(
    pushes: Sequence[tuple[NaturalShape, Sequence[float]]],
    *,
    depth_um: float,
    radius_um: float,
    friction: float,
) -> Rubbed:
    """Return what several shapes answer to several probes each, with friction and without.

    Parameters
    ----------
    pushes : sequence of (NaturalShape, sequence of float)
        With how far each probe gives way along the jaws for a force of EI times 1/um2, um3; as many
        probes for each shape. At least one shape.

    Raises
    ------
    BendingError
        A fibre slides off.
    """
    fibres = [shape.pushed_by(gives, depth_um) for shape, gives in pushes]
    found = balanced(fibres, friction=friction, depth_um=depth_um, radius_um=radius_um)
    slid = found.ends_um - radius_um * found.contact_rad
    probes = len(pushes[0][1])
    contacts = []
    for fibre, probe in np.ndindex(len(fibres), probes):
        here, lever = (fibre, probe), fibres[fibre].lever_um
        met = np.abs(found.off_um[here]) < MET_ENOUGH_PART * lever
        contacts.append(
            _contact(pushes[fibre][0], found.across_um[here], found.pushed[here], slid[here], met)
        )
    levers = tuple(each.lever_um for each in fibres for _ in range(probes))
    return Rubbed(tuple(contacts), levers, probes)


def _contact(
    shape: NaturalShape, across_um: Floats, pushed: Floats, slid_um: Floats, met: Mask
) -> Contact:
    """Return equilibria by the travel, from those by the load; rows by friction."""
    travel = across_um[:, :1] - across_um
    good = met.copy()
    good[:, 1:] &= (np.diff(travel) > 0.0) & (np.diff(pushed) > 0.0)
    ends = np.where(good.all(axis=1), LOADS, good.argmin(axis=1))
    if ends.min() < 3:
        raise BendingError(
            f"the fibre lies at {math.degrees(shape.slope_rad):.0f} deg to the jaws at the "
            "probe: it slides off instead of bending; push it nearer to the jaws"
        )
    without = FRICTION_SIGNS.index(0.0)
    # At the equilibria without friction themselves, for between them curves are straight lines,
    # and as many places for each fibre.
    nodes = travel[without, : ends[without]]
    more = np.linspace(0.0, nodes[-1], LOADS - len(nodes) + 2)[1:-1]
    at = np.sort(np.concatenate([nodes, more]))
    rows = [
        (_straight_on(at, gone[:end], force[:end]), _straight_on(at, gone[:end], slide[:end]))
        for gone, force, slide, end in zip(travel, pushed, slid_um, ends, strict=True)
    ]
    return Contact(at, np.array([each[0] for each in rows]), np.array([each[1] for each in rows]))


def _straight_on(at: Floats, nodes: Floats, values: Floats) -> Floats:
    """Return values between nodes, and beyond the last as between the last two."""
    over = np.maximum(at - nodes[-1], 0.0)
    slope = (values[-1] - values[-2]) / (nodes[-1] - nodes[-2])
    return np.asarray(np.interp(at, nodes, values) + over * slope)
