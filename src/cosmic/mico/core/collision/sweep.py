"""The pure gate: tells whether the volume that a movement can sweep is clear (thesis 6.1.2)."""

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.mico.core.collision.answer import Approach, Spans, SweepAnswer
from cosmic.mico.core.collision.arrangement import Arrangement
from cosmic.mico.core.collision.fcl_pieces import ConvexPiece, separation
from cosmic.mico.core.collision.model import BodyPair, Floats, SceneModel
from cosmic.mico.core.collision.motion_box import (
    MotionBox,
    SpanError,
    axis_positions,
    make_box,
)
from cosmic.mico.core.collision.sliding import Slide, guess_holds, smallest_gap
from cosmic.mico.core.collision.turning import Turn, TurningPairs

_Numbers = npt.NDArray[np.intp]

INSIDE_TEXT: Final = "closer than the margin already; they may only move apart"


@dataclass(frozen=True, eq=False)
class _Stand:
    """All pieces with the joints in the middle of a box."""

    rotations: list[Floats]
    places: Floats
    low: Floats
    high: Floats


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
        self._corner_low = np.array([piece.vertices_um.min(axis=0) for piece in model.pieces])
        self._corner_high = np.array([piece.vertices_um.max(axis=0) for piece in model.pieces])
        self._turn_boxes()
        self._concerned: dict[bytes, _Numbers] = {}
        self._normals: dict[int, Floats] = {}

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
        self._ways = arrangement.shifts[second_body] - arrangement.shifts[first_body]
        unsteady = arrangement.turning | ~arrangement.steady
        self._turns = np.asarray((self._between & unsteady).any(axis=1))

    def _turn_boxes(self) -> None:
        """Bring the boxes round the pieces of sliding bodies into the directions of the world."""
        for number, piece in enumerate(self.model.pieces):
            world = piece.vertices_um @ self._arrangement.rotations[self._body[number]].T
            self._corner_low[number] = world.min(axis=0)
            self._corner_high[number] = world.max(axis=0)
        self._turned = np.flatnonzero(~self._arrangement.slides[self._body])

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
        stand = self._stand(box.centre)
        for row in self._candidates(box, stand):
            pair = self.model.pairs[self._pair[row]]
            if pair.bodies in ignored:
                continue
            touch = self._first_touch(int(row), box, stand)
            if touch is not None:
                values, inside = touch
                approach = self._approach(int(row), values)
                reason = INSIDE_TEXT if inside else ""
                return SweepAnswer(clear=False, approach=approach, reason=reason)
        return SweepAnswer(clear=True)

    def _stand(self, values: Floats) -> _Stand:
        rotations, places = self._arrangement.poses(values)
        shift = places[self._body]
        low, high = self._corner_low + shift, self._corner_high + shift
        for piece in self._turned:
            body = self._body[piece]
            world = self.model.pieces[piece].vertices_um @ rotations[body].T + places[body]
            low[piece], high[piece] = world.min(axis=0), world.max(axis=0)
        return _Stand(rotations, places, low, high)

    def _concerning(self, moving: npt.NDArray[np.bool_]) -> _Numbers:
        """Return the pairs that some moving joint brings nearer to each other, or apart."""
        key = moving.tobytes()
        rows = self._concerned.get(key)
        if rows is None:
            rows = np.flatnonzero((self._between & moving).any(axis=1))
            self._concerned[key] = rows
        return rows

    def _candidates(self, box: MotionBox, stand: _Stand) -> Iterator[int]:
        """Yield the pairs whose swept boxes come within the margin, the nearest first."""
        rows = self._concerning(box.moving)
        first, second = self._first[rows], self._second[rows]
        apart = np.maximum(
            stand.low[second] - stand.high[first], stand.low[first] - stand.high[second]
        )
        reach = np.abs(self._ways[rows]) @ box.half
        turning = np.flatnonzero(self._turns[rows])
        if turning.size:
            reach[turning] += self._turned_reach(rows[turning], box, stand)[:, np.newaxis]
        near = ((apart - reach) <= self._margin[rows][:, np.newaxis]).all(axis=1)
        found = np.flatnonzero(near)
        order = np.argsort((apart - reach)[found].max(axis=1))
        yield from (int(row) for row in rows[found[order]])

    def _turned_reach(self, rows: _Numbers, box: MotionBox, stand: _Stand) -> Floats:
        """Return how far turning can carry the pieces of each pair, in any direction."""
        half = np.where(self._arrangement.turning | ~self._arrangement.steady, box.half, 0.0)
        return np.array(
            [
                self._turning.any_way(self._turn(row), half, stand.rotations, stand.places)
                for row in rows
            ]
        )

    def _turn(self, row: int) -> Turn:
        first, second = int(self._first[row]), int(self._second[row])
        return Turn(first, second, int(self._body[first]), int(self._body[second]))

    def _first_touch(self, row: int, box: MotionBox, stand: _Stand) -> tuple[Floats, bool] | None:
        """Return joint values at which a pair is too close, and whether it begins so."""
        margin = float(self._margin[row])
        half = box.half
        used = np.flatnonzero(self._between[row] & (half > 0.0))
        swings = self._arrangement.turning[used] | ~self._arrangement.steady[used]
        if swings.any():
            values = self._turning.first_touch(self._turn(row), box, margin)
            return None if values is None else (values, False)
        slide = self._slide(row, box, stand, used)
        guess = self._normals.get(row)
        if guess is not None and guess_holds(slide, guess, margin):
            return None
        finding = smallest_gap(slide, margin)
        if finding.clear:
            if finding.normal is not None:
                self._normals[row] = finding.normal
            return None
        values = box.centre
        if finding.at is not None:
            values[used] += finding.at
        return values, finding.inside

    def _slide(self, row: int, box: MotionBox, stand: _Stand, used: _Numbers) -> Slide:
        first, second = self._first[row], self._second[row]
        self._pieces[first].put(stand.rotations[self._body[first]], stand.places[self._body[first]])
        body = self._body[second]
        centre = box.centre[used]
        start = np.clip(box.origin[used] - centre, -box.half[used], box.half[used])
        return Slide(
            first=self._pieces[first],
            second=self._pieces[second],
            rotation=stand.rotations[body],
            place_um=stand.places[body],
            ways=self._ways[row][:, used],
            half=box.half[used],
            start=start,
            asked_low=box.asked_low[used] - box.origin[used],
            asked_high=box.asked_high[used] - box.origin[used],
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
