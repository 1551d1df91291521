"""The plate's frame, and which turn of the table brings a fibre to the jaws."""

import math

import numpy as np
import pytest

from cosmic.autonomy.handling.plate import (
    Candidate,
    Jaws,
    Neighbours,
    PlateFrame,
    Reach,
    along,
    reaches,
    within_um,
)
from cosmic.autonomy.handling.settings import GraspSettings


def straight(x_um: float, y_um: float, angle_deg: float, length_um: float = 1200.0) -> Candidate:
    way = np.linspace(-length_um / 2.0, length_um / 2.0, 61)
    angle = math.radians(angle_deg)
    line = np.column_stack([x_um + way * math.cos(angle), y_um + way * math.sin(angle)])
    return Candidate(line, length_um, 30.0, 0.0, 60.0)


def found(
    candidate: Candidate,
    *others: Candidate,
    jaws: Jaws | None = None,
    now_deg: float = 0.0,
    frame: PlateFrame | None = None,
) -> list[Reach]:
    neighbours = Neighbours([each.line_um for each in others])
    return reaches(
        candidate, frame or PlateFrame(), jaws or Jaws(), GraspSettings(), neighbours, now_deg
    )


def test_places_go_to_the_plate_and_back_at_any_angle():
    frame = PlateFrame((12.0, -7.0))
    places = np.array([[100.0, 200.0], [-3000.0, 50.0]])
    for angle in (-150.0, 0.0, 33.0):
        there = frame.on_plate(places, angle)
        assert frame.on_platform(there, angle) == pytest.approx(places)
    turned = frame.on_platform(frame.on_plate(np.array([[112.0, -7.0]]), 0.0), 90.0)
    assert turned[0] == pytest.approx([12.0, 93.0]), "the table turns against the clock"


@pytest.mark.parametrize("forward", [1.0, -1.0])
@pytest.mark.parametrize("angle_deg", [-70.0, 0.0, 12.0, 140.0])
def test_the_turned_fibre_lies_along_the_jaws_with_its_free_end_ahead(
    forward: float, angle_deg: float
):
    frame = PlateFrame((5.0, 3.0))
    for reach in found(straight(300.0, -200.0, angle_deg), jaws=Jaws(forward), frame=frame):
        assert np.ptp(reach.line_um[:, 1]) < 1e-6
        assert np.all(np.diff(reach.line_um[:, 0]) * forward > 0.0)
        assert reach.tip_um == pytest.approx(tuple(along(reach.line_um, 250.0)))


def test_the_smaller_turn_comes_first():
    for now_deg, nearer in ((-50.0, -60.0), (110.0, 120.0)):
        first, second = found(straight(200.0, 100.0, 60.0), now_deg=now_deg)
        assert first.angle_deg == pytest.approx(nearer)
        assert abs(second.angle_deg - first.angle_deg) == pytest.approx(180.0)


def test_no_path_leads_where_the_gripper_or_the_table_cannot_go():
    both = found(straight(3000.0, 0.0, 0.0))
    assert [each.tip_um[0] < 0.0 for each in both] == [], "180 degrees are too far for the table"
    assert len(found(straight(3000.0, 0.0, 40.0))) == 1, "as it lies its end is out of reach"
    assert found(straight(0.0, 5000.0, 0.0), jaws=Jaws()) == []


def test_a_fibre_is_not_taken_where_another_would_be_grasped_as_well():
    one = straight(0.0, 0.0, 0.0)
    assert found(one, straight(-300.0, 100.0, 5.0, 400.0), straight(300.0, 100.0, 0.0, 400.0)) == []


def test_ways_with_nothing_under_the_jaws_come_before_smaller_turns():
    one, behind = straight(0.0, 0.0, 60.0), straight(-1500.0, -2598.0, 130.0)
    ways = found(one, behind)
    assert [each.under for each in ways] == [0, 1]
    assert [each.angle_deg for each in ways] == pytest.approx([120.0, -60.0])


CLIP = np.array([[10e3, -4e3], [12e3, -4e3], [12e3, 4e3], [10e3, 4e3]])
"""Stands on the plate, to the right of its middle where the table is at zero."""


@pytest.mark.parametrize("forward", [1.0, -1.0])
def test_no_path_leads_the_jaws_over_what_stands_on_the_plate(forward: float) -> None:
    settings, jaws = GraspSettings(reach_x_um=8000.0), Jaws(forward)
    free, kept = 0, 0
    for x_um in range(-6000, 6001, 1500):
        for angle_deg in range(-90, 90, 15):
            for clip in ((), (CLIP,)):
                ways = reaches(
                    straight(x_um, 500.0, angle_deg),
                    PlateFrame(),
                    jaws,
                    settings,
                    Neighbours(obstacles_um=clip),
                    0.0,
                )
                free, kept = (free, kept + len(ways)) if clip else (free + len(ways), kept)
                assert not clip or not any(lies_under(each, forward) for each in ways)
    assert 0.5 * free < kept < free, "some are left out, most are not"


def lies_under(reach: Reach, forward: float) -> bool:
    """Return whether a point of the clip lies under the jaws, as wide open as they go."""
    grid = np.array(
        [[x, y] for x in np.linspace(10e3, 12e3, 21) for y in np.linspace(-4e3, 4e3, 81)]
    )
    off = PlateFrame().on_platform(grid, reach.angle_deg) - np.array(reach.tip_um)
    ahead, aside = off[:, 0] * forward, np.abs(off[:, 1])
    return bool(((ahead < 0.0) & (ahead > -6000.0) & (aside < 600.0)).any())


def test_lines_are_near_to_each_other_where_any_of_their_points_are() -> None:
    random = np.random.default_rng(4)
    agreed = set()
    for _ in range(200):
        line, other = (
            straight(*random.uniform(-700.0, 700.0, 2), random.uniform(0.0, 180.0)).line_um
            for _ in range(2)
        )
        nearest = min(math.dist(one, another) for one in line for another in other)
        for um in (60.0, 300.0):
            assert within_um(line, other, um) == within_um(other, line, um) == (nearest < um)
            agreed.add((um, nearest < um))
    assert len(agreed) == 4, "each answer was wanted at each distance"
