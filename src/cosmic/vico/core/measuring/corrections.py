"""What an operator corrects about the fibres found on an image, kept with it and undoable.

Corrections are a list of edits over the lines that were found. Nothing is overwritten: undone edits
stay until another one takes their place, and what was found can always be had again. The file
belongs to one image, known by a digest of its pixels.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import ClassVar, Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import ConfigError, RecordingError, RecordingExistsError
from cosmic.frame.kept_file import write_whole
from cosmic.vico.core.vision.fibre import Fibre, paint
from cosmic.vico.core.vision.grey import Floats, grey_image
from cosmic.vico.core.vision.smoothing import arc_lengths, resampled

SUFFIX: Final = ".fibres.json"
VERSION: Final = 1
FEWEST_POINTS: Final = 2
LEAST_PX: Final = 3.0
NEAR_WIDTHS: Final = 2.0
NEAR_PX: Final = 8.0
MOST_LABELS: Final = 65_535

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One fibre as it stands after the edits.

    Attributes
    ----------
    number : int
        It keeps it through all edits that leave it whole.
    line_px : ndarray, shape (n, 2)
    by_operator : bool
        Drawn or changed by an operator, and not only found.
    """

    number: int
    line_px: Floats
    width_px: float
    by_operator: bool = False

    @property
    def length_px(self) -> float:
        """Length along the line."""
        return float(arc_lengths(self.line_px)[-1])


@dataclass(frozen=True, slots=True)
class Edit:
    """One thing an operator did.

    Attributes
    ----------
    kind : str
        ``add``, ``delete``, ``cut``, ``join`` or ``move end``.
    numbers : tuple of int
        The fibres it is about.
    points_px : tuple of (float, float)
        The points clicked: of the line added, of the cut, of the end and where it goes.
    when : str
        Time, ISO 8601, UTC.
    """

    KINDS: ClassVar[tuple[str, ...]] = ("add", "delete", "cut", "join", "move end")

    kind: str
    numbers: tuple[int, ...] = ()
    points_px: tuple[Point, ...] = ()
    width_px: float = 0.0
    when: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))


