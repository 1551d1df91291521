"""Branches that share places: one at a time, in order, and nobody waits for ever."""

from collections.abc import Callable

import pytest

from cosmic.autonomy.procedures.combinators import (
    Fallback,
    Holding,
    Parallel,
    Repeat,
    Role,
    Sequence,
)
from cosmic.autonomy.procedures.failures import ProcedureStopped
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.procedures.procedure import Part
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.procedures.tree import NodeEvent, NodeState
from cosmic.autonomy.procedures.waits import Resource
from unit.autonomy.procedures.parts import MOVE, Op, Work, done, run_of, stop


def of(*resources: Resource) -> Callable[[Work], tuple[Resource, ...]]:
    return lambda _work: resources


def times(run: ProcedureRun[Work]) -> dict[str, tuple[float, float]]:
    return {
        each.name: (each.event.started_s or 0.0, each.event.ended_s or 0.0)
        for each in run.tree.walk()
    }


def test_two_branches_use_a_position_one_after_the_other_and_do_the_rest_side_by_side() -> None:
    probe = Resource("the probe")
    hands = [
        Sequence(f"hand {name}", Op(f"fetch {name}"), Holding(Op(name), of(probe), name="measure"))
        for name in "ab"
    ]
    run = run_of(Parallel("both", *hands))
    run.run_here()
    when = times(run)
    assert when["fetch a"][0] == when["fetch b"][0]
    assert when["a"][1] <= when["b"][0]
    assert run.work.clock.now_s() == pytest.approx(3.0, abs=0.1)


def test_who_waits_for_what_stands_in_the_tree() -> None:
    probe = Resource("the probe")
    run = run_of(
        Parallel(
            "both",
            Holding(Op("a"), of(probe), name="first"),
            Holding(Op("b"), of(probe), name="second"),
        )
    )
    received: list[tuple[str, str]] = []
    waiting: list[NodeEvent] = []

    def note(event: NodeEvent) -> None:
        received.append((event.name, event.text))
        if event.name == "second":
            waiting.append(event)

    run.subscribe(note)
    run.run_here()
    words = [each for each in received if each[1]]
    assert words[:2] == [("first", "has the probe"), ("second", "waits for the probe")]
    assert ("second", "has the probe") in words
    states = [str(each.state) for each in waiting]
    assert states == ["running", "waits its turn", "holds", "done"]
    assert run.tree.children[1].event.text == "", "it waits no longer"


def test_who_came_first_gets_it_first_however_often_others_come_again() -> None:
    probe, left = Resource("the probe"), [4, 4]

    def over(which: int) -> Callable[[Work], bool]:
        def look(_work: Work) -> bool:
            left[which] -= 1
            return left[which] < 0

        return look

    hands: list[Part[Work]] = [
        Repeat(Holding(Op(name), of(probe), name=f"hold {name}"), over(which))
        for which, name in enumerate("ab")
    ]
    run = run_of(Parallel("both", *hands))
    run.run_here()
    assert done(run) == ["a", "b"] * 4


@pytest.mark.parametrize("phase", ["run", "verify", "move"])
def test_a_position_is_left_and_released_where_the_part_failed(phase: str) -> None:
    probe = Resource("the probe")
    bad = Holding(
        Op("push", steps=(MOVE,), fails_in=phase), of(probe), leaving=Op("back"), name="measure"
    )
    after = Holding(Op("again"), of(probe), name="second")
    run = run_of(Sequence("all", Fallback("try", bad, Op("give up")), after))
    run.run_here()
    assert [each for each in done(run) if not each.startswith("see")] == [
        "push",
        "undo push",
        "back",
        "give up",
        "again",
    ]


def test_a_part_fails_as_it_failed_even_where_the_position_could_not_be_left() -> None:
    probe = Resource("the probe")
    bad = Op("push", fails_in="run")
    stuck = Op("back", fails_in="run", error=lambda: OperationFailed("stuck", "it does not move"))
    run = run_of(Holding(bad, of(probe), leaving=stuck, name="measure"))
    with pytest.raises(OperationFailed, match="missed grasp"):
        run.run_here()
    assert probe.free


