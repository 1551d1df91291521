"""`CollisionManager`: verdicts in words, what is left out of the check, and responses."""

import logging
import math
import os
import signal
import sys
from collections.abc import Iterator, Mapping, Set
from dataclasses import replace

import pytest
from typing_extensions import override

from cosmic.frame.errors import NotAvailable, UnknownAxisError
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.core.collision.answer import Approach, SweepAnswer
from cosmic.mico.core.collision.callback import CollisionCallbackBase, Response
from cosmic.mico.core.collision.checker import AxisSpan, Spans
from cosmic.mico.core.collision.clear_travel import clear_travel
from cosmic.mico.core.collision.collision_manager import Answering, CollisionManager
from cosmic.mico.core.collision.helper_link import GateProcess, NoAnswerError
from cosmic.mico.core.collision.model import BodyPair, Contact, SceneModel
from cosmic.mico.core.collision.sweep import Sweep
from unit.mico.rigs import wait_until
from unit.mico.small_scenes import turntable, two_arms

ARMS = ("left_z", "right_z")


class Inside(Answering):
    """Answers in this process; says or raises what a test wants instead."""

    def __init__(self, model: SceneModel) -> None:
        self.sweep = Sweep(model)
        self.instead: SweepAnswer | Exception | None = None
        self.no_free_way = False
        self.checks = 0

    @override
    def start(self) -> None:
        if isinstance(self.instead, Exception):
            raise self.instead

    @override
    def close(self) -> None: ...

    @override
    def check(self, spans: Spans, ignored: Set[BodyPair] = frozenset()) -> SweepAnswer:
        self.checks += 1
        if isinstance(self.instead, Exception):
            raise self.instead
        return self.instead or self.sweep.check(spans, ignored)

    @override
    def check_promptly(
        self, spans: Spans, ignored: Set[BodyPair] = frozenset()
    ) -> SweepAnswer | None:
        return self.check(spans, ignored)

    @override
    def nearest(
        self, positions: Mapping[str, float], ignored: Set[BodyPair] = frozenset()
    ) -> Approach | None:
        return self.sweep.nearest(positions, ignored)

    @override
    def clear_travel(
        self, spans: Spans, axis: str, ignored: Set[BodyPair] = frozenset()
    ) -> float | None:
        if self.no_free_way:
            raise NoAnswerError("it was killed")
        return clear_travel(self.sweep, spans, axis, ignored)


def with_contacts() -> SceneModel:
    touch = Contact("touch", (("right_z", "left_z"),), "the grippers hand a fibre over")
    lay = Contact("lay", (("base", "left_z"), ("base", "right_z")), "a fibre is laid down")
    return replace(two_arms(), contacts=(touch, lay))


@pytest.fixture
def answering() -> Inside:
    return Inside(with_contacts())


@pytest.fixture
def manager(answering: Inside) -> CollisionManager:
    return CollisionManager(with_contacts(), process=answering)


def resting(model: SceneModel | None = None, **positions: float) -> dict[str, AxisSpan]:
    given = {name.replace("_", "."): value for name, value in positions.items()}
    return {
        axis: AxisSpan(given.get(axis, 0.0), given.get(axis, 0.0), given.get(axis, 0.0))
        for axis in (model or two_arms()).axes
    }


def way(start: float, end: float) -> AxisSpan:
    return AxisSpan(min(start, end), max(start, end), start, moving=True)


def ask(manager: CollisionManager, start: float, end: float, axis: str = "left.x") -> MoveVerdict:
    spans = resting(**{axis.replace(".", "_"): start})
    return manager.check({**spans, axis: way(start, end)})


# --- verdicts ---------------------------------------------------------------------------------


