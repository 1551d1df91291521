"""What the planner refuses, what it says then, and how long it takes over it."""

import math
import time
from dataclasses import replace

import pytest

from cosmic.frame.errors import LimitError, MoveRefused, UnknownAxisError
from cosmic.frame.verdict import Reason
from cosmic.mico.core.collision.answer import SweepAnswer
from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.planner import plan_path
from cosmic.mico.core.planning.problem import NoPath, Problem
from unit.mico.planning_problems import LIMITS, arms, at, certified, corners, solved

WALLED = {**LIMITS, "left.x": (2400.0, 4000.0), "left.z": (-40.0, 40.0)}
"""The left arm cannot get out from beside the right one."""
SIDE_TO_SIDE = Problem(at(left_x=2500.0, left_y=-600.0), {"left.y": 600.0}, WALLED, budget_s=0.3)


def refused(problem: Problem, model: SceneModel | None = None) -> NoPath:
    answer = plan_path(Sweep(model or arms()), problem)
    assert isinstance(answer, NoPath), answer
    return answer


def test_where_there_is_no_path_it_says_what_blocks_and_how_far_the_straight_one_goes() -> None:
    answer = refused(SIDE_TO_SIDE)
    assert answer.blocking is not None
    assert answer.blocking.bodies == ("left_z", "right_z")
    assert "left_z and right_z" in answer.text
    assert "in the time given" in answer.text
    assert -600.0 < answer.best["left.y"] < -104.0


def test_a_search_keeps_to_its_time() -> None:
    began_s = time.monotonic()
    refused(replace(SIDE_TO_SIDE, budget_s=0.2))
    assert time.monotonic() - began_s < 1.5


def test_a_goal_that_touches_something_is_refused_at_once() -> None:
    began_s = time.monotonic()
    answer = refused(Problem(at(), {"left.x": 2500.0}, LIMITS, budget_s=30.0))
    assert time.monotonic() - began_s < 5.0
    assert "the goal itself" in answer.text
    assert answer.blocking is not None
    assert answer.blocking.bodies == ("left_z", "right_z")


def test_a_goal_inside_the_margin_is_refused_though_nothing_touches() -> None:
    answer = refused(Problem(at(), {"left.x": 1997.0}, LIMITS))
    assert answer.blocking is not None
    assert answer.blocking.distance_um == pytest.approx(3.0, abs=0.01)


def test_a_goal_within_the_overshoot_of_the_margin_is_reached_by_another_axis() -> None:
    model = arms()
    problem = Problem(at(left_z=500.0), {"left.x": 1994.5, "left.z": 0.0}, LIMITS)
    found = solved(Sweep(model), problem)
    assert set(found.segments[-1].targets) == {"left.z"}
    assert corners(found)[-1]["left.x"] == 1994.5


def test_a_start_inside_the_margin_is_left_first_by_moving_apart() -> None:
    model = arms()
    start = at(left_x=1997.0)
    found = solved(Sweep(model), Problem(start, {"left.x": 1500.0, "left.y": 900.0}, LIMITS))
    assert certified(model, found)
    after = corners(found)[1]
    assert after["left.x"] <= 1994.0 or abs(after["left.y"]) > 100.0


def test_a_start_inside_the_margin_is_not_left_by_coming_closer() -> None:
    model = arms()
    start = at(left_x=1997.0)
    goal = {"left.x": 2500.0, "left.y": -300.0}
    found = solved(Sweep(model), Problem(start, goal, LIMITS, budget_s=20.0))
    assert corners(found)[1]["left.x"] <= 1997.0
    assert certified(model, found)


def test_a_start_without_a_way_out_says_what_is_too_close() -> None:
    start = at(left_z=-1500.0, left_x=0.0)
    limits = {**LIMITS, "left.z": (-1520.0, -1480.0)}
    answer = refused(Problem(start, {"left.x": 100.0, "left.z": -1490.0}, limits))
    assert "goal" in answer.text
    assert answer.blocking is not None
    shut_in = {axis: (place - 1.0, place + 1.0) for axis, place in at(left_x=1997.0).items()}
    there = refused(Problem(at(left_x=1997.0), {"left.x": 1996.5}, shut_in))
    assert "margin" in there.text


