"""Writing a trajectory as text that `reader` reads."""

from collections.abc import Iterable

from cosmic.mico.core.trajectory.model import (
    VERSION,
    Leg,
    Move,
    Speed,
    Statement,
    Steps,
    Trajectory,
    Wait,
)
from cosmic.mico.core.trajectory.reader import END_OF_RECORDING
from cosmic.mico.core.trajectory.words import number


def to_text(trajectory: Trajectory) -> str:
    """Return a trajectory as the text of a file; comments keep their places."""
    lines = head_lines(trajectory)
    comments = list(trajectory.comments)
    for statement in trajectory.statements:
        last = _last_line(statement)
        while comments and comments[0][0] <= last:
            lines.append(f"# {comments.pop(0)[1]}".rstrip())
        lines += statement_lines(statement)
    lines += [f"# {text}".rstrip() for _, text in comments]
    if trajectory.recorded:
        lines.append(END_OF_RECORDING)
    return "\n".join(lines) + "\n"


def head_lines(trajectory: Trajectory) -> list[str]:
    """Return the lines before the first statement."""
    lines = [f"cosmic-trajectory {VERSION}", f"platform {trajectory.platform}"]
    if trajectory.title:
        lines.append(f"title {trajectory.title}")
    if trajectory.recorded:
        lines.append(f"recorded {trajectory.recorded}")
    if trajectory.pose:
        axes = "" if trajectory.pose_axes is None else f": {', '.join(trajectory.pose_axes)}"
        lines.append(f"relative to pose {trajectory.pose}{axes}")
    lines += [
        f"start {axis} {number(position.value)} {position.unit}"
        for axis, position in trajectory.start.items()
    ]
    return [*lines, ""]


def statement_lines(statement: Statement) -> list[str]:
    """Return the lines of one statement."""
    match statement:
        case Wait():
            return [f"{_when(statement.at_s)}wait {number(statement.duration_s)} s"]
        case Speed():
            if statement.value is None:
                return [f"speed {statement.axis} usual"]
            return [f"speed {statement.axis} {number(statement.value)} {statement.unit}"]
        case Leg():
            when = _when(statement.at_s)
            if len(statement.parts) == 1:
                return [when + part_text(statement.parts[0])]
            inside: Iterable[str] = (f"    {part_text(part)}" for part in statement.parts)
            return [f"{when}together", *inside, "end"]


def part_text(part: Move | Steps) -> str:
    """Return one movement as text."""
    if isinstance(part, Move):
        return f"{part.axis} {'by' if part.by else 'to'} {number(part.value)} {part.unit}"
    volts = "" if part.amplitude_v is None else f" {number(part.amplitude_v)} V"
    hertz = "" if part.frequency_hz is None else f" {part.frequency_hz} Hz"
    return f"steps {part.axis} {part.steps}{volts}{hertz}"


def _when(at_s: float | None) -> str:
    return "" if at_s is None else f"t={number(at_s)} s "


def _last_line(statement: Statement) -> int:
    if isinstance(statement, Leg):
        return max(statement.line, *(part.line for part in statement.parts))
    return statement.line
