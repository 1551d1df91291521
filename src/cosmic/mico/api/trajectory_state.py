"""What a trajectory player is at, as plain data, and what is asked of it."""

import warnings
from dataclasses import dataclass
from enum import StrEnum
from threading import Condition, RLock
from typing import Final, Literal

from cosmic.mico.core.trajectory.rehearsal import Rehearsal

StartMode = Literal["refuse", "straight", "detour", "way"]
"""What to do where axes are not where a trajectory begins; "way" is the old name of "detour"."""
START_MODES: Final = ("refuse", "straight", "detour")


def present_mode(start: StartMode) -> StartMode:
    """Return a mode by its present name, after a `DeprecationWarning` where it has another."""
    if start != "way":
        return start
    text = "start='way' is now called start='detour'; the old name goes with the next version"
    warnings.warn(text, DeprecationWarning, stacklevel=3)
    return "detour"


class PlayState(StrEnum):
    """What a player is at."""

    READY = "ready"
    RUNNING = "running"
    PAUSED = "paused"
    FAILED = "failed"
    CANCELLED = "cancelled"
    ENDED = "ended"


@dataclass(frozen=True, slots=True)
class PlayProgress:
    """How far a player is.

    Attributes
    ----------
    line : int
        Line of the file that is being carried out, or comes next; 0 before the first.
    fraction : float
        Of this pass, 0 to 1, by time.
    left_s : float or None
        How long this pass still takes, without pauses; None before the rehearsal.
    loop, loops : int, int or None
        Which pass this is, and of how many; None: until it is paused or cancelled.
    error : str
        Why it stopped, empty while nothing went wrong.
    """

    state: PlayState
    line: int
    text: str
    fraction: float
    left_s: float | None
    loop: int
    loops: int | None
    error: str


@dataclass(frozen=True, slots=True)
class PlayerSnapshot:
    """All that is known of a player, as it is published.

    Attributes
    ----------
    rehearsal : Rehearsal or None
        What was found before the first movement, without its poses.
    failure : list or None
        Why it stopped, as plain values.
    """

    progress: PlayProgress
    speed: float
    rehearsal: Rehearsal | None
    failure: list[object] | None


class PlayControl:
    """What the operator wants of a run; written by any thread, read by the one that runs."""

    def __init__(self, *, timed: bool) -> None:
        self.changed = Condition(RLock())
        self.timed = timed
        self.speed = 1.0
        self.loops: int | None = 1
        self.pausing = False
        self.one_line = False
        self.start: StartMode = "refuse"
