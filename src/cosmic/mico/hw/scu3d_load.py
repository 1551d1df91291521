"""Finds and loads SmarAct's SCU3DControl library."""

import ctypes
import ctypes.util
import struct
import sys
from pathlib import Path

from cosmic.frame.errors import DeviceFault, NotConnectedError


def default_library_name() -> str:
    """Return the file name under which SmarAct ships the library for this system."""
    return "SCU3DControl.dll" if sys.platform == "win32" else "libscu3dcontrol.so"


def load_library(path: str = "") -> ctypes.CDLL:
    """Load the vendor's library from `path`, or from where the system looks when it is empty.

    Raises
    ------
    NotConnectedError
        There is no such file, it does not fit this Python, or it is another library.
    """
    wanted = path or default_library_name()
    try:
        library = ctypes.CDLL(_located(wanted))
    except (OSError, ValueError) as exc:
        raise NotConnectedError(
            _cannot_load(wanted, reason=str(exc)), fault=DeviceFault.COMMUNICATION
        ) from exc
    if not hasattr(library, "SA_InitDevices"):
        raise NotConnectedError(
            f"{wanted} was loaded but has no function SA_InitDevices: it is not SmarAct's "
            f"SCU3DControl (the controllers MCS and MCS2 have other libraries)",
            fault=DeviceFault.UNSUPPORTED,
        )
    return library


def _located(wanted: str) -> str:
    # Since Python 3.8 a bare name is no longer looked for along PATH on Windows; this does it.
    if sys.platform == "win32" and Path(wanted).name == wanted:
        return ctypes.util.find_library(wanted) or wanted
    return wanted


def _cannot_load(wanted: str, *, reason: str) -> str:
    bits = struct.calcsize("P") * 8
    return (
        f"cannot load SmarAct's library {wanted!r}: {reason}. Install the SmarAct SCU SDK "
        f"(SCU3DControl.dll on Windows, libscu3dcontrol.so on Linux) and name the file in "
        f"platform.toml, [mico] library. This Python has {bits} bit; the library must have too"
    )
