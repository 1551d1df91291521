"""Follow one fibre among those found on each frame; say it is lost rather than take another."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.tracking import TrackState

Pair = tuple[float, float]

LARGEST_LENGTH_CHANGE: Final = 0.15
LARGEST_WIDTH_CHANGE: Final = 0.35
LEAST_LEAD: Final = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class FibreTrack:
    """Which of the fibres found is the one that is followed.

    Attributes
    ----------
    fibre : Fibre or None
        None while it is lost; with `TrackState.UNSURE` the one that is most like it.
    moved_px : (float, float)
        How far its middle went since the last frame it was found on.
    distance_px : float or None
        Between where its line was expected and where it is.
    """

    state: TrackState
    fibre: Fibre | None
    moved_px: Pair = (0.0, 0.0)
    distance_px: float | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class _Likeness:
    fibre: Fibre
    distance_px: float
    length: float
    width: float

    def cost(self, reach_px: float) -> float:
        return (
            (self.distance_px / (0.3 * reach_px)) ** 2
            + (self.length / (0.3 * LARGEST_LENGTH_CHANGE)) ** 2
            + (self.width / (0.3 * LARGEST_WIDTH_CHANGE)) ** 2
        )

    def objection(self, reach_px: float) -> str:
        """Return why it is not the same fibre; empty when it may be."""
        if not self.distance_px <= reach_px:
            return f"the nearest lies {self.distance_px:.0f} px away"
        if not abs(self.length) <= LARGEST_LENGTH_CHANGE:
            return f"the length of the one there differs by {100.0 * self.length:+.0f} %"
        if not abs(self.width) <= LARGEST_WIDTH_CHANGE:
            return f"the width of the one there differs by {100.0 * self.width:+.0f} %"
        return ""


class FibreTracker:
    """Follows one fibre among those found on each frame; it never takes another one for it.

    Parameters
    ----------
    reach_px : float
        Mean distance between the line expected and the line found, at most.
    """

    def __init__(self, *, reach_px: float = 40.0) -> None:
        self._reach_px = reach_px
        self._first: Fibre | None = None
        self._line: Floats = np.empty((0, 2))
        self._step: Floats = np.zeros(2)

    @property
    def followed(self) -> bool:
        """Whether there is a fibre to be followed."""
        return self._first is not None

    def start(self, fibre: Fibre) -> None:
        """Follow `fibre` from now on; its length and width are what others are compared with."""
        self._first = fibre
        self._line, self._step = _evenly(fibre.centre_line_px), np.zeros(2)

    def end(self) -> None:
        """Follow none."""
        self._first = None

    def follow(
        self, fibres: Sequence[Fibre], expected_line_px: npt.ArrayLike | None = None
    ) -> FibreTrack:
        """Say which of `fibres`, all of one frame, it is.

        Parameters
        ----------
        expected_line_px : ndarray, shape (n, 2), or None
            Where the stages should have brought its line; None: it goes on as it did.

        Raises
        ------
        NotAvailable
            `start` has not been called.
        """
        first = self._first
        if first is None:
            raise NotAvailable("tracking: no fibre is followed; start with one that was found")
        line = self._line + self._step if expected_line_px is None else _evenly(expected_line_px)
        alike = [_likeness(first, line, each) for each in fibres]
        possible = sorted(
            (each for each in alike if not each.objection(self._reach_px)),
            key=lambda each: each.cost(self._reach_px),
        )
        if not possible:
            self._step = np.zeros(2)
            return FibreTrack(TrackState.LOST, None, reason=_why_none(alike, self._reach_px))
        return self._decide(possible)

    def _decide(self, possible: Sequence[_Likeness]) -> FibreTrack:
        best = possible[0]
        if len(possible) > 1:
            costs = [each.cost(self._reach_px) for each in possible[:2]]
            if costs[1] - costs[0] < LEAST_LEAD:
                reason = "two fibres fit it almost alike"
                return FibreTrack(
                    TrackState.UNSURE, best.fibre, distance_px=best.distance_px, reason=reason
                )
        line = _evenly(best.fibre.centre_line_px)
        step = line.mean(axis=0) - self._line.mean(axis=0)
        self._line, self._step = line, step
        state = TrackState.FOUND if best.fibre.certain else TrackState.UNSURE
        reason = "" if best.fibre.certain else "; ".join(best.fibre.doubts)
        moved = (float(step[0]), float(step[1]))
        return FibreTrack(state, best.fibre, moved, best.distance_px, reason)


def _why_none(alike: Sequence[_Likeness], reach_px: float) -> str:
    if not alike:
        return "there is no fibre on the image"
    return min(alike, key=lambda each: each.distance_px).objection(reach_px)


def _likeness(first: Fibre, line: Floats, other: Fibre) -> _Likeness:
    return _Likeness(
        other,
        _distance(line, _evenly(other.centre_line_px)),
        other.length_px / first.length_px - 1.0,
        other.width_px / first.width_px - 1.0,
    )


def _evenly(line: npt.ArrayLike, count: int = 40) -> Floats:
    """Return a line as `count` points with even distances."""
    points = np.asarray(line, dtype=np.float64)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], count)
    return np.column_stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)])


def _distance(one: Floats, other: Floats) -> float:
    """Return the mean distance from point to point, whichever end comes first."""
    return float(min(np.linalg.norm(one - each, axis=1).mean() for each in (other, other[::-1])))
