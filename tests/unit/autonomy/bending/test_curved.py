"""Curled fibres: the analysis against a chain of least energy, and against the twin's rod."""

import math

import numpy as np
import pytest

from cosmic.autonomy.bending.curved import NaturalShape, curves_of
from cosmic.autonomy.bending.fit import fit_bending
from cosmic.autonomy.bending.response import response_of
from cosmic.autonomy.bending.result import BendingError
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from cosmic.twin.cantilever import Cantilever
from oracles.pushed_rod import arc, pushed

EI = 5e-11 * 1e18
SPANS_UM = (600.0, 450.0, 300.0)
RADIUS_UM = FitSettings().radius_um
EXACT = FitSettings(
    offset_um=0.1,
    offset_std_um=0.02,
    contact_std_um=0.01,
    sensor_un_um=1e9,
    jaw_un_um=1e9,
    side_un_um=1e9,
    friction=0.0,
    relaxation_part=0.0,
    relaxation_std_part=1e-4,
    shear_part=0.0,
    shear_std_part=0.001,
)


def shape_at(turn_deg: float, at_um: float) -> NaturalShape:
    return NaturalShape(*arc(1300.0, turn_deg, 260).T, at_um)


@pytest.mark.parametrize(("turn_deg", "span_um"), [(-60.0, 450.0), (-25.0, 300.0), (60.0, 450.0)])
def test_the_curve_of_a_curled_fibre_agrees_with_a_chain_of_least_energy(
    turn_deg: float, span_um: float
) -> None:
    shape, travel = shape_at(turn_deg, span_um), 0.12 * span_um
    found = shape.curve(depth_um=20.0, radius_um=25.0)
    lever = shape.lever_um(20.0)
    force = 3.0 * EI / lever**2 * np.interp(travel, found.deflection * lever, found.pushed)
    chain = pushed(
        arc(1300.0, turn_deg, 260),
        ei_un_um2=EI,
        probe_x_um=span_um,
        radius_um=25.0,
        travel_um=travel,
        depth_um=20.0,
        links=100,
    )
    assert force == pytest.approx(chain, rel=5e-3)


@pytest.mark.parametrize("turn_deg", [-70.0, -45.0, 45.0, 70.0])
def test_friction_makes_a_curled_fibre_softer_on_the_way_out_and_back_alike(
    turn_deg: float,
) -> None:
    shape, pushed_part, friction = shape_at(turn_deg, 600.0), 0.06, 0.4

    def both(rub: float) -> float:
        curves = shape.curves(depth_um=20.0, radius_um=25.0, friction=rub)
        typical = [np.interp(pushed_part, each.deflection, each.pushed) for each in curves]
        return float(np.log(typical).mean())

    slope = (both(friction + 0.05) - both(friction - 0.05)) / 0.1
    turned = 1.5 * pushed_part
    said = shape.by_friction_both(friction, depth_um=20.0, turned_rad=turned)
    assert said == pytest.approx(slope, rel=0.2, abs=0.01)
    assert said < 0.0


def test_fibres_laid_out_together_bend_as_each_by_itself() -> None:
    shapes = [shape_at(turn_deg, 450.0) for turn_deg in (-60.0, 0.0, 25.0)]
    bent = {"depth_um": 20.0, "radius_um": 25.0, "friction": 0.3}
    together = curves_of([(each, (0.1 * EI, 0.0)) for each in shapes], **bent)
    for shape, (giving, stiff) in zip(shapes, together, strict=True):
        for curves, side_um_un in ((giving, 0.1), (stiff, 0.0)):
            alone = shape.curves(**bent, ei_un_um2=EI, side_um_un=side_um_un)
            for one, other in zip(curves, alone, strict=True):
                np.testing.assert_allclose(one.deflection, other.deflection, rtol=1e-8)
                np.testing.assert_allclose(one.pushed, other.pushed, rtol=1e-8)


def test_what_spans_answer_is_kept_until_it_is_asked_for_other_depths() -> None:
    response = response_of([shape_at(20.0, at_um) for at_um in SPANS_UM], depth_um=20.0)
    depths = np.array([5.0, 20.0, 60.0])
    first = response.laid_out(depths, 150.0, 0, every=1)
    assert response.laid_out(depths.copy(), 150.0, 0, every=1) is first
    other = response.laid_out(2.0 * depths, 150.0, 0, every=1)
    np.testing.assert_array_equal(other.log_stiffness, response.log_stiffness(2.0 * depths))
    np.testing.assert_array_equal(other.variation[1], response.variation(40.0, 150.0, 0))
    assert response.laid_out(depths, 150.0, 0, every=1) is not first


