"""Names that were used before: they still work for one version, with a warning."""

import inspect
import sys
import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, Final, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

_FRAME: Final = "cosmic.frame."
SKIP_OWN: Final = 2
"""Levels of the stack up to whoever used the old name."""


class Renamed:
    """Stands in a class under an old name and hands out what the new name gives; any thread.

    Parameters
    ----------
    name : str
        The new name.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._old = name

    def __set_name__(self, owner: type, name: str) -> None:
        self._old = f"{owner.__name__}.{name}"

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        """Return the attribute of the new name, after a `DeprecationWarning`."""
        if instance is None:
            return self
        warnings.warn(
            f"{self._old} is now called {self.name}; the old name goes with the next version",
            DeprecationWarning,
            stacklevel=SKIP_OWN,
        )
        return getattr(instance, self.name)


def renamed_in(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the `__getattr__` of a module that has functions or classes under a new name.

    Parameters
    ----------
    module : str
        Its `__name__`.
    names : mapping of str to str
        The new name by the old one.
    """

    def look_up(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warnings.warn(
            f"{module}.{name} is now called {names[name]}; the old name goes with the next version",
            DeprecationWarning,
            stacklevel=SKIP_OWN,
        )
        return getattr(sys.modules[module], names[name])

    return look_up


def _levels_up() -> int:
    """Return how far up the stack the caller stands, past what checks arguments."""
    frame, levels = inspect.currentframe(), 0
    while frame is not None and frame.f_globals.get("__name__", "").startswith(_FRAME):
        frame, levels = frame.f_back, levels + 1
    return levels


def renamed_parameters(**names: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Return a decorator for a function some of whose parameters have a new name.

    Parameters
    ----------
    **names : str
        The new name by the old one: ``@renamed_parameters(way="path")``.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> T:
            for old in names.keys() & kwargs.keys():
                new = names[old]
                if new in kwargs:
                    raise TypeError(f"{function.__qualname__}() got both {old!r} and {new!r}")
                warnings.warn(
                    f"{function.__qualname__}({old}=...) is now called {new}; "
                    "the old name goes with the next version",
                    DeprecationWarning,
                    stacklevel=_levels_up(),
                )
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return call

    return decorate


def renamed_fields(**names: str) -> Callable[[type[T]], type[T]]:
    """Return a decorator for a dataclass some of whose fields have a new name.

    Parameters
    ----------
    **names : str
        The new name by the old one; both are read, and given where an object is made.
    """

    def decorate(kind: type[T]) -> type[T]:
        for old, new in names.items():
            renamed = Renamed(new)
            renamed.__set_name__(kind, old)
            setattr(kind, old, renamed)
        setattr(kind, "__init__", renamed_parameters(**names)(vars(kind)["__init__"]))  # noqa: B010 - mypy
        return kind

    return decorate
