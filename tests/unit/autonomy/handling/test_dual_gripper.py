"""Two arms on one plate: each on its own side, and what is whose."""

import math
from typing import Any

import numpy as np
import pytest
from typing_extensions import override

from cosmic.autonomy.handling.context import Calibration, HandlingContext, SharedWorkspace
from cosmic.autonomy.handling.dual_gripper import (
    NOT_FREE,
    CarryInTurn,
    ChooseInTurn,
    EndRound,
    GoOn,
    hidden,
    over,
    stands_aside,
)
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import Candidate, Jaws, PlateFrame, Reach
from cosmic.autonomy.handling.put_away import NoteFailure
from cosmic.autonomy.handling.settings import HandlingSettings, of_arm
from cosmic.autonomy.handling.survey import NONE_LEFT, approaches_of
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.clock import ManualClock
from cosmic.vico.core.tool_settings import ToolSettings

SETTINGS = HandlingSettings()


def tool(name: str, forward: tuple[float, float]) -> ToolSettings:
    return ToolSettings(
        name=name,
        title=name,
        x_axis=f"{name}.x",
        y_axis=f"{name}.y",
        z_axis=f"{name}.z" if name != "probe" else "",
        tip_um=(0.0, 0.0, 1500.0),
        forward=forward,
        width_um=100.0,
    )


TOOLS = {
    "left": tool("left", (1.0, 0.0)),
    "right": tool("right", (-1.0, 0.0)),
    "probe": tool("probe", (0.0, -1.0)),
}


class Arm(HandlingContext):
    """An arm at a plate, with nothing that could move."""

    def __init__(self, name: str, shared: SharedWorkspace) -> None:
        none: Any = None
        settings = of_arm(SETTINGS, name)
        super().__init__(none, none, none, settings, ManualClock(), none, Calibration(), shared)
        self.tip_x_um = 0.0
        shared.arms[name] = self

    @override
    def tool(self, name: str) -> ToolSettings:
        return TOOLS[name]

    @override
    def tip_now(self, tool: ToolSettings) -> tuple[float, float]:
        return self.tip_x_um, 0.0

    @property
    @override
    def table_deg(self) -> float:
        return 0.0


def straight(x_um: float, y_um: float, angle_deg: float = 60.0) -> Candidate:
    way = np.linspace(-650.0, 650.0, 61)
    angle = math.radians(angle_deg)
    line = np.column_stack([x_um + way * math.cos(angle), y_um + way * math.sin(angle)])
    return Candidate(line, 1300.0, 30.0, 0.0, 60.0)


def arms(*candidates: Candidate) -> tuple[Arm, Arm]:
    shared = SharedWorkspace(candidates=list(candidates), surveyed=True)
    shared.lines_um = [each.line_um for each in candidates]
    return Arm("left", shared), Arm("right", shared)


def chosen(arm: Arm) -> HeldFibre:
    for _ in ChooseInTurn().run(arm):
        pass
    return arm.held_fibre()


def end_round(arm: Arm) -> None:
    for _ in EndRound().run(arm):
        pass


def test_each_arm_stays_on_its_own_side_and_both_are_mirrored() -> None:
    for x_um in (-2500.0, -900.0, 0.0, 700.0, 2500.0):
        left, right = arms(straight(x_um, -800.0))
        approaches = {
            arm: approaches_of(arm, arm.shared.candidates[0], 0.0) for arm in (left, right)
        }
        assert all(way.tip_um[0] <= -250.0 for way in approaches[left])
        assert all(way.tip_um[0] >= 250.0 for way in approaches[right])
        assert approaches[left], "each can be had by one of its ends"
        mirrored = {tuple(np.round(np.negative(way.tip_um), 6)) for way in approaches[right]}
        assert {tuple(np.round(way.tip_um, 6)) for way in approaches[left]} == mirrored
        for way in approaches[left]:
            assert np.all(np.diff(way.line_um[:, 0]) > 0.0)
        for way in approaches[right]:
            assert np.all(np.diff(way.line_um[:, 0]) < 0.0)


def test_before_the_probe_the_arms_are_apart_and_let_go_from_where_they_travel() -> None:
    left, right = arms()
    places = [arm.settings.places.hold_x_um * arm.jaws.forward for arm in (left, right)]
    assert places == [-250.0, 250.0]
    assert (left.settings.gripper, left.settings.other) == ("left", "right")
    assert (right.settings.gripper, right.settings.other) == ("right", "left")
    for arm in (left, right):
        assert arm.settings.places.bin_um >= arm.settings.places.travel_um


def test_the_free_ends_of_the_longest_fibres_do_not_meet() -> None:
    settings = of_arm(SETTINGS, "left")
    free_um = settings.grasp.longest_um - settings.grasp.inside_um
    at_probe_um = settings.places.hold_x_um + free_um
    drawn_back_um = -(settings.places.hold_x_um - settings.pair.behind_um) - free_um
    assert at_probe_um <= drawn_back_um


def test_what_lies_on_the_plate_is_shared_and_what_is_held_is_not() -> None:
    left, right = arms(straight(-2000.0, -900.0), straight(2000.0, -2000.0))
    first, second = chosen(left), chosen(right)
    assert left.shared.candidates == right.shared.candidates == []
    assert [first.number, second.number] == [1, 2]
    assert [first.arm, second.arm] == ["left", "right"]
    assert left.fibre is first
    assert right.fibre is second
    right.failures.append(("look", OperationFailed("lost", "gone")))
    assert not left.failures
    right.calibration.frame = PlateFrame((3.0, 4.0))
    assert left.calibration.frame == PlateFrame()


