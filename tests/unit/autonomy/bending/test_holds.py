"""What the slides of many fibres show tells how much one of them tells."""

import dataclasses
import math
import statistics

import numpy as np
import pytest

from cosmic.autonomy.bending import fit, population
from cosmic.autonomy.bending.fit import (
    MeasuredFibre,
    assess_campaign,
    half_width_percent,
    measure_fibre,
)
from cosmic.autonomy.bending.holds import UNKNOWN_HOLDS, Holds, holds_of
from cosmic.autonomy.bending.inference import FRICTION, _held
from cosmic.autonomy.bending.result import SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Freed
from unit.autonomy.bending.test_fit_bending import pushed, rig
from unit.autonomy.bending.test_freed import AFTER, LEVEL_UN

NOISE = 0.06
FIBRES = 8
SPANS = measure_fibre(pushed(rig(0)), settings=FitSettings()).spans


def slid(seed: int, held: float) -> MeasuredFibre:
    """Return a fibre of which friction takes a part, by slides that tell it with some noise."""
    random, spans = np.random.default_rng(seed), []
    for span in pushed(rig(seed)):
        force = LEVEL_UN + (span.force_un - LEVEL_UN) / (1.0 - held)
        before = force[AFTER] - LEVEL_UN
        after = np.array([LEVEL_UN + before * (1.0 - held + random.normal(0.0, NOISE))])
        # Up and down are one reading here.
        freed = Freed(AFTER, after, after, math.sqrt(2.0) * NOISE * before, 0.2)
        spans.append(dataclasses.replace(span, force_un=force, freed=freed))
    return measure_fibre(spans, settings=FitSettings())


def widths(holds: list[float], monkeypatch: pytest.MonkeyPatch) -> tuple[float, float]:
    """Return median half widths in per cent: each slide by itself, and as the others show."""
    fibres = [slid(seed, held) for seed, held in enumerate(holds)]
    together = assess_campaign(fibres).fibres
    with monkeypatch.context() as patched:
        patched.setattr(fit, "holds_of", lambda _: UNKNOWN_HOLDS)
        alone = assess_campaign(fibres).fibres
    found = [statistics.median(half_width_percent(each) for each in of) for of in (alone, together)]
    return found[0], found[1]


def test_where_no_fibre_is_held_little_is_believed_of_the_next() -> None:
    fibres = [slid(seed, 0.0) for seed in range(FIBRES)]
    holds = holds_of([each.spans for each in fibres])
    assert abs(holds.mean) < 0.02
    assert holds.std < 0.03
    assert holds.twisted < 0.02


def test_fibres_that_are_held_very_differently_teach_nothing_of_the_next() -> None:
    parts = [0.0, 0.25, 0.02, 0.12, 0.05, 0.2, 0.0, 0.08]
    fibres = [slid(seed, held) for seed, held in enumerate(parts)]
    holds = holds_of([each.spans for each in fibres])
    assert holds.std > 0.06
    found = assess_campaign(fibres).fibres
    free = [assess_campaign([slid(seed, 0.0)]).fibres[0] for seed in range(FIBRES)]
    for one, other in zip(found, free, strict=True):
        assert one.ei_low_n_m2 < other.ei_n_m2 < one.ei_high_n_m2


def test_intervals_are_narrower_by_it_only_where_fibres_are_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    alone, together = widths([0.0] * FIBRES, monkeypatch)
    assert together < 0.97 * alone
    alone, together = widths([0.0, 0.25, 0.02, 0.12, 0.05, 0.2, 0.0, 0.08], monkeypatch)
    assert together == pytest.approx(alone, rel=0.05)


def test_one_fibre_shows_nothing_of_others() -> None:
    assert holds_of([slid(1, 0.1).spans]) == UNKNOWN_HOLDS
    assert holds_of([]) == UNKNOWN_HOLDS
    never = [measure_fibre(pushed(rig(n)), settings=FitSettings()).spans for n in range(3)]
    assert holds_of(never) == UNKNOWN_HOLDS


