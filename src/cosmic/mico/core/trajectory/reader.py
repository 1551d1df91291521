"""Reading a trajectory from text: everything wrong with it is told, with its line."""

import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Final

from cosmic.frame.errors import QuantityError
from cosmic.frame.kept_file import open_file
from cosmic.mico.core.trajectory import words
from cosmic.mico.core.trajectory.model import (
    VERSION,
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

LARGEST_BYTES: Final = 32 * 1024 * 1024
MOST_LINES: Final = 200_000
LONGEST_LINE: Final = 500
MOST_PROBLEMS: Final = 200
END_OF_RECORDING: Final = "end of recording"
_LOOK_EVERY: Final = 500
_TIMED: Final = re.compile(r"t\s*=\s*([^ \t]+[ \t]*(?:ms|s|min))(?=[ \t]|$)[ \t]*(.*)")
_CONTROL: Final = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\x85\u2028\u2029]")
_STEPS: Final = re.compile(r"([+-]?\S+?)(?:\s+(\S+?\s*m?V))?(?:\s+(\S+?\s*k?Hz))?")

OnProgress = Callable[[float], object]


def head_problem(word: str, text: str) -> str:
    """Return why the line of that word, such as "title", cannot say `text`; empty where it can."""
    if "\n" in text or "#" in text:
        return "is one line without #"
    if _CONTROL.search(text) or any(unicodedata.category(each) == "Cs" for each in text):
        return "has only characters that can be printed"
    longest = LONGEST_LINE - len(word) - 1
    return f"has at most {longest} characters" if len(text) > longest else ""


