"""Where a fibre is pushed, and how far."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.autonomy.bending.plan import FARTHER, PlannedSpan, SpanLimits, guess_ei, plan_spans
from cosmic.autonomy.bending.result import BendingError
from cosmic.autonomy.bending.settings import FitSettings
from oracles.bent_fibre import Rig


@given(
    length=st.floats(240.0, 4000.0),
    ei=st.floats(1e-15, 1e-9),
    count=st.integers(1, 6),
    highest=st.floats(5.0, 150.0),
)
def test_no_span_goes_beyond_its_limits(
    length: float, ei: float, count: int, highest: float
) -> None:
    limits = SpanLimits(count=count, highest_un=highest)
    fit = FitSettings(fibre_width_um=40.0)
    plan = plan_spans(length, ei, limits, settings=fit)
    assert len(plan) == count
    for each in plan:
        assert limits.shortest_um <= each.span_um <= limits.longest_um
        assert each.span_um <= length - limits.beyond_um
        assert 0.0 < each.stroke_um <= limits.stroke_part * each.span_um
        assert each.force_un <= highest * (1.0 + 1e-9)
        strain = 3.0 * each.stroke_um * 20.0 / (each.span_um + fit.offset_um) ** 2
        assert strain <= 0.01 * limits.strain_percent * (1.0 + 1e-9), "at the surface"


def longest(plan: tuple[PlannedSpan, ...]) -> float:
    return max(each.span_um for each in plan)


def test_softer_fibres_get_shorter_spans() -> None:
    stiff, soft = plan_spans(1500.0, 5e-11), plan_spans(1500.0, 5e-13)
    assert longest(soft) < longest(stiff)


def test_spans_of_a_stiff_fibre_are_not_so_short_that_nothing_bends() -> None:
    limits = SpanLimits(shortest_part=0.3)
    stiff, dry = plan_spans(1500.0, 2e-10, limits), plan_spans(1500.0, 5e-11, limits)
    assert min(each.span_um for each in dry) == pytest.approx(0.3 * 600.0, abs=1.0)
    assert min(each.span_um for each in stiff) == pytest.approx(257.3, abs=1.0)
    assert min(each.stroke_um for each in stiff) == pytest.approx(limits.shortest_stroke_um)


def test_the_longest_span_comes_first() -> None:
    spans = [each.span_um for each in plan_spans(1500.0, 5e-11)]
    assert spans == sorted(spans, reverse=True)


def test_what_is_measured_is_not_planned_again_when_the_guess_gets_better() -> None:
    rig = Rig(5e-12, np.random.default_rng(1))
    first = plan_spans(1500.0)[0]
    done = [rig.push(first.span_um, first.stroke_um)]
    guess = guess_ei(done)
    assert guess == pytest.approx(5e-12, rel=0.4)
    rest = plan_spans(1500.0, guess, done=done)
    assert len(rest) == 4
    assert all(abs(each.span_um - first.span_um) > 30.0 for each in rest)
    # A fibre ten times softer than first thought is pushed farther for the same force.
    assert max(each.stroke_um for each in rest) > 10.0
    assert plan_spans(1500.0, guess, done=5 * done) == ()


def test_nothing_measured_gives_no_guess() -> None:
    assert guess_ei([]) is None
    span = Rig(5e-11, np.random.default_rng(1)).push(300.0, 12.0)
    for nowhere_um in (-300.0, math.nan):
        assert guess_ei([replace(span, nominal_um=nowhere_um)]) is None
    assert guess_ei([Rig(1e-20, np.random.default_rng(1)).push(300.0, 12.0)]) is None


def test_a_fibre_too_short_is_refused_with_what_is_needed() -> None:
    with pytest.raises(BendingError, match="too short: the shortest span is 110 um"):
        plan_spans(180.0, 5e-11)


@pytest.mark.parametrize("guess", [0.0, -1e-11, float("nan"), float("inf")])
def test_a_guess_that_is_no_stiffness_is_refused(guess: float) -> None:
    with pytest.raises(BendingError, match="not a bending stiffness to plan with"):
        plan_spans(1000.0, guess)


def test_a_free_length_that_is_no_number_is_refused() -> None:
    with pytest.raises(BendingError, match="too short"):
        plan_spans(float("nan"))


def test_spans_that_grow_by_the_same_part_lie_nearer_to_the_jaws() -> None:
    places = [each.span_um for each in plan_spans(1200.0, limits=FARTHER)]
    assert places[0] == 800.0
    even = plan_spans(1200.0, limits=FARTHER.model_copy(update={"nearer": 0.0}))
    assert places[-1] == pytest.approx(even[-1].span_um)
    assert places[2] < even[2].span_um - 50.0
    ratios = [one / other for one, other in pairwise(places)]
    assert ratios == pytest.approx([ratios[0]] * 4)
