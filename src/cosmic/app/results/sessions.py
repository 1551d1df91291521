"""Sessions: the folders of what was recorded, what lies in them, and what is known of them."""

import logging
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from datetime import date, datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import Final

import tomlkit
from PySide6.QtCore import QStandardPaths
from tomlkit.exceptions import TOMLKitError

from cosmic.autonomy.campaign.storage_format import DATABASE
from cosmic.frame.kept_file import write_whole
from cosmic.vico.core.recording.formats import SIDE_SUFFIX, ImageFormat, recording_suffix
from cosmic.vico.core.recording.side_row import COLUMNS

logger = logging.getLogger(__name__)

ABOUT: Final = "session.toml"
"""Sample, operator and note of a session; a person may write it, too."""
MOST_ITEMS: Final = 1000
SEEN: Final = "_seen"
"""Behind the name of a recording: an image of it as somebody saw it, which nobody recorded."""
_EXPORTED: Final = re.compile(rf"{SEEN}(_\d+)?$")
STILLS: Final = (".png", ".tif", ".tiff")


class SessionFolder:
    """The folder of one session's files in the user's documents; made when the first is written.

    Attributes
    ----------
    home : Path
        Where the folders of all sessions are.
    on_made : callable or None
        Called with the folder whenever somebody is about to write there.
    """

    def __init__(self, now: Callable[[], datetime] = datetime.now) -> None:
        place = QStandardPaths.StandardLocation.DocumentsLocation
        self.home = Path(QStandardPaths.writableLocation(place)) / "CoSMic" / "sessions"
        self._name = f"{now():%Y-%m-%d_%H-%M}"
        self._folder: Path | None = None
        self.on_made: Callable[[Path], object] | None = None

    @property
    def path(self) -> Path:
        """Where it is, or will be."""
        return self._folder or self.home / self._name

    def __call__(self) -> Path:
        """Return it, made now if need be; raises `OSError`."""
        folder = self.path
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        if self.on_made is not None:
            self.on_made(folder)
        return folder


class ItemKind(StrEnum):
    """What an item of a session is; the value is the word."""

    FORCE = "force"
    IMAGES = "images"
    IMAGE = "image"
    CAMPAIGN = "campaign"


@dataclass(frozen=True, slots=True)
class Item:
    """Something that was recorded.

    Attributes
    ----------
    path : Path
        A force recording, the side file of a recording of images, an image, or the folder of a
        campaign.
    changed : datetime
        When it was written to last; local time, with a zone.
    """

    kind: ItemKind
    path: Path
    changed: datetime
    size_bytes: int

    @property
    def name(self) -> str:
        """How it is called in a list."""
        return self.path.name.removesuffix(SIDE_SUFFIX).removesuffix(".h5")


@dataclass(frozen=True, slots=True)
class About:
    """What a person wrote of a session."""

    sample: str = ""
    operator: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Session:
    """A folder with what was recorded in it, newest first."""

    folder: Path
    items: tuple[Item, ...]
    about: About = About()

    @property
    def changed(self) -> datetime:
        """When something in it was written to last."""
        return max(each.changed for each in self.items)

    def matches(self, words: str, today: date) -> tuple[Item, ...]:
        """Return the items that all of `words` fit: name, day, sample, operator or note.

        "today" and "yesterday" are days, too.
        """
        wanted = words.casefold().split()
        about = " ".join((self.folder.name, *(getattr(self.about, f.name) for f in fields(About))))
        return tuple(
            each
            for each in self.items
            if all(word in f"{_words(each, today)} {about}".casefold() for word in wanted)
        )


def _words(item: Item, today: date) -> str:
    day = item.changed.date()
    named = {today: "today", today - timedelta(days=1): "yesterday"}.get(day, "")
    return f"{item.name} {item.kind} {day.isoformat()} {named}"


def sessions_in(folders: Sequence[Path]) -> list[Session]:
    """Return the sessions in folders and in those just below them, newest first."""
    found: dict[Path, list[Item]] = {}
    for folder in folders:
        for item in _items(folder):
            items = found.setdefault(item.path.parent, [])
            if item not in items:
                items.append(item)
    sessions = [
        Session(
            folder,
            tuple(sorted(items, key=lambda each: each.changed, reverse=True)),
            read_about(folder),
        )
        for folder, items in found.items()
    ]
    sessions.sort(key=lambda each: each.changed, reverse=True)
    kept, count = [], 0
    for each in sessions:
        kept.append(replace(each, items=each.items[: MOST_ITEMS - count]))
        count += len(kept[-1].items)
        if count >= MOST_ITEMS:
            break
    return kept


