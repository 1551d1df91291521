"""Fibres as elastic rods, against beam theory and against integration by brute force."""

import math

import numpy as np
import pytest

from cosmic.twin.rod import clamped_at_one_end, held_at_both_ends, tension_un

EI = 5e-11 * 1e18
EA = 7.2e6
RIGID = 1e30


def one_end(span_um: float = 400.0, **changed: float) -> float | object:
    kept = {"ei_un_um2": EI, "free_um": 3.0 * span_um, "radius_um": 0.0, "sensor_un_um": RIGID}
    return clamped_at_one_end(span_um=span_um, **(kept | changed))


def both_ends(ei: float = EI, **changed: float):
    kept = {
        "ei_un_um2": ei,
        "ea_un": EA,
        "span_um": 487.5,
        "distance_um": 975.0,
        "slack_um": 0.0,
        "gripper_un_um": RIGID,
        "sensor_un_um": RIGID,
    }
    return held_at_both_ends(**(kept | changed))


# --- clamped at one end -------------------------------------------------------------------------


@pytest.mark.parametrize("span_um", [200.0, 300.0, 400.0, 600.0])
@pytest.mark.parametrize("ei", [EI, 1e-12 * 1e18])
def test_a_small_push_follows_euler_and_bernoulli(span_um: float, ei: float) -> None:
    curve = one_end(span_um, ei_un_um2=ei)
    for part in (0.001, 0.01, 0.02):
        way = part * span_um
        assert curve.force_un(way) == pytest.approx(3.0 * ei * way / span_um**3, rel=0.002)