def test_a_fibre_that_was_not_slid_may_be_held_as_the_others_are() -> None:
    parts = [0.3, 0.05, 0.35, 0.2, 0.0, 0.25, 0.1, 0.4]
    fibres = [slid(seed, held) for seed, held in enumerate(parts)]
    (free,) = assess_campaign([slid(0, 0.0)]).fibres
    shown = assess_campaign(fibres).fibres[0]
    not_slid = [dataclasses.replace(each, freed=None) for each in fibres[0].raw]
    fibres[0] = measure_fibre(not_slid, settings=FitSettings())
    found = assess_campaign(fibres).fibres[0]
    assert found.ei_low_n_m2 < free.ei_n_m2 < found.ei_high_n_m2
    assert half_width_percent(found) > 2.0 * half_width_percent(shown)
    alike = [slid(seed, 0.0) for seed in range(FIBRES)]
    slid_width = half_width_percent(assess_campaign(alike).fibres[0])
    not_slid = [dataclasses.replace(each, freed=None) for each in alike[0].raw]
    alike[0] = measure_fibre(not_slid, settings=FitSettings())
    assert half_width_percent(assess_campaign(alike).fibres[0]) < 1.3 * slid_width


@pytest.mark.parametrize("noise_times", [0.2, 5.0])
def test_holds_are_found_whatever_the_noise_is_taken_to_be(noise_times: float) -> None:
    fibres = [
        [
            dataclasses.replace(each, freed_std_part=each.freed_std_part * noise_times)
            for each in slid(seed, 0.1).spans
        ]
        for seed in range(FIBRES)
    ]
    holds = holds_of(fibres)
    assert holds.mean == pytest.approx(math.log(0.9), abs=0.03)
    assert math.isfinite(holds.std)


def test_of_many_fibres_no_more_is_learned_than_of_so_many(monkeypatch: pytest.MonkeyPatch) -> None:
    readings = [slid(seed, 0.0).readings for seed in range(FIBRES)]

    def known(most: int) -> float:
        monkeypatch.setattr(population, "MOST_TAUGHT", most)
        common = population.assess(
            [each for each in readings if each is not None], FitSettings()
        ).common
        return float(np.sqrt(np.diag(common.covariance))[FRICTION])

    all_count, few_count = known(FIBRES), known(2)
    assert few_count > 1.2 * all_count
    assert few_count < FitSettings().friction_std


def shown(held: float, *, along: float = 0.0, differs: float = 0.0, seed: int = 0) -> list[SpanFit]:
    """Return spans of which slides tell to a per cent how far each is held, and let go along."""
    random = np.random.default_rng(seed)
    return [
        dataclasses.replace(
            each,
            friction=0.3,
            by_friction=rubbed,
            by_friction_both=0.0,
            freed_log=held * (1.0 + random.normal(0.0, differs))
            - along * rubbed
            + random.normal(0.0, 0.01),
            freed_std_part=0.01,
        )
        for each, rubbed in zip(SPANS, (0.1, 0.2, 0.3, 0.4, 0.5), strict=True)
    ]


@pytest.mark.parametrize(("differs", "low", "high"), [(0.03, 0.0, 0.09), (0.4, 0.22, 0.5)])
def test_how_unlike_spans_of_a_fibre_are_held_is_learned_from_all(
    differs: float, low: float, high: float
) -> None:
    helds = [-0.1, -0.3, -0.2, -0.15, -0.25, -0.3, -0.2, -0.1]
    holds = holds_of([shown(h, differs=differs, seed=n) for n, h in enumerate(helds)])
    assert low < holds.twisted_part < high


@pytest.mark.parametrize("part", [0.0, 1.0])
def test_whether_friction_along_lets_go_is_learned_from_slides(part: float) -> None:
    helds = [0.0, -0.3, 0.0, -0.15, -0.05, -0.3, -0.2, -0.1]
    fibres = [shown(h, along=part * 0.3, seed=n) for n, h in enumerate(helds)]
    holds = holds_of(fibres)
    assert holds.along == pytest.approx(part * 0.3, abs=0.08)
    assert holds.along_std < 0.06
    free = holds_of([[dataclasses.replace(fit, friction=0.0) for fit in each] for each in fibres])
    assert free.along == free.along_std == 0.0


def test_what_all_spans_have_in_common_is_not_known_better_by_more_of_them() -> None:
    few, many = (
        _held(shown(-0.2)[:count], Holds(std=1.0, twisted=0.0, twisted_part=0.0))[1]
        for count in (2, 5)
    )
    assert few[0, 1] == pytest.approx(few[0, 0], rel=1e-3)
    assert many[0, 4] == pytest.approx(0.01**2 / 5.0, rel=1e-2)
