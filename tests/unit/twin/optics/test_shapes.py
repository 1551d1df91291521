"""Centre lines of fibres as they are drawn."""

import math

import numpy as np
import pytest

from cosmic.twin.optics.bent import Compliance, bent
from cosmic.twin.optics.shapes import bridge, lying


def arc_length(line: np.ndarray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def heading_deg(line: np.ndarray, at: int) -> float:
    step = line[at + 1] - line[at] if at >= 0 else line[at] - line[at - 1]
    return math.degrees(math.atan2(step[1], step[0]))


@pytest.mark.parametrize(("curl", "kink"), [(0.0, 0.0), (28.0, 0.0), (-20.0, 35.0), (150.0, 0.0)])
def test_a_lying_fibre_has_its_length_and_turns_by_its_curl_and_kink(
    curl: float, kink: float
) -> None:
    line = lying(1200.0, curl, kink)
    assert arc_length(line) == pytest.approx(1200.0)
    turned = heading_deg(line, -1) - heading_deg(line, 0)
    assert turned == pytest.approx(curl + kink, abs=abs(curl) / 20 + 1e-9)
    assert line[0, 0] == pytest.approx(-line[-1, 0])
    assert line[:, 1].mean() == pytest.approx(0.0, abs=1e-9)


EVEN = Compliance(0.0, 0.0, np.array([0.0, 1200.0]), np.ones(2))
STRAIGHT = np.array([[0.0, 0.0], [1200.0, 0.0]])


@pytest.mark.parametrize("deflection", [10.0, -40.0, 150.0])
def test_a_pushed_cantilever_leaves_its_clamp_level_and_passes_the_probe(deflection: float) -> None:
    line = bent(STRAIGHT, EVEN, 400.0, deflection)
    assert line[0] == pytest.approx([0.0, 0.0])
    assert abs(heading_deg(line, 0)) < 0.12 * abs(heading_deg(line, -1))
    assert np.interp(400.0, line[:, 0], line[:, 1]) == pytest.approx(-deflection, abs=0.05)
    assert arc_length(line) == pytest.approx(1200.0, rel=1e-3)


def test_a_small_push_bends_it_as_euler_and_bernoulli_say() -> None:
    line = bent(STRAIGHT, EVEN, 400.0, 8.0)
    pushed = line[line[:, 0] <= 400.0]
    x = pushed[:, 0] / 400.0
    assert np.allclose(-pushed[:, 1], 8.0 * x * x * (3.0 - x) / 2.0, atol=0.02)
    assert -math.tan(math.radians(heading_deg(line, -1))) == pytest.approx(1.5 * 8 / 400, rel=0.03)


def test_a_deep_clamp_and_jaws_that_turn_show_at_the_jaws() -> None:
    def at_150(compliance: Compliance) -> float:
        line = bent(STRAIGHT, compliance, 600.0, 40.0)
        return -float(np.interp(150.0, line[:, 0], line[:, 1]))

    deep = Compliance(50.0, 0.0, EVEN.places_um, EVEN.softness)
    x = 200.0 / 650.0
    assert at_150(deep) == pytest.approx(40.0 * x * x * (3.0 - x) / 2.0, rel=0.01)
    turning = Compliance(0.0, 1e6, EVEN.places_um, EVEN.softness)
    assert at_150(turning) == pytest.approx(10.0, rel=0.02)
    assert at_150(EVEN) < at_150(deep) < at_150(turning)


def test_a_soft_place_is_a_kink() -> None:
    places = np.linspace(0.0, 1200.0, 601)
    soft = Compliance(0.0, 0.0, places, 1.0 + 500.0 * (np.abs(places - 300.0) < 12.0))
    line = bent(STRAIGHT, soft, 600.0, 30.0)
    assert -np.interp([200.0, 450.0], line[:, 0], line[:, 1]) == pytest.approx([0.0, 15.0], abs=1.5)


@pytest.mark.parametrize("turned", [0.5, -0.5])
def test_a_curled_fibre_keeps_its_length_and_is_bent_at_the_probe(turned: float) -> None:
    along = np.linspace(0.0, 900.0, 120)
    heading = turned * along / 900.0
    middle = 0.5 * (heading[1:] + heading[:-1])
    step = np.diff(along)
    free = np.column_stack(
        [
            np.concatenate([[0.0], np.cumsum(np.cos(middle) * step)]),
            np.concatenate([[0.0], np.cumsum(np.sin(middle) * step)]),
        ]
    )
    line = bent(free, Compliance(20.0, 0.0, EVEN.places_um, EVEN.softness), 600.0, 40.0)
    before = float(np.interp(600.0, free[:, 0], free[:, 1]))
    assert before - np.interp(600.0, line[:, 0], line[:, 1]) == pytest.approx(40.0, abs=0.05)
    assert arc_length(line) == pytest.approx(900.0, rel=1e-3)
    assert math.radians(heading_deg(line, -1)) == pytest.approx(turned - 1.5 * 40 / 600, abs=0.03)


def test_a_fibre_between_two_grippers_is_level_at_both_and_smooth_at_the_probe() -> None:
    line = bridge(300.0, 20.0, 1000.0)
    assert line[0] == pytest.approx([0.0, 0.0])
    assert line[-1] == pytest.approx([1000.0, 0.0])
    assert np.interp(300.0, line[:, 0], line[:, 1]) == pytest.approx(20.0)
    slopes = np.diff(line[:, 1]) / np.diff(line[:, 0])
    assert abs(slopes[0]) < 0.01
    assert abs(slopes[-1]) < 0.01
    assert np.abs(np.diff(slopes)).max() < 0.02
