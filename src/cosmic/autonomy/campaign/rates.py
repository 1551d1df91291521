"""What part of the fibres came to a value, and how much of the time was their treatment."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.campaign.records import (
    FINISHED,
    STANDARD,
    FibreRecord,
    Outcome,
    PlateChange,
    Pose,
    Sighting,
)
from cosmic.autonomy.campaign.statistics import SECONDS_AN_HOUR
from cosmic.autonomy.campaign.store_read import CampaignReader

SAME_UM: Final = 120.0
"""How far apart a sighting and the begin of a treatment are of one fibre."""
FAINT: Final = "too faint"
"""Problem of a sighting that may be noise: it does not count as a fibre."""
SEEN_LATER: Final = "not in the first survey"
"""Problem of a fibre that was treated, and that the first survey did not see."""
SAME_LENGTH: Final = 0.01
"""By what part lengths of one fibre differ that was treated twice."""


@dataclass(frozen=True, slots=True)
class Seen:
    """One sighting, and what became of the fibre.

    Attributes
    ----------
    outcome : Outcome or None
        None: its treatment was never begun, or has no end.
    treated_um : float
        Its length as it was treated; nan where it was not.
    """

    sighting: Sighting
    outcome: Outcome | None = None
    treated_um: float = math.nan

    @property
    def length_um(self) -> float:
        """As it was treated; else as the survey saw it."""
        return self.sighting.length_um if math.isnan(self.treated_um) else self.treated_um

    @property
    def graspable(self) -> bool:
        """Whether it could be taken: as it lay, or later when others were gone."""
        return not self.sighting.problem or self.outcome is not None


@dataclass(frozen=True, slots=True)
class CampaignRates:
    """Success and time of a campaign.

    Attributes
    ----------
    seen, graspable : int
        Fibres that the first survey of each plate saw or a later one found, and those of them that
        had room for jaws and the wanted size, or were freed later; 0 of a campaign that did not
        keep it.
    tried, good : int
        Fibres with an end, and the good ones of them.
    elapsed_s : float
        All, on the platform's clock.
    fibres_s, standards_s, plates_s : float
        Of that the treatment of fibres, of standards, and changes of the plate.
    plates : int
        How many were on the table.
    """

    seen: int
    graspable: int
    tried: int
    good: int
    elapsed_s: float
    fibres_s: float
    standards_s: float = 0.0
    plates_s: float = 0.0
    plates: int = 1

    @property
    def preparation_s(self) -> float:
        """What is left: calibration, surveys, rests."""
        rest_s = self.elapsed_s - self.fibres_s - self.standards_s - self.plates_s
        return max(rest_s, 0.0)

    @property
    def an_hour(self) -> float:
        """Good fibres an hour of all the time; nan where there is none."""
        return _an_hour(self.good, self.elapsed_s)

    @property
    def an_hour_without_plates(self) -> float:
        """The same without changes of the plate."""
        return _an_hour(self.good, self.elapsed_s - self.plates_s)

    @property
    def an_hour_of_treatment(self) -> float:
        """The same of the treatment of fibres alone."""
        return _an_hour(self.good, self.fibres_s)

    def part(self, of: int) -> float:
        """Return the good ones of so many, as a part; nan of none."""
        return self.good / of if of else math.nan


def _an_hour(good: int, elapsed_s: float) -> float:
    return good / elapsed_s * SECONDS_AN_HOUR if elapsed_s > 0.0 else math.nan


def rates_of(reader: CampaignReader) -> CampaignRates:
    """Return the rates of a campaign.

    Raises
    ------
    CampaignError
        It cannot be read.
    """
    fibres, changes = reader.fibres(), reader.plate_changes()
    seen = seen_fibres(reader.sightings(), fibres)
    finished = [each for each in fibres if each.outcome in FINISHED]
    return CampaignRates(
        seen=len(seen),
        graspable=sum(each.graspable for each in seen),
        tried=len(finished),
        good=sum(each.outcome is Outcome.GOOD for each in finished),
        elapsed_s=reader.elapsed_s(),
        fibres_s=reader.handling_s(),
        standards_s=reader.handling_s(STANDARD),
        plates_s=_changing_s(changes),
        plates=1 + sum(each.over for each in changes),
    )


def _changing_s(changes: Sequence[PlateChange]) -> float:
    return sum(max(each.put_s - each.asked_s, 0.0) for each in changes if each.over)


def seen_fibres(sightings: Sequence[Sighting], fibres: Sequence[FibreRecord]) -> tuple[Seen, ...]:
    """Return what became of all that was seen; what may be noise is left out.

    Each finished fibre goes with the nearest sighting on its plate that has none yet; one that lies
    elsewhere with a fibre as long as it that failed there before, and moved. The others were first
    seen by a later survey, and count as well.
    """
    shown = [each for each in sightings if each.problem != FAINT]
    plates = {each.plate for each in shown}
    became: dict[int, FibreRecord] = {}
    later: list[Seen] = []
    for fibre in fibres:
        if fibre.outcome not in FINISHED or fibre.found is None or fibre.plate not in plates:
            continue
        number = _sighting_of(fibre, fibre.found, shown, became)
        if number is None:
            later.append(_seen_later(fibre, fibre.found))
        else:
            became[number] = fibre
    return *(_seen(each, became.get(number)) for number, each in enumerate(shown)), *later


def _sighting_of(
    fibre: FibreRecord, found: Pose, shown: Sequence[Sighting], became: Mapping[int, FibreRecord]
) -> int | None:
    """Return the number of the sighting that a treated fibre goes with, if any does."""
    failed = {n: each for n, each in became.items() if each.outcome is not Outcome.GOOD}
    free = [
        n
        for n, each in enumerate(shown)
        if each.plate == fibre.plate and (n in failed or n not in became)
    ]
    at = found.x_plate_um, found.y_plate_um
    near = [(math.dist(at, (shown[n].x_plate_um, shown[n].y_plate_um)), n) for n in free]
    away_um, nearest = min(near, default=(math.inf, 0))
    if away_um <= SAME_UM:
        return nearest
    length_um = fibre.shape.length_um
    unlike = [
        (abs(failed[n].shape.length_um / length_um - 1.0), n)
        for n in free
        if n in failed and length_um > 0.0
    ]
    part, likest = min(unlike, default=(math.inf, 0))
    return likest if part <= SAME_LENGTH else None


def _seen(sighting: Sighting, fibre: FibreRecord | None) -> Seen:
    if fibre is None:
        return Seen(sighting)
    return Seen(sighting, fibre.outcome, fibre.shape.length_um)


def _seen_later(fibre: FibreRecord, found: Pose) -> Seen:
    shape = fibre.shape
    sighting = Sighting(
        fibre.plate,
        found.x_plate_um,
        found.y_plate_um,
        shape.length_um,
        shape.width_um,
        shape.curl,
        SEEN_LATER,
    )
    return Seen(sighting, fibre.outcome, shape.length_um)
