"""Fibres of a campaign fitted together, in sealed sessions that share nothing with the fit."""

import dataclasses
import math

import numpy as np
import pytest

from cosmic.autonomy.bending.budget import EXCESS_SCATTER, combined_std_ln
from cosmic.autonomy.bending.fit import (
    Certificate,
    MeasuredFibre,
    fit_bending,
    fit_campaign,
    half_width_percent,
    measure_fibre,
)
from cosmic.autonomy.bending.result import BendingResult, Kind, Quality
from cosmic.autonomy.bending.settings import FitSettings
from oracles.pushed_rod import pushed
from oracles.sealed_session import STANDARD_EI, Fibre, Session, World, curves
from unit.autonomy.bending.sealed_fibres import SCALE, spans_of
from unit.autonomy.bending.test_fit_bending import pushed as pushed_on_rig
from unit.autonomy.bending.test_fit_bending import rig

WORLD = World(
    noise_un=0.03,
    friction=(0.25, 0.25),
    clamp=("log", 20.0, 0.3),
    jaw_un_um=(1500.0, 0.0),
    probe_side_un_um=10.0,
    relaxation=(0.01, 0.0),
)
SETTINGS = FitSettings()
CERTIFICATE = Certificate(STANDARD_EI * SCALE, 0.02)


def measured(
    session: Session, fibre: Fibre, settings: FitSettings, certificate: Certificate | None = None
) -> MeasuredFibre:
    return measure_fibre(spans_of(session, fibre), settings=settings, certificate=certificate)


def test_the_generator_bends_as_a_chain_of_least_energy() -> None:
    session = Session(World(), np.random.default_rng(1))
    fibre = dataclasses.replace(Fibre.standard(session), turn_deg=30.0, depth_um=20.0)
    travel, across, *_ = curves(dataclasses.replace(fibre, friction=0.0), np.array([400.0]))
    chain = pushed(
        fibre.line(),
        ei_un_um2=fibre.ei,
        probe_x_um=400.0,
        radius_um=25.0,
        travel_um=25.0,
        depth_um=20.0,
        links=100,
    )
    assert np.interp(25.0, travel[0, 0], across[0, 0]) == pytest.approx(chain, rel=6e-3)


def test_a_standard_gives_the_scale_that_the_certificate_of_the_sensor_does_not() -> None:
    settings, world = FitSettings(), dataclasses.replace(WORLD, gain=0.0)
    session = Session(world, np.random.default_rng(5))
    session.gain = 1.06
    fibres = [Fibre.drawn(session) for _ in range(3)]
    kept = [measured(session, each, settings) for each in fibres]
    standard = measured(session, Fibre.standard(session), settings, CERTIFICATE)
    without = fit_campaign(kept, settings=settings)
    with_it = fit_campaign(kept, standards=[standard], settings=settings)
    for fibre, alone, verified in zip(fibres, without, with_it, strict=True):
        true = fibre.true_ei(600.0) * SCALE
        assert not alone.scale_verified
        assert verified.scale_verified
        assert verified.ei_n_m2 / alone.ei_n_m2 == pytest.approx(1.0 / 1.06, abs=0.03)
        assert verified.ei_low_n_m2 < true < verified.ei_high_n_m2
        assert half_width_percent(verified) < half_width_percent(alone)


def test_what_the_fit_knows_beside_the_stiffness_is_taken_off_each_span() -> None:
    session = Session(dataclasses.replace(WORLD, gain=0.0), np.random.default_rng(5))
    session.gain = 1.06
    fibres = [Fibre.drawn(session) for _ in range(3)]
    kept = [measured(session, each, SETTINGS) for each in fibres]
    standard = measured(session, Fibre.standard(session), SETTINGS, CERTIFICATE)
    for found in fit_campaign(kept, standards=[standard], settings=SETTINGS):
        ei_un_um2, begin = found.ei_n_m2 / SCALE, found.clamp_offset_um
        used = [found.spans[n] for n in found.used]
        left = [each.off_model_log for each in used]
        read = [
            math.log(each.k_un_um * (each.place_um + begin) ** 3 / (3.0 * ei_un_um2))
            for each in used
        ]
        assert max(map(abs, left)) < 0.04
        assert np.mean(read) > np.mean(left) + 0.03  # they are read 6 % too stiff


