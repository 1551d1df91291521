"""What standards say of the scale of the force, in sealed sessions that share nothing with it."""

import dataclasses

import numpy as np
import pytest

from cosmic.autonomy.bending.fit import (
    Certificate,
    MeasuredFibre,
    assess_campaign,
    half_width_percent,
    in_time,
    measure_fibre,
)
from cosmic.autonomy.bending.population import assess
from cosmic.autonomy.bending.result import DRIFT_FORM, BendingResult
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.standards import ForceScale
from oracles.sealed_session import STANDARD_EI, Fibre, Session, World
from unit.autonomy.bending.sealed_fibres import SCALE, spans_of

SETTINGS = FitSettings()
CERTIFICATE = Certificate(STANDARD_EI * SCALE, 0.02)
WORLD = World(
    noise_un=0.03,
    friction=(0.2, 0.2),
    clamp=("log", 12.0, 0.3),
    jaw_un_um=(1500.0, 0.0),
    probe_side_un_um=10.0,
)


def measured(
    session: Session,
    beam: Fibre,
    certificate: Certificate | None = None,
    settings: FitSettings = SETTINGS,
) -> MeasuredFibre:
    return measure_fibre(spans_of(session, beam), settings=settings, certificate=certificate)


def scale_of(*gains: float, certificate: Certificate = CERTIFICATE, seed: int = 5) -> ForceScale:
    """Return what standards measured with these gains, evenly over a campaign, say."""
    session = Session(WORLD, np.random.default_rng(seed))
    beam, standards = Fibre.standard(session), []
    for gain in gains:
        session.gain = gain
        standards.append(measured(session, beam, certificate))
    standards = in_time(standards, [float(n) for n in range(len(gains))])
    return assess_campaign([], standards=standards, settings=SETTINGS).scale


@pytest.mark.parametrize("gain", [0.93, 1.0, 1.07])
def test_a_wrong_gain_is_found_with_its_uncertainty(gain: float) -> None:
    scale = scale_of(gain, gain, gain)
    assert scale.verified
    assert scale.off_part == pytest.approx(gain - 1.0, abs=2.2 * scale.off_std_part)
    assert 0.008 < scale.off_std_part < 0.025
    assert [each.refused for each in scale.standards] == ["", "", ""]


def test_a_thick_standard_shears_as_glass_does() -> None:
    session = Session(WORLD, np.random.default_rng(5))
    thick_um, glass = 80.0, 1.7
    beam = dataclasses.replace(Fibre.standard(session), thickness_um=thick_um, shear=glass)
    settings = FitSettings(fibre_width_um=thick_um)
    standards = [measured(session, beam, CERTIFICATE, settings) for _ in range(3)]
    scale = assess_campaign([], standards=standards, settings=settings).scale
    assert scale.verified
    assert scale.off_part == pytest.approx(session.gain - 1.0, abs=0.008)
    assert scale.off_std_part < 0.012, "what wood does is not taken for glass"


def test_a_gain_far_from_the_sensors_certificate_is_believed_and_said_aloud() -> None:
    scale = scale_of(1.12, 1.12, 1.12)
    assert scale.verified
    assert scale.off_part == pytest.approx(0.12, abs=0.03)
    assert "contradicts the sensor's certificate" in "".join(scale.reasons)


def test_no_number_of_measurements_makes_a_beam_better_known_than_its_certificate() -> None:
    certificate = Certificate(STANDARD_EI * SCALE, 0.04)
    often = scale_of(*[1.0] * 12, certificate=certificate)
    known = (0.02**-2 + SETTINGS.gain_std_part**-2) ** -0.5
    assert known < often.off_std_part < 1.15 * known


def test_what_all_but_one_standard_say_is_what_they_say_without_it() -> None:
    session = Session(WORLD, np.random.default_rng(5))
    beam, read = Fibre.standard(session), []
    for session.gain in (1.0, 1.0, 1.03):
        one = measured(session, beam, Certificate(STANDARD_EI * SCALE, 0.04)).readings
        assert one is not None
        read.append(one)
    without = assess(read[:2], SETTINGS).common
    by_others = assess(read, SETTINGS).fibres[2].common
    assert by_others.mean[0] == pytest.approx(without.mean[0], abs=2e-4)
    assert by_others.covariance[0, 0] == pytest.approx(without.covariance[0, 0], rel=0.01)


def test_a_poor_standard_does_not_outweigh_the_certificate_of_the_sensor() -> None:
    poor = Certificate(STANDARD_EI * SCALE / 1.07, 0.12)
    scale = scale_of(1.0, certificate=poor)
    assert scale.verified
    assert abs(scale.off_part) < 0.02, "of 7 % that it says, which may as well be its own error"