def test_after_a_stop_nothing_is_left_but_all_is_given_back() -> None:
    probe = Resource("the probe")
    bad = Op("push", steps=(MOVE,), fails_in="move", error=stop)
    other = Holding(Op("b"), of(probe), name="second")
    measure = Holding(bad, of(probe), leaving=Op("back"), name="measure")
    run = run_of(Parallel("both", measure, other))
    with pytest.raises(ProcedureStopped):
        run.run_here()
    assert "back" not in run.work.log
    assert "b" not in run.work.log
    assert probe.free


def test_an_abort_gives_back_what_was_held_and_forgets_who_waited() -> None:
    probe = Resource("the probe")
    run = run_of(
        Parallel(
            "both",
            Holding(Op("a", steps=(MOVE,)), of(probe), name="first"),
            Holding(Op("b"), of(probe), name="second"),
        )
    )
    run.work.at_point = lambda _number: run.abort()
    with pytest.raises(Exception, match="aborted"):
        run.run_here()
    assert probe.free
    assert not run.work.moving


def test_what_is_held_around_a_part_is_its_own_already() -> None:
    probe = Resource("the probe")
    run = run_of(Holding(Holding(Op("a"), of(probe), name="in"), of(probe), name="out"))
    run.run_here()
    assert done(run) == ["a"]
    assert probe.free


def test_several_are_taken_in_the_order_of_their_ranks() -> None:
    plate, probe = Resource("the plate", 0), Resource("the probe", 1)
    both = Holding(Op("a"), of(probe, plate), name="first")
    other = Holding(
        Sequence("more", Op("b"), Holding(Op("c"), of(probe), name="in")), of(plate), name="second"
    )
    run = run_of(Parallel("both", both, other))
    run.run_here()
    assert done(run) == ["a", "b", "c"]


@pytest.mark.defects
def test_taking_things_in_the_wrong_order_is_a_defect_and_not_a_wait_for_ever() -> None:
    plate, probe = Resource("the plate", 0), Resource("the probe", 1)
    inner = Holding(Op("a"), of(plate), name="in")
    run = run_of(Holding(inner, of(probe), name="out"))
    with pytest.raises(OperationFailed, match="the plate must be taken before what is held"):
        run.run_here()
    assert probe.free


def test_a_pause_is_reached_while_one_rests_with_what_the_other_waits_for() -> None:
    probe = Resource("the probe")
    first = Holding(Sequence("a", Op("a1"), Op("a2")), of(probe), name="first")
    run = run_of(Parallel("both", first, Holding(Op("b"), of(probe), name="second")))
    rested: list[str] = []

    def look() -> None:
        if run.state == "paused" and len(rested) < 20:
            rested.extend(done(run)[-1:])
            run.step()

    run.on_change(look)
    run.step()
    run.join()
    assert run.state == "done"
    assert rested[0] == "a1"
    assert done(run) == ["a1", "a2", "b"]


def test_each_role_works_with_its_own_and_is_named_in_all_events() -> None:
    left, right = Work(), Work()
    both = {"left": left, "right": right}

    def work_of(name: str) -> Callable[[Work], Work]:
        return lambda _work: both[name]

    hands = [Role(name, Op(f"grasp {name}", fails_in="run"), work_of(name)) for name in both]
    run = run_of(Sequence("all", *(Fallback("try", hand, Op("go on")) for hand in hands)))
    events: list[NodeEvent] = []
    run.subscribe(events.append)
    run.run_here()
    assert left.log == ["grasp left", "undo grasp left"]
    assert right.log == ["grasp right", "undo grasp right"]
    assert [each for each in done(run) if each != "safe"] == ["go on", "go on"]
    roles = {each.name: each.role for each in events}
    assert roles["grasp left"] == "left"
    assert roles["grasp right"] == "right"
    assert roles["go on"] == ""
    assert {each.event.role for each in run.tree.walk()} == {"", "left", "right"}
    assert NodeState.UNDONE in {each.state for each in events if each.role == "left"}
