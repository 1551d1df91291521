"""Which of the fibres on the plates were measured, and what that does to their mean.

What cannot be grasped is not measured, so that short and curled fibres are missing among the
values. Fibres that were seen are put into classes of length; in the weighted mean each class
counts as it does on the plates.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.campaign.rates import Seen
from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.statistics import MeanEi, mean_ei

CLASSES: Final = 4
LEAST: Final = 8
"""Fewer fibres of known length are not put into classes."""
LENGTH_UNKNOWN: Final = frozenset({"crossing", "not certain", "out of the field"})
"""Problems with which the image shows no length; a treated fibre has one all the same."""
COULD: Final = "none"


@dataclass(frozen=True, slots=True)
class LengthClass:
    """Fibres of one class of length.

    Attributes
    ----------
    from_um, to_um : float
        Its limits; the last includes its upper one.
    seen, graspable, good : int
    weight : float
        What a good fibre of the class counts in the weighted mean, 1 on average; nan where there
        is no good one.
    """

    from_um: float
    to_um: float
    seen: int
    graspable: int
    good: int
    weight: float


@dataclass(frozen=True, slots=True)
class Selection:
    """Who was measured of those that were seen.

    Attributes
    ----------
    problems : tuple of (str, int, int)
        Why fibres could not be taken as they lay, "none" where they could; how many, and how many
        good ones came of them.
    classes : tuple of LengthClass
        Empty of too few fibres.
    unknown : int
        Fibres of which the image shows no length: they are in no class.
    missing_part : float
        Part of the fibres of known length in classes without a good one.
    weighted : MeanEi
        The mean with the weights of the classes; that of all without classes.
    """

    problems: tuple[tuple[str, int, int], ...]
    classes: tuple[LengthClass, ...]
    unknown: int
    missing_part: float
    weighted: MeanEi


def selection_of(
    seen: Sequence[Seen], good: Sequence[FibreRecord], *, common_std_ln: float = 0.0
) -> Selection:
    """Return who was measured of those that were seen.

    Parameters
    ----------
    good : sequence of FibreRecord
        The good fibres.
    common_std_ln : float
        Standard uncertainty of ln(EI) that all share.
    """
    counts = Counter(each.sighting.problem or COULD for each in seen)
    came = Counter(each.sighting.problem or COULD for each in seen if each.outcome is Outcome.GOOD)
    problems = tuple((name, count, came[name]) for name, count in counts.most_common())
    known = [each for each in seen if _has_length(each)]
    values = [
        (each.shape.length_um, each.bending.ei_n_m2)
        for each in good
        if each.bending is not None and each.bending.ei_n_m2 > 0.0
    ]
    unknown = len(seen) - len(known)
    stiffnesses = [ei for _, ei in values]
    if len(known) < LEAST or len(values) < 2:
        plain = mean_ei(stiffnesses, common_std_ln=common_std_ln)
        return Selection(problems, (), unknown, 0.0, plain)
    classes = _classes(known, [length for length, _ in values])
    weights = [classes[_class(classes, length)].weight for length, _ in values]
    missing = sum(each.seen for each in classes if not each.good)
    return Selection(
        problems=problems,
        classes=classes,
        unknown=unknown,
        missing_part=missing / len(known),
        weighted=mean_ei(stiffnesses, weights=weights, common_std_ln=common_std_ln),
    )


def _has_length(seen: Seen) -> bool:
    shown = not math.isnan(seen.treated_um) or seen.sighting.problem not in LENGTH_UNKNOWN
    return shown and math.isfinite(seen.length_um)


def _classes(known: Sequence[Seen], lengths_um: Sequence[float]) -> tuple[LengthClass, ...]:
    """Return classes with about as many of the fibres seen in each, and their weights."""
    seen_um = np.array([each.length_um for each in known])
    edges = np.quantile(seen_um, np.linspace(0.0, 1.0, CLASSES + 1))
    seen_in = np.clip(np.searchsorted(edges, seen_um, side="right") - 1, 0, CLASSES - 1)
    good_in = np.clip(np.searchsorted(edges, lengths_um, side="right") - 1, 0, CLASSES - 1)
    can = np.array([each.graspable for each in known])
    seen = np.bincount(seen_in, minlength=CLASSES)
    good = np.bincount(good_in, minlength=CLASSES)
    represented = float(seen[good > 0].sum())
    weights = seen / represented * good.sum() / np.maximum(good, 1)
    return tuple(
        LengthClass(
            from_um=float(edges[n]),
            to_um=float(edges[n + 1]),
            seen=int(seen[n]),
            graspable=int(can[seen_in == n].sum()),
            good=int(good[n]),
            weight=float(weights[n]) if good[n] else math.nan,
        )
        for n in range(CLASSES)
    )


def _class(classes: Sequence[LengthClass], length_um: float) -> int:
    inner = [each.from_um for each in classes[1:]]
    return int(np.searchsorted(inner, length_um, side="right"))
