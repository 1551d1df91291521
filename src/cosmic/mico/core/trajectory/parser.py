"""Reading a trajectory from text: everything wrong with it is told, with its line."""

from pathlib import Path
from typing import Final

from cosmic.frame.kept_file import open_file
from cosmic.mico.core.trajectory.model import Problem, Trajectory, TrajectoryError
from cosmic.mico.core.trajectory.reader import OnProgress, TrajectoryReader

LARGEST_BYTES: Final = 32 * 1024 * 1024
MOST_LINES: Final = 200_000


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
        size = f"is larger than {LARGEST_BYTES // 2**20} MB, which is no trajectory"
        raise TrajectoryError(name, [Problem(0, size)])
    try:
        text = data.decode("utf-8-sig") if isinstance(data, bytes) else data
    except UnicodeDecodeError as exc:
        line = exc.object[: exc.start].count(b"\n") + 1
        problem = Problem(line, "is no UTF-8 text; save the file in the encoding UTF-8")
        raise TrajectoryError(name, [problem]) from None
    return text.replace("\r\n", "\n")
