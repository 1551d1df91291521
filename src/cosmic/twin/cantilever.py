"""A fibre held at one end and pushed by a round edge: planar equilibrium, solved by shooting.

The fibre is a rod that neither stretches nor shears, with a shape of its own and a bending
stiffness that may vary along it. Where the probe touches there is no moment, and the force stands
on the fibre there, turned aside by friction. From such a contact the equilibrium is integrated
back to the clamp; the heading at the contact is sought with which the clamp is met. This is done
once for a grasp, for many places of contact and loads together, and a push reads the table.

Units that fit together without factors: um, uN, uN um2 for a stiffness, uN/um for a spring.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats
from cosmic.twin.rod import PushCurve

CELLS: Final = 40
"""Pieces of fibre between contact and clamp."""

PLACES: Final = 34
LOADS: Final = 36
HEAVIEST: Final = 2.6
"""Load in units of EI/length^2, which turns a straight fibre by about one radian."""

STEEPEST_RAD: Final = 1.15
"""Heading at the contact up to which a curve is laid out."""

RIGID_UN_UM: Final = 1e6
HARDEST_UN: Final = 1500.0
"""Beyond any sensor's range; more is not laid out where tools give way."""

SHORTEST_UM: Final = 4.0
ROUNDS: Final = 7
NUDGE_RAD: Final = 1e-5
SHORTEST_STEP_RAD: Final = 1e-9
MET_RAD: Final = 1e-7
BEYOND: Final = 1.9
"""So much longer the fibre is laid out, straight on, so that its end is found between places."""


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """What a push meets, by load (rows) and place of the probe (columns), without units.

    Deflection is a part of the length, forces are in EI/length^2, the arc from the jaws' tip to the
    contact, and what of it slides, are parts of the length; length counts from the clamp to the
    probe.
    """

    log_lengths: Floats
    deflections: Floats
    forces: Floats
    alongs: Floats
    arcs: Floats
    slids: Floats


