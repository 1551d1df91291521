"""Values as bytes and back: msgpack with a version, limits, and arrays beside it, never pickle.

A message is one byte 0xC5, the version, four bytes with the length of the head, the head in
msgpack, and the raw bytes of the arrays, each at a multiple of 16 bytes. Arrays are read where
they lie, without a copy, and cannot be written to.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from enum import Enum
from functools import cache
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any, Final, get_type_hints

import numpy as np

from cosmic.frame.config import StrictModel
from cosmic.frame.errors import ConfigError, NotAvailable, ProtocolError, needs_extra
from cosmic.frame.network.conform import Mismatch, conform
from cosmic.frame.network.transfer import known_class, may_travel

VERSION: Final = 1
CALL_LIMIT_BYTES: Final = 64 * 1024
"""The most that a call may send to a station."""
MESSAGE_LIMIT_BYTES: Final = 64 * 1024 * 1024
"""The most that a station may answer or publish in one message."""

_MAGIC: Final = 0xC5
_PREFIX: Final = struct.Struct(">BBI")
_ALIGNMENT: Final = 16
_DEPTH_LIMIT: Final = 16
_DIMENSIONS_LIMIT: Final = 8
_ARRAY, _TIME, _ENUM, _DATA, _TUPLE, _MODEL, _PATH = 1, 2, 3, 4, 5, 6, 7


@cache
def _msgpack() -> Any:
    """Return the package of the extra `net`: applications are declared without it."""
    try:
        return import_module("msgpack")
    except ImportError as exc:
        raise NotAvailable(needs_extra("A station", "net")) from exc


def encode(value: object, limit_bytes: int = MESSAGE_LIMIT_BYTES) -> bytes:
    """Return `value` as a message.

    Raises
    ------
    ProtocolError
        It holds what cannot travel, or is larger than `limit_bytes`.
    """
    arrays: list[np.ndarray[Any, Any]] = []
    head = _pack(value, arrays)
    size = _padded(_PREFIX.size + len(head)) + sum(_padded(each.nbytes) for each in arrays)
    if size > limit_bytes:
        raise ProtocolError(f"a message of {size} bytes is too large; {limit_bytes} are allowed")
    parts: list[Any] = [_PREFIX.pack(_MAGIC, VERSION, len(head)), head]
    if arrays:
        parts.append(b"\0" * (_padded(_PREFIX.size + len(head)) - _PREFIX.size - len(head)))
        for each in arrays:
            parts += [each.data.cast("B") if each.size else b""]
            parts.append(b"\0" * (_padded(each.nbytes) - each.nbytes))
    return b"".join(parts)


def decode(message: bytes, limit_bytes: int = MESSAGE_LIMIT_BYTES) -> Any:
    """Return the value that `encode` wrote.

    Raises
    ------
    ProtocolError
        It is no message of this version, or larger than `limit_bytes`.
    """
    if len(message) > limit_bytes:
        raise ProtocolError(f"a message of {len(message)} bytes came; {limit_bytes} are allowed")
    if len(message) < _PREFIX.size or message[0] != _MAGIC:
        raise ProtocolError("something came that is not a message of CoSMic")
    _, version, length = _PREFIX.unpack_from(message)
    if version != VERSION:
        raise ProtocolError(f"a message of version {version} came; this program speaks {VERSION}")
    end = _PREFIX.size + length
    if end > len(message):
        raise ProtocolError("half a message came")
    return _Reader(message, _padded(end)).unpack(message[_PREFIX.size : end], 0)


def _padded(size: int) -> int:
    return -(-size // _ALIGNMENT) * _ALIGNMENT


def _pack(value: object, arrays: list[np.ndarray[Any, Any]], depth: int = 0) -> bytes:
    if depth > _DEPTH_LIMIT:
        raise ProtocolError("a value is nested too deeply to travel")

    def other(item: object) -> object:
        return _pack_other(item, arrays, lambda inner: _pack(inner, arrays, depth + 1))

    try:
        packed: bytes = _msgpack().packb(value, default=other, strict_types=True)
    except (TypeError, ValueError, OverflowError) as exc:
        raise ProtocolError(f"a value cannot travel: {exc}") from exc
    return packed


def _pack_other(
    item: object, arrays: list[np.ndarray[Any, Any]], pack: Callable[[object], bytes]
) -> object:
    if isinstance(item, tuple):
        return _msgpack().ExtType(_TUPLE, pack(list(item)))
    if isinstance(item, np.ndarray):
        return _msgpack().ExtType(_ARRAY, pack(_describe(item, arrays)))
    if isinstance(item, np.generic):
        return item.item()
    if isinstance(item, Enum) and may_travel(type(item)):
        return _msgpack().ExtType(_ENUM, pack([type(item).__name__, item.name]))
    if isinstance(item, PurePath):
        return _msgpack().ExtType(_PATH, pack([str(item)]))
    if isinstance(item, StrictModel) and may_travel(type(item)):
        return _msgpack().ExtType(
            _MODEL, pack([type(item).__name__, item.model_dump(mode="json", warnings=False)])
        )
    if isinstance(item, datetime):
        if item.tzinfo is None:
            raise TypeError("a time without its zone")
        return _msgpack().ExtType(_TIME, struct.pack(">d", item.timestamp()))
    if is_dataclass(item) and may_travel(type(item)):
        values = [getattr(item, each.name) for each in fields(item) if each.init]
        return _msgpack().ExtType(_DATA, pack([type(item).__name__, values]))
    raise TypeError(f"{type(item).__name__} is not among the types that travel")


def _describe(array: np.ndarray[Any, Any], arrays: list[np.ndarray[Any, Any]]) -> list[object]:
    if array.dtype.kind not in "biufc":
        raise TypeError(f"an array of {array.dtype}")
    arrays.append(np.ascontiguousarray(array))
    return [array.dtype.str, list(array.shape), len(arrays) - 1]


@cache
def _wanted(cls: type) -> dict[str, Any]:
    """Return the annotations of what makes one of `cls`, by name in its order."""
    hints = get_type_hints(cls)
    return {each.name: hints[each.name] for each in fields(cls) if each.init}


class _Reader:
    """Reads one message; arrays are taken in the order in which they were written."""

    def __init__(self, message: bytes, arrays_start: int) -> None:
        self._message = message
        self._next = arrays_start
        self._count = 0
        self._depth = 0

    def unpack(self, data: bytes, depth: int) -> Any:
        """Return the value in `data`."""
        if depth > _DEPTH_LIMIT:
            raise ProtocolError("a message is nested too deeply")
        try:
            return _msgpack().unpackb(
                data,
                ext_hook=lambda code, inner: self._other(code, inner, depth + 1),
                strict_map_key=False,
                max_ext_len=len(data),
                max_str_len=len(data),
                max_bin_len=len(data),
                max_array_len=len(data),
                max_map_len=len(data),
            )
        except (ValueError, TypeError, _msgpack().UnpackException, RecursionError) as exc:
            raise ProtocolError(f"a broken message came: {exc}") from exc

    def _other(self, code: int, data: bytes, depth: int) -> object:
        if code == _TIME and len(data) == 8:
            return _time(struct.unpack(">d", data)[0])
        inner = self.unpack(data, depth)
        if not isinstance(inner, list):
            raise ProtocolError("a broken message came")
        if code == _TUPLE:
            return tuple(inner)
        if code == _ARRAY:
            return self._array(inner)
        if code == _ENUM:
            return _enum(inner)
        if code == _DATA:
            return _data(inner)
        if code == _MODEL:
            return _model(inner)
        if code == _PATH and len(inner) == 1 and isinstance(inner[0], str):
            return Path(inner[0])
        raise ProtocolError(f"a message holds a value of the unknown type {code}")

    def _array(self, said: list[Any]) -> np.ndarray[Any, Any]:
        if len(said) != 3 or not isinstance(said[0], str) or not isinstance(said[1], list):
            raise ProtocolError("a broken array came")
        kind, shape, number = said
        whole = all(type(each) is int and each >= 0 for each in shape)
        if not whole or len(shape) > _DIMENSIONS_LIMIT or number != self._count:
            raise ProtocolError("a broken array came")
        try:
            dtype = np.dtype(kind)
        except (TypeError, SyntaxError, ValueError) as exc:
            raise ProtocolError(f"an array of the unknown type {kind!r} came") from exc
        size = math.prod(shape) * dtype.itemsize
        if dtype.kind not in "biufc" or self._next + size > len(self._message):
            raise ProtocolError("a broken array came")
        array = (
            np.frombuffer(self._message, dtype, count=math.prod(shape), offset=self._next).reshape(
                shape
            )
            if size
            else np.zeros(shape, dtype)
        )
        array.flags.writeable = False
        self._next += _padded(size)
        self._count += 1
        return array


def _time(seconds: float) -> datetime:
    try:
        return datetime.fromtimestamp(seconds, UTC)
    except (ValueError, OverflowError, OSError) as exc:
        raise ProtocolError(f"a time that is none came: {seconds!r}") from exc


def _enum(said: list[Any]) -> object:
    cls = known_class(said[0]) if len(said) == 2 else None
    if cls is None or not issubclass(cls, Enum) or said[1] not in cls.__members__:
        raise ProtocolError(f"an unknown word came: {said!r}"[:200])
    return cls[said[1]]


def _data(said: list[Any]) -> object:
    cls = known_class(said[0]) if len(said) == 2 else None
    if cls is None or not is_dataclass(cls) or not isinstance(said[1], list):
        raise ProtocolError(f"a value of an unknown class came: {said[:1]!r}"[:200])
    wanted = _wanted(cls)
    if len(wanted) != len(said[1]):
        raise ProtocolError(f"a {said[0]} of another version came")
    try:
        values = {
            name: conform(value, hint)
            for (name, hint), value in zip(wanted.items(), said[1], strict=True)
        }
        return cls(**values)
    except (Mismatch, TypeError, ValueError, ConfigError) as exc:
        raise ProtocolError(f"a broken {said[0]} came: {exc}") from exc


def _model(said: list[Any]) -> object:
    cls = known_class(said[0]) if len(said) == 2 else None
    if cls is None or not issubclass(cls, StrictModel):
        raise ProtocolError(f"settings of an unknown kind came: {said[:1]!r}"[:200])
    try:
        return cls.model_validate(said[1])
    except ValueError as exc:
        raise ProtocolError(f"a broken {said[0]} came: {exc}"[:2000]) from exc