def spans(turn_deg: float, *, seed: int = 1) -> list[Span]:
    """Return what a probe measures of an arc that the twin's rod bends; quiet, and exact."""
    line, rng = arc(1300.0, turn_deg, 260), np.random.default_rng(seed)
    rod = Cantilever(*line.T, ei_un_um2=EI, depth_um=0.0, radius_um=RADIUS_UM)
    found = []
    for at_um in SPANS_UM:
        curve = rod.curve(at_um, sensor_un_um=1e9)
        out = np.linspace(-0.03, 0.1, 24) * at_um
        travel = np.concatenate([out, out[::-1]])
        force = np.array([curve.force_un(each) if each > 0.0 else 0.0 for each in travel])
        shape = shape_at(turn_deg, at_um)
        lever = shape.lever_um()
        found.append(
            Span(
                nominal_um=lever,
                probe_x_um=lever,
                hold_x_um=0.0,
                probe_um=travel - touch_um(line, at_um),
                force_un=force + 0.01 * rng.standard_normal(48),
                force_std_un=np.full(48, 0.01),
                time_s=0.06 * np.arange(48),
                loading=np.arange(48) < 24,
                shape=shape,
            )
        )
    return found


def touch_um(line: np.ndarray, at_um: float) -> float:
    """Return how high the middle of the probe stands where it just touches."""
    fine = np.column_stack(
        [np.interp(np.linspace(0, 1, 40001), np.linspace(0, 1, len(line)), each) for each in line.T]
    )
    off = RADIUS_UM**2 - (fine[:, 0] - at_um) ** 2
    return float(np.max(fine[off > 0.0, 1] + np.sqrt(off[off > 0.0])))


def old_lever_um(line: np.ndarray, at_um: float) -> float:
    """Return the lever of a push along the probe's axis, as it was once believed to act."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    to = np.linspace(0.0, np.interp(at_um, line[:, 0], along), 2001)
    return float(np.cbrt(3.0 * np.trapezoid((at_um - np.interp(to, along, line[:, 0])) ** 2, to)))


@pytest.mark.parametrize("turn_deg", [-60.0, -40.0, -20.0, 0.0, 20.0, 40.0, 60.0])
def test_curl_does_not_bias_the_stiffness(turn_deg: float) -> None:
    found = fit_bending(spans(turn_deg), settings=EXACT)
    assert found.ei_n_m2 == pytest.approx(5e-11, rel=0.01, abs=0.0)


def test_the_lever_of_before_is_wrong_by_what_the_direction_of_the_force_makes() -> None:
    """Shows that the twin bends by other physics than that of the lever once believed."""
    line = arc(1300.0, 25.0, 260)
    k = []
    for at_um in SPANS_UM:
        curve = Cantilever(*line.T, ei_un_um2=EI, depth_um=0.0, radius_um=0.0).curve(
            at_um, sensor_un_um=1e9
        )
        k.append(curve.force_un(0.002 * at_um) / (0.002 * at_um))
    levers = np.array([old_lever_um(line, at_um) for at_um in SPANS_UM])
    slope = np.polyfit(levers, np.array(k) ** (-1.0 / 3.0), 1)[0]
    error_percent = 100.0 * (slope**-3.0 / 3.0 / EI - 1.0)
    assert error_percent == pytest.approx(-8.6, abs=1.0)


def test_a_fit_of_curled_spans_is_trusted_and_right() -> None:
    rigid = EXACT.model_copy(update={"offset_um": 8.0, "offset_std_um": 8.0})
    found = fit_bending(spans(35.0), settings=rigid)
    assert found.trusted, found.reasons
    assert found.ei_low_n_m2 < 5e-11 < found.ei_high_n_m2


def test_a_fibre_that_slopes_too_much_is_refused_with_its_slope() -> None:
    line = arc(1300.0, 170.0, 400)
    rising = line[: int(np.argmax(np.diff(line[:, 0]) <= 0.0)) or None]
    shape = NaturalShape(*rising.T, 0.97 * float(rising[-1, 0]))
    assert math.degrees(shape.slope_rad) > 60.0
    with pytest.raises(BendingError, match=r"lies at \d+ deg to the jaws"):
        shape.curve(depth_um=8.0, radius_um=25.0)


@pytest.mark.parametrize(
    ("ahead", "aside", "at_um", "says"),
    [
        ([0.0, 100.0, 50.0], [0.0, 0.0, 0.0], 90.0, "must rise"),
        ([0.0, 100.0], [0.0, 0.0], 300.0, "must rise .* at 300 um"),
        ([0.0, 100.0], [0.0], 50.0, "one list"),
        ([0.0, math.nan], [0.0, 0.0], 50.0, "not numbers"),
    ],
)
def test_a_shape_that_is_none_is_refused(ahead, aside, at_um: float, says: str) -> None:
    with pytest.raises(BendingError, match=says):
        NaturalShape(np.array(ahead), np.array(aside), at_um)
