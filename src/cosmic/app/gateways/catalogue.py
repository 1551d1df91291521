"""What there is to command, to read and to follow: read from the declarations of applications."""

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from cosmic.frame.declaration import (
    CommandDeclaration,
    Declared,
    declaration_of,
)
from cosmic.frame.network.host import command_name


@dataclass(frozen=True, slots=True)
class Place:
    """A declared object of an application: where its commands and streams are.

    Attributes
    ----------
    parts : tuple of str
        Names of the parts that lead to it, from the application down.
    keyed : tuple of bool
        Which of them have keys.
    """

    application: str
    kind: type[Declared]
    parts: tuple[str, ...] = ()
    keyed: tuple[bool, ...] = ()


@dataclass(frozen=True, slots=True)
class Command:
    """A command of an object.

    Attributes
    ----------
    text : str
        Its docstring.
    defaults : mapping
        What stands for parameters that are left out.
    """

    place: Place
    declared: CommandDeclaration
    text: str
    defaults: Mapping[str, Any]

    @property
    def function(self) -> str:
        """How it is called on a line."""
        return command_name(self.place.parts, self.declared.name)

    @property
    def summary(self) -> str:
        """The first line of its docstring."""
        return self.text.partition("\n")[0]


def places_of(application: str, kind: type[Declared]) -> Iterator[Place]:
    """Yield the objects of an application: itself, and its parts."""
    yield from _places(Place(application, kind))


def _places(place: Place) -> Iterator[Place]:
    yield place
    for name, part in declaration_of(place.kind).parts.items():
        inner = Place(
            place.application, part.kind, (*place.parts, name), (*place.keyed, part.keyed)
        )
        yield from _places(inner)


def commands_of(application: str, kind: type[Declared]) -> Iterator[Command]:
    """Yield all commands of an application and its parts."""
    for place in places_of(application, kind):
        for name, declared in declaration_of(place.kind).commands.items():
            function = inspect.getattr_static(place.kind, name)
            found = inspect.signature(function).parameters.values()
            defaults = {each.name: each.default for each in found if each.default is not each.empty}
            yield Command(place, declared, inspect.getdoc(function) or "", defaults)
