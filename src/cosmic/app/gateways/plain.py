"""Values of a declaration as JSON and back, and the JSON Schema that describes them."""

import base64
import math
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from datetime import datetime
from enum import Enum
from pathlib import Path, PurePath
from typing import Any, Final, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import ValidationError

from cosmic.frame.config import StrictModel, wrong_values
from cosmic.frame.errors import CosmicError
from cosmic.frame.network.errors import CallRefused

KIND: Final = "kind"
"""Which dataclass is meant where several may stand; left out where the fields tell."""
LARGEST_ARRAY: Final = 200_000
"""Values of an array that are told as JSON; what is larger is fetched in a form of its own."""

_SEQUENCES: Final = (list, Sequence, Iterable)
_MAPPINGS: Final = (dict, Mapping)
_NUMBERS: Final = {bool: "boolean", int: "integer", float: "number", str: "string"}


def to_json(value: object) -> Any:
    """Return `value` as JSON has it; what is not finite becomes null."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, Enum):
        return value.value if isinstance(value.value, (str, int)) else value.name
    if isinstance(value, np.generic):
        return to_json(value.item())
    if isinstance(value, (int, float)):
        return value if not isinstance(value, float) or math.isfinite(value) else None
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, Mapping):
        return {_key(key): to_json(each) for key, each in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [to_json(each) for each in value]
    return _other(value)


def _other(value: object) -> Any:
    if isinstance(value, StrictModel):
        return to_json(value.model_dump(mode="json", warnings=False))
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: to_json(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, bytes):
        return base64.b64encode(value).decode("ascii")
    return value.as_posix() if isinstance(value, PurePath) else str(value)


def _key(key: object) -> str:
    return str(key.value) if isinstance(key, Enum) else str(key)


def _array(value: "np.ndarray[Any, Any]") -> Any:
    if value.size > LARGEST_ARRAY:
        return {"shape": list(value.shape), "dtype": str(value.dtype)}
    return to_json(value.tolist())


def from_json(value: object, annotation: Any) -> object:
    """Return `value`, as JSON said it, as the annotation wants it.

    Raises
    ------
    CallRefused
        It is not of that kind; the text says what is.
    """
    if annotation in (Any, object):
        return value
    if annotation in (None, type(None)):
        return _same(value, value is None, annotation)
    origin = get_origin(annotation)
    if origin is not None:
        return _generic(value, annotation, origin)
    if annotation in _NUMBERS:
        return _plain(value, annotation)
    if annotation in (Path, datetime, bytes):
        return _text(value, annotation)
    if annotation in (tuple, *_SEQUENCES):
        listed = isinstance(value, list)
        return tuple(_items(value)) if listed and annotation is tuple else _same(value, listed, "")
    return _of_class(value, annotation)


def _same(value: object, fits: bool, annotation: Any) -> object:
    if not fits:
        raise CallRefused(f"{_short(value)} is no {_said(annotation)}")
    return value


def _plain(value: object, annotation: Any) -> object:
    if annotation is float and isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise CallRefused("a number beyond all floats is not a number") from None
    return _same(value, type(value) is annotation, annotation)


def _text(value: object, annotation: Any) -> object:
    _same(value, isinstance(value, str), "text")
    text = str(value)
    try:
        if annotation is Path:
            return Path(text)
        if annotation is datetime:
            return datetime.fromisoformat(text)
        return base64.b64decode(text, validate=True)
    except ValueError as exc:
        raise CallRefused(f"{_short(value)} is no {_said(annotation)}: {exc}") from exc


def _items(value: object) -> list[Any]:
    if not isinstance(value, list):
        raise CallRefused(f"{_short(value)} is not a list")
    return value


def _generic(value: object, annotation: Any, origin: Any) -> object:
    inner = get_args(annotation)
    if origin in (Union, types.UnionType):
        return _one_of(value, inner)
    if origin is Literal:
        return _same(value, value in inner, f"one of {', '.join(map(repr, inner))}")
    if origin is np.ndarray:
        try:
            return np.asarray(_items(value), dtype=np.float64)
        except (ValueError, TypeError) as exc:
            raise CallRefused(f"a list that is not an array came: {exc}") from exc
    if origin is tuple:
        items = _items(value)
        if len(inner) == 2 and inner[1] is Ellipsis:
            return tuple(from_json(each, inner[0]) for each in items)
        _same(value, len(items) == len(inner), f"list of {len(inner)}")
        return tuple(from_json(each, kind) for each, kind in zip(items, inner, strict=True))
    if origin in _SEQUENCES:
        return [from_json(each, inner[0]) for each in _items(value)]
    if origin in _MAPPINGS and isinstance(value, dict):
        return {from_json(k, inner[0]): from_json(v, inner[1]) for k, v in value.items()}
    raise CallRefused(f"{_short(value)} is no {_said(annotation)}")


def _one_of(value: object, kinds: tuple[Any, ...]) -> object:
    if isinstance(value, dict) and KIND in value:
        named = [each for each in kinds if _said(each) == value[KIND]]
        if not named:
            there = ", ".join(_said(each) for each in kinds)
            raise CallRefused(f"{KIND} {_short(value[KIND])} is none of {there}")
        return from_json(value, named[0])
    tried, fits = [], []
    for each in sorted(kinds, key=lambda each: each is float):  # an int stays one if it may
        if get_origin(each) is Callable:
            continue
        try:
            made = from_json(value, each)
        except CallRefused as exc:
            tried.append(str(exc))
            continue
        if not isinstance(value, dict) or not isinstance(each, type):
            return made
        fits.append((each, made))
    if len(fits) == 1:
        return fits[0][1]
    if fits:  # what needs no fields would be meant by an empty object
        there = ", ".join(_said(each) for each, _ in fits)
        raise CallRefused(f"say by {KIND!r} what is meant: one of {there}")
    raise CallRefused(f"{_short(value)} is nothing that fits ({'; '.join(tried)[:300]})")


def _of_class(value: object, kind: Any) -> object:
    if isinstance(kind, type) and issubclass(kind, Enum):
        for each in kind:
            if value in (each.value, each.name):
                return each
        words = ", ".join(str(to_json(each)) for each in kind)
        raise CallRefused(f"{_short(value)} is none of {words}")
    if not isinstance(value, dict):
        raise CallRefused(f"{_short(value)} is no {_said(kind)}, which is an object")
    try:
        if isinstance(kind, type) and issubclass(kind, StrictModel):
            return kind.model_validate(value)
        return _data(value, kind)
    except ValidationError as exc:
        raise CallRefused(f"no {_said(kind)}: {wrong_values(exc)}"[:1000]) from exc
    except (TypeError, ValueError, CosmicError) as exc:
        raise CallRefused(f"no {_said(kind)}: {exc}"[:1000]) from exc


def _data(value: dict[Any, Any], kind: Any) -> object:
    said, called = dict(value), _said(kind)
    if said.pop(KIND, called) != called or not (isinstance(kind, type) and is_dataclass(kind)):
        raise CallRefused(f"{_short(value.get(KIND))} is no {called}")
    hints = get_type_hints(kind)
    known = {each.name: each for each in fields(kind) if each.init}
    surplus = [name for name in said if name not in known]
    missing = [
        each.name
        for each in known.values()
        if each.name not in said and each.default is MISSING and each.default_factory is MISSING
    ]
    if surplus or missing:
        unknown = ", ".join(map(str, surplus))[:60] or "none"
        raise CallRefused(
            f"a {called} has {', '.join(known)}; unknown: {unknown}, "
            f"missing: {', '.join(missing) or 'none'}"
        )
    return kind(**{name: from_json(each, hints[name]) for name, each in said.items()})


def _said(annotation: Any) -> str:
    if isinstance(annotation, str):
        return annotation
    return getattr(annotation, "__name__", None) or str(annotation)


def _short(value: object) -> str:
    return (
        repr(value)[:60]
        if isinstance(value, (str, int, float, bool, type(None)))
        else (f"a {type(value).__name__}")
    )


class Schemas:
    """JSON Schemas of annotations; classes are described once, under `components`.

    Parameters
    ----------
    where : str
        What a reference to a class begins with.
    """

    def __init__(self, where: str = "#/components/schemas/") -> None:
        self._where = where
        self.components: dict[str, Any] = {}

    def of(self, annotation: Any) -> dict[str, Any]:
        """Return the schema of what an annotation lets in."""
        if annotation in _NUMBERS:
            return {"type": _NUMBERS[annotation]}
        if annotation in (None, type(None)):
            return {"type": "null"}
        if annotation is Path:
            return {"type": "string", "format": "path"}
        if annotation is datetime:
            return {"type": "string", "format": "date-time"}
        if annotation is bytes:
            return {"type": "string", "contentEncoding": "base64"}
        origin = get_origin(annotation)
        if origin is not None:
            return self._generic(annotation, origin)
        if annotation in (tuple, *_SEQUENCES):
            return {"type": "array"}
        if annotation in _MAPPINGS:
            return {"type": "object"}
        return self._of_class(annotation)

    def _generic(self, annotation: Any, origin: Any) -> dict[str, Any]:
        inner = get_args(annotation)
        if origin in (Union, types.UnionType):
            kinds = [each for each in inner if get_origin(each) is not Callable]
            return {"anyOf": [self.of(each) for each in kinds]}
        if origin is Literal:
            return {"enum": [to_json(each) for each in inner]}
        if origin is tuple and not (len(inner) == 2 and inner[1] is Ellipsis):
            items = [self.of(each) for each in inner]
            return {
                "type": "array",
                "prefixItems": items,
                "minItems": len(items),
                "maxItems": len(items),
            }
        if origin is np.ndarray:
            return {"type": "array"}
        if origin is tuple or origin in _SEQUENCES:
            return {"type": "array", "items": self.of(inner[0])}
        if origin in _MAPPINGS:
            return {"type": "object", "additionalProperties": self.of(inner[1])}
        return {}

    def _of_class(self, kind: Any) -> dict[str, Any]:
        if not isinstance(kind, type) or kind is object:
            return {}
        name = kind.__name__
        if name not in self.components and (
            is_dataclass(kind) or issubclass(kind, (Enum, StrictModel))
        ):
            self.components[name] = {}  # it may name itself
            self.components[name] = self._described(kind)
        return {"$ref": f"{self._where}{name}"} if name in self.components else {}

    def _described(self, kind: Any) -> dict[str, Any]:
        if issubclass(kind, Enum):
            return {"enum": [to_json(each) for each in kind]}
        text = (kind.__doc__ or "").strip().partition("\n")[0]
        if issubclass(kind, StrictModel):
            names = kind.model_fields
            properties = {name: self.of(each.annotation) for name, each in names.items()}
            required = [name for name, each in names.items() if each.is_required()]
        else:
            hints = get_type_hints(kind)
            made = [each for each in fields(kind) if each.init]
            properties = {each.name: self.of(hints[each.name]) for each in made}
            required = [
                each.name
                for each in made
                if each.default is MISSING and each.default_factory is MISSING
            ]
        return {
            "type": "object",
            "description": text,
            "properties": properties,
            "required": required,
        }
