"""What a bend test says about a fibre, and how far it may be believed."""

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import CosmicError
from cosmic.frame.renamed import renamed_fields

UN_UM2_PER_N_M2: Final = 1e18
N_M2_PER_UN_UM2: Final = 1e-18


class BendingError(CosmicError):
    """What was handed over is not a bend test; the text says what is wrong with it."""


class Quality(StrEnum):
    """What makes a span or a result doubtful."""

    SLIPPED = "slipped"
    BROKEN = "force lost while pushing"
    HYSTERESIS = "loading and unloading differ"
    NO_CONTACT = "no contact"
    TOO_SOFT = "too soft for the sensor"
    SATURATED = "sensor saturated"
    TOO_FEW_SPANS = "too few good spans"
    POOR_FIT = "the model does not fit"
    RELAXED = "relaxes"
    SET = "plastic set"
    HINGE = "weak place"
    NON_UNIFORM = "not uniform"
    FRICTION = "friction"
    CLAMP_DEEP = "clamped deep in the jaws"
    MOVED = "contact moved"
    NOT_A_FIBRE = "not a fibre"
    SHAPE = "image and force disagree"


COMMON_SOURCES: Final = (
    "scale of the force",
    "drift of the scale",
    "friction",
    "jaws and sensor give way",
    "place of the probe's edge",
    "cross-talk",
    "probe gives way aside",
    "shear",
    "the probe slides where it should stick",
)
"""Contributions to the budget that all fibres of a campaign share, in the order of the fit."""

DRIFT_FORM: Final = "how the scale changed between two standards"
"""Another one that they share."""


class Kind(StrEnum):
    """How a contribution to the uncertainty is known, after GUM."""

    A = "A"
    B = "B"


@dataclass(frozen=True, slots=True)
class Contribution:
    """One line of the budget of a bending stiffness.

    Attributes
    ----------
    kind : Kind
        A: from the scatter of readings. B: from what is known otherwise.
    std : float
        Standard uncertainty of the source, in `unit`.
    sensitivity : float
        Change of ln(EI) for one `unit`.
    share : float
        Of the variance of ln(EI), 0 to 1; all lines together make 1.
    """

    source: str
    kind: Kind
    std: float
    unit: str
    sensitivity: float
    share: float

    @property
    def common(self) -> bool:
        """Whether it is the same for all fibres of a campaign: their mean does not lessen it."""
        return self.source in (*COMMON_SOURCES, DRIFT_FORM)


@renamed_fields(ways_correlation="branches_correlation")
@dataclass(frozen=True, slots=True, eq=False)
class SpanFit:
    """One span with the model fitted to it.

    Attributes
    ----------
    place_um : float
        From the tip of the jaws to the middle of the probe: exact from span to span, with an
        offset common to all.
    k_un_um, k_std_un_um : float
        Stiffness at the first contact, of the fibre alone; nan where there is none.
    k_loading_un_um, k_unloading_un_um : float
        The same of the way out and the way back alone.
    hinge_um, hinge_back_um : float
        Position of the probe's axis at the first contact, and at the last on the way back.
    baseline_un, drift_un_s : float
        The force without contact: at the begin of the span, and its rate of change.
    hysteresis_percent : float
        Mean force that loading has more than unloading, of the highest force.
    peak_un : float
        Highest force, above the baseline.
    chi2, freedom : float, int
        Sum of squares over the noise foreseen, and degrees of freedom.
    fitted_un : ndarray, shape (n,), float64
        The model at each point of the span, baseline included; nan where it was left out.
    flags : frozenset of Quality
    out_std_part, back_std_part, branches_correlation : float
        Standard deviations of ln(k) on the way out and back, and how they go together.
    friction : float
        About which it was fitted.
    by_friction : float
        Half of what a friction of 1 makes ln(k) of both ways differ by.
    by_friction_both : float
        Change of ln(k) on both ways alike for a friction of 1, beside that.
    by_side_out, by_side_back : float
        Change of ln(k) by all that the probe is taken to give way along the fibre.
    by_sliding_out, by_sliding_back : float
        Change of ln(k) if the probe never stuck to the fibre.
    by_friction_sliding : (float, float)
        Change of ln(k) on the ways out and back for a friction of 1, if the probe never stuck.
    chi2_by_friction : tuple of float
        `chi2` for each of `friction.GIVES_TRIED` and of `friction.FRICTIONS_TRIED`, and last for a
        probe that never sticks.
    shift_um, shift_std_um : float
        How much farther out contact ends than it began.
    relaxation_part, relaxation_std_part : float
        Part of the force that is lost in a tenfold time.
    freed_log, freed_std_part : float
        ln of the force, as a part of itself, once friction was made to let go of a section askew,
        and its standard deviation; nan where that was not tried.
    off_model_log : float
        ln of its stiffness, less that of the result's model: what noise, places of contact and a
        stiffness that varies along the fibre leave once scale, friction, compliance and the like
        are taken off; nan where the result does not stand on it.
    """

    place_um: float
    k_un_um: float
    k_std_un_um: float
    k_loading_un_um: float
    k_unloading_un_um: float
    hinge_um: float
    hinge_back_um: float
    baseline_un: float
    drift_un_s: float
    hysteresis_percent: float
    peak_un: float
    chi2: float
    freedom: int
    fitted_un: Floats
    flags: frozenset[Quality]
    out_std_part: float = math.nan
    back_std_part: float = math.nan
    branches_correlation: float = 0.0
    friction: float = 0.0
    by_friction: float = 0.0
    by_friction_both: float = 0.0
    by_side_out: float = 0.0
    by_side_back: float = 0.0
    by_sliding_out: float = 0.0
    by_sliding_back: float = 0.0
    by_friction_sliding: tuple[float, float] = (0.0, 0.0)
    chi2_by_friction: tuple[float, ...] = ()
    shift_um: float = math.nan
    shift_std_um: float = math.nan
    relaxation_part: float = math.nan
    relaxation_std_part: float = math.nan
    freed_log: float = math.nan
    freed_std_part: float = math.nan
    off_model_log: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class BendingResult:
    """Bending stiffness with its interval.

    Attributes
    ----------
    ei_n_m2, ei_low_n_m2, ei_high_n_m2 : float
        Best value and 95 % interval; nan where there is none.
    clamp_offset_um, clamp_offset_std_um : float
        From the tip of the jaws, as `Span.nominal_um` has it, back to the clamp.
    spans : tuple of SpanFit
        As they were handed over.
    used : tuple of int
        Which of them the result stands on.
    chi2, freedom : float, int
        Of the spans' stiffnesses on one straight line.
    flags : frozenset of Quality
        Of the result; those of single spans stand with them.
    trusted : bool
        Whether the result may be used without a second look.
    reasons : tuple of str
        Why not, or what was left out.
    budget : tuple of Contribution
        What the interval follows from, the largest first; empty where there is no interval.
    scale_verified : bool
        Whether the scale of the force comes from a standard; else the sensor's certificate is in
        the interval.
    notes : frozenset of Quality
        What was seen and stands in the interval, without speaking against the value.
    """

    ei_n_m2: float
    ei_low_n_m2: float
    ei_high_n_m2: float
    clamp_offset_um: float
    clamp_offset_std_um: float
    spans: tuple[SpanFit, ...]
    used: tuple[int, ...]
    chi2: float
    freedom: int
    flags: frozenset[Quality]
    trusted: bool
    reasons: tuple[str, ...]
    budget: tuple[Contribution, ...] = ()
    scale_verified: bool = False
    notes: frozenset[Quality] = frozenset()
