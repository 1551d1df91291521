"""The one proxy: an object of a declared class whose application is at another station.

`proxy_of` makes a subclass of the class out of its declaration. Commands travel, state is what was
last published, streams are subscribed to over the line, parts are proxies again. Everything else
of the class is inherited, and so works in terms of these.
"""

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, Final, TypeVar, cast

from typing_extensions import override

from cosmic.frame.arguments import checked
from cosmic.frame.background import OnResult, do_and_report
from cosmic.frame.clock import Clock
from cosmic.frame.declaration import CommandDeclaration, Declared, declaration_of
from cosmic.frame.network.known_state import Address
from cosmic.frame.network.link import ApplicationLink
from cosmic.frame.threads import may_wait_here

D = TypeVar("D", bound=Declared)
T = TypeVar("T")


def proxy_of(kind: type[D], link: ApplicationLink) -> D:
    """Return an object of `kind` whose application is at the other end of `link`."""
    return cast("D", _made(link, Address(kind)))


class Proxied(Declared):
    """What every proxy is besides its class; any thread."""

    def __init__(self, link: ApplicationLink, address: Address) -> None:
        self._link = link
        self._address = address
        self._parts: dict[tuple[str, str | None], Proxied] = {}
        self.set_up_proxy(address.keys[-1] if address.keys else "", link.policy)
        if not address.at:
            link.join(self.made_companion(), self._on_change)

    @property
    @override
    def clock(self) -> Clock:
        return self._link.clock

    @property
    @override
    def away(self) -> str:
        return self._link.away

    @property
    @override
    def remote(self) -> str:
        return self._link.remote

    @property
    @override
    def refused(self) -> str:
        return self._link.commands.refused(self._address)

    @property
    @override
    def missed(self) -> int:
        return self._link.missed

    @property
    @override
    def moves_remotely(self) -> bool:
        return self._link.commands.moves

    @override
    @checked
    def wall_s_here(self, wall_s: float) -> float:
        return self._link.wall_s_here(wall_s)

    @override
    @checked
    def carry_out(
        self, action: Callable[[], T], on_result: OnResult[T], *, slow: bool = False
    ) -> None:
        del slow  # everything may be
        if may_wait_here():
            do_and_report(action, on_result)
        else:
            self._link.commands.aside(action, on_result)

    def _part(self, name: str, key: str | None = None) -> "Proxied":
        found = self._parts.get((name, key))
        if found is None:
            found = _made(self._link, self._address.part(name, key))
            self._parts[name, key] = found
        return found

    def _on_change(self, at: tuple[str, ...]) -> None:
        """Tell who listens to the object at that address; of the application itself."""
        proxy, names = self, iter(at)
        for name in names:
            keyed = declaration_of(proxy._address.kind).parts[name].keyed
            proxy = proxy._part(name, next(names) if keyed else None)
        proxy.note_change()


def _made(link: ApplicationLink, address: Address) -> Proxied:
    made = _class_for(address.kind)(link, address)
    assert isinstance(made, Proxied)
    return made


_classes: Final[dict[type[Declared], Callable[[ApplicationLink, Address], object]]] = {}


def _class_for(kind: type[Declared]) -> Callable[[ApplicationLink, Address], object]:
    known = _classes.get(kind)
    if known is None:
        known = _classes[kind] = _class_of(kind)
    return known


def _class_of(kind: type[Declared]) -> Callable[[ApplicationLink, Address], object]:
    declaration = declaration_of(kind)
    members: dict[str, Any] = {"__module__": kind.__module__, "__doc__": kind.__doc__}
    for name, command in declaration.commands.items():
        members[name] = _command(getattr(kind, name), command)
    for name in declaration.state:
        members[name] = _state(name)
    for name in declaration.streams:
        members[name] = _stream(name)
    for name, of in declaration.newest.items():
        members[name] = _newest(of)
    for name, part in declaration.parts.items():
        members[name] = _parts(name) if part.keyed else _part(name, optional=part.optional)
    return type(kind.__name__, (Proxied, kind), members)


def _command(original: Callable[..., object], declared: CommandDeclaration) -> object:
    signature = inspect.signature(original)

    @wraps(original)
    def call(self: Proxied, /, *args: object, **kwargs: object) -> object:
        _, *given = signature.bind(self, *args, **kwargs).arguments.items()
        return self._link.commands.call(self._address, declared, dict(given))

    return checked(call) if hasattr(original, "__wrapped__") else call


def _state(name: str) -> property:
    return property(lambda self: self._link.state.value(self._address, name, self._link.away))


def _stream(name: str) -> object:
    @checked
    def subscribe(
        self: Proxied,
        receiver: Callable[[Any], object],
        wanted: Callable[[], bool] | None = None,
    ) -> Callable[[], None]:
        del wanted  # it is: here
        return self._link.stream(self._address, name).subscribe(receiver)

    return subscribe


def _newest(of: str) -> property:
    return property(lambda self: self._link.stream(self._address, of).newest)


def _part(name: str, *, optional: bool) -> property:
    def found(self: Proxied) -> Proxied | None:
        missing = optional and not self._link.state.there(self._address, name)
        return None if missing else self._part(name)

    return property(found)


def _parts(name: str) -> property:
    def found(self: Proxied) -> Mapping[str, Proxied]:
        return {key: self._part(name, key) for key in self._link.state.keys(self._address, name)}

    return property(found)
