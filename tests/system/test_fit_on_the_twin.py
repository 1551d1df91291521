"""The analysis on pushes of the twin's fibres, without images: effects alone, and all at once."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosmic.autonomy.bending.fit import MeasuredFibre, fit_campaign, measure_fibre
from cosmic.autonomy.bending.plan import guess_ei, plan_spans
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Freed, Span
from cosmic.twin.settings import TwinSettings
from cosmic.twin.world import World, load_world
from unit.twin.force_bench import FIBRE, Bench, Heard, settings

ROOT = Path(__file__).resolve().parents[2]
FIBRES = 5
FREE_UM = 1100.0
NOISE_UN = 0.06
FREED_FROM_UN = 1.0
SLID_UM = 10.0
NOT_FELT = ("optics", "light", "handling", "kinds.rotary")
RIGID = {"shear_part": 0.0, "shear_std_part": 0.0}
RUBS = {"probe_friction": 0.3, "probe_side_un_um": 10.0}


def pushed(bench: Bench, span_um: float, stroke_um: float, rng: np.random.Generator) -> Span:
    """Push once, out and back, with the fibre met exactly where it is."""
    bench.go(probe_y=-4800.0)
    bench.go(left_x=4000.0 - span_um).go(left_z=-810.0)
    state, tips = bench.moment.fibres[0], bench.scene.tips(bench.now_s)
    x, y, _ = state.line_um[np.argsort(state.line_um[:, 0])].T
    met = -5000.0 + 0.5 * state.seen_um + float(np.interp(tips["probe"][0], x, y))
    out = [-12.0, -6.0, 0.06 * stroke_um, 0.12 * stroke_um, -3.0]
    out += (np.linspace(0.1, 1.0, 10) * stroke_um).tolist()
    back = [*(np.linspace(1.0, 0.0, 7)[1:] * stroke_um), -3.0, -14.0]
    ways = np.array([*out, *(4 * [stroke_um]), *back])
    forces: list[float] = []
    times: list[float] = []
    freed = None
    for before, way in zip([np.nan, *ways[:-1]], ways, strict=True):
        if way == before:
            bench.wait(0.4)
        else:
            bench.go(200.0, probe_y=met - way)
        forces.append(signal(bench.wait(0.15)))
        times.append(bench.now_s)
        if len(forces) in (3, 4) and freed is None and forces[-1] - forces[0] > FREED_FROM_UN:
            freed = slid(bench, len(forces) - 1, rng)
    bench.go(200.0, probe_y=met + 20.0)
    return Span(
        nominal_um=span_um,
        probe_x_um=tips["probe"][0],
        hold_x_um=tips["left.hold"][0],
        probe_um=ways,
        force_un=np.array(forces) + NOISE_UN * rng.standard_normal(len(ways)),
        force_std_un=np.full(len(ways), NOISE_UN),
        time_s=np.array(times),
        loading=np.arange(len(ways)) < len(out) + 4,
        freed=freed,
    )


def slid(bench: Bench, after: int, rng: np.random.Generator) -> Freed:
    """Slide the fibre up and down the probe, and back to where it was each time."""
    height = bench.scene.stages["left.z"].position_then(bench.now_s)
    found: list[float] = []
    begin_s = bench.now_s
    for side in (1.0, -1.0, 1.0, -1.0):
        bench.go(left_z=height + side * SLID_UM).go(left_z=height)
        found.append(signal(bench.wait(0.1)) + NOISE_UN * float(rng.standard_normal()))
    wait_s = 0.5 * (bench.now_s - begin_s)
    return Freed(after, np.array(found[::2]), np.array(found[1::2]), NOISE_UN, wait_s)


def signal(bench: Bench) -> float:
    """What the sensor would tell without noise, uN."""
    return float(bench.force_side.sensors["force"]._force_un(np.array([bench.now_s]))[0])


def measured(
    twin: TwinSettings, number: int, known: Mapping[str, float]
) -> tuple[MeasuredFibre, float]:
    """Return a fibre as measured, and what is true of it, N m2."""
    heard, rng = Heard(), np.random.default_rng(number)
    bench = Bench(twin, number, heard)
    fit = FitSettings(fibre_width_um=bench.moment.fibres[0].seen_um, **known)
    spans: list[Span] = []
    guess = FIBRE.ei_n_m2
    while plan := plan_spans(FREE_UM, guess, done=spans, settings=fit):
        spans.append(pushed(bench, plan[0].span_um, plan[0].stroke_um, rng))
        guess = guess_ei(spans, settings=fit) or guess
    met = [facts for name, facts in heard.events if name == "touched"]
    longest = max(met, key=lambda facts: facts["abscissa_um"])
    return measure_fibre(spans, settings=fit), longest["ei_n_m2"]


def results(
    twins: list[TwinSettings], known: Mapping[str, float] | None = None
) -> list[tuple[BendingResult, float]]:
    """Return what a campaign finds of one fibre of each, and what is true."""
    known = known or {}
    kept, truths = zip(*(measured(twin, n, known) for n, twin in enumerate(twins)), strict=True)
    return list(zip(fit_campaign(kept, settings=FitSettings(**known)), truths, strict=True))


def drawn(number: int) -> dict[str, float]:
    """Return what is a fibre's own in the realistic world."""
    rng = np.random.default_rng([7, number])
    return {
        "plane_ratio": float(np.clip(4.0 * np.exp(0.7 * rng.standard_normal()), 1.5, 40.0)),
        "orientation_deg": float(rng.uniform(0.0, 90.0)),
        "twist_deg_mm": float(15.0 * rng.standard_normal()),
        "ei_variation": 0.15,
        "ei_length_um": 150.0,
        "relaxation_per_decade": float(max(0.0, 0.03 + 0.01 * rng.standard_normal())),
        "shear_ratio": 20.0,
    }