def test_what_is_common_does_not_hang_on_rounding() -> None:
    """A compliance in um/uN, here known well, stands beside places in um."""
    exact = SETTINGS.model_copy(update={"jaw_std_part": 1e-6, "sensor_std_part": 1e-6})
    session, chance = Session(WORLD, np.random.default_rng(11)), np.random.default_rng(1)
    kept = [measured(session, Fibre.drawn(session), SETTINGS) for _ in range(6)]
    standard = measured(session, Fibre.standard(session), SETTINGS, CERTIFICATE)

    def rounded(fibre: MeasuredFibre) -> MeasuredFibre:
        assert fibre.readings is not None
        off = 1e-13 * chance.standard_normal(len(fibre.readings.log_k))
        readings = dataclasses.replace(fibre.readings, log_k=fibre.readings.log_k + off)
        return dataclasses.replace(fibre, readings=readings)

    found = [
        [each.ei_n_m2 for each in fit_campaign(fibres, standards=[standard], settings=exact)]
        for fibres in (kept, *([*map(rounded, kept)] for _ in range(6)))
    ]
    for each in found[1:]:
        assert each == pytest.approx(found[0], rel=1e-10, abs=0.0)


def test_a_span_off_the_model_is_named_by_how_much() -> None:
    spans = sorted(pushed_on_rig(rig(contact_std_um=0.1)), key=lambda each: each.nominal_um)
    odd = dataclasses.replace(spans[2], force_un=1.12 * spans[2].force_un)
    plain, found = fit_bending(spans), fit_bending([*spans[:2], odd, *spans[3:]])
    assert found.spans[2].off_model_log > plain.spans[2].off_model_log + 0.05
    short = fit_bending(spans[:1])
    assert math.isfinite(short.spans[0].off_model_log)


def test_what_others_say_of_clamp_and_friction_makes_an_interval_narrower() -> None:
    settings, session = FitSettings(), Session(WORLD, np.random.default_rng(8))
    fibres = [Fibre.drawn(session) for _ in range(7)]
    kept = [measured(session, each, settings) for each in fibres]
    together = fit_campaign(kept, settings=settings)
    alone = [fit_campaign([each], settings=settings)[0] for each in kept]
    narrower = [
        half_width_percent(one) / half_width_percent(other)
        for one, other in zip(together, alone, strict=True)
    ]
    assert np.median(narrower) < 0.95
    for fibre, found in zip(fibres, together, strict=True):
        assert found.ei_low_n_m2 < fibre.true_ei(600.0) * SCALE < found.ei_high_n_m2


def test_how_differently_fibres_shear_makes_the_interval_of_a_wide_one_wider() -> None:
    session = Session(WORLD, np.random.default_rng(5))
    fibre = dataclasses.replace(Fibre.drawn(session), thickness_um=40.0)
    spans, widths = spans_of(session, fibre), []
    for part in (0.0, 0.4, 0.8):
        settings = FitSettings(fibre_width_um=40.0, shear_own_part=part)
        (found,) = fit_campaign([measure_fibre(spans, settings=settings)], settings=settings)
        (line,) = (each for each in found.budget if each.source == "shear of this fibre alone")
        assert line.std == pytest.approx(part * settings.shear_part)
        widths.append(half_width_percent(found))
    assert widths == sorted(set(widths))


def test_the_budget_is_whole_and_says_which_way_each_line_is_known() -> None:
    session = Session(WORLD, np.random.default_rng(2))
    found = fit_bending(spans_of(session, Fibre.drawn(session)))
    assert sum(line.share for line in found.budget) == pytest.approx(1.0)
    shares = [line.share for line in found.budget]
    assert shares == sorted(shares, reverse=True)
    kinds = {line.source: line.kind for line in found.budget}
    assert kinds["readings"] is Kind.A
    assert kinds["scale of the force"] is Kind.B
    scale = next(line for line in found.budget if line.source == "scale of the force")
    assert scale.sensitivity == pytest.approx(1.0, abs=1e-6)
    half = math.log(found.ei_high_n_m2 / found.ei_low_n_m2) / 2.0 / 1.96
    assert scale.std * math.sqrt(1.0 / scale.share) == pytest.approx(half, rel=0.25)


def std_ln(found: BendingResult) -> float:
    return math.log(found.ei_high_n_m2 / found.ei_low_n_m2) / (2.0 * 1.96)


def test_what_is_learned_together_counts_in_the_budget_as_it_does_in_the_interval() -> None:
    session = Session(WORLD, np.random.default_rng(5))
    standards = [measured(session, Fibre.standard(session), SETTINGS, CERTIFICATE).at(0.5)]
    fibres = [measured(session, Fibre.drawn(session), SETTINGS).at(n / 2.0) for n in range(3)]
    for found in fit_campaign(fibres, standards=standards, settings=SETTINGS):
        whole = combined_std_ln(found.budget)
        assert whole == pytest.approx(std_ln(found), rel=0.04)
        shared = sum(line.share for line in found.budget if line.common)
        assert combined_std_ln(found.budget, common=True) == pytest.approx(
            whole * math.sqrt(shared)
        )


