"""Exceptions as plain values and back, as the same class of the one tree."""

from collections.abc import Iterator
from typing import Any, Final

from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, MoveRefused, ProtocolError
from cosmic.frame.network import errors  # noqa: F401 - its classes belong to the tree
from cosmic.frame.network.transfer import transferable
from cosmic.frame.verdict import MoveVerdict

transferable(DeviceFault)

_FIELDS: Final[dict[str, tuple[type, ...]]] = {
    "verdict": (MoveVerdict,),
    "fault": (DeviceFault,),
    "code": (int, type(None)),
    "device": (int, type(None)),
    "channel": (int, type(None)),
    "text": (str,),
    "targets": (dict,),
    "problems": (tuple,),
}


def to_plain(error: CosmicError) -> list[object]:
    """Return the names of its class and of those above it, its text, and what else it tells."""
    line = [each.__name__ for each in type(error).__mro__ if issubclass(each, CosmicError)]
    more = {
        name: value
        for name, value in vars(error).items()
        if name in _FIELDS and isinstance(value, _FIELDS[name])
    }
    return [line, str(error), more]


def from_plain(said: object) -> CosmicError:
    """Return the exception; where its class is not known here, the nearest one above it.

    Raises
    ------
    ProtocolError
        It is no exception.
    """
    if not (isinstance(said, list) and len(said) == 3):
        raise ProtocolError("a broken exception came")
    line, text, more = said
    if not (isinstance(line, list) and isinstance(text, str) and isinstance(more, dict)):
        raise ProtocolError("a broken exception came")
    kind = next((known for name in line if (known := _class_named(name))), CosmicError)
    if issubclass(kind, MoveRefused) and not isinstance(more.get("verdict"), MoveVerdict):
        raise ProtocolError("a refusal without its verdict came")
    return _made(kind, text, more)


def _made(kind: type[CosmicError], text: str, more: dict[Any, Any]) -> CosmicError:
    # Each class has parameters of its own; what they set is in `more`.
    error = kind.__new__(kind, text)
    error.args = (text,)
    if isinstance(error, DeviceError):
        error.fault, error.code, error.device, error.channel = DeviceFault.OTHER, None, None, None
    for name, value in more.items():
        if name in _FIELDS and isinstance(value, _FIELDS[name]):
            setattr(error, name, value)
    return error


def _class_named(name: object) -> type[CosmicError] | None:
    return next((each for each in _tree(CosmicError) if each.__name__ == name), None)


def _tree(root: type[CosmicError]) -> Iterator[type[CosmicError]]:
    yield root
    for each in root.__subclasses__():
        yield from _tree(each)
