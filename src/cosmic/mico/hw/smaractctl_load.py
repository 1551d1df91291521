"""Finds and loads SmarAct's SmarActCTL library."""

import ctypes
import ctypes.util
import struct
import sys
from pathlib import Path

from cosmic.frame.errors import DeviceFault, NotConnectedError


def default_library_name() -> str:
    """Return the file name under which SmarAct ships the library for this system."""
    return "SmarActCTL.dll" if sys.platform == "win32" else "libsmaractctl.so"


def load_library(path: str = "") -> ctypes.CDLL:
    """Load the vendor's library from `path`, or from where the system looks when it is empty.

    Raises
    ------
    NotConnectedError
        There is no such file, it does not fit this Python, or it is another library.
    """
    wanted = path or default_library_name()
    # Since Python 3.8 a bare name is no longer looked for along PATH on Windows; this does it.
    bare = sys.platform == "win32" and Path(wanted).name == wanted
    located = (ctypes.util.find_library(wanted) or wanted) if bare else wanted
    try:
        library = ctypes.CDLL(located)
    except (OSError, ValueError) as exc:
        bits = struct.calcsize("P") * 8
        raise NotConnectedError(
            f"cannot load SmarAct's library {wanted!r}: {exc}. Install the SmarAct MCS2 SDK "
            f"(SmarActCTL.dll on Windows, libsmaractctl.so on Linux) and name the file in "
            f"platform.toml, [mico] library. This Python has {bits} bit; the library must have too",
            fault=DeviceFault.COMMUNICATION,
        ) from exc
    if not hasattr(library, "SA_CTL_Open"):
        raise NotConnectedError(
            f"{wanted} was loaded but has no function SA_CTL_Open: it is not SmarAct's "
            f"SmarActCTL (the controllers SCU and MCS have other libraries)",
            fault=DeviceFault.UNSUPPORTED,
        )
    return library
