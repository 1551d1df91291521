"""The bent shape in the image agrees with the force, or says so."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from cosmic.autonomy.bending.bent_shape import (
    BentShape,
    ShapeFit,
    fitted_shape,
    turned_in_jaws,
)
from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.fit import fit_bending, fit_campaign, measure_fibre
from cosmic.autonomy.bending.plan import plan_spans
from cosmic.autonomy.bending.result import Quality
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from oracles.bent_fibre import Rig

Floats = npt.NDArray[np.float64]
SPAN_UM, PUSHED_UM, NOISE_UM = 600.0, 60.0, 0.8
PLACES_UM = np.arange(70.0, 530.0, 15.0)


def uniform(ahead_um: Floats, depth_um: float = 25.0) -> Floats:
    """How a straight beam bends, from a textbook: fixed end, load at the other."""
    x, whole = ahead_um + depth_um, SPAN_UM + depth_um
    return PUSHED_UM * x**2 * (3.0 * whole - x) / (2.0 * whole**3)


def seen(
    shape_um: Callable[[Floats], Floats], *, seed: int = 1, shift_um: float = 0.0, times: float = 1
) -> BentShape:
    noise = np.random.default_rng(seed).normal(0.0, NOISE_UM, len(PLACES_UM))
    aside = times * shape_um(PLACES_UM) + shift_um + noise
    return BentShape(PLACES_UM, aside, NOISE_UM, probe_um=100.0, force_un=30.0)


def fit(bent: BentShape, shape: NaturalShape | None = None, **change: float) -> ShapeFit | None:
    natural = shape or NaturalShape(np.linspace(0.0, 900.0, 181), np.zeros(181), SPAN_UM)
    known = {
        "pushed_um": PUSHED_UM,
        "pushed_std_um": 1.0,
        "depth_um": 25.0,
        "depth_std_um": 8.0,
        "variation": 0.15,
        "length_um": 150.0,
    }
    return fitted_shape(bent, natural, **(known | change))


def test_a_beam_as_the_textbook_bends_it_agrees_and_is_bent_as_far_as_it_was_pushed() -> None:
    for seed in range(20):
        found = fit(seen(uniform, seed=seed))
        assert found is not None
        assert not found.problem
        assert found.bent_um == pytest.approx(PUSHED_UM, abs=4.0 * found.bent_std_um)
        assert found.bent_std_um < 3.0


def test_an_image_that_is_shifted_a_little_or_a_deeper_clamp_speaks_against_nothing() -> None:
    assert not require(fit(seen(uniform, shift_um=3.0))).problem
    assert not require(fit(seen(lambda x: uniform(x, depth_um=60.0)))).problem


def require(found: ShapeFit | None) -> ShapeFit:
    assert found is not None
    return found


def test_a_fibre_whose_stiffness_varies_by_a_sixth_agrees() -> None:
    rng = np.random.default_rng(3)
    cells = np.linspace(-25.0, SPAN_UM, 400)
    alike = np.exp(-np.abs(cells[:, None] - cells[None, :]) / 150.0)
    root = np.linalg.cholesky(alike + 1e-9 * np.eye(len(cells)))
    for _ in range(10):
        soft = np.exp(-0.15 * root @ rng.normal(size=len(cells)))

        def bends(x_um: Floats, soft: Floats = soft) -> Floats:
            curvature = (SPAN_UM - cells) * soft
            moved = [curvature @ np.clip(x - cells, 0.0, None) for x in (*x_um, SPAN_UM)]
            return PUSHED_UM * np.array(moved[:-1]) / moved[-1]

        assert not require(fit(seen(bends))).problem


def test_what_turns_in_the_jaws_instead_of_bending_does_not_agree() -> None:
    turned = require(fit(seen(lambda x: PUSHED_UM * x / SPAN_UM)))
    assert "otherwise than one beam" in turned.problem


def test_what_one_fibre_may_do_by_a_soft_place_all_of_them_do_in_jaws_that_turn() -> None:
    def turning(x_um: Floats) -> Floats:
        return 0.75 * uniform(x_um) + 0.25 * PUSHED_UM * x_um / SPAN_UM

    several = [require(fit(seen(turning, seed=seed))) for seed in range(16)]
    assert not any(each.problem for each in several)
    assert "16 fibres show them turn in the jaws" in turned_in_jaws(several)
    assert turned_in_jaws(several[:3]) == ""
    assert turned_in_jaws([require(fit(seen(uniform, seed=seed))) for seed in range(40)]) == ""


def test_a_weak_place_does_not_agree() -> None:
    def hinged(x_um: Floats) -> Floats:
        kink = np.clip(x_um - 300.0, 0.0, None) / (SPAN_UM - 300.0)
        return 0.3 * uniform(x_um) + 0.7 * PUSHED_UM * kink

    assert "otherwise than one beam" in require(fit(seen(hinged))).problem


@pytest.mark.parametrize("times", [0.8, 1.25])
def test_a_fibre_bent_by_less_or_more_than_the_probe_pushed_does_not_agree(times: float) -> None:
    found = require(fit(seen(uniform, times=times)))
    assert f"bent by {found.bent_um:.1f} um" in found.problem
    assert "60.0 um" in found.problem


def test_a_curled_fibre_bends_by_the_arms_it_has() -> None:
    radius = 900.0
    along = np.linspace(0.0, 800.0, 400)
    ahead, aside = radius * np.sin(along / radius), radius * (1.0 - np.cos(along / radius))
    shape = NaturalShape(ahead, aside, SPAN_UM)
    contact = radius * math.asin(SPAN_UM / radius)
    ends = np.array([SPAN_UM, radius * (1.0 - math.cos(contact / radius))])
    slope = math.tan(contact / radius)
    cells = np.linspace(0.0, contact, 4000)
    x, y = radius * np.sin(cells / radius), radius * (1.0 - np.cos(cells / radius))
    curvature = (ends[0] - x) + (ends[1] - y) * slope

    def bends(places_um: Floats) -> Floats:
        moved = []
        for place in (*places_um, SPAN_UM):
            at = radius * math.asin(place / radius)
            tangent = math.tan(at / radius)
            height = radius * (1.0 - math.cos(at / radius))
            arm = (place - x) + (height - y) * tangent
            moved.append(curvature[cells < at] @ arm[cells < at])
        return PUSHED_UM * np.array(moved[:-1]) / moved[-1]

    found = require(fit(seen(bends), shape, depth_um=1.5, depth_std_um=0.5))
    assert not found.problem
    assert found.bent_um == pytest.approx(PUSHED_UM, rel=0.05)


def test_what_is_hardly_bent_or_seen_at_few_places_or_near_the_jaws_alone_shows_nothing() -> None:
    assert fit(seen(uniform), pushed_um=5.0) is None
    few = seen(uniform)
    few = BentShape(few.ahead_um[:5], few.aside_um[:5], NOISE_UM, 100.0, 30.0)
    assert fit(few) is None
    near = seen(uniform)
    here = near.ahead_um < 250.0
    near = BentShape(near.ahead_um[here], near.aside_um[here], NOISE_UM, 100.0, 30.0)
    assert len(near.ahead_um) > 8
    assert fit(near) is None


def looked_at(span: Span, *, times: float = 1.0, turned: float = 0.0) -> Span:
    """Return a push with what an image of an even straight fibre shows of it."""
    ahead = np.linspace(0.0, 1000.0, 201)
    shape = NaturalShape(ahead, np.zeros(201), span.nominal_um)
    places = np.arange(70.0, span.nominal_um - 70.0, 15.0)
    top = int(np.argmax(span.probe_um))
    touched = span.probe_um[span.loading][np.argmax(span.force_un[span.loading] > 0.6)]
    pushed = float(span.probe_um[top] - touched)
    part = (places + 9.0) / (span.nominal_um + 9.0)
    aside = (1.0 - turned) * part**2 * (3.0 - part) / 2.0 + turned * places / span.nominal_um
    force = float(span.force_un[top])
    bent = BentShape(places, times * pushed * aside, 0.6, float(span.probe_um[top]), force)
    return replace(span, shape=shape, bent=bent)


def measured(seed: int, **image: float) -> tuple[Span, ...]:
    rig = Rig(5e-11, np.random.default_rng(seed))
    first, *others = [rig.push(each.span_um, each.stroke_um) for each in plan_spans(1200.0, 5e-11)]
    return looked_at(first, **image), *others


def test_a_value_that_the_image_speaks_against_is_refused_and_says_why() -> None:
    assert fit_bending(measured(3)).trusted
    refused = fit_bending(measured(3, times=1.4))
    assert Quality.SHAPE in refused.flags
    assert not refused.trusted
    assert any("span 1: the image shows the fibre bent by" in each for each in refused.reasons)


def test_jaws_that_turn_with_all_fibres_refuse_all_of_them() -> None:
    settings = FitSettings()
    several = [measure_fibre(measured(n, turned=0.3), settings=settings) for n in range(12)]
    found = fit_campaign(several, settings=settings)
    assert all(Quality.SHAPE in each.flags for each in found)
    assert all("12 fibres show them turn" in each.reasons[-1] for each in found)