class TrajectoryReader:
    """Takes one line after the other and keeps what it says."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self._statements: list[Statement] = []
        self._comments: list[tuple[int, str]] = []
        self._start: dict[str, StartPosition] = {}
        self._once: dict[str, tuple[str, int]] = {}
        self._pose_axes: tuple[str, ...] | None = None
        self._moved: set[str] = set()
        self._block: list[Move | Steps] | None = None
        self._block_line = 0
        self._block_at_s: float | None = None
        self._last_at_s = 0.0
        self._headed = False
        self._ended = 0
        self._line = 0
        self._words: dict[str, Callable[[str], None]] = {
            "platform": lambda rest: self._note("platform", rest),
            "title": lambda rest: self._note("title", rest),
            "recorded": lambda rest: self._note("recorded", rest),
            "relative": self._relative,
            "start": self._starts,
            "speed": self._speed,
            "wait": lambda rest: self._wait(rest, None),
            "together": lambda rest: self._open_block(rest, None),
            "end": self._end,
        }

    def read(self, lines: list[str], progress: OnProgress) -> None:
        """Take all lines."""
        for number, line in enumerate(lines, start=1):
            self._line = number
            try:
                self._take(line)
            except QuantityError as exc:
                self.problems.append(Problem(number, str(exc)))
            if number == 1 and not self._headed:
                return  # of a foreign file one line is enough
            if len(self.problems) >= MOST_PROBLEMS:
                self.problems.append(Problem(number, "the rest was not read: too many mistakes"))
                return
            if number % _LOOK_EVERY == 0:
                progress(number / len(lines))

    def close(self, last: int, *, cut_off: bool) -> None:
        """See that nothing is missing at the end."""
        if not last:
            self.problems.append(Problem(1, "the file is empty"))
        if self.problems:
            return
        if self._block is not None:
            text = f"the block together of line {self._block_line} has no end"
            self.problems.append(Problem(last, f"{text}; is the file cut off?"))
        if "platform" not in self._once:
            self.problems.append(Problem(1, "the line 'platform NAME' is missing"))
        if "recorded" in self._once and not self._ended and not cut_off:
            text = f"the recording is cut off: it has no last line {END_OF_RECORDING!r}"
            self.problems.append(Problem(last, f"{text}; add that line to use what is there"))

    def trajectory(self, lines: tuple[str, ...], path: Path | None) -> Trajectory:
        """Return what was read."""
        nothing = ("", 0)
        platform, platform_line = self._once.get("platform", nothing)
        pose, pose_line = self._once.get("relative", nothing)
        return Trajectory(
            platform=platform,
            statements=tuple(self._statements),
            title=self._once.get("title", nothing)[0],
            recorded=self._once.get("recorded", nothing)[0],
            pose=pose,
            pose_axes=self._pose_axes,
            pose_line=pose_line,
            platform_line=platform_line,
            start=dict(self._start),
            comments=tuple(self._comments),
            lines=lines,
            path=path,
        )

    # One line

    def _take(self, line: str) -> None:
        if len(line) > LONGEST_LINE:
            raise QuantityError(f"has {len(line)} characters, more than {LONGEST_LINE}")
        if _CONTROL.search(line):
            raise QuantityError("has characters that cannot be printed; is this a text file?")
        said, mark, comment = line.partition("#")
        said = said.strip()
        if self._line == 1:
            self._head(said)
            return
        if mark:
            self._comments.append((self._line, comment.strip()))
        if not said:
            return
        if self._ended:
            raise QuantityError(f"comes after {END_OF_RECORDING!r} of line {self._ended}")
        self._statement(said)

    def _head(self, said: str) -> None:
        parts = said.split()
        if len(parts) != 2 or parts[0] != "cosmic-trajectory":
            raise QuantityError(
                f"this is not a trajectory: the first line of one is 'cosmic-trajectory {VERSION}'"
            )
        if words.whole(parts[1], "a version") != VERSION:
            raise QuantityError(
                f"is of version {parts[1]}, and this program reads version {VERSION}; "
                "use a newer program"
            )
        self._headed = True

    def _statement(self, said: str) -> None:
        timed = _TIMED.fullmatch(said) if said.startswith("t") else None
        if timed is not None:
            self._at(timed[1], timed[2])
            return
        first, _, rest = said.partition(" ")
        action = self._words.get(first)
        if action is None:
            self._motion(said, None)
        elif self._block is not None and first != "end":
            raise QuantityError(f"{first!r} cannot be in a block together; is its 'end' missing?")
        else:
            action(rest.strip())

    def _at(self, when: str, said: str) -> None:
        """Take a statement that says when it begins."""
        if self._block is not None:
            raise QuantityError("give the time before 'together', not inside the block")
        at_s = words.time_s(when)
        if at_s < self._last_at_s:
            raise QuantityError(
                f"t = {when} is earlier than the {self._last_at_s:g} s of a line before"
            )
        self._last_at_s = at_s
        first, _, rest = said.partition(" ")
        if first == "wait":
            self._wait(rest.strip(), at_s)
        elif first == "together":
            self._open_block(rest.strip(), at_s)
        else:
            self._motion(said, at_s)

    def _note(self, key: str, value: str) -> None:
        if key in self._once:
            raise QuantityError(f"{key!r} is in line {self._once[key][1]} already")
        if self._statements:
            raise QuantityError(f"{key!r} belongs before the first movement")
        if not value:
            raise QuantityError(f"{key!r} says nothing")
        self._once[key] = (value, self._line)

    def _relative(self, rest: str) -> None:
        head, _, axes = rest.partition(":")
        before, _, pose = head.strip().partition("pose ")
        if before.split() != ["to"]:
            raise QuantityError(
                "write it as: relative to pose NAME, or: relative to pose NAME: left.x"
            )
        self._note("relative", words.free_name(pose.strip(), "pose"))
        if axes.strip():
            self._pose_axes = tuple(words.axis_name(each.strip()) for each in axes.split(","))

    def _starts(self, rest: str) -> None:
        for each in rest.split(","):
            name, _, where = each.strip().partition(" ")
            axis = words.axis_name(name)
            if axis in self._moved:
                raise QuantityError(f"{axis} moves before line {self._line} gives its start")
            if axis in self._start:
                raise QuantityError(f"the start of {axis} is in line {self._start[axis].line}")
            value, unit = words.position(where.strip())
            self._start[axis] = StartPosition(value, unit, self._line)

    def _speed(self, rest: str) -> None:
        name, _, how = rest.partition(" ")
        value, unit = words.speed(how.strip())
        self._statements.append(Speed(words.axis_name(name), value, unit, self._line))

    def _wait(self, rest: str, at_s: float | None) -> None:
        self._statements.append(Wait(words.time_s(rest), self._line, at_s))

    def _open_block(self, rest: str, at_s: float | None) -> None:
        if rest:
            raise QuantityError("'together' is alone in its line; the movements follow, then 'end'")
        self._block, self._block_line, self._block_at_s = [], self._line, at_s

    def _end(self, rest: str) -> None:
        if rest == "of recording" and self._block is None:
            self._ended = self._line
            return
        if rest or self._block is None:
            raise QuantityError("'end' closes a block together, and there is none open here")
        block, self._block = tuple(self._block), None
        if not block:
            raise QuantityError(f"the block together of line {self._block_line} is empty")
        self._statements.append(Leg(block, self._block_line, self._block_at_s))

    def _motion(self, said: str, at_s: float | None) -> None:
        part = self._part(said)
        self._moved.add(part.axis)
        if self._block is None:
            self._statements.append(Leg((part,), self._line, at_s))
            return
        twice = [each.line for each in self._block if each.axis == part.axis]
        if twice:
            raise QuantityError(f"{part.axis} moves in line {twice[0]} of the same block already")
        self._block.append(part)

    def _part(self, said: str) -> Move | Steps:
        first, _, rest = said.partition(" ")
        if first == "steps":
            return self._steps(rest.strip())
        word, _, where = rest.strip().partition(" ")
        if word not in ("to", "by"):
            known = "AXIS to 12.5 um, AXIS by -5 um, steps, wait, together, speed"
            raise QuantityError(f"{said[:60]!r} is not understood; there are: {known}")
        value, unit = words.position(where.strip())
        return Move(words.axis_name(first), value, unit, word == "by", self._line)

    def _steps(self, rest: str) -> Steps:
        name, _, how = rest.partition(" ")
        match = _STEPS.fullmatch(how.strip())
        if match is None:
            raise QuantityError("write it as: steps left.gripper -100 100 V 1000 Hz")
        hertz = None if match[3] is None else words.quantity(match[3], "Hz")
        if hertz is not None and hertz != round(hertz):
            raise QuantityError(f"{match[3]!r} is not a whole number of Hz")
        return Steps(
            axis=words.axis_name(name),
            steps=words.whole(match[1], "steps"),
            amplitude_v=None if match[2] is None else words.quantity(match[2], "V"),
            frequency_hz=None if hertz is None else round(hertz),
            line=self._line,
        )


def load(path: Path, progress: OnProgress | None = None, *, cut_off: bool = False) -> Trajectory:
    """Read a trajectory from a file.

    Parameters
    ----------
    progress : callable or None
        Called with the part that is done, 0 to 1.
    cut_off : bool
        Take a recording that has no end, as one that a crash or a full disk has cut off.

    Raises
    ------
    TrajectoryError
        The file cannot be read, or something in it is wrong; names each line.
    """
    try:
        with open_file(path) as file:
            data = file.read(LARGEST_BYTES + 1)
    except (OSError, ValueError) as exc:  # a name with a zero in it is no OSError
        text = f"cannot be read: {exc}"
        raise TrajectoryError(str(path), [Problem(0, text)]) from exc
    return parse(data, name=str(path), path=path, progress=progress, cut_off=cut_off)


def parse(
    data: bytes | str,
    *,
    name: str = "trajectory",
    path: Path | None = None,
    progress: OnProgress | None = None,
    cut_off: bool = False,
) -> Trajectory:
    """Read a trajectory from what a file holds; arguments and errors as `load`."""
    text = _decoded(data, name)
    lines = text.split("\n")
    if lines[-1] == "":
        lines.pop()
    if len(lines) > MOST_LINES:
        problem = f"has {len(lines)} lines, more than {MOST_LINES}; split it"
        raise TrajectoryError(name, [Problem(0, problem)])
    reader = TrajectoryReader()
    reader.read(lines, progress or (lambda _part: None))
    reader.close(len(lines), cut_off=cut_off)
    if reader.problems:
        raise TrajectoryError(name, reader.problems)
    return reader.trajectory(tuple(lines), path)


def _decoded(data: bytes | str, name: str) -> str:
    if len(data) > LARGEST_BYTES:
        size = f"is larger than {LARGEST_BYTES // 2**20} MB, which is not a trajectory"
        raise TrajectoryError(name, [Problem(0, size)])
    try:
        text = data.decode("utf-8-sig") if isinstance(data, bytes) else data
    except UnicodeDecodeError as exc:
        line = exc.object[: exc.start].count(b"\n") + 1
        problem = Problem(line, "is no UTF-8 text; save the file in the encoding UTF-8")
        raise TrajectoryError(name, [problem]) from None
    return text.replace("\r\n", "\n")
