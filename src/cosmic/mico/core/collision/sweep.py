"""The pure gate: tells whether the volume that a movement can sweep is clear (thesis 6.1.2)."""

from collections.abc import Mapping, Set
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.mico.core.collision.answer import INSIDE_TEXT, Approach, SweepAnswer
from cosmic.mico.core.collision.arrangement import Arrangement, Turned
from cosmic.mico.core.collision.checker import Spans
from cosmic.mico.core.collision.fcl_pieces import ConvexPiece, gap_along, overlaps, separation
from cosmic.mico.core.collision.model import BodyPair, Floats, SceneModel
from cosmic.mico.core.collision.motion_box import (
    MotionBox,
    SpanError,
    axis_positions,
    make_box,
)
from cosmic.mico.core.collision.sliding import Slide, guess_holds, leaves, smallest_gap
from cosmic.mico.core.collision.turning import Turn, TurningPairs

_Numbers = npt.NDArray[np.intp]
_ACROSS: Final = 1e-6
"""A joint that moves less than this along a direction does not move along it."""
_BEYOND_UM: Final = 0.01
_MOST_CONCERNS: Final = 32
"""So many sets of moving joints are remembered; eleven axes have 2048, of 200 to 500 kB each."""


@dataclass(frozen=True, eq=False)
class _Concern:
    """The pairs that some joints bring nearer to each other, or apart; one row a pair."""

    rows: _Numbers
    first: _Numbers
    second: _Numbers
    margin: Floats
    reach: Floats


@dataclass(frozen=True, eq=False)
class _Stand:
    """All pieces with the joints somewhere, and the boxes round them."""

    rotations: list[Floats]
    places: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True, eq=False)
class _Inside:
    """Two bodies that begin closer than their margin.

    Attributes
    ----------
    rows : list of int
        All pairs of their pieces.
    gaps : mapping of float
        Gap of those that are near each other, um.
    sure : bool
        False where one of them is only believed to stand there.
    """

    rows: list[int]
    gaps: Mapping[int, float]
    nearest: int
    sure: bool