def test_the_budget_has_what_readings_that_do_not_lie_together_make_of_the_interval() -> None:
    session = Session(WORLD, np.random.default_rng(2))
    fibre = dataclasses.replace(Fibre.drawn(session), moves_in=1)
    session.world = dataclasses.replace(WORLD, moved_um=60.0)
    found = fit_bending(spans_of(session, fibre))
    line = next(each for each in found.budget if each.source == EXCESS_SCATTER)
    assert line.share > 0.3
    assert combined_std_ln(found.budget) == pytest.approx(std_ln(found), rel=0.1)


@pytest.mark.parametrize("turn_deg", [-75.0, -60.0])
def test_how_friction_softens_a_curled_fibre_on_both_ways_is_in_its_interval(
    turn_deg: float,
) -> None:
    session = Session(dataclasses.replace(WORLD, friction=(0.5, 0.5)), np.random.default_rng(2))
    fibre = dataclasses.replace(Fibre.drawn(session), turn_deg=turn_deg)
    found = fit_bending(spans_of(session, fibre))
    assert found.ei_low_n_m2 < fibre.true_ei(600.0) * SCALE < found.ei_high_n_m2


def test_where_the_probe_touches_puts_right_what_the_image_has_wrong() -> None:
    world = dataclasses.replace(WORLD, arc_deg=(40.0, 0.0))
    session = Session(world, np.random.default_rng(3))
    fibre = Fibre.drawn(session)
    true = fibre.true_ei(600.0) * SCALE
    for shown_deg in (-2.0, 2.0):
        found = fit_bending(spans_of(session, fibre, shown_deg=shown_deg))
        assert found.trusted, found.reasons
        assert found.ei_low_n_m2 < true < found.ei_high_n_m2
        line = next(each for each in found.budget if each.source == "direction of the fibre")
        assert line.std < math.radians(0.5)


CAUSES = {
    Quality.SLIPPED: {"slip": 1.0, "slip_um": (8.0, 9.0)},
    Quality.RELAXED: {"relaxation": (0.12, 0.0)},
    Quality.SET: {"yield_strain": (0.001, 0.0), "set_part": 0.5},
    Quality.HINGE: {"weak": 1.0},
    Quality.NON_UNIFORM: {"ei_cv": 0.5},
    Quality.FRICTION: {"friction": (0.7, 0.7)},
    Quality.CLAMP_DEEP: {"clamp": ("log", 110.0, 0.0)},
    Quality.MOVED: {"moved": 1.0},
    Quality.SATURATED: {"range_un": 25.0},
    Quality.NOT_A_FIBRE: {"not_fibre": 1.0},
}


@pytest.mark.parametrize("cause", CAUSES)
def test_a_cause_is_named_where_it_acts(cause: Quality) -> None:
    world = dataclasses.replace(WORLD, **CAUSES[cause])
    settings = FitSettings(range_un=world.range_un)
    session, named = Session(world, np.random.default_rng(21)), 0
    kept = [measured(session, Fibre.drawn(session), settings) for _ in range(4)]
    for found in fit_campaign(kept, settings=settings):
        named += cause in found.flags | found.notes
    assert named >= 3


@pytest.mark.parametrize(
    ("change", "weak_ones"), [({"weak": 1.0}, range(10, 13)), ({"ei_cv": 0.5}, range(3))]
)
def test_a_weak_place_is_distinguished_from_a_fibre_that_is_uneven_all_along(
    change: dict[str, float], weak_ones: range
) -> None:
    session = Session(dataclasses.replace(WORLD, **change), np.random.default_rng(33))
    kept = [measured(session, Fibre.drawn(session), FitSettings()) for _ in range(12)]
    seen = [each.flags | each.notes for each in fit_campaign(kept)]
    assert sum(Quality.HINGE in each for each in seen) in weak_ones
    assert sum(bool(each & {Quality.HINGE, Quality.NON_UNIFORM}) for each in seen) >= 9


def test_a_quiet_fibre_has_nothing_to_name() -> None:
    session = Session(WORLD, np.random.default_rng(4))
    kept = [measured(session, Fibre.drawn(session), FitSettings()) for _ in range(4)]
    for found in fit_campaign(kept):
        assert found.trusted, found.reasons
        assert not found.notes


def test_a_fibre_whose_grip_gave_way_is_not_clamped_as_deep_as_the_others() -> None:
    settings = FitSettings()
    others = [
        measure_fibre(pushed_on_rig(rig(seed, clamp_um=10.0)), settings=settings)
        for seed in range(12)
    ]
    loose = rig(99, clamp_um=75.0)
    plain = pushed_on_rig(loose)
    loose.slipped_um = 12.0
    slipped = measure_fibre([loose.push(600.0, 30.0), *plain[1:4]], settings=settings)
    assert Quality.SLIPPED in slipped.spans[0].flags
    found = fit_campaign([*others, slipped], settings=settings)[-1]
    assert found.ei_low_n_m2 < loose.ei_n_m2 < found.ei_high_n_m2
    assert abs(found.ei_n_m2 / loose.ei_n_m2 - 1.0) < 0.15
