"""Units: the one place where they are read from text and converted."""

import math
import re
from typing import Final, Literal

from cosmic.frame.errors import QuantityError

AxisUnit = Literal["um", "deg"]
TWO_SIDED: Final = 1.96
"""Standard deviations in half of a 95 % interval."""

_TO_UM: Final = {"nm": 1e-3, "um": 1.0, "µm": 1.0, "μm": 1.0, "mm": 1e3, "cm": 1e4, "m": 1e6}
_TO_DEG: Final = {
    "deg": 1.0,
    "°": 1.0,
    "mdeg": 1e-3,
    "rad": 180.0 / math.pi,
    "mrad": 0.18 / math.pi,
}
_TO_V: Final = {"V": 1.0, "mV": 1e-3, "kV": 1e3}
_TO_HZ: Final = {"Hz": 1.0, "kHz": 1e3}
_TO_STEPS: Final = {"steps": 1.0, "step": 1.0}
_FACTORS: Final[dict[str, dict[str, float]]] = {
    "um": _TO_UM,
    "deg": _TO_DEG,
    "um/s": {f"{unit}/s": factor for unit, factor in _TO_UM.items()},
    "deg/s": {f"{unit}/s": factor for unit, factor in _TO_DEG.items()},
    "V": _TO_V,
    "Hz": _TO_HZ,
    "steps": _TO_STEPS,
}
_QUANTITY: Final = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\d\s.]*)\s*"
)

_ASCII_MICRO: Final = re.compile(r"(?<![A-Za-z_'\"`])u(?=[mNV](?![A-Za-z_]))")

DISPLAY: Final = {
    "um": "µm",
    "deg": "°",
    "um/s": "µm/s",
    "deg/s": "°/s",
    "V": "V",
    "Hz": "Hz",
    "steps": "steps",
}


def parse_quantity(text: str, unit: str) -> float:
    """Read a number, with or without a unit, and return it in `unit`.

    Parameters
    ----------
    text : str
        Such as "120", "-0.2 mm", "1.5 deg"; a decimal point, no thousands separators.
    unit : str
        The unit wanted and assumed where none is written: "um", "deg", "um/s", "deg/s", "V",
        "Hz", "steps".

    Raises
    ------
    QuantityError
        The text is not a finite number, or its unit does not measure the same thing.
    """
    if not text.strip():
        raise QuantityError("nothing entered: type a number, such as 12.5 or 0.2 mm")
    match = _QUANTITY.fullmatch(text)
    if match is None:
        hint = "; write the decimal sign as a point" if "," in text else ""
        raise QuantityError(f"{text.strip()!r} is not a number{hint}")
    factors = _FACTORS[unit]
    written = match["unit"] or unit
    if written not in factors:
        raise QuantityError(
            f"{written!r} is not a unit that fits here; use one of {', '.join(factors)}"
        )
    value = float(match["number"]) * factors[written]
    if not math.isfinite(value):
        raise QuantityError(f"{text.strip()!r} is too large to be a number")
    return value


def format_quantity(value: float, unit: str, decimals: int | None = None) -> str:
    """Return `value` as text for the operator, such as "12.5 µm"."""
    if abs(value) >= 1e9:
        return f"{value:.3e} {DISPLAY.get(unit, unit)}"
    digits = {"um": 1, "deg": 4, "V": 1}.get(unit, 0) if decimals is None else decimals
    rounded = round(value, digits) + 0.0  # no minus in front of zero
    return f"{rounded:.{digits}f} {DISPLAY.get(unit, unit)}"


def with_micro_signs(text: str) -> str:
    """Return a sentence for the operator: the units "um", "uN" and "uV" in it as µm, µN, µV."""
    return _ASCII_MICRO.sub("µ", text)
