"""What scripts and windows call; names are loaded when first used, so that importing is quick."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cosmic.vico.core.vision.fibre import Fibre, fibre_mask
    from cosmic.vico.core.vision.finding import find_fibres

_HOME_OF = {
    "Fibre": "cosmic.vico.core.vision.fibre",
    "fibre_mask": "cosmic.vico.core.vision.fibre",
    "find_fibres": "cosmic.vico.core.vision.finding",
}

__all__ = ["Fibre", "fibre_mask", "find_fibres"]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'cosmic.vico.api' has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
