"""Loads the C library of a camera driver, and sets the types of its functions."""

import ctypes
from collections.abc import Mapping
from typing import Any

from cosmic.frame.errors import DeviceFault, NotConnectedError

Prototypes = Mapping[str, tuple[Any, tuple[Any, ...]]]
"""By name: the type of the answer, and those of the arguments."""


def load_camera_library(wanted: str, advice: str) -> ctypes.CDLL:
    """Load a library by path, or by a name under which the system looks for it.

    Raises
    ------
    NotConnectedError
        It is not installed; `advice` says how to.
    """
    try:
        return ctypes.CDLL(wanted)
    except OSError as exc:
        raise NotConnectedError(
            f"cannot load {wanted}: {exc}. {advice}", fault=DeviceFault.COMMUNICATION
        ) from exc


def bind_functions(
    library: object, prototypes: Prototypes, *, name: str, needed: str
) -> dict[str, Any]:
    """Return every function of `prototypes` by name.

    Parameters
    ----------
    library : ctypes.CDLL or object
        What has the functions as attributes; types are set only on those of a `CDLL`.
    name, needed : str
        What the library is called, and which version is needed.

    Raises
    ------
    NotConnectedError
        A function is missing: the library is too old, or another one.
    """
    functions = {}
    for function_name, (answer, arguments) in prototypes.items():
        function = getattr(library, function_name, None)
        if function is None:
            raise NotConnectedError(
                f"the library {name} has no function {function_name}: {needed}",
                fault=DeviceFault.UNSUPPORTED,
            )
        if isinstance(library, ctypes.CDLL):
            function.restype, function.argtypes = answer, arguments
        functions[function_name] = function
    return functions
