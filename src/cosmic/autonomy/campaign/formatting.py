"""Numbers and their units as the report and the window show them."""

import math
from typing import Final

from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.standards import ForceScale
from cosmic.autonomy.campaign.records import FibreRecord, Shape
from cosmic.autonomy.campaign.statistics import MeanEi
from cosmic.frame.units import TWO_SIDED

EI_UNIT: Final = 1e-12
EI_LABEL: Final = "10⁻¹² N m²"
NONE: Final = "–"
LEAST_SHARE: Final = 0.005
"""Of the variance: contributions with less stand together in one line."""


def number(value: float, digits: int = 0) -> str:
    """Return a number; a dash where there is none."""
    # The sum turns a rounded -0 into 0.
    return f"{round(value, digits) + 0.0:.{digits}f}" if math.isfinite(value) else NONE


def with_interval(value: float, std: float, digits: int = 0) -> str:
    """Return a number with half of its 95 % interval, as far as there are any.

    With up to three more digits where the interval would be read as none.
    """
    if not (math.isfinite(value) and math.isfinite(std)):
        return number(value, digits)
    half = TWO_SIDED * std
    shown = (each for each in range(digits, digits + 4) if round(half, each))
    digits = next(shown, digits)
    return f"{number(value, digits)} ± {number(half, digits)}"


def scale_words(scale: ForceScale | None) -> str:
    """Return whether the scale of the force is verified, and by how much it was put right."""
    if scale is None or not scale.verified:
        text = "force scale not verified: the sensor's certificate is in every interval"
        return "; ".join((text, *(scale.reasons if scale is not None else ())))
    used = sum(not each.refused for each in scale.standards)
    text = (
        f"verified by a standard, measured {used} {'time' if used == 1 else 'times'}: the sensor "
        f"reads {100.0 * scale.off_part:+.1f} ± {200.0 * scale.off_std_part:.1f} % (k = 2), which "
        f"all values take into account; change over the campaign "
        f"{100.0 * scale.drift_part:+.1f} ± {200.0 * scale.drift_std_part:.1f} %"
    )
    return "; ".join((text, *scale.reasons))


def length_words(shape: Shape) -> str:
    """Return a length with its 95 % interval; where it may be that of a part it says so."""
    text = f"{with_interval(shape.length_um, shape.length_std_um)} µm"
    # Rounded down: what is not certain is never told as 100 %.
    percent = math.floor(1000.0 * shape.probability) / 10.0 if shape.doubted else 100.0
    return f"{text} (a whole fibre: {percent:g} %)" if shape.doubted else text


def width_words(shape: Shape) -> str:
    """Return a width with its 95 % interval; one that was not resolved says so."""
    text = with_interval(shape.width_um, shape.width_std_um, 1)
    unknown = not math.isfinite(shape.width_std_um) or shape.width_resolved
    return text if unknown else f"{text} (not resolved)"


def stiffness(value_n_m2: float) -> str:
    """Return a stiffness in the unit of the report with three digits."""
    value = value_n_m2 / EI_UNIT
    if not math.isfinite(value):
        return NONE
    return f"{value:#.3g}".removesuffix(".") if value < 999.5 else f"{value:.0f}"


def interval(low_n_m2: float, high_n_m2: float) -> str:
    """Return an interval of stiffnesses."""
    if not (math.isfinite(low_n_m2) and math.isfinite(high_n_m2)):
        return NONE
    return f"{stiffness(low_n_m2)} to {stiffness(high_n_m2)}"


def mean_words(mean: MeanEi) -> str:
    """Return the mean with its interval, as far as there are any."""
    if mean.count == 0:
        return NONE
    if mean.count == 1:
        return f"{stiffness(mean.ei_n_m2)} (one fibre)"
    return f"{stiffness(mean.ei_n_m2)} ({interval(mean.ei_low_n_m2, mean.ei_high_n_m2)})"


def duration(seconds: float) -> str:
    """Return a time in words."""
    if not math.isfinite(seconds):
        return NONE
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def when(iso: str) -> str:
    """Return a moment as a person reads it."""
    return iso.replace("T", " ", 1)


def outcome_words(record: FibreRecord) -> str:
    """Return how a fibre ended, with the cause."""
    return f"{record.outcome}: {record.cause}" if record.cause else str(record.outcome)


def budget_rows(result: BendingResult) -> list[tuple[str, ...]]:
    """Return the budget of a stiffness as rows of text; contributions too small to see in one."""
    shown = [line for line in result.budget if line.share >= LEAST_SHARE]
    rows: list[tuple[str, ...]] = [
        (
            line.source,
            line.kind.value,
            f"{line.std:.3g} {line.unit.replace('um', 'µm').replace('uN', 'µN')}".strip(),
            f"{line.sensitivity:.3g}",
            f"{100.0 * line.share:.1f}",
        )
        for line in shown
    ]
    rest = sum(line.share for line in result.budget) - sum(line.share for line in shown)
    if result.budget and len(shown) < len(result.budget):
        rows.append(("all others", "", "", "", f"{100.0 * max(rest, 0.0):.1f}"))
    return rows