def test_a_standard_that_no_clamp_explains_says_less_of_the_scale() -> None:
    session = Session(WORLD, np.random.default_rng(5))
    beam = Fibre.standard(session)
    spans = spans_of(session, beam)
    # Jaws that turn, say: the shortest span and the longest are soft, those between are not.
    uneven = [
        dataclasses.replace(each, force_un=each.force_un * (1.0 + off))
        for each, off in zip(spans, (-0.04, 0.01, 0.02, 0.01, -0.04), strict=True)
    ]
    fits, misfits = (
        measure_fibre(each, settings=SETTINGS, certificate=CERTIFICATE) for each in (spans, uneven)
    )
    sure = assess_campaign([], standards=[fits], settings=SETTINGS).scale.standards[0]
    unsure = assess_campaign([], standards=[misfits], settings=SETTINGS).scale.standards[0]
    assert not unsure.refused, "it is a measurement, if a poor one"
    assert unsure.off_std_part > 1.5 * sure.off_std_part


def test_a_drift_larger_than_foreseen_is_followed() -> None:
    scale = scale_of(1.0, 1.05, 1.10)
    assert scale.verified
    assert scale.drift_part == pytest.approx(0.10, abs=0.03)
    assert "drifts by" in "".join(scale.reasons)


def test_standards_that_contradict_each_other_verify_nothing() -> None:
    scale = scale_of(1.0, 1.25, 1.0)
    assert not scale.verified
    assert "contradict each other" in "".join(scale.reasons)


def fibre_between(*gains: float, at: float) -> tuple[ForceScale, float, BendingResult]:
    """Return what standards over a campaign say, and a fibre with its gain, at a part of it."""
    session = Session(WORLD, np.random.default_rng(5))
    beam, standards = Fibre.standard(session), []
    for number, session.gain in enumerate(gains):
        part = number / (len(gains) - 1)
        standards.append(measured(session, beam, CERTIFICATE).at(part))
    session.gain = gains[0]
    fibre = dataclasses.replace(Fibre.drawn(session), ei=5e7)
    found = assess_campaign(
        [measured(session, fibre).at(at)], standards=standards, settings=SETTINGS
    )
    return found.scale, fibre.true_ei(600.0) * SCALE, found.fibres[0]


def test_what_jumped_between_two_standards_may_be_anywhere_between_both() -> None:
    scale, true, fibre = fibre_between(1.0, 1.2, at=0.6)
    assert "little by little or at once" in "".join(scale.reasons)
    assert fibre.ei_low_n_m2 < true < fibre.ei_high_n_m2, "it had not jumped yet"
    assert any(line.source == DRIFT_FORM and line.common for line in fibre.budget)


def test_where_standards_contradict_each_other_the_scale_is_known_no_better_than_that() -> None:
    scale, _, fibre = fibre_between(1.0, 1.25, 1.0, at=0.5)
    assert scale.off_std_part > 0.1
    assert half_width_percent(fibre) > 20.0
    _, _, fibre = fibre_between(1.0, 1.0, 1.0, at=0.5)
    assert half_width_percent(fibre) < 10.0


def test_each_standard_is_reported_in_per_cent_and_not_in_logarithms() -> None:
    (one,) = scale_of(1.2).standards
    assert one.off_percent == pytest.approx(20.0, abs=3.5)
    assert one.off_percent == pytest.approx(100.0 * np.expm1(one.off_part))


def test_a_beam_of_another_stiffness_is_refused_as_a_standard() -> None:
    scale = scale_of(1.0, certificate=Certificate(2.0 * STANDARD_EI * SCALE, 0.02))
    assert not scale.verified
    assert "another beam" in "".join(scale.reasons)
    assert scale.off_std_part == pytest.approx(0.025, rel=0.1)


def test_a_drifting_gain_is_put_right_in_every_fibre() -> None:
    session = Session(WORLD, np.random.default_rng(11))
    beam = Fibre.standard(session)
    fibre = dataclasses.replace(Fibre.drawn(session), ei=5e7)
    kept, times = [], []
    for time_s, one, certificate in (
        (0.0, beam, CERTIFICATE),
        (100.0, fibre, None),
        (500.0, beam, CERTIFICATE),
        (900.0, fibre, None),
        (1000.0, beam, CERTIFICATE),
    ):
        session.gain = 1.0 + 0.08 * time_s / 1000.0
        kept.append(measured(session, one, certificate))
        times.append(time_s)
    kept = in_time(kept, times)
    found = assess_campaign(
        [kept[1], kept[3]], standards=[kept[0], kept[2], kept[4]], settings=SETTINGS
    )
    alone = assess_campaign([kept[1], kept[3]], settings=SETTINGS)
    true = fibre.true_ei(600.0) * SCALE
    for each, without in zip(found.fibres, alone.fibres, strict=True):
        assert each.scale_verified
        assert each.ei_low_n_m2 < true < each.ei_high_n_m2
        assert half_width_percent(each) < half_width_percent(without)
    drifted = alone.fibres[1].ei_n_m2 / alone.fibres[0].ei_n_m2
    right = found.fibres[1].ei_n_m2 / found.fibres[0].ei_n_m2
    assert abs(right - 1.0) < 0.5 * abs(drifted - 1.0)
