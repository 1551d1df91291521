"""Whatever a procedure is made of, nothing begins after its end and all that began has ended."""

from collections import defaultdict
from dataclasses import dataclass

from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from cosmic.autonomy.procedures.combinators import (
    Fallback,
    Guard,
    Holding,
    Parallel,
    Repeat,
    Retry,
    Role,
    Sequence,
)
from cosmic.autonomy.procedures.failures import ProcedureAborted, ProcedureStopped
from cosmic.autonomy.procedures.operation import SAFE_POINT
from cosmic.autonomy.procedures.procedure import Part
from cosmic.autonomy.procedures.tree import ENDS, NodeEvent, NodeState
from cosmic.autonomy.procedures.waits import Resource
from cosmic.frame.errors import CosmicError
from unit.autonomy.procedures.parts import MOVE, Op, Work, missed, run_of, stop

STEPS = st.lists(st.sampled_from([MOVE, 0.0, 0.3, 1.0, SAFE_POINT]), max_size=3)
ERRORS = st.sampled_from([missed, missed, missed, stop])


@dataclass
class Rounds:
    """Ends a repeat after some rounds."""

    left: int

    def over(self, _work: Work) -> bool:
        self.left -= 1
        return self.left < 0


@dataclass
class Looks:
    """Holds for so many looks."""

    left: int

    def hold(self, _work: Work) -> bool:
        self.left -= 1
        return self.left > 0


OPERATIONS = st.builds(
    Op,
    st.sampled_from("abcdef"),
    steps=STEPS,
    looks=st.none() | STEPS,
    undoes=st.none() | STEPS,
    fails_in=st.sampled_from(["", "", "precondition", "run", "verify", "move", "undo"]),
    times=st.integers(1, 3),
    error=ERRORS,
)


PROBE = Resource("the probe")
NEEDS = st.sampled_from([(), (PROBE,)]).map(lambda some: lambda _work: some)


def several(parts: st.SearchStrategy[Part[Work]]) -> st.SearchStrategy[Part[Work]]:
    some = st.lists(parts, min_size=1, max_size=3)
    guards = st.builds(Looks, st.integers(0, 40)).map(lambda looks: looks.hold)
    rounds = st.builds(Rounds, st.integers(0, 3)).map(lambda each: each.over)
    return st.one_of(
        some.map(lambda them: Sequence("sequence", *them)),
        some.map(lambda them: Fallback("fallback", *them)),
        some.map(lambda them: Parallel("parallel", *them)),
        st.builds(Retry, parts, st.integers(1, 3), between=st.none() | OPERATIONS),
        st.builds(Guard, parts, guards, st.just("unsafe")),
        st.builds(Repeat, parts, rounds),
        st.builds(Holding, parts, NEEDS, leaving=st.none() | OPERATIONS, name=st.just("holding")),
        st.builds(Role, st.just("hand"), parts, st.just(lambda work: work)),
    )


TREES: st.SearchStrategy[Part[Work]] = st.recursive(OPERATIONS, several, max_leaves=8)


@given(tree=TREES, abort_at=st.none() | st.integers(0, 30))
@hypothesis_settings(max_examples=120)
def test_what_began_has_ended_once_and_nothing_begins_after_the_end(
    tree: Part[Work], abort_at: int | None
) -> None:
    run = run_of(tree)
    events: list[NodeEvent] = []
    run.subscribe(events.append)
    marks: list[int] = []

    def at(number: int) -> None:
        if number == abort_at:
            marks.append(len(events))
            run.abort()

    run.work.at_point = at
    try:
        run.run_here()
    except ProcedureAborted:
        assert marks
        after = {event.state for event in events[marks[0] :]}
        assert after <= {NodeState.ENDED, NodeState.NOT_UNDONE}
    except ProcedureStopped:
        assert run.state == "failed"
    except CosmicError:
        assert run.state == "failed"
    else:
        assert run.state == "done"
    assert run.over
    assert not run.work.moving
    assert PROBE.free
    assert_each_begun_one_ended_once(events)
    undone = (NodeState.UNDONE, NodeState.NOT_UNDONE)
    assert run.tree.state in ENDS or (isinstance(tree, Op) and run.tree.state in undone)
    assert events[-1].path == () or events[-1].state in undone
    times = [event.ended_s for event in events if event.state in ENDS]
    assert times == sorted(times, key=lambda each: each or 0.0)


def assert_each_begun_one_ended_once(events: list[NodeEvent]) -> None:
    under_way: dict[tuple[int, ...], bool] = defaultdict(bool)
    ended = False
    for event in events:
        if event.state is NodeState.RUNNING:
            assert not ended, f"{event.path} begins after the end"
            assert not under_way[event.path]
            assert all(under_way[event.path[:depth]] for depth in range(len(event.path)))
            under_way[event.path] = True
        elif event.state in ENDS:
            assert under_way[event.path]
            under_way[event.path] = False
            assert not any(
                on and path[: len(event.path)] == event.path for path, on in under_way.items()
            ), "a part ends after those below it"
            ended = ended or event.path == ()
        elif event.state in (NodeState.VERIFYING, NodeState.QUEUED, NodeState.HOLDING):
            assert under_way[event.path]
        else:
            assert not under_way[event.path], "only what has ended is undone"
    assert not any(under_way.values())
