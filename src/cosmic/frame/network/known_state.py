"""What is known here of the state of an application at another station."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cosmic.frame.declaration import UNKNOWN, Declared, declaration_of
from cosmic.frame.errors import ProtocolError
from cosmic.frame.network.conform import Mismatch, conform
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.ongoing import StateMessage


@dataclass(frozen=True, slots=True)
class Address:
    """Which object of an application.

    Attributes
    ----------
    kind : type
        What it declares.
    parts : tuple of str
        Names of the parts that lead to it.
    keys : tuple of str
        For those of them that have keys.
    at : tuple of str
        Both, in order.
    """

    kind: type[Declared]
    parts: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    at: tuple[str, ...] = ()

    def part(self, name: str, key: str | None = None) -> "Address":
        """Return the address of a part."""
        kind = declaration_of(self.kind).parts[name].kind
        if key is None:
            return Address(kind, (*self.parts, name), self.keys, (*self.at, name))
        return Address(kind, (*self.parts, name), (*self.keys, key), (*self.at, name, key))


@dataclass(frozen=True, slots=True)
class _Known:
    """State of one object, and the number of the message that told it."""

    number: int
    values: dict[str, object]
    fixed: dict[str, object]


Published = Mapping[tuple[str, ...], tuple[Address, dict[str, object]]]
"""Values of several objects, by where they are."""


@dataclass(frozen=True, slots=True)
class Taken:
    """What a message has changed.

    Attributes
    ----------
    first : bool
        It is the first of this start of the station.
    newer : bool
        It said something newer of any object.
    changed : tuple
        The objects that differ now, by where they are.
    """

    first: bool
    newer: bool
    changed: tuple[tuple[str, ...], ...]


class KnownState:
    """The newest state of an application and of its parts; reading it takes no lock, any thread.

    Parameters
    ----------
    root : Address
        Of the application.
    """

    def __init__(self, root: Address) -> None:
        self._root = root
        self._start = ""
        self._known: dict[tuple[str, ...], _Known] = {}

    def value(self, address: Address, name: str, away: str) -> object:
        """Return a value of the state of an object.

        Raises
        ------
        StationAway
            It was never told, and has no value that stands for that.
        """
        known = self._known.get(address.at)
        if known is not None and name in known.values:
            return known.values[name]
        unknown = declaration_of(address.kind).state[name].unknown
        if unknown is UNKNOWN:
            raise StationAway(f"{name} is not known: {away or 'nothing was published yet'}")
        return unknown

    def keys(self, address: Address, name: str) -> tuple[str, ...]:
        """Return the keys of the parts of that name that there are."""
        known = self._known.get(address.at)
        found = known.values.get(name, ()) if known is not None else ()
        return found if isinstance(found, tuple) else ()

    def there(self, address: Address, name: str) -> bool:
        """Return whether there is the part of that name, which may be missing."""
        known = self._known.get(address.at)
        return known is not None and known.values.get(name) is True

    def checked(self, payload: StateMessage) -> Published:
        """Return what a message says of each object, checked; raises `ProtocolError`."""
        return dict(_flat(self._address(payload.at), payload.values))

    def take(self, payload: StateMessage, published: Published) -> Taken | None:
        """Take state that was `checked`, unless a newer one is known; one thread at a time.

        None where the rest of it has to be asked for first: of an application that was started
        anew, or of a part that is new.
        """
        first = payload.start != self._start
        if (first and payload.at) or not (payload.whole or self._completes(published, first=first)):
            return None
        if first:
            self._known.clear()
            self._start = payload.start
        newer = [at for at in published if self._number(at) < payload.number]
        changed = tuple(at for at in newer if self._differs(at, published[at]))
        for at in newer:
            known = self._known.get(at)
            fixed = known.fixed if known is not None else {}
            if payload.whole:
                fixed = _fixed(*published[at])
            self._known[at] = _Known(payload.number, {**fixed, **published[at][1]}, fixed)
        return Taken(first, bool(newer), changed)

    def _completes(self, published: Published, *, first: bool) -> bool:
        """Return whether what never changes is known of all that is told."""
        for at, (address, _) in published.items():
            known = None if first else self._known.get(at)
            for name, each in declaration_of(address.kind).state.items():
                if each.fixed and (known is None or name not in known.fixed):
                    return False
        return True

    def _address(self, at: tuple[str, ...]) -> Address:
        address, names = self._root, iter(at)
        for name in names:
            part = declaration_of(address.kind).parts.get(name)
            if part is None:
                raise ProtocolError(f"the state of the unknown part {name[:60]!r} came")
            address = address.part(name, next(names, "") if part.keyed else None)
        return address

    def _number(self, at: tuple[str, ...]) -> int:
        known = self._known.get(at)
        return known.number if known is not None else 0

    def _differs(self, at: tuple[str, ...], published: tuple[Address, dict[str, object]]) -> bool:
        known, (address, values) = self._known.get(at), published
        states = declaration_of(address.kind).state
        loud = [name for name in values if name not in states or not states[name].quiet]
        return known is None or any(known.values.get(each) != values[each] for each in loud)


def _fixed(address: Address, values: dict[str, object]) -> dict[str, object]:
    states = declaration_of(address.kind).state
    return {name: values[name] for name, each in states.items() if each.fixed}


def _flat(
    address: Address, values: Mapping[str, object]
) -> Iterator[tuple[tuple[str, ...], tuple[Address, dict[str, object]]]]:
    """Yield the state of an object and each of its parts, checked; of parts with keys the keys."""
    own: dict[str, object] = {}
    for name, part in declaration_of(address.kind).parts.items():
        inner = values.get(name)
        if part.optional:
            own[name] = inner is not None
            if inner is None:
                continue
        if not isinstance(inner, dict):
            raise ProtocolError(f"state without its part {name} came")
        if not part.keyed:
            yield from _flat(address.part(name), inner)
            continue
        for key, each in inner.items():
            if not (isinstance(key, str) and isinstance(each, dict)):
                raise ProtocolError(f"a broken part {name} came")
            yield from _flat(address.part(name, key), each)
        own[name] = tuple(inner)
    yield address.at, (address, {**own, **_conformed(address, values)})


def _conformed(address: Address, values: Mapping[str, object]) -> dict[str, object]:
    """Return the state of an object, checked; what never changes may be left out."""
    own: dict[str, object] = {}
    for name, state in declaration_of(address.kind).state.items():
        if state.fixed and name not in values:
            continue
        try:
            own[name] = conform(values[name], state.kind)
        except (KeyError, Mismatch) as exc:
            raise ProtocolError(f"state of another version came: {name}: {exc}") from exc
    return own
