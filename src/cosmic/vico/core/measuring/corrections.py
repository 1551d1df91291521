"""What an operator corrects about the fibres found on an image, kept with it and undoable.

Corrections are a list of edits over the lines that were found. Nothing is overwritten: undone edits
stay until another one takes their place, and what was found can always be had again. The file
belongs to one image, known by a digest of its pixels.
"""

import hashlib
import json
import operator
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import ConfigError, RecordingError, RecordingExistsError
from cosmic.frame.kept_file import write_whole
from cosmic.vico.core.vision.fibre import Fibre, paint
from cosmic.vico.core.vision.grey import MOST_SIDE_PX, grey_image
from cosmic.vico.core.vision.smoothing import arc_lengths, resampled

if TYPE_CHECKING:
    from cosmic.vico.core.measuring.corrections_file import KeptCorrections, KeptEdit, KeptLine

SUFFIX: Final = ".fibres.json"
VERSION: Final = 2
"""Since 2 edits have the number of the fibre they make; in 1 it follows from the edits before."""
FEWEST_POINTS: Final = 2
LEAST_PX: Final = 3.0
NEAR_WIDTHS: Final = 2.0
NEAR_PX: Final = 8.0
LEAST_REACH_PX: Final = 20.0
"""An edit is refused beyond it, or beyond what `nearest` takes for a click if that is more."""
MARGIN_PX: Final = 1.0
"""From the centre of an outermost pixel: half a pixel beyond its edge."""
MOST_LABELS: Final = 65_535

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One fibre as it stands after the edits.

    Attributes
    ----------
    number : int
        It keeps it through all edits that leave it whole; no other fibre ever gets it.
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
    new_number : int
        Of the fibre that an ``add`` or a ``cut`` makes, never used before; else 0.
    """

    KINDS: ClassVar[tuple[str, ...]] = ("add", "delete", "cut", "join", "move end")
    MAKING: ClassVar[tuple[str, ...]] = ("add", "cut")

    kind: str
    numbers: tuple[int, ...] = ()
    points_px: tuple[Point, ...] = ()
    width_px: float = 0.0
    when: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))
    new_number: int = 0


_COUNTS: Final = frozenset(
    {("add", 0, FEWEST_POINTS), ("delete", 1, 0), ("cut", 1, 1), ("join", 2, 0), ("move end", 1, 2)}
)
"""Kinds of edits with the fibres and points they have; an ``add`` may have more points."""


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
        self._next = len(self._found) + 1

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

    def contains(self, point_px: Point) -> bool:
        """Whether a point lies in the image, or half a pixel beside it at most."""
        rows, columns = self._pixels.shape
        x, y = point_px
        return bool(
            -MARGIN_PX <= x <= columns - 1 + MARGIN_PX and -MARGIN_PX <= y <= rows - 1 + MARGIN_PX
        )

    def add(self, points_px: Sequence[Point], width_px: float | None = None) -> None:
        """Add a fibre along clicked points, as wide as the others unless it is said.

        Raises
        ------
        ConfigError
            Fewer than two points, one outside the image, or a width that is not positive and
            smaller than the image.
        """
        points = _points(points_px)
        if len(points) < FEWEST_POINTS:
            raise ConfigError("corrections: a fibre has two points or more; click another")
        for each in points:
            self._check_inside(each)
        widths = [each.width_px for each in self.lines]
        usual = float(np.median(widths)) if widths else 2.0 * LEAST_PX
        self._do(Edit("add", (), points, usual if width_px is None else self._width(width_px)))

    def delete(self, number: int) -> None:
        """Delete a fibre; raises `ConfigError` where there is none of that number."""
        self._do(Edit("delete", (_number(number),)))

    def cut(self, number: int, at_px: Point) -> None:
        """Make two of a fibre, at the point of its line nearest to one clicked.

        Raises
        ------
        ConfigError
            The point is far from the line, a part would be too short, or there is no such fibre.
        """
        edit = Edit("cut", (_number(number),), _points([at_px]))
        self._check_near(edit)
        self._do(edit)

    def join(self, first: int, second: int) -> None:
        """Make one of two fibres, at the ends nearest to each other."""
        self._do(Edit("join", (_number(first), _number(second))))

    def move_end(self, number: int, end_px: Point, to_px: Point) -> None:
        """Move the end nearest to a point: back along the fibre, or straight on.

        Raises
        ------
        ConfigError
            The point is far from the line, the end would be outside the image, too little would be
            left, or there is no such fibre.
        """
        edit = Edit("move end", (_number(number),), _points([end_px, to_px]))
        self._check_near(edit)
        self._check_inside(edit.points_px[1])
        self._do(edit)

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
            if away <= _near_px(each) and (best is None or away < best[0]):
                best = (away, each)
        return None if best is None else best[1]

    def _do(self, edit: Edit) -> None:
        lines = {each.number: each for each in self.lines}
        making = edit.kind in Edit.MAKING
        if making:
            # Not even that of an edit undone since: it may stand in what was exported.
            edit = replace(edit, new_number=self._next)
        _apply(lines, edit)  # refuses before anything is changed
        self._next += making
        self._edits[self._done :] = [edit]
        self._done += 1

    def _check_inside(self, point: Point) -> None:
        if not self.contains(point):
            rows, columns = self._pixels.shape
            raise ConfigError(
                f"corrections: {_said(point)} lies outside the image of {columns} x {rows} px; "
                "choose a point on it"
            )

    def _check_near(self, edit: Edit) -> None:
        """Refuse a first point that is far from the fibre; one that is missing is refused later."""
        for line in self.lines:
            if line.number == edit.numbers[0]:
                away = _away_px(line, edit.points_px[0])
                reach = max(LEAST_REACH_PX, _near_px(line))
                if not away <= reach:
                    raise ConfigError(
                        f"corrections: {_said(edit.points_px[0])} is {away:.0f} px from fibre "
                        f"{line.number}, and {reach:.0f} px is the limit; choose a nearer point"
                    )

    def _width(self, width_px: float) -> float:
        most = min(self._pixels.shape)
        try:
            width = float(width_px)
        except (TypeError, ValueError, OverflowError):
            width = float("nan")
        if not 0.0 < width < most:
            raise ConfigError(
                f"corrections: a fibre is wider than 0 and narrower than the image, {most} px, not "
                f"{width_px!r} px"
            )
        return width

    # With the image

    @property
    def digest(self) -> str:
        """Of the pixels: what says that corrections and image belong together."""
        shape = str(self._pixels.shape).encode()
        return hashlib.sha256(shape + np.ascontiguousarray(self._pixels).tobytes()).hexdigest()

    def save(self, image_file: Path) -> Path:
        """Write them beside an image's file, instead of older ones; raises `RecordingError`."""
        path = side_file(image_file)
        whole = {
            "version": VERSION,
            "image": image_file.name,
            "pixels_sha256": self.digest,
            "found": [_plain(each) for each in self._found],
            "edits": [asdict(each) for each in self._edits],
            "in_force": self._done,
            "next_number": self._next,
            "fibres": [_plain(each) for each in self.lines],
        }
        try:
            write_whole(path, _json(whole, path))
        except OSError as exc:
            raise RecordingError(f"{path}: cannot be written ({exc.strerror or exc})") from exc
        return path

    @classmethod
    def open(cls, image: npt.NDArray[np.generic], image_file: Path) -> "Corrections":
        """Return what was saved beside an image.

        Raises
        ------
        RecordingError
            There is nothing, it is damaged or of a newer version, or it belongs to other pixels.
        """
        # Here: what reads it takes longer to load than all of this.
        from cosmic.vico.core.measuring.corrections_file import read_corrections, unreadable

        path = side_file(image_file)
        kept = read_corrections(path, VERSION)
        opened = cls(image, (), image_file.name)
        if kept.pixels_sha256 != opened.digest:
            raise RecordingError(f"{path}: belongs to another image than {image_file.name}")
        try:
            opened._restore(kept)
        except ConfigError as exc:
            raise unreadable(path, str(exc)) from exc
        return opened

    def _restore(self, kept: "KeptCorrections") -> None:
        """Take over what was read; raises `ConfigError` where edits do not fit the fibres."""
        self._found = tuple(_line(each) for each in kept.found)
        lines = {each.number: each for each in self._found}
        if len(lines) < len(self._found):
            raise ConfigError("two fibres have one number")
        used = set(lines)
        for position, each in enumerate(kept.edits, start=1):
            edit = _edit(each)
            if kept.version == 1 and edit.kind in Edit.MAKING:
                # As it was then, so that what was exported stays true.
                edit = replace(edit, new_number=max(lines, default=0) + 1)
            try:
                _apply(lines, edit)
            except ConfigError as exc:
                raise ConfigError(f"edit {position}: {exc}") from exc
            used.add(edit.new_number)
            self._edits.append(edit)
        self._done = kept.in_force
        self._next = max(kept.next_number, max(used, default=0) + 1)

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
                f"{stem}.json": _json(lines, folder / f"{stem}.json").encode(),
            },
        )


