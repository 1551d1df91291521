"""Know your stage: direction, step, repeatability and backlash of axes, seen by a camera."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.stage_procedure import StageProcedure
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.kept_file import toml_lines
from cosmic.frame.operation import Operation, Task
from cosmic.vico.core.calibration_fit import Sighting

STEP_UM: Final = 50.0
"""From one position of an axis to the next."""
RUN_UP_UM: Final = 20.0
"""A position is approached from so far, from either side."""
TIMES: Final = 4
"""How often each position is approached from each side."""
FEWEST: Final = 3
"""Approaches from one side that must have been seen."""


@dataclass(frozen=True, slots=True)
class Approach:
    """One arrival of an axis at a position.

    Attributes
    ----------
    axis : str
        Which axis moved.
    place : int
        Number of the position.
    side : int
        1: the axis came from below, and moved up; -1: from above.
    seen : Sighting
        Where encoders and camera have the tip.
    """

    axis: str
    place: int
    side: int
    seen: Sighting


@dataclass(frozen=True, slots=True)
class AxisCheck:
    """What the camera says of one axis.

    Attributes
    ----------
    direction_deg : float
        Where the tip goes in the image when the axis moves up: 0 to the right, 90 to the top.
    pixel_um : float
        Travel of the axis for one pixel of the sensor.
    repeatability_um : float
        Standard deviation of arrivals at one position from one side.
    backlash_um : float
        How much further up the tip lies where the axis came from above than from below.
    arrivals : int
        How many were seen.
    """

    axis: str
    direction_deg: float
    pixel_um: float
    repeatability_um: float
    backlash_um: float
    arrivals: int


@dataclass(frozen=True, slots=True)
class StageReport:
    """What was found of the axes of one tool.

    Attributes
    ----------
    angle_deg : float
        Between the two axes, as seen; 90 where they are square.
    """

    tool: str
    axes: tuple[AxisCheck, ...]
    angle_deg: float

    @property
    def text(self) -> str:
        """One line for each axis, for people."""
        lines = [
            f"{each.axis}: {each.pixel_um:.4f} µm a pixel, towards {each.direction_deg:.1f}°, "
            f"repeats within {each.repeatability_um:.2f} µm, backlash {each.backlash_um:+.2f} µm "
            f"({each.arrivals} arrivals)"
            for each in self.axes
        ]
        return "\n".join([*lines, f"Angle between the axes: {self.angle_deg:.2f}°"])

    @property
    def toml(self) -> str:
        """The same as a file that programs read."""
        head = toml_lines({"tool": self.tool, "angle_deg": round(self.angle_deg, 3)})
        parts = [
            "\n[[axis]]\n"
            + toml_lines(
                {
                    "name": each.axis,
                    "direction_deg": round(each.direction_deg, 2),
                    "pixel_um": round(each.pixel_um, 5),
                    "repeatability_um": round(each.repeatability_um, 3),
                    "backlash_um": round(each.backlash_um, 3),
                    "arrivals": each.arrivals,
                }
            )
            for each in self.axes
        ]
        return "".join([head, *parts])


def evaluate(tool: str, axes: tuple[str, str], approaches: Sequence[Approach]) -> StageReport:
    """Return what arrivals say of the two axes that move a tool across the image.

    Raises
    ------
    NotAvailable
        Too few arrivals were seen.
    """
    px_um, offset = _fit([each.seen for each in approaches])
    back = np.linalg.inv(px_um)
    checks = []
    for number, axis in enumerate(axes):
        mine = [each for each in approaches if each.axis == axis]
        errors: dict[tuple[int, int], list[float]] = {}
        for each in mine:
            there = back @ (np.array(each.seen.image_px) - offset)
            error = float(there[number]) - each.seen.platform_um[number]
            errors.setdefault((each.place, each.side), []).append(error)
        if any(sum(s == side for _, s in errors) == 0 for side in (-1, 1)) or not any(
            len(found) >= FEWEST for found in errors.values()
        ):
            raise NotAvailable(f"{axis}: the tip was seen too seldom; light it evenly and focus")
        column = px_um[:, number]
        checks.append(
            AxisCheck(
                axis,
                direction_deg=math.degrees(math.atan2(-column[1], column[0])),
                pixel_um=1.0 / float(np.linalg.norm(column)),
                repeatability_um=_spread(list(errors.values())),
                backlash_um=_backlash(errors),
                arrivals=len(mine),
            )
        )
    cosine = float(px_um[:, 0] @ px_um[:, 1]) / float(
        np.linalg.norm(px_um[:, 0]) * np.linalg.norm(px_um[:, 1])
    )
    return StageReport(tool, tuple(checks), math.degrees(math.acos(max(-1.0, min(1.0, cosine)))))


def _fit(seen: Sequence[Sighting]) -> tuple[Floats, Floats]:
    """Return what moves do in pixels, shape (2, 2), and the pixel of the origin."""
    if len(seen) < 2 * FEWEST:
        raise NotAvailable("the tip was seen too seldom; light it evenly and focus on it")
    where = np.column_stack([np.array([each.platform_um for each in seen]), np.ones(len(seen))])
    pixels = np.array([each.image_px for each in seen])
    solved, _, rank, _ = np.linalg.lstsq(where, pixels, rcond=None)
    if rank < where.shape[1]:
        raise NotAvailable("the tip was not seen along both axes")
    return np.asarray(solved[:2].T), np.asarray(solved[2])


def _spread(groups: Sequence[Sequence[float]]) -> float:
    """Return the standard deviation within groups, each around its own mean."""
    squares = sum(float(np.sum((np.array(each) - np.mean(each)) ** 2)) for each in groups)
    freedom = sum(len(each) - 1 for each in groups)
    return math.sqrt(squares / freedom) if freedom else 0.0


def _backlash(errors: dict[tuple[int, int], list[float]]) -> float:
    places = {place for place, _ in errors if (place, 1) in errors and (place, -1) in errors}
    steps = [float(np.mean(errors[p, -1]) - np.mean(errors[p, 1])) for p in places]
    return float(np.mean(steps)) if steps else 0.0


class StageCheck:
    """Moves the axes of a tool to positions from both sides, and looks; run in ViCo's thread.

    Parameters
    ----------
    procedure : StageProcedure
        What moves the tool and finds its tip.
    tool : str
        Its name.
    axes : tuple of str
        The two that move it across the image.
    """

    def __init__(self, procedure: StageProcedure, tool: str, axes: tuple[str, str]) -> None:
        self._procedure, self._tool, self._axes = procedure, tool, axes

    def run(self, task: Task, report: Operation[StageReport]) -> None:
        """Measure, go back where the tool was, and end both."""
        try:
            found = self._procedure.around(task, self._measure)
        except CosmicError as exc:
            report.fail(exc)
            task.fail(exc)
            return
        report.finish(found)
        task.report(1.0, found.text)
        task.finish()

    def _measure(self, task: Task, begun_um: Floats) -> StageReport:
        guess = self._procedure.first_idea(task, begun_um)
        around = begun_um[:2] - 3.0 * RUN_UP_UM * self._procedure.ahead
        approaches: list[Approach] = []
        count, done = len(self._axes) * 2 * TIMES * 2, 0
        for number, axis in enumerate(self._axes):
            along = np.eye(2)[number]
            for time in range(TIMES):
                for place in (0, 1):
                    for side in (1, -1):
                        done += 1
                        task.report(done / (count + 1), f"{axis}, round {time + 1} of {TIMES}")
                        target = around + place * STEP_UM * along
                        self._procedure.move(task, target - side * RUN_UP_UM * along)
                        seen = self._procedure.sight(task, target, guess)
                        if seen is not None:
                            approaches.append(Approach(axis, place, side, seen))
        return evaluate(self._tool, self._axes, approaches)
