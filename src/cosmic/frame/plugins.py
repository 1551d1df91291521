"""Devices and methods by name: what ships with CoSMic and what other packages bring, by one door.

A package announces what it brings as an entry point in its ``pyproject.toml``::

    [project.entry-points."cosmic.boards"]
    my_board = "my_package.board:BACKEND"

The name before the equals sign is what the configuration says; behind it stands a `Backend`. CoSMic
announces its own in the same way. A package is loaded when the configuration names it, not before.
What fails to load raises `PluginError`, which names the package: the part that it was for is
missing, and the rest of the platform goes on.

Free of Qt; any thread.
"""

import re
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from enum import StrEnum
from functools import cache, lru_cache
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, entry_points
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

from cosmic.frame.config import StrictModel, check_model
from cosmic.frame.errors import ConfigError, PluginError

C = TypeVar("C")
P = TypeVar("P")


class Kind(StrEnum):
    """What can be brought; the value is the group of the entry points."""

    CONTROLLER = "cosmic.controllers"
    BOARD = "cosmic.boards"
    CAMERA = "cosmic.cameras"
    LENS = "cosmic.lenses"
    LIGHT = "cosmic.lights"
    INPUT = "cosmic.inputs"
    POSITIONER = "cosmic.positioners"
    PROCEDURE = "cosmic.procedures"
    ANALYSIS = "cosmic.analyses"
    EXPORTER = "cosmic.exporters"
    APPLICATION = "cosmic.applications"
    CONTACT = "cosmic.contacts"

    @property
    def word(self) -> str:
        """What one of them is called before the operator."""
        return _WORDS[self]


_WORDS: Final[Mapping[Kind, str]] = {
    Kind.CONTROLLER: "controller",
    Kind.BOARD: "acquisition board",
    Kind.CAMERA: "camera",
    Kind.LENS: "lens",
    Kind.LIGHT: "light",
    Kind.INPUT: "input device",
    Kind.POSITIONER: "positioner type",
    Kind.PROCEDURE: "procedure",
    Kind.ANALYSIS: "analysis",
    Kind.EXPORTER: "exporter",
    Kind.APPLICATION: "application",
    Kind.CONTACT: "contact response",
}


class NoOptions(StrictModel):
    """The settings of a backend that has none of its own."""


@dataclass(frozen=True)
class Backend(Generic[C, P]):
    """What an entry point of CoSMic leads to.

    Attributes
    ----------
    make : callable
        Returns the product, with nothing opened and nothing moving; its arguments are the
        backend's own settings, checked, and what the platform gives to every backend of its kind.
        Raises `CosmicError` where something is missing that the user can mend.
    options : type of StrictModel
        What the configuration may say under ``options``.
    simulated : bool
        No hardware is behind it.
    twin : bool
        It moves, feels or shows the simulated platform. Where a controller does, there is one.
    """

    make: Callable[[Any, C], P]
    options: type[StrictModel] = NoOptions
    simulated: bool = False
    twin: bool = False