class Corrections:
    """The fibres of one image with an operator's edits. One thread.

    Parameters
    ----------
    image : ndarray
        As `find_fibres` takes it.
    found : iterable of Fibre
        What was found on it.
    """

    def __init__(
        self, image: npt.NDArray[np.generic], found: Iterable[Fibre] = (), name: str = ""
    ) -> None:
        self.name = name
        self._pixels = grey_image(image)
        self._found = tuple(
            Line(number, np.array(each.centre_line_px), each.width_px)
            for number, each in enumerate(found, start=1)
        )
        self._edits: list[Edit] = []
        self._done = 0

    @property
    def edits(self) -> tuple[Edit, ...]:
        """Those in force, the first one first."""
        return tuple(self._edits[: self._done])

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to be undone."""
        return self._done > 0

    @property
    def can_redo(self) -> bool:
        """Whether one that was undone can be had again."""
        return self._done < len(self._edits)

    @property
    def lines(self) -> tuple[Line, ...]:
        """The fibres after all edits in force."""
        lines = {each.number: each for each in self._found}
        for edit in self.edits:
            _apply(lines, edit)
        return tuple(lines.values())

    def add(self, points_px: Sequence[Point], width_px: float | None = None) -> None:
        """Add a fibre along clicked points; raises `ConfigError` for fewer than two."""
        if len(points_px) < FEWEST_POINTS:
            raise ConfigError("corrections: a fibre has two points or more; click another")
        widths = [each.width_px for each in self.lines]
        usual = float(np.median(widths)) if widths else 2.0 * LEAST_PX
        self._do(Edit("add", (), _points(points_px), usual if width_px is None else width_px))

    def delete(self, number: int) -> None:
        """Delete a fibre; raises `ConfigError` where there is none of that number."""
        self._do(Edit("delete", (number,)))

    def cut(self, number: int, at_px: Point) -> None:
        """Make two of a fibre, at the point of its line nearest to one clicked."""
        self._do(Edit("cut", (number,), _points([at_px])))

    def join(self, first: int, second: int) -> None:
        """Make one of two fibres, at the ends nearest to each other."""
        self._do(Edit("join", (first, second)))

    def move_end(self, number: int, end_px: Point, to_px: Point) -> None:
        """Move the end nearest to a point: back along the fibre, or straight on."""
        self._do(Edit("move end", (number,), _points([end_px, to_px])))

    def undo(self) -> None:
        """Undo the last edit in force; does nothing where there is none."""
        self._done = max(0, self._done - 1)

    def redo(self) -> None:
        """Do again what was undone last."""
        self._done = min(len(self._edits), self._done + 1)

    def nearest(self, point_px: Point) -> Line | None:
        """Return the fibre that was clicked; None: none is near."""
        best: tuple[float, Line] | None = None
        for each in self.lines:
            away = float(np.linalg.norm(each.line_px - np.array(point_px), axis=1).min())
            if away <= NEAR_WIDTHS * each.width_px + NEAR_PX and (best is None or away < best[0]):
                best = (away, each)
        return None if best is None else best[1]

    def _do(self, edit: Edit) -> None:
        lines = {each.number: each for each in self.lines}
        _apply(lines, edit)  # refuses before anything is changed
        self._edits[self._done :] = [edit]
        self._done += 1

    # With the image

    @property
    def digest(self) -> str:
        """Of the pixels: what says that corrections and image belong together."""
        shape = str(self._pixels.shape).encode()
        return hashlib.sha256(shape + np.ascontiguousarray(self._pixels).tobytes()).hexdigest()

    def save(self, image_file: Path) -> Path:
        """Write them beside an image's file; raises `RecordingError`."""
        path = side_file(image_file)
        whole = {
            "version": VERSION,
            "image": image_file.name,
            "pixels_sha256": self.digest,
            "found": [_plain(each) for each in self._found],
            "edits": [asdict(each) for each in self._edits],
            "in_force": self._done,
            "fibres": [_plain(each) for each in self.lines],
        }
        try:
            write_whole(path, json.dumps(whole, indent=1))
        except OSError as exc:
            raise RecordingError(f"{path}: cannot be written ({exc.strerror or exc})") from exc
        return path

    @classmethod
    def open(cls, image: npt.NDArray[np.generic], image_file: Path) -> "Corrections":
        """Return what was saved beside an image.

        Raises
        ------
        RecordingError
            There is nothing, it cannot be read, or it belongs to other pixels.
        """
        path = side_file(image_file)
        try:
            whole = json.loads(path.read_text(encoding="utf-8"))
            found = tuple(_line(each) for each in whole["found"])
            edits = [_edit(each) for each in whole["edits"]]
            done, digest = int(whole["in_force"]), str(whole["pixels_sha256"])
        except (OSError, ValueError, KeyError, TypeError) as exc:
            raise RecordingError(f"{path}: holds no corrections that can be read ({exc})") from exc
        opened = cls(image, (), image_file.name)
        if digest != opened.digest:
            raise RecordingError(f"{path}: belongs to another image than {image_file.name}")
        opened._found, opened._edits = found, edits
        opened._done = min(max(done, 0), len(edits))
        return opened

    def export(self, folder: Path, stem: str) -> None:
        """Write the image and its fibres as training data: pixels, labels, lines.

        ``STEM.png`` is the image in grey, ``STEM-labels.png`` has 0 for ground and the fibre's
        number, 16 bit, where one is (the later one where two cross), and ``STEM.json`` the lines.

        Raises
        ------
        RecordingError
            They cannot be written; `RecordingExistsError` where one of them is there already:
            nothing is replaced, the image that was corrected least of all.
        """
        labels = np.zeros(self._pixels.shape, np.uint16)
        for each in self.lines:
            if not each.number <= MOST_LABELS:
                raise RecordingError(
                    f"{folder}: labels go to {MOST_LABELS}, and a fibre has the number "
                    f"{each.number}; delete it before the export"
                )
            mask = np.zeros(self._pixels.shape, np.uint8)
            line = resampled(each.line_px, 2.0)
            paint(mask, line, np.full(len(line), each.width_px))
            labels[mask > 0] = each.number
        lines = {"fibres": [_plain(each) for each in self.lines]}
        _write_new(
            folder,
            {
                f"{stem}.png": cv2.imencode(".png", self._pixels)[1].tobytes(),
                f"{stem}-labels.png": cv2.imencode(".png", labels)[1].tobytes(),
                f"{stem}.json": json.dumps(lines, indent=1).encode(),
            },
        )


def side_file(image_file: Path) -> Path:
    """Return where the corrections of an image stand."""
    return image_file.with_name(image_file.name + SUFFIX)


