"""Friction that holds a section askew is told by sliding the fibre, and by nothing else."""

import dataclasses
import math

import numpy as np
import pytest

from cosmic.autonomy.bending.crept import Loads
from cosmic.autonomy.bending.fit import (
    assess_campaign,
    fit_bending,
    half_width_percent,
    measure_fibre,
)
from cosmic.autonomy.bending.freed import STANDS_PART, freed_of
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Freed, Span
from unit.autonomy.bending.test_fit_bending import pushed, rig

LEVEL_UN = 0.4
HELD = 1.25
AFTER = 12


def held(span: Span, **freed: float) -> Span:
    """Return a span of a fibre that friction makes stiffer both ways, slid after one reading."""
    force = LEVEL_UN + HELD * (span.force_un - LEVEL_UN)
    before = force[AFTER] - LEVEL_UN
    up, down = (LEVEL_UN + freed.get(name, 1.0) * before for name in ("up", "down"))
    slid = Freed(AFTER, np.array([up]), np.array([down]), 0.03, 0.2)
    return dataclasses.replace(span, force_un=force, freed=slid if freed else None)


def test_a_fibre_that_friction_holds_both_ways_is_put_right_by_what_sliding_shows() -> None:
    plain = fit_bending(pushed(rig()))
    # Friction takes 0.2 of the compliance; slid, it takes 0.1 one way, and adds it the other.
    slid = fit_bending([held(each, up=0.8 / 0.9, down=0.8 / 1.1) for each in pushed(rig())])
    unknown = fit_bending([held(each) for each in pushed(rig())])
    assert unknown.ei_n_m2 == pytest.approx(HELD * plain.ei_n_m2, rel=0.03)
    assert slid.trusted, slid.reasons
    assert slid.ei_n_m2 == pytest.approx(plain.ei_n_m2, rel=0.03)
    assert slid.ei_low_n_m2 < plain.ei_n_m2 < slid.ei_high_n_m2
    assert any(line.source == "friction along, once it let go" for line in slid.budget)


def test_spans_that_were_not_slid_are_taken_to_be_held_like_the_others_and_less_is_known() -> None:
    spans = pushed(rig())
    all_slid = fit_bending([held(each, up=0.8, down=0.8) for each in spans])
    first, *others = spans
    one_slid = fit_bending([held(first, up=0.8, down=0.8), *(held(each) for each in others)])
    assert one_slid.ei_n_m2 == pytest.approx(all_slid.ei_n_m2, rel=0.04)
    assert half_width_percent(one_slid) > half_width_percent(all_slid)


def askew_stds(spans: list[Span]) -> np.ndarray:
    """Return how well both ways of each span are known beside what friction holds, of ln(k)."""
    readings = measure_fibre(spans, settings=FitSettings()).readings
    assert readings is not None
    return np.asarray(np.sqrt(np.diag(readings.askew)).reshape(-1, 2))


def test_where_slides_differ_less_is_known_of_the_spans_between() -> None:
    spans = sorted(pushed(rig()), key=lambda each: -each.nominal_um)

    def between(*parts: float) -> float:
        slid = [
            held(each, up=part, down=part) for each, part in zip(spans[::2], parts, strict=True)
        ]
        return float(askew_stds([slid[0], held(spans[1]), *slid[1:]])[1, 0])

    alike, unlike = between(0.8, 0.8, 0.8), between(0.7, 0.8, 0.9)
    apart = float(np.std(np.log([0.7, 0.8, 0.9]), ddof=1))
    assert alike < 0.08
    assert 0.9 * apart < unlike < 1.5 * apart


def test_the_way_back_counts_by_how_well_slides_show_that_nothing_is_held() -> None:
    def back(noise_un: float) -> np.ndarray:
        spans = []
        for span in pushed(rig()):
            as_before = span.force_un[[AFTER]]
            freed = Freed(AFTER, as_before, as_before, noise_un, 0.2)
            spans.append(dataclasses.replace(span, freed=freed))
        return askew_stds(spans)[:, 1]

    assert (back(0.02) < 0.05).all()
    assert (back(2.0) > 1.5 * back(0.02)).all()