def side_file(image_file: Path) -> Path:
    """Return where the corrections of an image stand."""
    return image_file.with_name(image_file.name + SUFFIX)


def _apply(lines: dict[int, Line], edit: Edit) -> None:
    """Change lines as an edit says; raises `ConfigError` before anything is changed."""
    _check_edit(lines, edit)
    new = edit.new_number
    chosen = [lines[number] for number in edit.numbers]
    if edit.kind == "add":
        line = resampled(np.array(edit.points_px, dtype=np.float64), 2.0)
        _long_enough(line)
        lines[new] = Line(new, line, edit.width_px, by_operator=True)
    elif edit.kind == "delete":
        del lines[edit.numbers[0]]
    elif edit.kind == "cut":
        for number, part in zip((chosen[0].number, new), _cut(chosen[0], edit), strict=True):
            lines[number] = replace(chosen[0], number=number, line_px=part, by_operator=True)
    elif edit.kind == "join":
        first, second = chosen
        if first is second:
            raise ConfigError("corrections: a fibre cannot be joined to itself")
        line = _joined(first.line_px, second.line_px)
        del lines[second.number]
        lines[first.number] = replace(first, line_px=line, by_operator=True)
    else:
        moved = _with_end(chosen[0].line_px, *np.array(edit.points_px))
        lines[chosen[0].number] = replace(chosen[0], line_px=moved, by_operator=True)


