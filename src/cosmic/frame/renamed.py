"""An attribute under the name it had before: it still works for one version, with a warning."""

import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any, Final

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
