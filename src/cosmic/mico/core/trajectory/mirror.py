"""A trajectory of one assembly for the other one, which faces it."""

from collections.abc import Mapping
from dataclasses import replace

from cosmic.mico.core.trajectory.model import (
    Leg,
    Move,
    Problem,
    Speed,
    StartPosition,
    Statement,
    Steps,
    Trajectory,
    TrajectoryError,
    Wait,
)
from cosmic.mico.core.trajectory.settings import MirrorSettings


def mirrored(trajectory: Trajectory, settings: MirrorSettings) -> Trajectory:
    """Return `trajectory` for the opposite axes, signs as the configuration has them.

    Raises
    ------
    TrajectoryError
        An axis has no counterpart in ``[mico.mirror]``; names the line.
    """
    mirror = _Mirror(settings.partners(), settings.reversed)
    statements = tuple(mirror.statement(each) for each in trajectory.statements)
    start = {
        mirror.axis(axis, position.line): mirror.start_position(axis, position)
        for axis, position in trajectory.start.items()
    }
    pose_axes = trajectory.pose_axes
    if pose_axes is not None:
        pose_axes = tuple(mirror.axis(axis, trajectory.pose_line) for axis in pose_axes)
    if mirror.problems:
        raise TrajectoryError(trajectory.name, mirror.problems)
    title = f"{trajectory.title} (mirrored)" if trajectory.title else ""
    return replace(
        trajectory,
        statements=statements,
        start=start,
        pose_axes=pose_axes,
        title=title,
        path=None,
        lines=(),
    )


class _Mirror:
    def __init__(self, partners: Mapping[str, str], turned: tuple[str, ...]) -> None:
        self._partners = partners
        self._turned = set(turned)
        self.problems: list[Problem] = []

    def axis(self, axis: str, line: int) -> str:
        """Return the counterpart of an axis, and note where it has none."""
        partner = self._partners.get(axis)
        if partner is None:
            text = f"{axis} has no counterpart; name it in [mico.mirror] of the platform file"
            self.problems.append(Problem(line, text))
            return axis
        return partner

    def _sign(self, axis: str) -> float:
        return -1.0 if axis in self._turned else 1.0

    def start_position(self, axis: str, position: StartPosition) -> StartPosition:
        return replace(position, value=self._sign(axis) * position.value)

    def statement(self, statement: Statement) -> Statement:
        """Return the counterpart of a statement."""
        match statement:
            case Wait():
                return statement
            case Speed():
                return replace(statement, axis=self.axis(statement.axis, statement.line))
            case Leg():
                return replace(statement, parts=tuple(map(self._part, statement.parts)))

    def _part(self, part: Move | Steps) -> Move | Steps:
        axis, sign = self.axis(part.axis, part.line), self._sign(part.axis)
        if isinstance(part, Move):
            return replace(part, axis=axis, value=sign * part.value + 0.0)
        return replace(part, axis=axis, steps=round(sign * part.steps))