def _check_edit(lines: Mapping[int, Line], edit: Edit) -> None:
    """Refuse an edit that no fibres can have, or not these; it may be one of a damaged file."""
    missing = [number for number in edit.numbers if number not in lines]
    if missing:
        raise ConfigError(f"corrections: there is no fibre {missing[0]}")
    if _count(edit) not in _COUNTS:
        raise ConfigError(
            f"corrections: there is no edit {edit.kind!r} of {len(edit.numbers)} fibres and "
            f"{len(edit.points_px)} points"
        )
    if edit.kind in Edit.MAKING and (edit.new_number < 1 or edit.new_number in lines):
        raise ConfigError(f"corrections: {edit.new_number} is not the number of a new fibre")
    if edit.kind == "add" and not 0.0 < edit.width_px <= MOST_SIDE_PX:
        raise ConfigError(f"corrections: a fibre is not {edit.width_px:g} px wide")


def _count(edit: Edit) -> tuple[str, int, int]:
    points = len(edit.points_px)
    return (
        edit.kind,
        len(edit.numbers),
        min(points, FEWEST_POINTS) if edit.kind == "add" else points,
    )


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
    try:
        plain = tuple((float(x), float(y)) for x, y in points)
    except (TypeError, ValueError, OverflowError) as exc:
        raise ConfigError(f"corrections: a point is two numbers, x and y ({exc})") from exc
    if not np.isfinite(np.array(plain)).all():
        raise ConfigError("corrections: a point is not finite; click again")
    return plain


def _number(number: int) -> int:
    """Return it as JSON has it: numpy's own cannot be kept."""
    try:
        return operator.index(number)
    except TypeError as exc:
        raise ConfigError(f"corrections: there is no fibre {number!r}") from exc


def _near_px(line: Line) -> float:
    return NEAR_WIDTHS * line.width_px + NEAR_PX


def _away_px(line: Line, point: Point) -> float:
    """Return how far a point is from a line; infinite where floats do not reach."""
    with np.errstate(over="ignore"):
        return float(np.hypot(*(line.line_px - np.array(point)).T).min())


def _said(point: Point) -> str:
    return f"the point ({point[0]:.5g}, {point[1]:.5g})"


def _json(whole: Mapping[str, object], path: Path) -> str:
    try:
        return json.dumps(whole, indent=1, allow_nan=False)
    except ValueError as exc:
        raise RecordingError(
            f"{path}: not written: a fibre that was found has a number that is not finite"
        ) from exc


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


def _line(kept: "KeptLine") -> Line:
    points = np.array(kept.line_px, dtype=np.float64)
    return Line(kept.number, points, kept.width_px, by_operator=kept.by_operator)


def _edit(kept: "KeptEdit") -> Edit:
    points = tuple((x, y) for x, y in kept.points_px)
    return Edit(kept.kind, tuple(kept.numbers), points, kept.width_px, kept.when, kept.new_number)
