"""What standards say of the scale of the force, and whether they may be believed.

Each standard is a beam of certified stiffness, bent by the same operations as a fibre. By itself it
says how much too high the sensor reads, whatever the sensor's certificate has. Where standards
contradict that certificate, or drift by more than foreseen, what is known beforehand of scale and
drift is made as wide as what they show, so that they decide; where they contradict each other, or
are no good measurements, they are refused with the reason, and the scale is known no better than
they show.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtrc

from cosmic.autonomy.bending.inference import DRIFT, GAIN, Common, Readings, common_prior
from cosmic.autonomy.bending.population import said_alone
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.frame.arrays import Floats

UNKNOWN_GAIN: Final = 0.5
"""Standard deviation of a scale of which nothing is known."""

MOST_OFF: Final = 0.3
"""Of the certificate: what is as far off is another beam, or none."""

CONTRADICTS: Final = 3.0
"""Standard deviations from which standard and certificate of the sensor do not go together."""

UNFORESEEN: Final = 2.0
"""Standard deviations beyond which the standard decides; nearer, both count as they are known."""

DRIFTS: Final = 2.0
LEAST_FOR_A_LINE: Final = 3
"""So many standards show whether the scale drifts evenly."""

EXACT: Final = 1e-6
DISAGREE: Final = 1e-3
ALIKE: Final = {
    "sensor_std_part": 0.0,
    "jaw_std_part": 0.0,
    "contact_offset_std_um": 0.0,
    "cross_std_part": 0.0,
    "side_std_part": 0.0,
    "gain_drift_std_part": 0.0,
}
"""What is the same for all standards of a campaign does not make them differ."""


@dataclass(frozen=True, slots=True)
class StandardReading:
    """What one measurement of a standard says.

    Attributes
    ----------
    part : float
        Of the campaign that was over, 0 to 1.
    off_part, off_std_part : float
        How much too high the sensor reads by it alone, ln, and the standard uncertainty of that
        with the certificate's; nan where it has no stiffness.
    alike_std_part : float
        The same without what all standards of a campaign have in common.
    refused : str
        Why it is not used; empty where it is.
    """

    part: float
    off_part: float = math.nan
    off_std_part: float = math.nan
    alike_std_part: float = math.nan
    refused: str = ""

    @property
    def off_percent(self) -> float:
        """How much too high the sensor reads by it alone."""
        return 100.0 * math.expm1(self.off_part)


@dataclass(frozen=True, slots=True)
class ForceScale:
    """How the scale of the force is known in a campaign.

    Attributes
    ----------
    verified : bool
        It rests on a standard; else on the sensor's certificate alone.
    off_part, off_std_part : float
        How much too high the sensor reads in the middle of the campaign, as a part, and the
        standard uncertainty of that: with it all values were put right.
    drift_part, drift_std_part : float
        Change of the scale from begin to end.
    standards : tuple of StandardReading
        In the order they were measured.
    reasons : tuple of str
        What speaks against a standard, or was made wider because of it.
    """

    verified: bool
    off_part: float
    off_std_part: float
    drift_part: float = 0.0
    drift_std_part: float = 0.0
    standards: tuple[StandardReading, ...] = ()
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CheckedStandards:
    """Standards as the fit is to take them.

    Attributes
    ----------
    settings : FitSettings
        With what is known beforehand of scale and drift as wide as the standards ask for.
    jump_part : float
        Change of the scale that two standards alone show: whether it came little by little or at
        once they cannot tell.
    """

    readings: tuple[StandardReading, ...]
    settings: FitSettings
    reasons: tuple[str, ...]
    jump_part: float = 0.0

    @property
    def used(self) -> tuple[int, ...]:
        """The numbers of those that count."""
        return tuple(n for n, each in enumerate(self.readings) if not each.refused)


def check_standards(
    standards: Sequence[tuple[Readings | None, float, tuple[str, ...]]], settings: FitSettings
) -> CheckedStandards:
    """Return what standards say, each by itself and compared with each other.

    Parameters
    ----------
    standards : sequence of (Readings or None, float, tuple of str)
        Of each its readings, the part of the campaign that was over, and what speaks against it
        as a measurement.
    """
    readings = [_alone(read, part, doubts, settings) for read, part, doubts in standards]
    good = [each for each in readings if not each.refused]
    if not good:
        return CheckedStandards(tuple(readings), settings, tuple(each.refused for each in readings))
    reasons = [f"standard {n + 1}: {e.refused}" for n, e in enumerate(readings) if e.refused]
    off, slope, drifts, agree = _line(good, settings)
    if not agree:
        text = "the standards contradict each other by more than noise and drift explain"
        readings = [replace(each, refused=each.refused or text) for each in readings]
        # Whatever made them differ makes fibres differ too.
        shown = math.sqrt(sum(each.off_part**2 for each in good) / len(good))
        wide = {"gain_std_part": min(max(settings.gain_std_part, shown), 1.0)}
        return CheckedStandards(tuple(readings), settings.model_copy(update=wide), (*reasons, text))
    wider: dict[str, float] = {}
    jump = 0.0
    std = min(each.off_std_part for each in good)
    foreseen = math.hypot(settings.gain_std_part, std)
    if abs(off) > UNFORESEEN * foreseen:
        wider["gain_std_part"] = min(abs(off), 1.0)
    if drifts:
        wider["gain_drift_std_part"] = min(abs(slope), 1.0)
        reasons.append(f"the scale drifts by {100.0 * math.expm1(slope):+.1f} % over the campaign")
        if len(good) < LEAST_FOR_A_LINE:
            jump = abs(slope)
            reasons.append(
                "two standards do not tell whether it changed little by little or at once: measure "
                "one in the middle too"
            )
    if abs(off) > CONTRADICTS * foreseen:
        reasons.append(
            "the standard contradicts the sensor's certificate by "
            f"{100.0 * math.expm1(off):+.1f} %: have the sensor calibrated"
        )
    return CheckedStandards(
        tuple(readings), settings.model_copy(update=wider), tuple(reasons), jump
    )


def scale_of(common: Common, found: CheckedStandards, *, verified: bool) -> ForceScale:
    """Return how the scale is known once all was assessed together."""
    middle = np.zeros(len(common.mean))
    middle[GAIN], middle[DRIFT] = 1.0, 0.5
    return ForceScale(
        verified=verified,
        off_part=math.expm1(float(middle @ common.mean)),
        off_std_part=math.sqrt(float(middle @ common.covariance @ middle)),
        drift_part=math.expm1(float(common.mean[DRIFT])),
        drift_std_part=math.sqrt(float(common.covariance[DRIFT, DRIFT])),
        standards=found.readings,
        reasons=found.reasons,
    )


def _alone(
    read: Readings | None, part: float, doubts: tuple[str, ...], settings: FitSettings
) -> StandardReading:
    if read is None:
        return StandardReading(part, refused="; ".join(doubts) or "it has no stiffness")
    off, std = _implied(read, part, settings)
    log_ei, _ = read.certified or (0.0, 0.0)
    exact = replace(read, certified=(log_ei, EXACT))
    _, alike = _implied(exact, part, settings.model_copy(update=ALIKE))
    refused = "; ".join(doubts)
    if not refused and not abs(off) <= MOST_OFF:
        percent = 100.0 * math.expm1(off)
        refused = f"{percent:+.0f} % from its certificate: another beam, or a wrong certificate"
    return StandardReading(part, off, std, alike, refused)


def _implied(read: Readings, part: float, settings: FitSettings) -> tuple[float, float]:
    """Return by how much the sensor reads too high by this standard alone, ln, and its std."""
    wide = settings.model_copy(update={"gain_std_part": UNKNOWN_GAIN})
    precision, pull = said_alone(read, wide)
    prior = common_prior(wide)
    before = np.linalg.inv(prior.covariance)
    covariance = np.linalg.inv(before + precision)
    mean = covariance @ (before @ prior.mean + pull)
    here = np.zeros(len(mean))
    here[GAIN], here[DRIFT] = 1.0, part
    return float(here @ mean), math.sqrt(float(here @ covariance @ here))


def _line(
    good: Sequence[StandardReading], settings: FitSettings
) -> tuple[float, float, bool, bool]:
    """Return mean, slope, whether that is more than chance, and whether all lie on one line."""
    parts = np.array([each.part for each in good])
    offs = np.array([each.off_part for each in good])
    stds = np.maximum([each.alike_std_part for each in good], 1e-4)
    weights = 1.0 / stds**2
    mean = float(weights @ offs / weights.sum())
    if len(good) < 2 or np.ptp(parts) < 1e-6:
        return mean, 0.0, False, _goes_together(offs - mean, stds, len(good) - 1)
    away = parts - float(weights @ parts / weights.sum())
    spread = float(weights @ away**2)
    slope = float(weights @ (away * offs)) / spread
    foreseen = math.hypot(settings.gain_drift_std_part, spread**-0.5)
    drifts = abs(slope) > DRIFTS * foreseen
    return mean, slope, drifts, _goes_together(offs - mean - slope * away, stds, len(good) - 2)


def _goes_together(left: Floats, stds: Floats, freedom: int) -> bool:
    if freedom < 1:
        return True
    return bool(chdtrc(freedom, float(np.sum((left / stds) ** 2))) > DISAGREE)
