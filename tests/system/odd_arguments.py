"""Odd arguments for everything that scripts call, found by introspection."""

import inspect
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from cosmic.frame.errors import CosmicError


class _Odd:
    def __repr__(self) -> str:
        return "<odd>"


ODD: Final[tuple[object, ...]] = (
    None, "abc", "", "x" * 100_000, "a\0b", b"5", math.nan, math.inf, -math.inf, -1, 0, 2**70,
    10**400, True, [], {}, (), [1.0, "x"], {"a": object()}, object(), _Odd(), np.array([1.0, 2.0]),
    np.float32(math.nan), np.int64(-1), 1j, lambda *_: None,
)  # fmt: skip

LEFT_OUT: Final = {
    # They end what the others are tried on, or wait for what does not come.
    "close", "shut_down", "join", "run_here", "rescan", "release_control", "take_control",
    "initialise", "calibrate_stage", "find_rotation_centre",
}  # fmt: skip
STORED: Final = {"set_sensor_type", "set_safe_direction"}
"""What they change in the controller leaves an axis without a position, or takes it away."""
INSIDE: Final = (
    AttributeError, ValueError, LookupError, ArithmeticError, RecursionError, AssertionError,
    UnicodeError, OSError, NameError, NotImplementedError, MemoryError,
)  # fmt: skip


@dataclass(frozen=True)
class Call:
    """One thing to be called, with what its arguments sensibly are."""

    where: str
    function: Callable[..., object]
    sensible: dict[str, object]

    @property
    def name(self) -> str:
        """What it is called, without what it belongs to."""
        return self.where.rpartition(".")[2]

    @property
    def parameters(self) -> list[inspect.Parameter]:
        """What it takes."""
        try:
            found = list(inspect.signature(self.function).parameters.values())
        except (TypeError, ValueError):
            return []
        return [each for each in found if each.kind is not each.VAR_KEYWORD]


def calls_of(
    where: str, thing: object, sensible: dict[str, object], left_out: set[str] = LEFT_OUT
) -> Iterator[Call]:
    """Yield the public methods of an object."""
    for name in dir(type(thing)):
        if name in left_out or (name.startswith("_") and name != "__getitem__"):
            continue
        member = inspect.getattr_static(type(thing), name)
        if isinstance(member, property) and member.fset is not None:
            yield Call(f"{where}.{name} =", _setter(member.fset, thing), sensible)
        elif inspect.isfunction(member) or isinstance(member, staticmethod | classmethod):
            yield Call(f"{where}.{name}", getattr(thing, name), sensible)


def _setter(put: Callable[[Any, object], None], thing: object) -> Callable[[object], None]:
    return lambda value: put(thing, value)


def tried(call: Call) -> Iterator[tuple[str, object, BaseException | None]]:
    """Yield what became of each call with one odd argument; what it is given else is sensible."""
    parameters = call.parameters
    for parameter in parameters:
        for odd in ODD:
            given, more = [], {}
            known = True
            for each in parameters:
                usual = each.default
                if usual is each.empty:
                    usual = call.sensible.get(each.name, usual)
                usual = call.sensible.get(f"{call.name}.{each.name}", usual)
                value = odd if each is parameter else usual
                if value is each.empty:
                    known = each.kind is each.VAR_POSITIONAL
                elif each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD):
                    given.append(value)
                elif each.kind is each.VAR_POSITIONAL:
                    given += [value] if each is parameter else []
                else:
                    more[each.name] = value
            if not known:
                continue
            try:
                found = call.function(*given, **more)
                _end(found)
            except BaseException as exc:  # noqa: BLE001 - that is what is looked at
                yield parameter.name, odd, exc
            else:
                yield parameter.name, odd, None


def _end(found: object) -> None:
    """End what was begun by chance."""
    names = ("cancel", "abort", "close")
    for name in ("stop",) if type(found).__name__ == "TrajectoryRecording" else names:
        act = getattr(found, name, None)
        if callable(act) and not isinstance(found, SimpleNamespace):
            act()
            return


def complaint(call: Call, name: str, odd: object, error: BaseException | None) -> str:
    """Return what is wrong with an outcome; empty when nothing is."""
    if error is None or isinstance(error, CosmicError | ValidationError):  # it names the field
        return ""
    shown = f"{call.where}({name}={repr(odd)[:40]}): {type(error).__name__}: {str(error)[:110]}"
    if isinstance(error, TypeError):
        # What subscribes is called so everywhere, whatever its parameter is.
        known = (name, "subscriber") if name == "listener" else (name,)
        named = call.where.endswith("=") or any(each in str(error) for each in known)
        return "" if named else shown
    return shown
