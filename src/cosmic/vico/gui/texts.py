"""Numbers as the operator reads them."""

import math


def length_text(length_px: float, scale_um_px: float | None) -> str:
    """Return a length in um, or in pixels where the scale is not known."""
    if scale_um_px is None:
        return f"{length_px:.1f} px"
    length_um = length_px * scale_um_px
    return f"{length_um / 1e3:.4g} mm" if length_um >= 1e4 else f"{_four(length_um)} µm"


def _four(value: float) -> str:
    """Return four figures without an exponent."""
    decimals = 0 if value >= 1000 else 1 if value >= 100 else 2
    return f"{value:.{decimals}f}"


def measure_text(value: float) -> str:
    """Return a measure of any size in so many figures that a change is seen."""
    size = abs(value)
    decimals = 0 if size >= 1000 else 1 if size >= 100 else 2 if size >= 1 else 5
    return f"{value:.{decimals}f}"


def number_text(value: float, figures: int = 6) -> str:
    """Return a number as short as it can be typed."""
    return f"{value:.{figures}g}"


def plain_steps(low: float, high: float) -> float:
    """Return a step of 1, 2 or 5 times a power of ten, about a hundredth of the range."""
    span = high - low
    if span <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(span / 100.0))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= span / 100.0)
