"""Fibres held at both ends, against beam theory and the energy minimised on a grid."""

import math

import numpy as np
import pytest

from cosmic.twin.rod import held_at_both_ends, tension_un

EI = 5e-11 * 1e18
EA = 7.2e6
RIGID = 1e30


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
    curves = [both_ends(), both_ends(slack_um=3.0), both_ends(slack_um=-2.0)]
    curves.append(both_ends(span_um=5.0))
    for curve in (*curves, both_ends(ei=0.01)):
        assert curve.travels_um[0] == curve.forces_un[0] == 0.0
        assert np.isfinite(curve.forces_un).all()
        assert (np.diff(curve.travels_um) > 0.0).all()
        assert math.isfinite(curve.force_un(1e6))
