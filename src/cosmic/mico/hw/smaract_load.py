"""Finds and loads the libraries of SmarAct, and binds their functions by name.

SCU3DControl is loaded here, others by their description.
"""

import ctypes
import ctypes.util
import struct
import sys
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cosmic.frame.errors import DeviceFault, NotConnectedError


@dataclass(frozen=True, slots=True)
class SmaractLibrary:
    """What is said of one of SmarAct's libraries where it cannot be loaded.

    Attributes
    ----------
    windows, linux : str
        File names under which it is shipped.
    product, sdk : str
        What it is called, and what installs it.
    proof : str
        A function that no other library has.
    others : str
        Controllers that have another one.
    """

    windows: str
    linux: str
    product: str
    sdk: str
    proof: str
    others: str

    @property
    def name(self) -> str:
        """File name under which SmarAct ships it for this system."""
        return self.windows if sys.platform == "win32" else self.linux

    def load(self, path: str = "") -> ctypes.CDLL:
        """Load it from `path`, or from where the system looks when it is empty.

        Raises
        ------
        NotConnectedError
            There is no such file, it does not fit this Python, or it is another library.
        """
        wanted = path or self.name
        try:
            library = ctypes.CDLL(_located(wanted))
        except (OSError, ValueError) as exc:
            bits = struct.calcsize("P") * 8
            raise NotConnectedError(
                f"cannot load SmarAct's library {wanted!r}: {exc}. Install the {self.sdk} "
                f"({self.windows} on Windows, {self.linux} on Linux) and name the file in "
                f"platform.toml, [mico] library. This Python has {bits} bit; the library must "
                f"have too",
                fault=DeviceFault.COMMUNICATION,
            ) from exc
        if not hasattr(library, self.proof):
            raise NotConnectedError(
                f"{wanted} was loaded but has no function {self.proof}: it is not SmarAct's "
                f"{self.product} (the controllers {self.others} have other libraries)",
                fault=DeviceFault.UNSUPPORTED,
            )
        return library


SCU3D_CONTROL: Final = SmaractLibrary(
    windows="SCU3DControl.dll",
    linux="libscu3dcontrol.so",
    product="SCU3DControl",
    sdk="SmarAct SCU SDK",
    proof="SA_InitDevices",
    others="MCS and MCS2",
)


def load_library(path: str = "") -> ctypes.CDLL:
    """Load SCU3DControl; see `SmaractLibrary.load`."""
    return SCU3D_CONTROL.load(path)


class SmaractFunctions:
    """The functions of one library, each bound when it is first called; any thread."""

    def __init__(self, library: object) -> None:
        self._library = library
        self._bound: dict[str, Callable[..., Any] | None] = {}

    @property
    def keeps_interpreter(self) -> bool:
        """A call never lets another thread of Python in."""
        in_python = getattr(self._library, "in_python", False)
        return bool(getattr(self._library, "keeps_interpreter", in_python))

    def has(self, name: str) -> bool:
        """Return whether the library has the function `name`."""
        return self._function(name) is not None

    def _function(self, name: str) -> Callable[..., Any] | None:
        # Two threads may bind the same name at once; both make the same binding.
        if name not in self._bound:
            self._bound[name] = self._bind(name)
        return self._bound[name]

    @abstractmethod
    def _bind(self, name: str) -> Callable[..., Any] | None:
        """Return the function with its types, None where the library has none."""


def _located(wanted: str) -> str:
    # Since Python 3.8 a bare name is no longer looked for along PATH on Windows; this does it.
    if sys.platform == "win32" and Path(wanted).name == wanted:
        return ctypes.util.find_library(wanted) or wanted
    return wanted
