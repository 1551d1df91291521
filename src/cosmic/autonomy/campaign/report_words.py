"""Numbers and sentences as a report writes them."""

import math
from typing import Final

from cosmic.autonomy.campaign.records import TWIN, CampaignInfo, FibreRecord, Shape
from cosmic.autonomy.campaign.report_figures import EI_UNIT
from cosmic.autonomy.campaign.statistics import MeanEi

NONE: Final = "–"
TWO_SIDED: Final = 1.96
"""Standard deviations in half of a 95 % interval."""

PROVES_ON_TWIN: Final = (
    "These fibres were simulated. The report shows that the procedures, the safety checks, the "
    "fit and the records work together without a person, at the speeds of the real axes, camera "
    "and acquisition as they are modelled, and with faults as often as the model has them.",
    "It does not show how often real jaws miss, drop or keep a fibre, nor how real pulp fibres "
    "cling to a plate: these rates are guesses that wait for measurements on the platform. "
    "The figures for rate and success are worth as much as those guesses.",
    "The stiffnesses are right for fibres that are straight, elastic and uniform beams, as those "
    "of the twin are. The intervals hold what is foreseen of noise, drift, force scale, stages, "
    "sensor stiffness and the unknown clamp; they do not hold a fibre that is no such beam.",
)
PROVES_ON_RIG: Final = (
    "The intervals of the stiffnesses hold what is foreseen of noise, drift, force scale, stages, "
    "sensor stiffness and the unknown clamp, as far as those were calibrated. They do not hold a "
    "fibre that is not a straight, elastic and uniform beam.",
    "The fibres measured are those that the program could find, grasp and hold: crossing, very "
    "short and strongly curled fibres are missing, so that the distribution is that of the "
    "graspable part of the sample.",
    "The 95 % interval of the mean counts the spread between fibres of this sample only, not "
    "that between samples of one pulp, and no error of the force scale, which all fibres share.",
)


def proves(info: CampaignInfo) -> tuple[str, ...]:
    """Return what the campaign shows and what it does not, a paragraph each."""
    return PROVES_ON_TWIN if info.hardware == TWIN else PROVES_ON_RIG


def number(value: float, digits: int = 0) -> str:
    """Return a number; a dash where there is none."""
    # The sum turns a rounded -0 into 0.
    return f"{round(value, digits) + 0.0:.{digits}f}" if math.isfinite(value) else NONE


def with_interval(value: float, std: float, digits: int = 0) -> str:
    """Return a number with half of its 95 % interval, as far as there are any."""
    if not (math.isfinite(value) and math.isfinite(std)):
        return number(value, digits)
    return f"{number(value, digits)} ± {number(TWO_SIDED * std, digits)}"


def width_words(shape: Shape) -> str:
    """Return a width with its 95 % interval; one that was not resolved says so."""
    told = with_interval(shape.width_um, shape.width_std_um, 1)
    unknown = not math.isfinite(shape.width_std_um) or shape.width_resolved
    return told if unknown else f"{told} (not resolved)"


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
