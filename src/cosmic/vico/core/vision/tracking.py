"""Follow a part of the image from frame to frame, and say when it is lost."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.vision.matching import Match, Template
from cosmic.vico.hw.interface import Pixels, Roi

Pair = tuple[float, float]

LOST_BELOW: Final = 0.6
RENEW_BELOW: Final = 0.9
RIVAL_SHARE: Final = 0.9
LARGEST_STD_PX: Final = 0.5
WIDEST_SEARCH: Final = 3.0


class TrackState(StrEnum):
    """Whether what is followed was found again."""

    FOUND = "found"
    UNSURE = "not sure"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class Track:
    """Where a part of the image went.

    Attributes
    ----------
    position_px, std_px : (float, float) and float, or None
        None while it is lost. The uncertainty counts every renewal of the template since `start`.
    score : float
        Likeness to the template, up to 1.
    reason : str
        Why it is lost or not sure.
    """

    state: TrackState
    position_px: Pair | None
    std_px: float | None
    score: float
    reason: str = ""


class TemplateTracker:
    """Follows one point on the image by how its surroundings look.

    Parameters
    ----------
    size_px : int
        Side of the square that is compared.
    reach_px : float
        How far from where it is expected it may be; up to three times as much once it is lost.
    """

    def __init__(self, *, size_px: int = 64, reach_px: float = 60.0) -> None:
        self._size_px = size_px
        self._reach_px = reach_px
        self._template: Template | None = None
        self._offset_px: Pair = (0.0, 0.0)
        self._last_px: Pair = (0.0, 0.0)
        self._step_px: Pair = (0.0, 0.0)
        self._variance = 0.0
        self._missed = 0

    @property
    def expected_px(self) -> Pair:
        """Where it should be on the next frame if it goes on as it did."""
        return self._last_px[0] + self._step_px[0], self._last_px[1] + self._step_px[1]

    def start(self, image: Pixels, at_px: Pair) -> None:
        """Follow what is at `at_px` from now on; raises `ConfigError` where nothing can be."""
        self._renew(image, at_px)
        self._last_px, self._step_px = at_px, (0.0, 0.0)
        self._variance, self._missed = 0.0, 0

    def follow(self, image: Pixels, expected_px: Pair | None = None) -> Track:
        """Look for it on the next frame.

        Parameters
        ----------
        expected_px : (float, float) or None
            Where the stages should have brought it; None: it goes on as it did.

        Raises
        ------
        NotAvailable
            `start` has not been called.
        """
        if self._template is None:
            raise NotAvailable("tracking: nothing is followed yet; start on an image")
        around = self.expected_px if expected_px is None else expected_px
        centre = around[0] - self._offset_px[0], around[1] - self._offset_px[1]
        reach_px = self._reach_px * min(WIDEST_SEARCH, 1.0 + 0.5 * self._missed)
        match = self._template.find(image, centre, reach_px)
        reason = _why_lost(match)
        if match is None or reason:
            self._missed += 1
            self._step_px = (0.0, 0.0)
            return Track(TrackState.LOST, None, None, match.score if match else 0.0, reason)
        return self._found(image, match)

    def _found(self, image: Pixels, match: Match) -> Track:
        position = (
            match.centre_px[0] + self._offset_px[0],
            match.centre_px[1] + self._offset_px[1],
        )
        std_px = math.sqrt(self._variance + match.std_px**2)
        doubt = _why_unsure(match)
        if doubt:
            # Not learnt from: the next frame is looked at from the last sure point.
            self._missed += 1
            return Track(TrackState.UNSURE, position, std_px, match.score, doubt)
        straight = self._missed == 0
        step = position[0] - self._last_px[0], position[1] - self._last_px[1]
        self._step_px = step if straight else (0.0, 0.0)
        self._last_px, self._missed = position, 0
        if match.score < RENEW_BELOW and self._fits(image, position):
            self._renew(image, position)
            self._variance = std_px**2
        return Track(TrackState.FOUND, position, std_px, match.score)

    def _region(self, at_px: Pair) -> Roi:
        x, y = (round(each - 0.5 * (self._size_px - 1)) for each in at_px)
        return Roi(x, y, self._size_px, self._size_px)

    def _fits(self, image: Pixels, at_px: Pair) -> bool:
        region = self._region(at_px)
        height, width = image.shape[:2]
        last_x, last_y = width - self._size_px, height - self._size_px
        return bool(0 <= region.x_px <= last_x and 0 <= region.y_px <= last_y)

    def _renew(self, image: Pixels, at_px: Pair) -> None:
        template = Template(image, self._region(at_px))
        self._offset_px = at_px[0] - template.centre_px[0], at_px[1] - template.centre_px[1]
        self._template = template


def _why_lost(match: Match | None) -> str:
    if match is None:
        return "it left the image"
    if not match.score >= LOST_BELOW:
        return f"no match was found (score {match.score:.2f}, {LOST_BELOW:g} is needed)"
    return ""


def _why_unsure(match: Match) -> str:
    if match.at_rim:
        return "it lies at the border of the search region"
    if match.rival > RIVAL_SHARE * match.score:
        return f"another point looks like it (scores {match.score:.2f} and {match.rival:.2f})"
    if not match.std_px <= LARGEST_STD_PX:
        return "it can slip along an edge"
    return ""
