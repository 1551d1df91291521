"""Whether a value is what an annotation says, strictly: nothing is converted but int to float."""

import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from datetime import datetime
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal, Union, get_args, get_origin

import numpy as np

from cosmic.frame.config import StrictModel

_PLAIN: Final = (bool, int, str, bytes, datetime, type(None))
_SEQUENCES: Final = (list, Sequence, Iterable)
_MAPPINGS: Final = (dict, Mapping)


_origin: Final = cache(get_origin)  # states and samples come some hundred times a second


class Mismatch(Exception):  # noqa: N818 - private to this package
    """A value is not what the annotation says."""


def conform(value: object, annotation: Any) -> object:
    """Return `value` as `annotation` wants it (an int as a float), or raise `Mismatch`."""
    if annotation in (Any, object):
        return value
    if annotation is float:
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            try:
                return float(value)
            except OverflowError:
                raise _mismatch("an integer beyond all floats", annotation) from None
        raise _mismatch(value, annotation)
    if annotation is None:
        annotation = type(None)
    origin = _origin(annotation)
    if origin is not None:
        return _conform_generic(value, annotation, origin)
    if _is_plain_match(value, annotation):
        return value
    raise _mismatch(value, annotation)


def _is_plain_match(value: object, annotation: Any) -> bool:
    if annotation in _PLAIN:
        return type(value) is annotation
    if annotation in _SEQUENCES:
        return isinstance(value, (list, tuple))
    if annotation in (*_MAPPINGS, tuple):
        return isinstance(value, dict if annotation is not tuple else tuple)
    return isinstance(annotation, type) and is_kind(annotation) and isinstance(value, annotation)


def _conform_generic(value: object, annotation: Any, origin: Any) -> object:
    arguments = get_args(annotation)
    if origin in (Union, types.UnionType):
        return _conform_union(value, annotation, arguments)
    if origin is Literal:
        if any(type(value) is type(each) and value == each for each in arguments):
            return value
    elif origin is np.ndarray:
        if isinstance(value, np.ndarray):
            return value
    elif origin is tuple:
        return _conform_tuple(value, annotation, arguments)
    elif origin in _SEQUENCES and isinstance(value, (list, tuple)):
        return type(value)(conform(each, arguments[0]) for each in value)
    elif origin in _MAPPINGS and isinstance(value, dict):
        key, item = arguments
        return {conform(k, key): conform(v, item) for k, v in value.items()}
    raise _mismatch(value, annotation)


def _conform_union(value: object, annotation: Any, arguments: tuple[Any, ...]) -> object:
    for each in sorted(arguments, key=lambda each: each is float):  # an int stays one if it may
        try:
            return conform(value, each)
        except Mismatch:
            continue
    raise _mismatch(value, annotation)


def _conform_tuple(value: object, annotation: Any, arguments: tuple[Any, ...]) -> object:
    if not isinstance(value, tuple):
        raise _mismatch(value, annotation)
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return tuple(conform(each, arguments[0]) for each in value)
    if len(arguments) != len(value):
        raise _mismatch(value, annotation)
    return tuple(conform(each, kind) for each, kind in zip(value, arguments, strict=True))


def is_kind(annotation: Any) -> bool:
    """Return whether a class may stand in the signature of a remote function."""
    return isinstance(annotation, type) and (
        issubclass(annotation, (Enum, np.ndarray, Path, StrictModel)) or is_dataclass(annotation)
    )


def can_check(annotation: Any) -> bool:
    """Return whether `conform` can tell what fits `annotation`.

    Functions cannot travel: an optional parameter that takes one may stand there, and whatever is
    sent for it does not fit.
    """
    if annotation in (Any, object, float, None, tuple, *_PLAIN, *_SEQUENCES, *_MAPPINGS):
        return True
    origin = get_origin(annotation)
    if origin is None:
        return is_kind(annotation)
    if origin in (Literal, np.ndarray):
        return True
    inner = [each for each in get_args(annotation) if each is not Ellipsis]
    if origin in (Union, types.UnionType):
        return any(can_check(each) for each in inner) and all(
            can_check(each) or get_origin(each) is Callable for each in inner
        )
    known = origin is tuple or origin in _SEQUENCES or origin in _MAPPINGS
    return known and all(can_check(each) for each in inner)


def _mismatch(value: object, annotation: Any) -> Mismatch:
    wanted = getattr(annotation, "__name__", None) if not get_args(annotation) else None
    return Mismatch(f"{_short(value)} is not {wanted or annotation}")


def _short(value: object) -> str:
    text = repr(value) if isinstance(value, (str, bytes, int, float, bool, type(None))) else ""
    return text[:60] if text else f"a {type(value).__name__}"