def test_an_axis_that_holds_a_span_is_kept_clear_of_all_over_it() -> None:
    others = {"right.y": AxisSpan(-2000.0, 2000.0, moving=True)}
    start = {axis: place for axis, place in at(left_y=-600.0).items() if axis != "right.y"}
    free = Problem(start, {"left.x": 2500.0}, WALLED | {"left.x": (0.0, 4000.0)}, budget_s=0.3)
    assert solved(Sweep(arms()), replace(free, others={"right.y": AxisSpan(0.0, 0.0, 0.0)}))
    assert "goal" in refused(replace(free, others=others)).text


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none_are_refused(wrong: float) -> None:
    sweep = Sweep(arms())
    for problem in (
        Problem(at(), {"left.x": wrong}, LIMITS),
        Problem(at(left_x=wrong), {"left.x": 0.0}, LIMITS),
        Problem(at(), {"left.x": 100.0}, LIMITS, budget_s=wrong),
    ):
        with pytest.raises(MoveRefused) as caught:
            plan_path(sweep, problem)
        assert caught.value.verdict.reason is Reason.NOT_FINITE


@pytest.mark.parametrize("budget_s", [0.0, -1.0, 3600.1, 1e9])
def test_a_time_that_nobody_waits_is_refused(budget_s: float) -> None:
    problem = Problem(at(), {"left.x": 100.0}, LIMITS, budget_s=budget_s)
    with pytest.raises(MoveRefused, match="not a time to plan a path in; give up to 3600 s"):
        plan_path(Sweep(arms()), problem)


def test_limits_that_are_no_numbers_are_refused() -> None:
    for low, high in ((math.nan, 100.0), (-100.0, math.nan), (100.0, -100.0)):
        with pytest.raises(LimitError):
            plan_path(Sweep(arms()), Problem(at(), {"left.x": 0.5}, {"left.x": (low, high)}))


def test_a_held_span_that_is_no_interval_is_refused_and_never_planned_past() -> None:
    start = {axis: place for axis, place in at().items() if axis != "right.y"}
    others = {"right.y": AxisSpan(math.nan, 0.0)}
    with pytest.raises(MoveRefused) as caught:
        plan_path(Sweep(arms()), Problem(start, {"left.x": 100.0}, LIMITS, others))
    assert caught.value.verdict.reason is Reason.NO_ANSWER


def test_a_target_outside_its_limits_is_refused_with_the_limit() -> None:
    with pytest.raises(LimitError) as caught:
        plan_path(Sweep(arms()), Problem(at(), {"left.x": 4000.5}, LIMITS))
    assert caught.value.verdict.limit == 4000.0


def test_an_unknown_axis_is_refused_by_name() -> None:
    with pytest.raises(UnknownAxisError, match=r"middle\.x"):
        plan_path(Sweep(arms()), Problem({**at(), "middle.x": 0.0}, {"middle.x": 1.0}, LIMITS))


def test_an_axis_that_stands_nowhere_known_is_refused() -> None:
    with pytest.raises(MoveRefused) as caught:
        plan_path(Sweep(arms()), Problem({}, {"left.x": 1.0}, LIMITS))
    assert caught.value.verdict.reason is Reason.POSITION_UNKNOWN


class Failing(Sweep):
    """A gate that breaks after some questions."""

    def __init__(self, model: SceneModel, good: int) -> None:
        super().__init__(model)
        self._left = good

    def check(self, spans: object, ignored: object = frozenset()) -> SweepAnswer:
        self._left -= 1
        if self._left < 0:
            raise RuntimeError("broken in the middle")
        return super().check(spans, ignored)  # type: ignore[arg-type]


class Forgetful(Sweep):
    """A gate that refuses what it has let pass before."""

    def __init__(self, model: SceneModel) -> None:
        super().__init__(model)
        self._passed: set[str] = set()

    def check(self, spans: object, ignored: object = frozenset()) -> SweepAnswer:
        answer = super().check(spans, ignored)  # type: ignore[arg-type]
        if answer.clear and repr(spans) in self._passed:
            nearest = self.nearest(dict.fromkeys(self.model.axes, 0.0))
            return SweepAnswer(clear=False, approach=nearest)
        self._passed.add(repr(spans))
        return answer


def test_every_leg_of_a_plan_is_asked_about_once_more_before_it_is_reported() -> None:
    problem = Problem(at(), {"left.x": 1000.0, "left.y": 500.0}, LIMITS)
    assert isinstance(plan_path(Forgetful(arms()), problem), NoPath)


@pytest.mark.parametrize("good", [0, 1, 5, 40, 60, 80])
def test_a_gate_that_breaks_in_the_middle_never_leads_to_a_plan(good: int) -> None:
    problem = replace(SIDE_TO_SIDE, limits=LIMITS, budget_s=20.0)
    with pytest.raises(RuntimeError, match="broken in the middle"):
        plan_path(Failing(arms(lift=None), good), problem)
