"""Fibres held at one end, against beam theory, brute force, and a chain of least energy."""

import math

import numpy as np
import pytest

from cosmic.twin.cantilever import Cantilever
from cosmic.twin.rod import PushCurve
from oracles.pushed_rod import arc, pushed

EI = 5e-11 * 1e18
RIGID = 1e30


def curve(
    span_um: float = 400.0,
    *,
    line: np.ndarray | None = None,
    free_um: float = 0.0,
    sensor_un_um: float = RIGID,
    **changed: float,
) -> PushCurve:
    if line is None:
        line = np.array([[0.0, 0.0], [free_um or 3.0 * span_um, 0.0]])
    kept = {"ei_un_um2": EI, "depth_um": 0.0, "radius_um": 0.0} | changed
    return Cantilever(*line.T, **kept).curve(span_um, sensor_un_um=sensor_un_um)


@pytest.mark.parametrize("span_um", [200.0, 300.0, 400.0, 600.0])
@pytest.mark.parametrize("ei", [EI, 1e-12 * 1e18])
def test_a_small_push_follows_euler_and_bernoulli(span_um: float, ei: float) -> None:
    pushed = curve(span_um, ei_un_um2=ei)
    for part in (0.001, 0.01, 0.02):
        travel = part * span_um
        assert pushed.force_un(travel) == pytest.approx(3.0 * ei * travel / span_um**3, rel=0.003)


def test_the_clamp_lies_inside_the_jaws() -> None:
    assert curve(392.0, depth_um=8.0).force_un(4.0) == pytest.approx(
        curve(400.0).force_un(4.0), rel=1e-3
    )


@pytest.mark.parametrize("normal_un", [5.0, 60.0, 200.0])
def test_a_large_bow_agrees_with_the_elastica_integrated_step_by_step(normal_un: float) -> None:
    # From the contact, where the moment is zero, back towards the clamp; angle counted from the
    # fibre at the contact, to which a force without friction is normal.
    step, way, psi, bend, x, y = 0.01, 0.0, 0.0, 0.0, 0.0, 0.0
    while way < 500.0:
        middle = psi + 0.5 * step * bend
        bend_middle = bend + 0.5 * step * normal_un / EI * math.cos(psi)
        x, y = x + step * math.cos(middle), y + step * math.sin(middle)
        psi, bend = psi + step * bend_middle, bend + step * normal_un / EI * math.cos(middle)
        way += step
    span = x * math.cos(psi) + y * math.sin(psi)
    bow = x * math.sin(psi) - y * math.cos(psi)
    force = curve(span).force_un(bow)
    assert force == pytest.approx(normal_un * math.cos(psi), rel=2e-3)
    # A fibre just too short for it slides off before.
    assert curve(span, free_um=503.0).reach_um >= bow > curve(span, free_um=498.0).reach_um


@pytest.mark.parametrize(("turn_deg", "span_um"), [(-60.0, 450.0), (-25.0, 300.0), (60.0, 450.0)])
def test_a_curled_fibre_agrees_with_a_chain_of_least_energy(
    turn_deg: float, span_um: float
) -> None:
    line = arc(1300.0, turn_deg, 300)
    curled = curve(span_um, line=line, depth_um=20.0, radius_um=25.0)
    travel = 0.12 * span_um
    chain = pushed(
        line,
        ei_un_um2=EI,
        probe_x_um=span_um,
        radius_um=25.0,
        travel_um=travel,
        depth_um=20.0,
        links=100,
    )
    assert curled.force_un(travel) == pytest.approx(chain, rel=5e-3)


def test_stiffness_may_vary_along_the_fibre() -> None:
    line = arc(1300.0, 20.0, 300)

    def softer(along_um: np.ndarray) -> np.ndarray:
        return 1.0 - 0.4 * np.exp(-(((along_um - 120.0) / 60.0) ** 2))

    curled = Cantilever(*line.T, ei_un_um2=EI, depth_um=0.0, radius_um=25.0, stiffness=softer)
    chain = pushed(
        line,
        ei_un_um2=EI,
        probe_x_um=400.0,
        radius_um=25.0,
        travel_um=20.0,
        ei_of=softer,
        links=130,
    )
    force = curled.curve(400.0, sensor_un_um=RIGID).force_un(20.0)
    assert force == pytest.approx(chain, rel=5e-3)
    assert force < 0.9 * curve(400.0, line=line, radius_um=25.0).force_un(20.0)


def test_jaws_that_give_way_take_their_part() -> None:
    rigid, span = curve(), 400.0
    turning = curve(turn_rad_un_um=1e-6)
    sliding = curve(side_un_um=10.0)
    stiff = 3.0 * EI / span**3
    assert rigid.force_un(2.0) == pytest.approx(stiff * 2.0, rel=3e-3)
    assert sliding.force_un(2.0) == pytest.approx(2.0 / (1.0 / stiff + 1.0 / 10.0), rel=3e-3)
    assert turning.force_un(2.0) == pytest.approx(2.0 / (1.0 / stiff + 1e-6 * span**2), rel=3e-3)


def test_friction_pushes_back_more_while_loading_than_while_unloading() -> None:
    out, free, back = (curve(friction=mu).force_un(60.0) for mu in (0.3, 0.0, -0.3))
    assert out > 1.05 * free > 1.1 * back


def test_the_force_is_odd_and_starts_at_nothing() -> None:
    straight = curve()
    assert straight.force_un(0.0) == 0.0
    assert straight.force_un(-13.0) == -straight.force_un(13.0) < 0.0


def test_the_spring_of_the_sensor_takes_its_part_of_the_travel() -> None:
    stiff = 3.0 * EI / 200.0**3
    assert curve(200.0, sensor_un_um=stiff).force_un(2.0) == pytest.approx(stiff, rel=0.01)


def test_a_fibre_slides_off_when_the_bow_needs_more_than_there_is() -> None:
    short, long = curve(free_um=402.0), curve(free_um=1000.0)
    assert 20.0 < short.reach_um < 60.0 < long.reach_um
    along = 400.0 * (1.0 + 0.6 * (short.reach_um / 400.0) ** 2)  # of a cantilever's small bow
    assert along == pytest.approx(402.0, abs=0.3)


@pytest.mark.parametrize("span_um", [120.0, 200.0, 600.0])
@pytest.mark.parametrize("friction", [-0.4, -0.2, 0.2, 0.4])
def test_a_soft_probe_that_rubs_bends_the_fibre_and_does_not_slide_off(
    span_um: float, friction: float
) -> None:
    line = np.array([[0.0, 0.0], [1700.0, 0.0]])
    soft = curve(
        span_um, line=line, depth_um=30.0, radius_um=17.0, friction=friction, probe_un_um=10.0
    )
    stiff = 3.0 * EI / (span_um + 30.0) ** 3
    assert soft.reach_um > 0.08 * span_um
    assert soft.force_un(3.0) == pytest.approx(3.0 * stiff, rel=0.2)


def test_curves_are_finite_and_rise() -> None:
    shapes = [None, arc(1200.0, 70.0, 300), arc(1200.0, -70.0, 300), arc(600.0, 100.0, 60)]
    for line in shapes:
        for span_um in (5.0, 30.0, 150.0, 399.9):
            curled = curve(span_um, line=line, depth_um=8.0, radius_um=25.0)
            assert curled.travels_um[0] == curled.forces_un[0] == 0.0
            assert np.isfinite(curled.forces_un).all()
            assert (np.diff(curled.travels_um) > 0.0).all()
            assert math.isfinite(curled.force_un(1e6))
