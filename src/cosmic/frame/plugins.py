"""Devices and methods by name: what ships with CoSMic and what other packages bring, by one door.

A package announces what it brings as an entry point in its ``pyproject.toml``::

    [project.entry-points."cosmic.boards"]
    my_board = "my_package.board:BACKEND"

The name before the equals sign is what the configuration says; behind it stands a `Backend`. CoSMic
announces its own in the same way. A package is loaded when the configuration names it, not before.

Free of Qt; any thread.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, Generic, TypeVar

from cosmic.frame.config import StrictModel, check_model, not_there
from cosmic.frame.errors import ConfigError

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
    """

    make: Callable[[Any, C], P]
    options: type[StrictModel] = NoOptions
    simulated: bool = False


@dataclass(frozen=True, slots=True)
class Plugin:
    """One name of one kind, not loaded.

    Attributes
    ----------
    package : str
        Who brings it, with the version.
    target : str
        Module and attribute.
    """

    kind: Kind
    name: str
    package: str
    target: str


_NO_OPTIONS: Final[Mapping[str, object]] = {}


def plugins(kind: Kind) -> tuple[Plugin, ...]:
    """Return all of a kind, by name."""
    return tuple(
        Plugin(kind, each.name, _package(each), each.value)
        for each in sorted(_entries(kind), key=lambda each: each.name)
    )


def names(kind: Kind) -> tuple[str, ...]:
    """Return the names that the configuration may use."""
    return tuple(dict.fromkeys(each.name for each in plugins(kind)))


@cache
def find_backend(kind: Kind, name: str) -> Backend[Any, Any]:
    """Load what has this name.

    Raises
    ------
    ConfigError
        Nothing has it, more than one package has it, or it cannot be loaded.
    """
    found = [each for each in _entries(kind) if each.name == name]
    if not found:
        known = names(kind)
        again = "" if known else "; CoSMic's own are missing too: install it again (pip install .)"
        raise ConfigError(not_there("backend", name, known) + again)
    if len(found) > 1:
        packages = " and ".join(sorted(_package(each) for each in found))
        raise ConfigError(f"backend {name!r} is brought by {packages}: remove all but one")
    (entry,) = found
    try:
        backend = entry.load()
    except Exception as exc:  # the code of somebody else, which raises what it likes
        raise ConfigError(
            f"backend {name!r} of {_package(entry)} cannot be loaded from {entry.value}: "
            f"{type(exc).__name__}: {exc}"
        ) from exc
    if not isinstance(backend, Backend):
        raise ConfigError(
            f"backend {name!r} of {_package(entry)}: {entry.value} is no cosmic Backend but a "
            f"{type(backend).__name__}"
        )
    return backend


def read_options(kind: Kind, name: str, options: Mapping[str, object] = _NO_OPTIONS) -> StrictModel:
    """Return the settings of a backend, checked.

    Raises
    ------
    ConfigError
        There is no such backend, or its options are wrong: a line for each.
    """
    where = f"options of backend {name!r}"
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
    # One found along two paths, as in a folder that was installed and is run from, counts once.
    return tuple(dict.fromkeys(entry_points(group=kind.value)))


def _package(entry: EntryPoint) -> str:
    if entry.dist is None:
        return "an unknown package"
    return f"{entry.dist.name} {entry.dist.version}"