def _apply(lines: dict[int, Line], edit: Edit) -> None:
    """Change lines as an edit says; raises `ConfigError` before anything is changed."""
    missing = [number for number in edit.numbers if number not in lines]
    if missing:
        raise ConfigError(f"corrections: there is no fibre {missing[0]}")
    fresh = max(lines, default=0) + 1
    chosen = [lines[number] for number in edit.numbers]
    if edit.kind == "add":
        line = resampled(np.array(edit.points_px, dtype=np.float64), 2.0)
        _long_enough(line)
        lines[fresh] = Line(fresh, line, edit.width_px, by_operator=True)
    elif edit.kind == "delete":
        del lines[edit.numbers[0]]
    elif edit.kind == "cut":
        for number, part in zip((chosen[0].number, fresh), _cut(chosen[0], edit), strict=True):
            lines[number] = replace(chosen[0], number=number, line_px=part, by_operator=True)
    elif edit.kind == "join":
        first, second = chosen
        if first is second:
            raise ConfigError("corrections: a fibre cannot be joined to itself")
        line = _joined(first.line_px, second.line_px)
        del lines[second.number]
        lines[first.number] = replace(first, line_px=line, by_operator=True)
    elif edit.kind == "move end":
        moved = _with_end(chosen[0].line_px, *np.array(edit.points_px))
        lines[chosen[0].number] = replace(chosen[0], line_px=moved, by_operator=True)
    else:
        raise ConfigError(f"corrections: there is no edit {edit.kind!r}")


def _cut(line: Line, edit: Edit) -> tuple[Floats, Floats]:
    away = np.linalg.norm(line.line_px - np.array(edit.points_px[0]), axis=1)
    at = int(np.argmin(away))
    parts = line.line_px[: at + 1], line.line_px[at:]
    for part in parts:
        _long_enough(part)
    return parts


def _joined(first: Floats, second: Floats) -> Floats:
    orders = [(one, other) for one in (first, first[::-1]) for other in (second, second[::-1])]
    one, other = min(orders, key=lambda order: float(np.linalg.norm(order[0][-1] - order[1][0])))
    return np.concatenate([one, other])


def _with_end(line: Floats, end: Floats, to: Floats) -> Floats:
    """Return a line with the end nearest to `end` at `to`."""
    turned = np.linalg.norm(line[0] - end) < np.linalg.norm(line[-1] - end)
    ordered = line[::-1] if turned else line
    at = int(np.argmin(np.linalg.norm(ordered - to, axis=1)))
    moved = np.concatenate([ordered[: at + 1] if at < len(ordered) - 1 else ordered, to[None]])
    _long_enough(moved)
    return moved[::-1] if turned else moved


def _long_enough(line: Floats) -> None:
    if len(line) < FEWEST_POINTS or not float(arc_lengths(line)[-1]) >= LEAST_PX:
        raise ConfigError(f"corrections: what is left would be shorter than {LEAST_PX:g} px")


def _points(points: Sequence[Point]) -> tuple[Point, ...]:
    plain = tuple((float(x), float(y)) for x, y in points)
    if not np.isfinite(np.array(plain)).all():
        raise ConfigError("corrections: a point is no number")
    return plain


def _write_new(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files, all of them or none; none of them may be there."""
    made: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in contents.items():
            path = folder / name
            if os.path.lexists(path):
                raise _exists(path)
            with path.open("xb") as file:
                made.append(path)
                file.write(content)
    except OSError as exc:
        for path in made:
            with suppress(OSError):
                path.unlink()
        if isinstance(exc, RecordingError):
            raise
        raise RecordingError(f"{folder}: cannot be written ({exc.strerror or exc})") from exc


def _exists(path: Path) -> RecordingExistsError:
    return RecordingExistsError(
        f"{path}: there is such a file, and it is not replaced. Export to another folder, or move "
        "the file away if it is an old export."
    )


def _plain(line: Line) -> dict[str, object]:
    return {
        "number": line.number,
        "width_px": line.width_px,
        "length_px": line.length_px,
        "by_operator": line.by_operator,
        "line_px": np.round(line.line_px, 3).tolist(),
    }


def _line(plain: dict[str, object]) -> Line:
    points = np.array(plain["line_px"], dtype=np.float64).reshape(-1, 2)
    width = float(str(plain["width_px"]))
    return Line(int(str(plain["number"])), points, width, by_operator=bool(plain["by_operator"]))


def _edit(plain: dict[str, object]) -> Edit:
    numbers, points = np.array(plain["numbers"], int), np.array(plain["points_px"], np.float64)
    return Edit(
        str(plain["kind"]),
        tuple(numbers.tolist()),
        tuple((float(x), float(y)) for x, y in points.reshape(-1, 2)),
        float(str(plain["width_px"])),
        str(plain["when"]),
    )