@dataclass(frozen=True, slots=True)
class Plugin:
    """One name of one kind, not loaded.

    Attributes
    ----------
    package : str
        Who brings it, with the version.
    target : str
        Module and attribute.
    extras : tuple of str
        Extras of the package that it needs.
    """

    kind: Kind
    name: str
    package: str
    target: str
    extras: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Its name and who brings it, such as "scu3d (cosmic 0.4.0)"."""
        package, _, version = self.package.partition(" ")
        extras = f"[{','.join(self.extras)}]" if self.extras else ""
        return f"{self.name} ({package}{extras} {version})"


_NO_OPTIONS: Final[Mapping[str, object]] = {}


def plugins(kind: Kind) -> tuple[Plugin, ...]:
    """Return all of a kind, by name."""
    return tuple(
        Plugin(kind, each.name, _package(each), each.value, tuple(each.extras))
        for each in sorted(_entries(kind), key=lambda each: each.name)
    )


def names(kind: Kind) -> tuple[str, ...]:
    """Return the names that the configuration may use."""
    return tuple(sorted({each.name for each in _entries(kind)}))


@cache
def find_backend(kind: Kind, name: str) -> Backend[Any, Any]:
    """Load what has this name.

    Raises
    ------
    ConfigError
        Nothing has it, or more than one package has it.
    PluginError
        It is there and cannot be loaded; a `ConfigError` too.
    """
    found = [each for each in _entries(kind) if each.name == name]
    if not found:
        raise ConfigError(unknown_name(kind, name))
    if len(found) > 1:
        packages = " and ".join(sorted(_package(each) for each in found))
        raise ConfigError(f"{kind.word} {name!r} is brought by {packages}: remove all but one")
    (entry,) = found
    try:
        backend = entry.load()
    except Exception as exc:  # the code of somebody else, which raises what it likes
        raise PluginError(
            f"{kind.word} {name!r} of {_package(entry)} cannot be loaded from {entry.value}: "
            f"{type(exc).__name__}: {exc}"
        ) from exc
    if not isinstance(backend, Backend):
        raise PluginError(
            f"{kind.word} {name!r} of {_package(entry)}: {entry.value} is not a cosmic Backend "
            f"but a {type(backend).__name__}"
        )
    return backend


def unknown_name(kind: Kind, name: str) -> str:
    """Return what is said of a name that nothing has: what there is, and what would bring it."""
    known = plugins(kind)
    if not known:
        return (
            f"there is no {kind.word} {name!r}, and CoSMic's own are missing too: install it "
            "again (pip install .)"
        )
    said = f"there is no {kind.word} {name!r}; there are {', '.join(each.text for each in known)}"
    others = [each for each in Kind if each is not kind and name in names(each)]
    if others:
        return f"{said}. {name!r} is the name of a {others[0].word}"
    close = get_close_matches(name, names(kind), n=1)
    if close:
        return f"{said}. Did you mean {close[0]!r}?"
    return (
        f"{said}. Install the package that announces {name!r} in its entry points "
        f"[{kind.value}]; [platform] requires of the platform file can name it"
    )


def missing_packages(requirements: Iterable[str]) -> tuple[str, ...]:
    """Return those of `requirements`, such as "labware>=1.2", whose package is not installed."""
    missing: list[str] = []
    for each in requirements:
        try:
            distribution(_NOT_OF_A_NAME.split(each.strip(), maxsplit=1)[0])
        except (PackageNotFoundError, ValueError):
            missing.append(each)
    return tuple(missing)


_NOT_OF_A_NAME: Final = re.compile(r"[^A-Za-z0-9._-]")


def is_simulated(kind: Kind, name: str) -> bool:
    """Whether no hardware is behind what has this name; False of what is unknown or broken."""
    backend = _loaded(kind, name)
    return backend is not None and backend.simulated


def has_twin(kind: Kind, name: str) -> bool:
    """Whether what has this name moves, feels or shows the twin; as `is_simulated`."""
    backend = _loaded(kind, name)
    return backend is not None and backend.twin


def _loaded(kind: Kind, name: str) -> Backend[Any, Any] | None:
    try:
        return find_backend(kind, name)
    except ConfigError:
        return None


def read_options(kind: Kind, name: str, options: Mapping[str, object] = _NO_OPTIONS) -> StrictModel:
    """Return the settings of a backend, checked.

    Raises
    ------
    ConfigError
        There is no such backend, or its options are wrong: a line for each.
    """
    where = f"options of {kind.word} {name!r}"
    return check_model(where, dict(options), find_backend(kind, name).options)


def make(
    kind: Kind, name: str, context: object, options: Mapping[str, object] = _NO_OPTIONS
) -> Any:
    """Return what a backend makes.

    Raises
    ------
    ConfigError
        There is no such backend, or its options are wrong.
    CosmicError
        What it needs is missing.
    """
    checked = read_options(kind, name, options)
    return find_backend(kind, name).make(checked, context)


def _entries(kind: Kind) -> tuple[EntryPoint, ...]:
    return _entries_along(kind, tuple((place, _changed(place)) for place in sys.path))


@lru_cache(maxsize=64)
def _entries_along(kind: Kind, _places: tuple[tuple[str, int], ...]) -> tuple[EntryPoint, ...]:
    """Return what the packages along a path announce; all of them are read for it."""
    # One found along two paths, as in a folder that was installed and is run from, counts once.
    return tuple(dict.fromkeys(entry_points(group=kind.value)))


def _changed(place: str) -> int:
    """Return when something was installed in a folder or removed from it, ns; 0: never."""
    try:
        return Path(place).stat().st_mtime_ns
    except OSError:
        return 0  # such as the archive of the standard library, where there is none


def _package(entry: EntryPoint) -> str:
    if entry.dist is None:
        return "an unknown package"
    return f"{entry.dist.name} {entry.dist.version}"