def test_ribbons_that_stand_askew_and_rub_on_the_probe_are_as_stiff_as_they_are() -> None:
    own = (
        {key: drawn(n)[key] for key in ("plane_ratio", "orientation_deg")} for n in range(FIBRES)
    )
    found = results([settings(FIBRE.model_copy(update=each), **RUBS) for each in own], RIGID)
    assert all(result.trusted for result, _ in found)
    assert [result.ei_n_m2 / true for result, true in found] == pytest.approx(
        [1.0] * FIBRES, abs=0.05
    )
    assert all(r.ei_low_n_m2 <= true <= r.ei_high_n_m2 for r, true in found)


def test_wide_ribbons_on_edge_shear_and_are_as_stiff_as_they_are() -> None:
    edge = {"plane_ratio": 1.2, "orientation_deg": 90.0, "shear_ratio": 20.0}
    own = (FIBRE.model_copy(update={**edge, "width_um": 30.0 + 3.0 * n}) for n in range(FIBRES))
    twins = [settings(each, clamp_depth_um=15.0) for each in own]
    found = results(twins)
    assert [result.ei_n_m2 / true for result, true in found] == pytest.approx(
        [1.0] * FIBRES, abs=0.05
    )
    assert all(r.ei_low_n_m2 <= true <= r.ei_high_n_m2 for r, true in found)
    assert [r.clamp_offset_um for r, _ in found] == pytest.approx([15.0] * FIBRES, abs=10.0)


def test_what_creeps_is_as_stiff_as_it_shows_one_second_after_a_step() -> None:
    creeps = settings(FIBRE.model_copy(update={"relaxation_per_decade": 0.03}))
    ((result, true),) = results([creeps])
    assert true == pytest.approx(FIBRE.ei_n_m2 * (1.0 - 0.064), rel=0.005)
    assert result.trusted
    assert result.ei_n_m2 == pytest.approx(true, rel=0.025)


def test_what_creeps_relaxes_alike_at_each_span_and_as_much_after_earlier_pushes() -> None:
    fits = [
        measured(settings(FIBRE.model_copy(update={"relaxation_per_decade": part})), 0, {})[0].spans
        for part in (0.0, 0.03)
    ]
    plain, creeps = fits
    assert [fit.relaxation_part for fit in creeps] == pytest.approx([0.028] * len(creeps), abs=0.01)
    assert all(fit.chi2 < 1.2 * fit.freedom for fit in creeps), "nothing is left to explain"
    # The same noise in both: what a slide shows is not mistaken for what creeps.
    for one, other in zip(plain, creeps, strict=True):
        assert other.freed_log == pytest.approx(one.freed_log, abs=0.02)


@pytest.mark.parametrize("left", [2, 4])
def test_a_way_back_that_is_cut_off_loads_the_fibre_no_longer_than_it_was_pushed(left: int) -> None:
    creeps = settings(FIBRE.model_copy(update={"relaxation_per_decade": 0.06}))
    whole, _ = measured(creeps, 0, {})
    *others, last = whole.raw
    cut_off = [begun(each, int(each.loading.sum()) + left) for each in others]
    found = measure_fibre([*cut_off, last], settings=whole.settings)
    assert [fit.freed_log for fit in found.spans] == pytest.approx(
        [fit.freed_log for fit in whole.spans], abs=0.015
    )


def begun(span: Span, readings: int) -> Span:
    """Return the first readings of a span."""
    names = ("probe_um", "force_un", "force_std_un", "time_s", "loading")
    return replace(span, **{name: getattr(span, name)[:readings] for name in names})


def test_with_all_effects_of_the_realistic_world_the_truth_is_inside() -> None:
    realistic = load_world("realistic", ROOT / "config").session
    felt = {key: each for key, each in realistic.items() if not key.startswith(NOT_FELT)}
    own = (FIBRE.model_copy(update=drawn(n)) for n in range(FIBRES))
    found = results([World(session=felt).applied(settings(each), 3) for each in own])
    good = [(result, true) for result, true in found if result.trusted]
    assert len(good) >= FIBRES - 1
    outside = [r for r, true in good if not r.ei_low_n_m2 <= true <= r.ei_high_n_m2]
    assert len(outside) <= 1, "it is a 95 % interval"