def test_a_slide_where_little_was_pushed_is_known_less_well() -> None:
    span = held(pushed(rig())[0], up=0.9, down=0.9)
    level = np.full(len(span.probe_um), LEVEL_UN)
    before_un = float(span.force_un[AFTER]) - LEVEL_UN
    exact = freed_of(span, level, 0.0)
    known = freed_of(span, level, 0.0, stage_std_un=0.15 * before_un)
    assert known[0] == exact[0] == pytest.approx(math.log(0.9))
    assert known[1] == pytest.approx(math.hypot(exact[1], STANDS_PART * 0.15))


def test_what_a_slide_shows_is_known_as_well_as_the_stage_stands_still() -> None:
    span = held(min(pushed(rig()), key=lambda each: each.nominal_um), up=0.9, down=0.9)
    (found,) = fit_bending([span], settings=FitSettings(way_std_um=0.1)).spans
    force_un = float(span.force_un[AFTER]) - LEVEL_UN
    stands_part = STANDS_PART * found.k_loading_un_um * 0.1 / force_un
    assert found.freed_std_part == pytest.approx(stands_part, rel=0.2)
    (exact,) = fit_bending([span], settings=FitSettings(way_std_um=0.001)).spans
    assert exact.freed_std_part < 0.5 * found.freed_std_part


@pytest.mark.parametrize(
    ("freed", "why"),
    [
        (None, "not tried"),
        (Freed(AFTER, np.array([0.45]), np.array([20.0]), 0.03, 0.2), "it left the probe"),
        (Freed(99, np.array([20.0]), np.array([20.0]), 0.03, 0.2), "no such point"),
        (Freed(0, np.array([20.0]), np.array([20.0]), 0.03, 0.2), "nothing pressed before"),
    ],
)
def test_what_a_slide_did_not_show_is_not_known(freed: Freed | None, why: str) -> None:
    span = dataclasses.replace(pushed(rig())[0], freed=freed)
    found = freed_of(span, np.full(len(span.probe_um), LEVEL_UN), 0.02)
    assert all(math.isnan(each) for each in found), why


def test_what_relaxed_meanwhile_is_not_taken_for_friction() -> None:
    span = pushed(rig())[0]
    before = span.force_un[AFTER] - LEVEL_UN
    fell = 1.0 - 0.05 * math.log10(1.0 + 0.9 / 0.1)
    after = np.array([LEVEL_UN + fell * before])
    slid = dataclasses.replace(span, freed=Freed(AFTER, after, after, 0.001, 0.9))
    log, std = freed_of(slid, np.full(len(span.probe_um), LEVEL_UN), 0.05)
    assert log == pytest.approx(0.0, abs=0.003)
    assert std > 0.02, "how fast it relaxed just then is not well known"


def test_the_friction_is_small_where_both_branches_agree_and_no_slide_lets_go() -> None:
    settings = FitSettings()
    fibres = []
    for seed in range(6):
        spans = []
        for span in pushed(rig(seed)):
            as_before = span.force_un[[AFTER]]
            freed = Freed(AFTER, as_before, as_before, 0.03, 0.2)
            spans.append(dataclasses.replace(span, freed=freed))
        fibres.append(measure_fibre(spans, settings=settings))
    found = assess_campaign(fibres, standards=[], settings=settings)
    assert found.friction < 0.9 * settings.friction


def test_a_fibre_that_comes_back_from_an_earlier_push_is_not_taken_to_be_held() -> None:
    span = pushed(rig())[0]
    before_un = span.force_un[AFTER] - LEVEL_UN
    read_s = span.time_s[AFTER]
    earlier = Loads.of_push(read_s - np.array([3.0, 2.0, 1.0]), np.array([0.0, 60.0, 60.0]))
    lost_un = earlier.lost_un(read_s + np.array([0.0, 0.9]))
    # It stands nearer to the probe by as much as it has come back: the force has risen by that.
    rose_un = 0.05 * float(lost_un[0] - lost_un[1])
    fell_un = 0.05 * before_un
    after = np.array([span.force_un[AFTER] + rose_un - fell_un])
    slid = dataclasses.replace(span, freed=Freed(AFTER, after, after, 0.001, 0.9))
    baseline_un = np.full(len(span.probe_um), LEVEL_UN)
    log, std = freed_of(slid, baseline_un, 0.05, earlier)
    alone, sure = freed_of(slid, baseline_un, 0.05)
    assert rose_un > 0.02 * before_un
    assert log == pytest.approx(0.0, abs=0.01)
    assert alone > log + 0.02
    assert std > sure, "what is put right twice is known less"
