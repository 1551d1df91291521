"""Custom scales as text, and what is odd about one."""

from typing import Final

import numpy as np
from pydantic import ValidationError

from cosmic.daqco.core.scale import LARGEST_COEFFICIENT, Scale
from cosmic.daqco.core.settings import EXTREMES_V, ScaleSettings
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.errors import ConfigError

_RAISED: Final = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def formula(coefficients: tuple[float, ...], unit: str) -> str:
    """Return a polynomial as text, such as "value in µN = 0.5 + 20 V − 0.1 V²"."""
    terms: list[str] = []
    for power, coefficient in enumerate(coefficients):
        if coefficient == 0.0 and len(coefficients) > 1:
            continue
        sign = "−" if coefficient < 0.0 else "+" if terms else ""
        volts = "" if power == 0 else " V" if power == 1 else f" V{str(power).translate(_RAISED)}"
        gap = " " if terms else ""
        terms.append(f"{sign}{gap}{abs(coefficient):g}{volts}")
    return f"value in {display_unit(unit)} = {' '.join(terms) or '0'}"


def checked(name: str, unit: str, coefficients: tuple[float, ...]) -> ScaleSettings:
    """Return a scale that the program can use.

    Raises
    ------
    ConfigError
        It has no name, no unit or no coefficients, or one that is not finite or far too large.
    """
    Scale(name, unit, coefficients)
    if not unit.strip():
        raise ConfigError(f"scale {name!r}: say in which unit its values are")
    try:
        return ScaleSettings(name=name.strip(), unit=unit.strip(), coefficients=coefficients)
    except ValidationError as exc:
        raise ConfigError(f"scale {name!r}: {exc.errors()[0]['msg']}") from None


def coefficient_problem(value: float) -> str:
    """Return why a number cannot be a coefficient; empty when it can."""
    if abs(value) <= LARGEST_COEFFICIENT:
        return ""
    return f"give a number up to {LARGEST_COEFFICIENT:g}"


def oddity(scale: ScaleSettings) -> str:
    """Return what the operator may not have meant; empty when there is nothing."""
    values = scale.scale().apply(np.linspace(*EXTREMES_V, 401))
    steps = np.diff(values)
    if not np.any(values != values[0]):
        return "every voltage gives the same value"
    if np.any(steps > 0.0) and np.any(steps < 0.0):
        return "the scale is not monotonic: two voltages give the same value"
    return ""