@pytest.mark.parametrize("name", ["left", "right"])
def test_a_fibre_that_the_other_arm_may_hide_is_chosen_last(name: str) -> None:
    side = -1.0 if name == "left" else 1.0
    # Along the jaws of both already, so that there is one way only.
    near, far = straight(side * 1800.0, 500.0, 0.0), straight(side * 1800.0, -3000.0, 150.0)
    left, right = arms(near, far)
    arm = left if name == "left" else right
    approaches = {each: approaches_of(arm, each, 0.0) for each in (far, near)}
    assert [hidden(arm, way) for way in approaches[near]] == [True]
    assert not all(hidden(arm, way) for way in approaches[far])
    assert approaches[near][0].angle_deg == 0.0, "it would be the smaller turn"
    assert chosen(arm).reach.candidate is far
    assert chosen(arm).reach.candidate is near


def test_an_arm_begins_no_further_fibre_once_it_is_enough_or_the_plate_must_be_seen_again() -> None:
    left, right = arms(straight(-2000.0, -900.0))
    assert not over(left)
    assert not over(right)
    left.shared.enough = lambda: True
    assert over(left)
    left.shared.enough = lambda: False
    right.shared.surveyed = False
    assert over(left), "the other has lost one somewhere on the plate"
    right.shared.surveyed = True
    chosen(right)
    assert over(left), "none is left"
    with pytest.raises(OperationFailed, match="the other gripper has taken the last one"):
        chosen(left)


def test_an_arm_counts_from_when_it_begins_until_its_fibre_is_done_with() -> None:
    left, right = arms(straight(-2000.0, -900.0), straight(2000.0, -2000.0))
    # One fibre is wanted: who has begun with one, though it waits for the plate, is enough.
    left.shared.enough = lambda: bool(left.shared.seeking)
    assert not over(left)
    assert over(right)
    fibre = chosen(left)
    assert over(right)
    left.shared.done_with(fibre)
    assert left.shared.finished == [fibre]
    assert not over(right), "it did not become a good one, say"
    assert over(left)
    assert not over(right), "its own beginning does not keep an arm from going on"


def test_an_arm_that_cannot_put_away_three_in_a_row_stands_aside_and_the_other_goes_on() -> None:
    left, right = arms(*(straight(-2000.0, y_um) for y_um in (-900.0, -1800.0, -2700.0)))
    for _ in range(SETTINGS.pair.stuck):
        assert not stands_aside(left)
        chosen(left)
        for _ in GoOn().run(left):
            pass
        assert left.fibre is None
        left.shared.surveyed = True
    assert [each.stuck for each in left.shared.finished] == [True] * 3
    left.shared.candidates = [straight(-2000.0, 900.0)]
    assert over(left)
    assert not over(right)
    end_round(left)
    right.shared.finished += [
        HeldFibre(9, each.reach, arm="right", stuck=True) for each in left.shared.finished
    ]
    with pytest.raises(OperationFailed, match="both grippers failed to release") as caught:
        end_round(left)
    assert caught.value.cause == NOT_FREE


def test_after_a_round_with_fibres_it_is_looked_again_and_after_one_without_none_is_left() -> None:
    left, _ = arms(straight(-2000.0, -900.0))
    chosen(left)
    end_round(left)
    assert not left.shared.surveyed
    left.shared.surveyed, left.shared.since_survey = True, 0
    with pytest.raises(OperationFailed) as caught:
        end_round(left)
    assert caught.value.cause == NONE_LEFT


@pytest.mark.parametrize(("x_um", "in_the_way"), [(250.0, True), (2000.0, True), (4250.0, False)])
def test_nobody_comes_to_the_probe_while_the_other_still_holds_a_fibre_there(
    x_um: float, in_the_way: bool
) -> None:
    left, right = arms()
    line = np.zeros((2, 2))
    right.fibre = HeldFibre(1, Reach(straight(0.0, 0.0), 0.0, line, (0.0, 0.0)), held=True)
    right.tip_x_um = x_um
    if in_the_way:
        with pytest.raises(OperationFailed, match="still holds a fibre near the probe"):
            CarryInTurn().precondition(left)
        right.fibre.held = False
    CarryInTurn().precondition(left)


def test_a_fibre_given_up_before_the_probe_is_noted_with_that_and_not_with_an_earlier_failure() -> (
    None
):
    left, right = arms()
    line = np.zeros((2, 2))
    for arm in (left, right):
        arm.fibre = HeldFibre(1, Reach(straight(0.0, 0.0), 0.0, line, (0.0, 0.0)), held=True)
    right.tip_x_um = 250.0
    left.failures.append(("close", OperationFailed("missed grasp", "mended by another try")))
    with pytest.raises(OperationFailed):
        CarryInTurn().precondition(left)
    list(NoteFailure().run(left))
    assert left.fibre is not None
    assert left.fibre.failure is not None
    assert left.fibre.failure.cause == "other gripper in the way"


def test_jaws_know_which_way_they_point() -> None:
    left, right = arms()
    assert [left.jaws.forward, right.jaws.forward] == [1.0, -1.0]
    assert isinstance(left.jaws, Jaws)
