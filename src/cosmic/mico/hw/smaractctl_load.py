"""Finds and loads SmarAct's SmarActCTL library."""

import ctypes
from typing import Final

from cosmic.mico.hw.scu3d_load import SmaractLibrary

SMARACT_CTL: Final = SmaractLibrary(
    windows="SmarActCTL.dll",
    linux="libsmaractctl.so",
    product="SmarActCTL",
    sdk="SmarAct MCS2 SDK",
    proof="SA_CTL_Open",
    others="SCU and MCS",
)


def load_library(path: str = "") -> ctypes.CDLL:
    """Load SmarActCTL; see `SmaractLibrary.load`."""
    return SMARACT_CTL.load(path)
