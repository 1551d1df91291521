"""Know your stage: what arrivals from both sides say of an axis, by images made up here."""

import math
import tomllib

import numpy as np
import pytest

from cosmic.autonomy.stage_check import Approach, evaluate
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration_fit import Sighting

PIXEL_UM = 2.2
TURN_DEG = 12.0
AXES = ("left.x", "left.y")


def arrivals(
    *, backlash_um: float, scatter_um: float, times: int = 8, skew_deg: float = 0.0
) -> list[Approach]:
    """Return what a camera, turned by 12 degrees, sees of axes with that backlash and scatter."""
    random = np.random.default_rng(5)
    x_way = np.array([math.cos(math.radians(TURN_DEG)), -math.sin(math.radians(TURN_DEG))])
    up = math.radians(TURN_DEG + 90.0 + skew_deg)
    y_way = np.array([math.cos(up), -math.sin(up)])
    found = []
    for number, axis in enumerate(AXES):
        for place in (0, 1):
            for side in (1, -1):
                for _ in range(times):
                    stood = np.array([100.0, -40.0])
                    stood[number] += 50.0 * place
                    tip = stood.copy()
                    tip[number] += -0.5 * side * backlash_um + random.normal(0.0, scatter_um)
                    pixel = 600.0 + (tip[0] * x_way + tip[1] * y_way) / PIXEL_UM
                    seen = Sighting((stood[0], stood[1]), (pixel[0], pixel[1]))
                    found.append(Approach(axis, place, side, seen))
    return found


def test_direction_pixel_size_repeatability_and_backlash_are_found() -> None:
    report = evaluate("left", AXES, arrivals(backlash_um=1.5, scatter_um=0.2))
    x, y = report.axes
    assert (x.axis, y.axis) == AXES
    assert x.direction_deg == pytest.approx(TURN_DEG, abs=0.3)
    assert y.direction_deg == pytest.approx(TURN_DEG + 90.0, abs=0.3)
    for each in (x, y):
        assert each.pixel_um == pytest.approx(PIXEL_UM, rel=0.01)
        assert each.backlash_um == pytest.approx(1.5, abs=0.2)
        assert each.repeatability_um == pytest.approx(0.2, rel=0.4)
        assert each.arrivals == 32
    assert report.angle_deg == pytest.approx(90.0, abs=0.5)


def test_a_good_axis_has_no_backlash_and_an_oblique_one_is_noticed() -> None:
    report = evaluate("left", AXES, arrivals(backlash_um=0.0, scatter_um=0.02, skew_deg=3.0))
    assert all(abs(each.backlash_um) < 0.05 for each in report.axes)
    assert report.angle_deg == pytest.approx(93.0, abs=0.1)


def test_the_report_is_read_by_people_and_by_programs() -> None:
    report = evaluate("left", AXES, arrivals(backlash_um=1.5, scatter_um=0.1))
    assert "left.x: 2.2" in report.text
    assert "backlash +1.5" in report.text
    table = tomllib.loads(report.toml)
    assert table["tool"] == "left"
    assert [each["name"] for each in table["axis"]] == list(AXES)
    assert table["axis"][1]["backlash_um"] == pytest.approx(1.5, abs=0.2)


def test_too_few_arrivals_are_refused() -> None:
    seen = arrivals(backlash_um=1.0, scatter_um=0.1)
    with pytest.raises(NotAvailable, match="too seldom"):
        evaluate("left", AXES, seen[:4])
    with pytest.raises(NotAvailable, match=r"left\.y"):
        evaluate("left", AXES, [e for e in seen if e.axis == "left.x" or e.side == 1])