class Sweep:
    """Decides movements on the convex pieces of a scene; pure, but one thread at a time.

    The unit of a check is a joint box: all axes anywhere in their intervals, in any order. What
    is called clear is proved from the vertices of the pieces. What is called not clear has been
    seen closer than the margin at a pose inside the box, but for turning pieces, which are given
    up when a part of the box that moves them by less than 1 um is not proved free.
    """

    def __init__(self, model: SceneModel) -> None:
        self.model = model
        self._arrangement = Arrangement(model)
        self._pieces = [ConvexPiece(shape) for shape in model.pieces]
        self._turning = TurningPairs(self._arrangement, self._pieces)
        self._body = np.array([model.body_number[piece.body] for piece in model.pieces], np.intp)
        self._list_pairs()
        self._concerns: dict[bytes, _Concern] = {}
        self._normals: dict[int, Floats] = {}
        self._late = np.flatnonzero(~self._arrangement.slides[self._body]).tolist()
        zero = self._arrangement.turned(np.zeros(len(model.joints)))
        boxes = [self._box(n, zero.rotations[body]) for n, body in enumerate(self._body)]
        low, high = np.array(boxes, float).reshape(-1, 2, 3).transpose(1, 0, 2).copy()
        self._corners = (zero, low, high)

    def _list_pairs(self) -> None:
        """Lay all watched pairs of pieces out as arrays."""
        of_body: dict[str, list[int]] = {}
        for number, piece in enumerate(self.model.pieces):
            of_body.setdefault(piece.body, []).append(number)
        rows = [
            (first, second, pair.margin_um, number)
            for number, pair in enumerate(self.model.pairs)
            for first in of_body.get(pair.bodies[0], ())
            for second in of_body.get(pair.bodies[1], ())
        ]
        self._first = np.array([row[0] for row in rows], np.intp)
        self._second = np.array([row[1] for row in rows], np.intp)
        self._margin = np.array([row[2] for row in rows], float)
        self._pair = np.array([row[3] for row in rows], np.intp)
        chains, arrangement = self._arrangement.chains, self._arrangement
        first_body, second_body = self._body[self._first], self._body[self._second]
        self._between = chains[first_body] ^ chains[second_body]
        self._relative = arrangement.shifts[second_body] - arrangement.shifts[first_body]

    # The question

    def check(self, spans: Spans, ignored: Set[BodyPair] = frozenset()) -> SweepAnswer:
        """Return whether every watched pair keeps its margin while the axes are in `spans`.

        Parameters
        ----------
        spans : mapping of AxisSpan
            By name of axis, in the unit of the axis; those not named may be anywhere.
        ignored : set of pairs of names
            Pairs of bodies not looked at this time.
        """
        try:
            box = make_box(self.model, spans)
        except SpanError as exc:
            return SweepAnswer(clear=False, reason=str(exc))
        centre = box.centre
        stand = self._stand(centre)
        retreating: set[int] = set()
        for row in self._candidates(box, stand):
            number = int(self._pair[row])
            pair = self.model.pairs[number]
            if pair.bodies in ignored or number in retreating:
                continue
            values = self._first_touch(row, box, stand, pair.margin_um)
            if values is None:
                continue
            begin = self._inside(number, box)
            if begin is not None and self._retreats(begin, box.onward):
                retreating.add(number)
            elif begin is not None and begin.sure:
                approach = self._approach(begin.nearest, box.origin)
                return SweepAnswer(clear=False, approach=approach, reason=INSIDE_TEXT)
            else:
                return SweepAnswer(clear=False, approach=self._approach(row, values))
        return SweepAnswer(clear=True)

    def _stand(self, values: Floats) -> _Stand:
        turned = self._arrangement.turned(values)
        places = turned.places_at(values)
        low, high = self._boxes(turned)
        shift = places[self._body]
        return _Stand(turned.rotations, places, low + shift, high + shift)

    def _boxes(self, turned: Turned) -> tuple[Floats, Floats]:
        """Return the boxes round all pieces, their bodies being at the origin of the world."""
        if self._corners[0] is not turned:
            low, high = self._corners[1:]
            for number in self._late:
                rotation = turned.rotations[self._body[number]]
                low[number], high[number] = self._box(number, rotation)
            self._corners = (turned, low, high)
        return self._corners[1], self._corners[2]

    def _box(self, number: int, rotation: Floats) -> tuple[Floats, Floats]:
        world = rotation @ self.model.pieces[number].vertices_um.T
        return world.min(axis=1), world.max(axis=1)

    def _concerning(self, moving: npt.NDArray[np.bool_]) -> _Concern:
        """Return the pairs that some moving joint brings nearer to each other, or apart."""
        key = moving.tobytes()
        concern = self._concerns.get(key)
        if concern is None:
            rows = np.flatnonzero((self._between & moving).any(axis=1))
            # What joints that swing can do is added to the boxes.
            steady = np.where(self._arrangement.swings, 0.0, np.abs(self._relative[rows]))
            concern = _Concern(
                rows, self._first[rows], self._second[rows], self._margin[rows], steady
            )
            if len(self._concerns) >= _MOST_CONCERNS:
                del self._concerns[next(iter(self._concerns))]
            self._concerns[key] = concern
        return concern

    def _candidates(self, box: MotionBox, stand: _Stand) -> list[int]:
        """Return the pairs whose swept boxes come within the margin, the nearest first."""
        concern = self._concerning(box.moving)
        low, high = self._widened(box, stand)
        first, second = concern.first, concern.second
        apart = np.maximum(low[second] - high[first], low[first] - high[second])
        apart -= concern.reach @ box.half
        least = apart.max(axis=1)
        near = np.flatnonzero(least <= concern.margin)
        order = np.argsort(least[near])
        return [int(row) for row in concern.rows[near[order]]]

    def _widened(self, box: MotionBox, stand: _Stand) -> tuple[Floats, Floats]:
        """Return the boxes round all pieces, widened by all that joints can turn them."""
        wide = self._arrangement.swings & (box.half > 0.0)
        if not wide.any():
            return stand.low, stand.high
        low, high = stand.low.copy(), stand.high.copy()
        for piece in np.flatnonzero((self._arrangement.chains[self._body] & wide).any(axis=1)):
            body = int(self._body[piece])
            self._pieces[piece].put(stand.rotations[body], stand.places[body])
            self._turning.widen(int(piece), body, box, (low[piece], high[piece]))
        return low, high

    def _turn(self, row: int) -> Turn:
        first, second = int(self._first[row]), int(self._second[row])
        return Turn(first, second, int(self._body[first]), int(self._body[second]))

    def _first_touch(self, row: int, box: MotionBox, stand: _Stand, margin: float) -> Floats | None:
        """Return joint values at which a pair is too close, or None."""
        used = np.flatnonzero(self._between[row] & (box.half > 0.0))
        if self._arrangement.swings[used].any():
            return self._turning.first_touch(self._turn(row), box, margin)
        slide = self._slide(row, box, stand, used)
        guess = self._normals.get(row)
        if guess is not None and guess_holds(slide, guess, margin):
            return None
        finding = smallest_gap(slide, margin, guess)
        if finding.clear:
            if finding.normal is not None:
                self._normals[row] = finding.normal
            return None
        values = box.centre
        if finding.at is not None:
            values[used] += finding.at
        return values

    # Pairs that begin inside their margin

    def _inside(self, number: int, box: MotionBox) -> _Inside | None:
        """Return how two bodies begin that are closer than their margin; None of any others.

        None too where nobody knows how they begin.
        """
        rows = np.flatnonzero(self._pair == number)
        wide = self._between[rows[0]] & ((box.half > 0.0) | ~box.sure)
        if not box.origin_known[wide].all():
            return None
        stand = self._stand(box.origin)
        first, second = self._first[rows], self._second[rows]
        apart = np.maximum(stand.low[second] - stand.high[first], 0.0)
        apart = np.maximum(apart, stand.low[first] - stand.high[second])
        margin = self.model.pairs[number].margin_um
        near = rows[np.linalg.norm(apart, axis=1) <= margin].tolist()
        gaps = {row: self._approach(row, box.origin, stand).distance_um for row in near}
        if not gaps or not min(gaps.values()) <= margin:
            return None
        nearest = min(gaps, key=gaps.__getitem__)
        return _Inside(rows.tolist(), gaps, nearest, sure=bool(box.sure[wide].all()))

    def _retreats(self, begin: _Inside, onward: MotionBox) -> bool:
        """Return True when two bodies come nowhere closer than they begin.

        Bodies count, not pieces: while one piece is left, another may come nearer, but not nearer
        than the first one was. Where they overlap they leave by the shortest way that leads out.
        """
        least = begin.gaps[begin.nearest]
        overlapping = [row for row, gap in begin.gaps.items() if not gap > 0.0]
        normal = self._exit(overlapping, begin.rows, onward.origin) if overlapping else None
        stand = self._stand(onward.centre)
        for row in begin.rows:
            used = np.flatnonzero(self._between[row] & (onward.half > 0.0))
            if not used.size:
                continue
            turns = bool(self._arrangement.swings[used].any())
            if row in overlapping:
                if normal is None or not self._parts(row, onward, stand, used, normal, turns=turns):
                    return False
            elif turns:
                if not self._turning.keeps(self._turn(row), onward, least):
                    return False
            elif not self._keeps(row, onward, stand, used, least, sure=begin.sure):
                return False
        return True

    def _keeps(
        self,
        row: int,
        onward: MotionBox,
        stand: _Stand,
        used: _Numbers,
        least: float,
        *,
        sure: bool,
    ) -> bool:
        """Return True when a piece that slides comes nowhere closer than `least`."""
        slide = self._slide(row, onward, stand, used)
        slide.second.put(slide.rotation, slide.place_um + slide.shifts @ slide.start)
        found = separation(slide.first, slide.second)
        if found.gap_um > 0.0 and leaves(slide, np.array(found.normal)):
            return True
        return sure and smallest_gap(slide, least).clear

    def _parts(
        self,
        row: int,
        onward: MotionBox,
        stand: _Stand,
        used: _Numbers,
        normal: Floats,
        *,
        turns: bool,
    ) -> bool:
        """Return True when a piece that overlaps another comes out along `normal`."""
        if turns:
            return self._turning.parts(self._turn(row), onward, normal)
        return leaves(self._slide(row, onward, stand, used), normal, strictly=True)

    def _exit(self, overlapping: list[int], rows: list[int], values: Floats) -> Floats | None:
        """Return the direction in which the second body is out of the first after least way.

        Only directions count in which the two can be moved against each other, and that do not
        lead into another piece.
        """
        stand = self._stand(values)
        choices: list[tuple[float, Floats]] = []
        for row in overlapping:
            choices += overlaps(*self._put(row, stand))
        relative = self._relative[rows[0]][:, self._between[rows[0]]]
        steady = not self._arrangement.swings[self._between[rows[0]]].any()
        for _, normal in sorted(choices, key=lambda choice: choice[0]):
            if steady and not np.abs(normal @ relative).max(initial=0.0) > _ACROSS:
                continue
            deepest = max(self._overlap(row, stand, normal) for row in overlapping)
            shift = (deepest + _BEYOND_UM) * normal
            if all(separation(*self._put(row, stand, shift)).gap_um > 0.0 for row in rows):
                return normal
        return None

    def _overlap(self, row: int, stand: _Stand, normal: Floats) -> float:
        return -gap_along(*self._put(row, stand), normal)

    def _put(
        self, row: int, stand: _Stand, shift: Floats | float = 0.0
    ) -> tuple[ConvexPiece, ConvexPiece]:
        """Put the two pieces of a pair where they stand, the second one shifted."""
        pieces = []
        for number, further in ((self._first[row], 0.0), (self._second[row], shift)):
            body = self._body[number]
            self._pieces[number].put(stand.rotations[body], stand.places[body] + further)
            pieces.append(self._pieces[number])
        return pieces[0], pieces[1]

    def _slide(self, row: int, box: MotionBox, stand: _Stand, used: _Numbers) -> Slide:
        first, second = self._first[row], self._second[row]
        self._pieces[first].put(stand.rotations[self._body[first]], stand.places[self._body[first]])
        body = self._body[second]
        half = box.half[used]
        return Slide(
            first=self._pieces[first],
            second=self._pieces[second],
            rotation=stand.rotations[body],
            place_um=stand.places[body],
            shifts=self._relative[row][:, used],
            half=half,
            start=np.clip(box.origin[used] - box.centre[used], -half, half),
            lowest=box.lowest[used],
            highest=box.highest[used],
            known=bool(box.origin_known[used].all()),
        )

    # Poses

    def nearest(
        self, positions: Mapping[str, float], ignored: Set[BodyPair] = frozenset()
    ) -> Approach | None:
        """Return the watched pair nearest to each other with the axes at `positions`."""
        values = self.model.joint_values(positions)
        if not np.isfinite(values).all():
            raise SpanError("a position is not finite")
        stand = self._stand(values)
        apart = np.maximum(
            stand.low[self._second] - stand.high[self._first],
            stand.low[self._first] - stand.high[self._second],
        )
        least = np.sqrt((np.maximum(apart, 0.0) ** 2).sum(axis=1))
        best: Approach | None = None
        for row in np.argsort(least).tolist():
            if best is not None and least[row] >= best.distance_um:
                break
            if self.model.pairs[self._pair[row]].bodies in ignored:
                continue
            here = self._approach(row, values, stand)
            if best is None or here.distance_um < best.distance_um:
                best = here
        return best

    def _approach(self, row: int, values: Floats, stand: _Stand | None = None) -> Approach:
        """Return how a pair of pieces stands at joint `values`."""
        stand = stand or self._stand(values)
        first, second = int(self._first[row]), int(self._second[row])
        for piece in (first, second):
            body = self._body[piece]
            self._pieces[piece].put(stand.rotations[body], stand.places[body])
        found = separation(self._pieces[first], self._pieces[second])
        pair = self.model.pairs[self._pair[row]]
        return Approach(
            bodies=pair.bodies,
            distance_um=found.gap_um,
            places_um=(found.first_um, found.second_um),
            margin_um=pair.margin_um,
            pose=axis_positions(self.model, values),
        )