@pytest.mark.parametrize("part", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("span_um", [300.0, 400.0, 600.0])
def test_with_the_edge_of_the_probe_the_straight_line_holds_to_a_tenth_of_the_span(
    part: float, span_um: float
) -> None:
    curve = one_end(span_um, radius_um=25.0)
    way = part * span_um
    assert curve.force_un(way) == pytest.approx(3.0 * EI * way / span_um**3, rel=0.013)
    assert curve.force_un(2 * 0.1 * span_um) < 0.99 * 3.0 * EI * 0.2 / span_um**2


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
    curve = one_end(span)
    assert curve.force_un(bow) == pytest.approx(normal_un * math.cos(psi), rel=1e-3)
    # A fibre just too short for it slides off before.
    assert one_end(span, free_um=503.0).reach_um >= bow > one_end(span, free_um=498.0).reach_um


def test_the_force_is_odd_and_starts_at_nothing() -> None:
    curve = one_end()
    assert curve.force_un(0.0) == 0.0
    assert curve.force_un(-13.0) == -curve.force_un(13.0) < 0.0


def test_the_spring_of_the_sensor_takes_its_part_of_the_way() -> None:
    stiff = 3.0 * EI / 200.0**3
    curve = one_end(200.0, sensor_un_um=stiff)
    assert curve.force_un(2.0) == pytest.approx(stiff * 1.0, rel=0.01)


def test_a_fibre_slides_off_when_the_bow_needs_more_than_there_is() -> None:
    short, long = one_end(free_um=402.0), one_end(free_um=1000.0)
    assert 20.0 < short.reach_um < 60.0 < long.reach_um
    arc = 400.0 * (1.0 + 0.6 * (short.reach_um / 400.0) ** 2)  # of a cantilever's small bow
    assert arc == pytest.approx(402.0, abs=0.3)


# --- held at both ends --------------------------------------------------------------------------


@pytest.mark.parametrize(("ei_n_m2", "linear_un", "stretched_un"), [
    (5e-11, 207.0, 879.0), (5e-12, 20.7, 616.0),
])  # fmt: skip
def test_a_fibre_held_at_both_ends_is_much_stiffer_than_linear_theory(
    ei_n_m2: float, linear_un: float, stretched_un: float
) -> None:
    # 1 mm between grippers; each clamp lies half a cell of 25 um inside, as in the prototype.
    ei = ei_n_m2 * 1e18
    assert 192.0 * ei / 975.0**3 * 20.0 == pytest.approx(linear_un, rel=0.01)
    assert both_ends(ei).force_un(20.0) == pytest.approx(stretched_un, rel=0.04)
    assert both_ends(ei).force_un(0.05) == pytest.approx(linear_un / 400.0, rel=0.02)


@pytest.mark.parametrize(
    ("ei_n_m2", "rigid", "soft"), [(5e-11, 1.9, 1.0), (5e-12, 8.7, 1.1), (5e-13, 71.0, 2.1)]
)
def test_soft_grippers_hide_the_stretching(ei_n_m2: float, rigid: float, soft: float) -> None:
    ei = ei_n_m2 * 1e18
    linear = 192.0 * ei / 975.0**3 * 10.0
    assert both_ends(ei).force_un(10.0) / linear == pytest.approx(rigid, rel=0.07)
    ratio = both_ends(ei, gripper_un_um=100.0).force_un(10.0) / linear
    assert ratio == pytest.approx(soft, rel=0.27), "the prototype's springs sat elsewhere"


@pytest.mark.parametrize(
    ("ei", "way", "gripper"),
    [(EI, 15.0, RIGID), (EI / 50.0, 15.0, RIGID), (EI, 60.0, RIGID), (EI, 60.0, 1000.0)],
)
def test_both_ends_agree_with_the_energy_minimised_on_a_grid(
    ei: float, way: float, gripper: float
) -> None:
    curve = both_ends(ei, span_um=300.0, gripper_un_um=gripper)
    axial = 1.0 / (975.0 / EA + 2.0 / gripper)
    assert curve.force_un(way) == pytest.approx(by_energy(ei, axial, way), rel=0.01)


def by_energy(ei: float, axial_un_um: float, way_um: float) -> float:
    """Force of a clamped beam with stretching, by finite differences and bisection."""
    count, span_um, distance_um = 521, 300.0, 975.0
    step = distance_um / (count - 1)
    probe = round(span_um / step)
    second = np.diff(np.eye(count), 2, axis=0) / step**2
    first = np.diff(np.eye(count), axis=0) / step
    bending = ei * step * second.T @ second
    ends = 2.0 * ei / step**3  # mirror points: no slope at the clamps
    for place in (1, count - 2):
        bending[place, place] += ends
    tension_part = step * first.T @ first
    low, high = 0.0, EA
    force = 0.0
    free = [i for i in range(1, count - 1) if i != probe]
    for _ in range(40):
        tension = 0.5 * (low + high)
        stiff = bending + tension * tension_part
        shape = np.zeros(count)
        shape[probe] = way_um
        shape[free] = np.linalg.solve(stiff[np.ix_(free, free)], -stiff[free, probe] * way_um)
        force = float(stiff[probe] @ shape)
        stretched = axial_un_um * 0.5 * float(shape @ tension_part @ shape)
        low, high = (tension, high) if stretched > tension else (low, tension)
        if high - low < 1e-3 * high:
            break
    return force


def test_slack_has_to_be_used_up_before_a_fibre_pulls() -> None:
    straight, slack = both_ends(), both_ends(slack_um=1.0)
    linear = 192.0 * EI / 975.0**3
    assert slack.force_un(15.0) == pytest.approx(15.0 * linear, rel=0.05)
    assert slack.force_un(40.0) < straight.force_un(40.0)
    assert slack.force_un(60.0) > 1.5 * 60.0 * linear


def test_a_stretched_fibre_pulls_and_is_stiff_from_the_start() -> None:
    pull = tension_un(ea_un=EA, distance_um=975.0, slack_um=-1.0, gripper_un_um=RIGID)
    assert pull == pytest.approx(EA / 975.0)
    assert tension_un(ea_un=EA, distance_um=975.0, slack_um=1.0, gripper_un_um=RIGID) == 0.0
    taut, loose = both_ends(slack_um=-1.0), both_ends()
    assert taut.force_un(1.0) > 1.3 * loose.force_un(1.0)
    soft = both_ends(1.0, slack_um=-1.0)  # hardly any bending stiffness: a string
    assert soft.force_un(0.1) == pytest.approx(pull * 0.1 * 4.0 / 975.0, rel=0.02)


def test_curves_are_finite_and_rise() -> None:
    curves = [one_end(), one_end(radius_um=25.0), one_end(free_um=399.9), both_ends()]
    curves += [both_ends(slack_um=3.0), both_ends(slack_um=-2.0), both_ends(span_um=5.0)]
    for curve in (*curves, both_ends(ei=0.01)):
        assert curve.ways_um[0] == curve.forces_un[0] == 0.0
        assert np.isfinite(curve.forces_un).all()
        assert (np.diff(curve.ways_um) > 0.0).all()
        assert math.isfinite(curve.force_un(1e6))