def test_a_free_movement_is_allowed_and_not_logged(
    manager: CollisionManager, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    verdict = ask(manager, 0.0, 1000.0)
    assert verdict.allowed
    assert verdict.reason is Reason.ALLOWED
    assert caplog.records == []


def test_a_refusal_says_what_where_how_close_and_what_to_do(manager: CollisionManager) -> None:
    verdict = ask(manager, 0.0, 1998.0)
    assert not verdict.allowed
    assert verdict.reason is Reason.COLLISION
    assert verdict.axis == "left.x"
    assert verdict.bodies == ARMS
    assert verdict.value == 1998.0
    assert verdict.unit == "um"
    assert verdict.limit == pytest.approx(1994.5, abs=0.6)
    assert verdict.clearance_um == pytest.approx(3.75, abs=1.0), "just behind the free part"
    assert verdict.place_um is not None
    assert verdict.place_um[0] == pytest.approx(998.0, abs=1.0)
    assert dict(verdict.pose)["left.x"] == pytest.approx(1996.25, abs=1.0)
    assert str(verdict) == (
        f"left.x: left_z would come within {verdict.clearance_um:.3g} µm of right_z (margin 5 µm) "
        "at (1.00, 0.05, 0.00) mm; "
        f"it may go to {verdict.limit:.1f} µm, or move one of them aside first"
    )


def test_the_travel_reported_is_allowed(manager: CollisionManager) -> None:
    limit = ask(manager, 0.0, 3000.0).limit
    assert limit is not None
    assert ask(manager, 0.0, limit).allowed


def test_the_body_that_moves_is_named_first(manager: CollisionManager) -> None:
    verdict = ask(manager, 0.0, -3000.0, "right.x")
    assert str(verdict).startswith("right.x: right_z would come within")
    assert " of left_z " in str(verdict)


def test_several_axes_are_all_named_and_none_is_blamed(manager: CollisionManager) -> None:
    spans = {**resting(), "left.x": way(0.0, 1500.0), "right.x": way(0.0, -1500.0)}
    verdict = manager.check(spans)
    assert verdict.reason is Reason.COLLISION
    assert verdict.axis == ""
    assert str(verdict).startswith("left.x and right.x: ")
    assert "one axis after the other" in str(verdict)


def test_an_axis_that_was_lost_in_its_movement_is_named_as_what_to_find_first(
    manager: CollisionManager,
) -> None:
    lost = AxisSpan(-math.inf, math.inf, moving=True)
    verdict = manager.check({**resting(), "left.x": lost, "right.x": way(0.0, 10.0)})
    assert verdict.reason is Reason.COLLISION
    assert "nobody knows where left.x is: press Rescan" in str(verdict)
    assert "one axis after the other" not in str(verdict)


def test_a_pair_inside_its_margin_may_only_retreat(manager: CollisionManager) -> None:
    assert ask(manager, 1998.0, 0.0).allowed
    verdict = ask(manager, 1998.0, 1999.0)
    assert verdict.reason is Reason.COLLISION
    assert "already" in str(verdict)
    assert "may only retreat" in str(verdict)
    assert verdict.limit is None


def test_a_turning_axis_is_given_in_degrees() -> None:
    model = turntable()
    manager = CollisionManager(model, process=Inside(model))
    spans = resting(model, left_z=-300.0)
    verdict = manager.check({**spans, "table.rotation": way(90.0, 0.0)})
    assert verdict.reason is Reason.COLLISION
    assert verdict.unit == "deg"
    assert "°" in str(verdict)


def test_a_refusal_stands_when_nobody_knows_how_far_it_may_go(
    manager: CollisionManager, answering: Inside
) -> None:
    answering.no_free_way = True
    verdict = ask(manager, 0.0, 3000.0)
    assert verdict.reason is Reason.COLLISION
    assert verdict.limit is None
    assert str(verdict).endswith("; move one of them aside first")


@pytest.mark.parametrize("failure", [NoAnswerError("it hangs"), ValueError("hm"), MemoryError()])
def test_no_answer_is_a_refusal_that_says_so(
    manager: CollisionManager, answering: Inside, failure: Exception
) -> None:
    answering.instead = failure
    verdict = ask(manager, 0.0, 1.0)
    assert not verdict.allowed
    assert verdict.reason is Reason.NO_ANSWER
    assert "The move was refused." in str(verdict)


def test_an_answer_that_is_neither_clear_nor_names_a_pair_is_a_refusal(
    manager: CollisionManager, answering: Inside
) -> None:
    answering.instead = SweepAnswer(clear="yes")  # type: ignore[arg-type]
    assert ask(manager, 0.0, 1.0).reason is Reason.NO_ANSWER


@pytest.mark.parametrize(
    "span",
    [
        AxisSpan(0.0, float("nan"), 0.0, moving=True),
        AxisSpan(float("nan"), 1.0, 0.0, moving=True),
        AxisSpan(0.0, 1.0, float("nan"), moving=True),
        AxisSpan(1.0, 0.0, 0.0, moving=True),
    ],
)
def test_an_interval_that_is_none_is_not_allowed(manager: CollisionManager, span: AxisSpan) -> None:
    assert not manager.check({**resting(), "left.x": span}).allowed


def test_an_axis_unknown_to_the_scene_cannot_be_checked(manager: CollisionManager) -> None:
    verdict = manager.check({**resting(), "middle.x": way(0.0, 1.0)})
    assert verdict.reason is Reason.NO_ANSWER
    assert "middle.x" in str(verdict)


def test_a_check_that_cannot_start_is_logged_and_raises_nothing(
    manager: CollisionManager, answering: Inside, caplog: pytest.LogCaptureFixture
) -> None:
    answering.instead = NoAnswerError("no memory")
    manager.start()
    assert "every movement is refused" in caplog.text
    assert manager.available


def test_the_nearest_pair_leaves_allowed_contacts_aside(manager: CollisionManager) -> None:
    nearest = manager.nearest({"left.x": 1500.0})
    assert nearest is not None
    assert nearest.bodies == ARMS
    with manager.contact("touch"):
        aside = manager.nearest({"left.x": 1500.0})
    assert aside is not None
    assert aside.bodies != ARMS


# --- axes taken out ---------------------------------------------------------------------------


def test_an_axis_taken_out_is_not_checked_and_everybody_is_notified(
    manager: CollisionManager, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    manager.take_out("left.x", source="window")
    assert manager.taken_out == {"left.x"}
    verdict = ask(manager, 0.0, 3000.0)
    assert verdict.allowed
    assert "left.x: taken out of collision detection" in str(verdict)
    manager.take_in("left.x", source="window")
    assert ask(manager, 0.0, 3000.0).reason is Reason.COLLISION
    assert [(each.levelname, "by window" in each.getMessage()) for each in caplog.records] == [
        ("WARNING", True),
        ("INFO", True),
    ]


def test_others_still_keep_clear_of_an_axis_taken_out(manager: CollisionManager) -> None:
    manager.take_out("left.x")
    assert ask(manager, 0.0, -3000.0, "right.x").reason is Reason.COLLISION
    spans = {**resting(), "left.x": way(0.0, 3000.0), "right.y": way(0.0, 10.0)}
    assert manager.check(spans).reason is Reason.COLLISION


def test_an_axis_that_the_scene_does_not_know_can_be_taken_out(answering: Inside) -> None:
    manager = CollisionManager(two_arms(), process=answering, axes=("left.x", "middle.x"))
    manager.take_out("middle.x")
    assert manager.check({**resting(), "middle.x": way(0.0, 1.0)}).allowed


def test_only_axes_that_exist_can_be_taken_out(manager: CollisionManager) -> None:
    for change in (manager.take_out, manager.take_in):
        with pytest.raises(UnknownAxisError, match=r"left\.x"):
            change("nonsense")
    assert manager.taken_out == frozenset()


# --- contacts ---------------------------------------------------------------------------------


def test_a_contact_is_allowed_only_while_it_is_meant(manager: CollisionManager) -> None:
    with manager.contact("touch"):
        assert manager.allowed_contacts == {"touch"}
        assert ask(manager, 0.0, 3000.0).allowed
        assert ask(manager, 0.0, -1500.0, "left.z").reason is Reason.COLLISION
    assert manager.allowed_contacts == frozenset()
    assert ask(manager, 0.0, 3000.0).reason is Reason.COLLISION


def test_nested_uses_of_a_contact_are_counted(manager: CollisionManager) -> None:
    with manager.contact("touch"):
        with manager.contact("touch"):
            pass
        assert manager.allowed_contacts == {"touch"}
    assert manager.allowed_contacts == frozenset()


def test_a_contact_ends_with_an_error_too(manager: CollisionManager) -> None:
    with pytest.raises(RuntimeError), manager.contact("touch"):
        raise RuntimeError("hm")
    assert manager.allowed_contacts == frozenset()


def test_a_contact_can_be_allowed_until_it_is_forbidden(
    manager: CollisionManager, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    manager.allow_contact("lay")
    manager.allow_contact("lay")
    with manager.contact("lay"):
        pass
    assert manager.allowed_contacts == {"lay"}
    assert ask(manager, 0.0, -1500.0, "left.z").allowed
    manager.forbid_contact("lay")
    assert manager.allowed_contacts == frozenset()
    assert [each.getMessage().split()[-3] for each in caplog.records] == ["allowed", "again"]


def test_forbidding_a_contact_wins_over_those_that_use_it(manager: CollisionManager) -> None:
    with manager.contact("touch"):
        manager.forbid_contact("touch")
        assert ask(manager, 0.0, 3000.0).reason is Reason.COLLISION
    assert manager.allowed_contacts == frozenset()


def test_an_unknown_contact_is_refused_with_those_there_are(manager: CollisionManager) -> None:
    with pytest.raises(NotAvailable, match="touch, lay"):
        manager.allow_contact("nonsense")
    with pytest.raises(NotAvailable, match="touch, lay"):
        manager.forbid_contact("nonsense")
    with pytest.raises(NotAvailable, match="touch, lay"), manager.contact("nonsense"):
        pass


def test_subscribers_hear_of_changes_and_only_of_changes(manager: CollisionManager) -> None:
    heard: list[tuple[frozenset[str], frozenset[str]]] = []

    def broken() -> None:
        raise ValueError("hm")

    manager.subscribe(broken)
    end = manager.subscribe(lambda: heard.append((manager.taken_out, manager.allowed_contacts)))
    manager.take_out("left.x")
    manager.take_out("left.x")
    with manager.contact("touch"), manager.contact("touch"):
        pass
    manager.take_in("left.x")
    end()
    manager.take_out("left.y")
    x, touch, none = frozenset({"left.x"}), frozenset({"touch"}), frozenset[str]()
    assert heard == [(x, none), (x, touch), (x, none), (none, none)]


# --- responses --------------------------------------------------------------------------------


class Recorder(CollisionCallbackBase):
    def __init__(self, answer: Response | Exception | None) -> None:
        self.answer = answer
        self.seen: list[BodyPair] = []

    @override
    def on_contact(self, approach: Approach, spans: Spans) -> Response:
        self.seen.append(approach.bodies)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer  # type: ignore[return-value]


def test_a_pair_can_have_its_own_response(manager: CollisionManager) -> None:
    ignoring = Recorder(Response.IGNORE)
    manager.set_callback(("right_z", "left_z"), ignoring)
    assert ask(manager, 0.0, 3000.0).allowed
    assert ignoring.seen == [ARMS]
    assert ask(manager, 0.0, -1500.0, "left.z").reason is Reason.COLLISION
    manager.set_callback(ARMS, None)
    assert ask(manager, 0.0, 3000.0).reason is Reason.COLLISION


def test_a_pair_ignored_does_not_hide_the_next(manager: CollisionManager) -> None:
    ignoring = Recorder(Response.IGNORE)
    manager.set_callback(ARMS, ignoring)
    lowered = {
        **resting(left_x=2100.0, right_z=-900.0),
        "left.z": way(0.0, -1500.0),
    }
    verdict = manager.check(lowered)
    assert verdict.bodies == ("base", "left_z")


def test_a_default_response_meets_every_pair_once(
    manager: CollisionManager, answering: Inside
) -> None:
    ignoring = Recorder(Response.IGNORE)
    manager.set_default_callback(ignoring)
    assert manager.check({axis: AxisSpan(-3000.0, 3000.0, 0.0, moving=True) for axis in
                          two_arms().axes}).allowed  # fmt: skip
    assert len(set(ignoring.seen)) == len(ignoring.seen) == 3
    assert answering.checks == 4


def test_a_gate_that_names_an_ignored_pair_again_is_no_answer(
    manager: CollisionManager, answering: Inside
) -> None:
    manager.set_default_callback(Recorder(Response.IGNORE))
    point = (0.0, 0.0, 0.0)
    answering.instead = SweepAnswer(clear=False, approach=Approach(ARMS, 0.0, (point, point)))
    assert ask(manager, 0.0, 1.0).reason is Reason.NO_ANSWER


@pytest.mark.parametrize("answer", [ValueError("hm"), None, Response.REFUSE])
def test_a_response_that_fails_is_a_refusal(
    manager: CollisionManager, answer: Response | Exception | None
) -> None:
    manager.set_callback(ARMS, Recorder(answer))
    assert ask(manager, 0.0, 3000.0).reason is Reason.COLLISION


def test_a_pair_that_is_not_watched_has_no_response(manager: CollisionManager) -> None:
    with pytest.raises(NotAvailable, match="nonsense"):
        manager.set_callback(("left_z", "nonsense"), Recorder(Response.IGNORE))


# --- with its process -------------------------------------------------------------------------


@pytest.fixture
def gate() -> Iterator[GateProcess]:
    made = GateProcess(with_contacts())
    yield made
    made.close()


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX are sent")
def test_a_process_that_dies_refuses_until_it_is_back(gate: GateProcess) -> None:
    manager = CollisionManager(with_contacts(), process=gate)
    assert ask(manager, 0.0, 1.0).reason is Reason.NO_ANSWER
    manager.start()
    assert ask(manager, 0.0, 1000.0).allowed
    pid = gate.pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    verdict = ask(manager, 0.0, 1000.0)
    assert verdict.reason is Reason.NO_ANSWER
    assert "restarted" in str(verdict)
    wait_until(lambda: ask(manager, 0.0, 1000.0).allowed, 20.0)
    manager.close()
    assert ask(manager, 0.0, 1000.0).reason is Reason.NO_ANSWER


def test_it_makes_its_process_itself() -> None:
    manager = CollisionManager(with_contacts(), answer_s=2.0)
    manager.start()
    try:
        verdict = ask(manager, 0.0, 3000.0)
        with manager.contact("touch"):
            allowed = ask(manager, 0.0, 3000.0)
        nearest = manager.nearest({})
    finally:
        manager.close()
    assert verdict.bodies == ARMS
    assert allowed.allowed
    assert nearest is not None