class Cantilever:
    """What a held fibre does to a probe; any thread.

    Parameters
    ----------
    abscissas_um, asides_um : ndarray, shape (n,), float64
        Natural shape outside the jaws, from their tip, which it leaves along the jaws: along them,
        and across, positive towards the probe.
    ei_un_um2 : float
        Bending stiffness.
    depth_um : float
        How far inside the jaws' tip it is clamped.
    radius_um : float
        Of the probe's edge and half the fibre together.
    friction : float
        Part of the normal force that acts along the fibre at the contact; positive pulls the
        fibre outwards.
    turn_rad_un_um : float
        By how much the clamp turns under a moment.
    side_un_um : float
        Stiffness of the jaws across; inf: rigid.
    probe_un_um : float
        Stiffness of the probe along the jaws; inf: rigid.
    stiffness : callable, optional
        Arc lengths from the jaws' tip to bending stiffness as a part of `ei_un_um2`.
    """

    def __init__(
        self,
        abscissas_um: Floats,
        asides_um: Floats,
        *,
        ei_un_um2: float,
        depth_um: float,
        radius_um: float,
        friction: float = 0.0,
        turn_rad_un_um: float = 0.0,
        side_un_um: float = math.inf,
        probe_un_um: float = math.inf,
        stiffness: Callable[[Floats], Floats] | None = None,
    ) -> None:
        self._ei, self._depth, self._radius = ei_un_um2, depth_um, radius_um
        self._friction, self._turn, self._side = friction, turn_rad_un_um, side_un_um
        self._probe = probe_un_um
        self._stiffness = stiffness
        steps = np.hypot(np.diff(abscissas_um), np.diff(asides_um))
        self._free_um = float(steps.sum())
        last = np.array([abscissas_um[-1] - abscissas_um[-2], asides_um[-1] - asides_um[-2]])
        end = last / steps[-1] * (BEYOND - 1.0) * self._free_um
        self._x = np.concatenate([[-depth_um], abscissas_um, [abscissas_um[-1] + end[0]]])
        self._y = np.concatenate([[0.0], asides_um, [asides_um[-1] + end[1]]])
        along = np.concatenate([[0.0], np.cumsum(steps)])
        self._s = np.concatenate([[-depth_um], along, [BEYOND * self._free_um]])
        none = np.zeros(1)
        self._asked: tuple[float, tuple[Floats, ...]] = math.nan, (none, none, none, none)

    def curve(self, abscissa_um: float, *, sensor_un_um: float, stiffer: float = 1.0) -> PushCurve:
        """Return force over travel of a probe whose middle stands at an abscissa from the tip.

        Parameters
        ----------
        sensor_un_um : float
            Stiffness of the sensor behind the probe, which takes its part of the travel.
        stiffer : float
            So many times as stiff the fibre itself bends: something else holds it besides.
        """
        asked_um, found = self._asked
        if abscissa_um != asked_um:  # a fibre asks for one place several times
            found = self._met(abscissa_um)
            self._asked = abscissa_um, found
        deflections, forces, alongs, slids = found
        deflections = deflections + (stiffer - 1.0) * forces / self._side
        return PushCurve(deflections, stiffer * forces, sensor_un_um, stiffer * alongs, slids)

    def _met(self, abscissa_um: float) -> tuple[Floats, ...]:
        """Return deflections, forces across and along, and where it touches, load by load."""
        table = self._table
        length = max(abscissa_um + self._depth, math.exp(table.log_lengths[0]))
        weights, columns = _between(table.log_lengths, math.log(length))
        deflections = table.deflections[:, columns] @ weights * length
        forces = table.forces[:, columns] @ weights * (self._ei / length**2)
        alongs = table.alongs[:, columns] @ weights * (self._ei / length**2)
        arcs = table.arcs[:, columns] @ weights * length
        slids = table.slids[:, columns] @ weights * length
        last = _last(deflections, forces, arcs, self._free_um)
        if last < len(arcs) and last > 0 and arcs[last - 1] < self._free_um < arcs[last]:
            # It slides off on its way to the next load.
            part = (self._free_um - arcs[last - 1]) / (arcs[last] - arcs[last - 1])
            for values in (deflections, forces, alongs, slids):
                values[last] = values[last - 1] + part * (values[last] - values[last - 1])
            last += 1
        last = max(last, 1)
        deflections[0] = forces[0] = alongs[0] = 0.0
        return deflections[:last], forces[:last], alongs[:last], slids[:last]

    @cached_property
    def _table(self) -> _Table:
        places = np.geomspace(SHORTEST_UM, BEYOND * self._free_um, PLACES)
        loads = HEAVIEST * np.linspace(0.0, 1.0, LOADS) ** 1.5
        pushed = self._shoot(places, loads)
        lengths = np.geomspace(
            SHORTEST_UM + self._depth, float(np.max(pushed.x[0])) + self._depth, PLACES
        )
        rows = [self._row(pushed, number, np.log(lengths)) for number in range(LOADS)]
        y, forces, alongs, arcs, slids = (np.array(each) for each in zip(*rows, strict=True))
        deflections = (y[0] - y) / lengths
        return _Table(np.log(lengths), deflections, forces, alongs, arcs / lengths, slids / lengths)

    def _row(self, pushed: "_Pushed", number: int, wanted: Floats) -> tuple[Floats, ...]:
        """Return height, forces, arc and what slides of one load; nan where there is none."""
        good = pushed.met[number]
        x = pushed.x[number] + self._depth
        # Pushed so hard near the clamp, a probe that gives way along the fibre may stand behind it.
        run = _longest_rise(x, good & (x > 0.0))
        if run.stop - run.start < 4:
            return tuple(np.full((5, len(wanted)), math.nan))
        x = x[run]
        logs = np.log(x)
        length = np.exp(wanted)
        out = (wanted < logs[0] - 0.2) | (wanted > logs[-1] + 1e-9)
        known = np.stack(
            [
                pushed.y[number, run],
                pushed.force[number, run] * x**2,
                pushed.along[number, run] * x**2,
                pushed.arcs[run] / x,
                pushed.slids[number, run] / x,
            ]
        )
        y, force, along, arc, slid = _smooth(logs, known, wanted)
        values = y, force / self._ei, along / self._ei, arc * length, slid * length
        return tuple(np.where(out, math.nan, each) for each in values)

    def _shoot(self, places: Floats, loads: Floats) -> "_Pushed":
        """Solve for all places of contact along the fibre and all loads."""
        lengths = places + self._depth
        normal = loads[:, None] * (self._ei / lengths**2)
        if self._probe < RIGID_UN_UM or self._turn:
            # Short pieces bear more than any probe does, and a soft one would give way by more
            # than they are long.
            normal = normal / (1.0 + normal / HARDEST_UN)
        nodes = np.linspace(places, np.full_like(places, -self._depth), CELLS + 1)
        x, y = np.interp(nodes, self._s, self._x), np.interp(nodes, self._s, self._y)
        chords = x[:-1] - x[1:], y[:-1] - y[1:]
        heading = self._headings(places)
        bends = (nodes[:-1] - nodes[1:]) / self._ei
        if self._stiffness is not None:
            bends = bends / self._stiffness(np.maximum(0.5 * (nodes[:-1] + nodes[1:]), 0.0))
        turn = -0.5 * loads[:, None] * np.ones_like(places)
        open_ = np.arange(turn.size)
        for _ in range(ROUNDS):
            row, place = np.divmod(open_, len(places))
            at = row, place
            both = np.stack([turn[at], turn[at] + NUDGE_RAD])
            there = chords[0][:, place], chords[1][:, place]
            missed, *_ = self._back(both, normal[at], heading[place], there, bends[:, place])
            slope = (missed[1] - missed[0]) / NUDGE_RAD
            step = missed[0] / np.where(np.abs(slope) > 1e-3, slope, 1.0)
            turn[at] -= np.clip(step, -0.5, 0.5)
            # Where a step is this short the next would be nothing but rounding.
            open_ = open_[np.abs(step) > SHORTEST_STEP_RAD]
        missed, px, py, felt = self._back(turn[None], normal, heading, chords, bends)
        theta = heading + turn
        along = -normal * (np.sin(theta) + self._friction * np.cos(theta))
        return _Pushed(
            x=px[0] - self._depth - self._radius * np.sin(theta) - along / self._probe,
            y=py[0] + self._radius * np.cos(theta) - felt[0] / self._side,
            force=felt[0],
            along=along,
            arcs=places,
            # An edge that rolls does not slide; how the probe gives way is added with the force.
            slids=places - self._radius * theta - along / self._probe,
            met=(np.abs(missed[0]) < MET_RAD) & (np.abs(theta) < STEEPEST_RAD),
        )

    def _back(
        self,
        turn: Floats,
        normal: Floats,
        heading: Floats,
        chords: tuple[Floats, Floats],
        bends: Floats,
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Go from the contact back to the clamp; return by how much its heading is missed.

        Also the way from clamp to contact, x and y, and the force across that the probe feels.
        """
        theta = heading + turn
        sin, cos = np.sin(theta), np.cos(theta)
        fx, fy = normal * (sin + self._friction * cos), normal * (self._friction * sin - cos)
        px, py = np.zeros_like(turn), np.zeros_like(turn)
        angle = turn
        for dx, dy, bend in zip(*chords, bends, strict=True):
            half = angle - 0.5 * bend * (px * fy - py * fx)
            sin, cos = np.sin(half), np.cos(half)
            sx, sy = dx * cos - dy * sin, dx * sin + dy * cos
            angle = angle - bend * ((px + 0.5 * sx) * fy - (py + 0.5 * sy) * fx)
            px, py = px + sx, py + sy
        return angle - self._turn * (px * fy - py * fx), px, py, -fy

    def _headings(self, places: Floats) -> Floats:
        """Return the natural direction at places along the fibre."""
        x = np.interp([places - 1.0, places + 1.0], self._s, self._x)
        y = np.interp([places - 1.0, places + 1.0], self._s, self._y)
        return np.asarray(np.arctan2(y[1] - y[0], x[1] - x[0]))


@dataclass(frozen=True, slots=True, eq=False)
class _Pushed:
    """Where the probe's holder is, um from the jaws' tip, and forces, uN; by load and place."""

    x: Floats
    y: Floats
    force: Floats
    along: Floats
    arcs: Floats
    slids: Floats
    met: npt.NDArray[np.bool_]


def _longest_rise(x: Floats, good: npt.NDArray[np.bool_]) -> slice:
    """Return the longest run of places that are good and lie one after the other."""
    follows = good[1:] & good[:-1] & (np.diff(x) > 0.0)
    edges = np.concatenate([[0], np.flatnonzero(~follows) + 1, [len(x)]])
    longest = int(np.diff(edges).argmax())
    return slice(int(edges[longest]), int(edges[longest + 1]))


def _last(deflections: Floats, forces: Floats, arcs: Floats, free_um: float) -> int:
    """Return how many loads can be followed: on the fibre, and with a force that still grows."""
    good = np.isfinite(deflections) & np.isfinite(forces) & (arcs <= free_um)
    good[1:] &= np.diff(deflections) > 0.0
    return len(good) if good.all() else int(good.argmin())


def _between(nodes: Floats, at: float) -> tuple[Floats, npt.NDArray[np.intp]]:
    """Return Lagrange's weights of the four nodes around a place, and their numbers."""
    begin = int(np.searchsorted(nodes, at)) - 2
    numbers = min(max(begin, 0), len(nodes) - 4) + np.arange(4)
    x = nodes[numbers]
    weights = np.array(
        [math.prod((at - x[k]) / (x[n] - x[k]) for k in range(4) if k != n) for n in range(4)]
    )
    return weights, numbers


def _smooth(nodes: Floats, values: Floats, wanted: Floats) -> Floats:
    """Return rows of values between nodes by a cubic through the four around each place."""
    first = np.clip(np.searchsorted(nodes, wanted) - 2, 0, len(nodes) - 4)
    numbers = first + np.arange(4)[:, None]
    x, found = nodes[numbers], np.zeros((len(values), len(wanted)))
    for n in range(4):
        weight = np.ones_like(wanted)
        for k in range(4):
            if k != n:
                weight = weight * (wanted - x[k]) / (x[n] - x[k])
        found += weight * values[:, numbers[n]]
    return found