def _items(folder: Path) -> Iterator[Item]:
    yield from _readable_items_of(folder)
    try:
        there = sorted(folder.iterdir())
    except OSError:
        return
    for each in there:
        try:
            # Recordings of a campaign belong to its report, and images of a film to that.
            listed = each.is_dir() and not (each / DATABASE).exists() and not _is_film(each)
        except OSError as exc:
            logger.debug("%s cannot be listed: %s", each, exc)
            continue
        if listed:
            yield from _readable_items_of(each)


def _is_film(folder: Path) -> bool:
    return is_side_file(folder.with_name(folder.name + SIDE_SUFFIX))


def _readable_items_of(folder: Path) -> Iterator[Item]:
    """Yield what can be seen in a folder; one that cannot be read hides no other."""
    try:
        yield from _items_of(folder)
    except OSError as exc:
        logger.debug("%s cannot be listed: %s", folder, exc)


def _items_of(folder: Path) -> Iterator[Item]:
    sides = [path for path in folder.glob(f"*{SIDE_SUFFIX}") if is_side_file(path)]
    filmed = {path.name.removesuffix(SIDE_SUFFIX) for path in sides}
    for path in folder.iterdir():
        kind = _kind(path, filmed)
        if kind is None:
            continue
        try:
            facts = (path / DATABASE if kind is ItemKind.CAMPAIGN else path).stat()
            size = facts.st_size + (_images_bytes(path) if kind is ItemKind.IMAGES else 0)
        except OSError:
            continue  # gone since
        changed = datetime.fromtimestamp(facts.st_mtime).astimezone()
        yield Item(kind, path, changed, size)


def _images_bytes(side: Path) -> int:
    """Return how large the images of a side file are: those of a film, or of a directory."""
    stem = side.name.removesuffix(SIDE_SUFFIX)
    beside = (side.with_name(stem + recording_suffix(each)) for each in ImageFormat)
    found = next((path for path in beside if path.exists()), side)
    files = found.rglob("*") if found.is_dir() else (found,) if found != side else ()
    return sum(path.stat().st_size for path in files if path.is_file())


def _kind(path: Path, filmed: set[str]) -> ItemKind | None:
    name = path.name.lower()
    if name.endswith(SIDE_SUFFIX):
        return ItemKind.IMAGES if path.name.removesuffix(SIDE_SUFFIX) in filmed else None
    if name.endswith(".h5"):
        return ItemKind.FORCE
    if path.is_dir() and (path / DATABASE).exists():
        return ItemKind.CAMPAIGN
    is_image = name.endswith(STILLS) and path.is_file()
    if is_image and path.stem not in filmed and not _EXPORTED.search(path.stem):
        return ItemKind.IMAGE
    return None


def is_side_file(path: Path) -> bool:
    """Tell whether a table is the side file of a recording of images, by its first columns."""
    head = ",".join(COLUMNS[:3]).encode()
    try:
        with path.open("rb") as file:
            return file.read(len(head)) == head
    except OSError:
        return False


# What is known of a session


def read_about(folder: Path) -> About:
    """Return what was written of a session; empty where nothing was, or nobody can read it."""
    try:
        document = tomlkit.parse((folder / ABOUT).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return About()
    except (OSError, ValueError, TOMLKitError) as exc:
        logger.warning("%s cannot be read: %s", folder / ABOUT, exc)
        return About()
    return About(**{each.name: str(document.get(each.name, "")) for each in fields(About)})


def write_about(folder: Path, about: About) -> None:
    """Keep what is known of a session; comments and other keys in the file stay.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    path = folder / ABOUT
    try:
        document = tomlkit.parse(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        document = tomlkit.document()
    except (ValueError, TOMLKitError) as exc:
        raise OSError(f"{path} is not TOML and stays as it is: {exc}") from exc
    for each in fields(About):
        document[each.name] = getattr(about, each.name)
    write_whole(path, tomlkit.dumps(document))
