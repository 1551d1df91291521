"""The old name of `planned_path`: what is taken from here still works, and warns."""

import warnings

from cosmic.mico.api import planned_path


def __getattr__(name: str) -> object:
    if name.startswith("__"):
        raise AttributeError(name)
    text = f"cosmic.mico.api.ways is now called {planned_path.__name__}"
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    return getattr(planned_path, name)
