"""A trajectory as frozen data: what one file says, each statement with its line."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import CosmicError
from cosmic.frame.units import AxisUnit

VERSION: Final = 1
SUFFIX: Final = ".trajectory"
_MOST_LISTED: Final = 20


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong with a trajectory, and in which line; line 0 is the file as a whole."""

    line: int
    text: str

    @override
    def __str__(self) -> str:
        return f"line {self.line}: {self.text}" if self.line else self.text


class TrajectoryError(CosmicError):
    """A trajectory cannot be used; the text names each line at fault.

    Attributes
    ----------
    problems : tuple of Problem
        All that was found, in the order of the lines.
    """

    def __init__(self, name: str, problems: Iterable[Problem]) -> None:
        self.problems = tuple(sorted(problems, key=lambda each: each.line))
        shown = [f"{name}: {each}" for each in self.problems[:_MOST_LISTED]]
        left = len(self.problems) - len(shown)
        if left > 0:
            shown.append(f"{name}: and {left} more")
        super().__init__("\n".join(shown))


@dataclass(frozen=True, slots=True)
class Move:
    """One axis goes to a position, or by a distance, as the file gives it.

    Attributes
    ----------
    value : float
        In `unit`, um or deg.
    by : bool
        It is a distance.
    """

    axis: str
    value: float
    unit: AxisUnit
    by: bool
    line: int


@dataclass(frozen=True, slots=True)
class Steps:
    """One axis makes steps without looking at a sensor."""

    axis: str
    steps: int
    amplitude_v: float | None
    frequency_hz: int | None
    line: int


@dataclass(frozen=True, slots=True)
class Leg:
    """What begins at once: one movement, or the block ``together``.

    Attributes
    ----------
    at_s : float or None
        Not before this time after the start of the trajectory.
    """

    parts: tuple[Move | Steps, ...]
    line: int
    at_s: float | None = None


@dataclass(frozen=True, slots=True)
class Wait:
    """Nothing moves for a while."""

    duration_s: float
    line: int
    at_s: float | None = None


@dataclass(frozen=True, slots=True)
class Speed:
    """How fast an axis goes from here on; None: as fast as the platform file says.

    Attributes
    ----------
    unit : str
        "um/s", "deg/s" or "Hz".
    """

    axis: str
    value: float | None
    unit: str
    line: int


Statement = Leg | Wait | Speed


@dataclass(frozen=True, slots=True)
class StartPosition:
    """Where an axis stood when a recording began."""

    value: float
    unit: AxisUnit
    line: int


@dataclass(frozen=True, slots=True)
class Trajectory:
    """One trajectory; positions count as the gate counts them, not from the user's zero.

    Attributes
    ----------
    platform : str
        Name of the platform it was made for.
    pose : str
        Named pose that positions are relative to; empty when they are not.
    pose_axes : tuple of str or None
        Which axes are; None: all.
    start : mapping of StartPosition
        Where axes stood when it was recorded.
    recorded : str
        When it was recorded; empty when it was written by hand.
    comments : tuple of (int, str)
        Line and text.
    lines : tuple of str
        The text as it was read, for display.
    """

    platform: str
    statements: tuple[Statement, ...]
    title: str = ""
    recorded: str = ""
    pose: str = ""
    pose_axes: tuple[str, ...] | None = None
    pose_line: int = 0
    platform_line: int = 0
    start: Mapping[str, StartPosition] = field(default_factory=dict)
    comments: tuple[tuple[int, str], ...] = ()
    lines: tuple[str, ...] = ()
    path: Path | None = None

    @property
    def name(self) -> str:
        """What it is called before the operator."""
        return self.title or (self.path.name if self.path else "trajectory")

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes it moves, in their order."""
        legs = [each for each in self.statements if isinstance(each, Leg)]
        return tuple(dict.fromkeys(part.axis for leg in legs for part in leg.parts))

    @property
    def timed(self) -> bool:
        """True when statements say when they begin."""
        return any(
            isinstance(each, Leg | Wait) and each.at_s is not None for each in self.statements
        )

    def is_relative(self, axis: str) -> bool:
        """Return True when positions of `axis` count from the named pose."""
        return bool(self.pose) and (self.pose_axes is None or axis in self.pose_axes)
