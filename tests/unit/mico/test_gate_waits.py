"""A collision check that is long in coming: what may happen until it answers."""

from contextlib import contextmanager
from threading import Event, Thread

import pytest

import cosmic
from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.network.lease import StationLease
from cosmic.frame.verdict import ALLOWED, Reason, refuse
from cosmic.mico.core.collision.answer import SweepAnswer
from cosmic.mico.core.collision.checker import AxisSpan, CollisionChecker
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.helper_link import LateAnswerError
from cosmic.mico.core.motion import gate as gate_module
from cosmic.mico.core.motion.checks import Request
from cosmic.mico.core.motion.gate import GateQuery
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import listen, mico, wait_until
from unit.mico.small_scenes import two_arms

X, Y = Channel(0, 0), Channel(1, 1)


class Slow(CollisionChecker):
    """Answers yes, once it is let go."""

    available = True

    def __init__(self):
        self.go, self.asked = Event(), []
        self.go.set()

    def check(self, spans, *, advice=True):
        self.asked.append(spans)
        assert self.go.wait(10.0)
        return ALLOWED

    def start(self):
        pass

    def close(self):
        pass


@contextmanager
def waiting(monkeypatch):
    """A platform with a move whose check does not answer yet."""
    monkeypatch.setattr(gate_module, "SOON_S", 0.0)
    with mico(("LLN", "LLN"), watch={"idle_poll_s": 0.1, "stale_s": 1.0}) as (rig, controller):
        manager, checker = rig.application.manager, Slow()
        manager.gate._checker = checker
        checker.go.clear()
        movement = rig["d0.c0"].move_to(50.0, wait=False)
        wait_until(lambda: bool(checker.asked))
        try:
            yield rig, controller, checker, movement
        finally:
            checker.go.set()


def test_a_slow_answer_is_an_answer(monkeypatch):
    with waiting(monkeypatch) as (_, _, checker, movement):
        WALL.sleep(0.2)
        checker.go.set()
        assert movement.wait(2) == 50.0
        assert len(checker.asked) == 1


class Prompt(Slow):
    """Answers at once, and hangs where it is asked to take its time."""

    def __init__(self, verdict=ALLOWED):
        super().__init__()
        self.go.clear()
        self.verdict = verdict

    def check_promptly(self, spans):
        self.prompted = spans
        return self.verdict


@pytest.mark.parametrize("allowed", [True, False])
def test_a_prompt_answer_is_waited_for_in_no_queue(allowed):
    refusal = refuse(Reason.NO_ANSWER, "the collision gate is down")
    with mico(("LLN",)) as (rig, controller):
        checker = Prompt(ALLOWED if allowed else refusal)
        rig.application.manager.gate._checker = checker
        movement = rig["d0.c0"].move_to(50.0, wait=False)
        if allowed:
            assert movement.wait(2) == 50.0
        else:
            assert movement.exception(2).verdict == refusal
        assert checker.prompted["d0.c0"].high == 50.0
        assert not checker.asked
        assert len(controller.of("move_to")) == allowed


def test_an_order_decided_late_does_not_replace_a_newer_one(monkeypatch):
    with mico(("LLN",)) as (rig, controller):
        gate, go = rig.application.manager.gate, Event()
        gate._checker = Prompt()
        gate._checker.go.set()
        decide, prompt, late = gate.decide, gate.decide_promptly, [None]

        def slow(*given):
            assert go.wait(10.0)
            return decide(*given)

        monkeypatch.setattr(gate, "decide", slow)
        monkeypatch.setattr(
            gate, "decide_promptly", lambda each: late.pop() if late else prompt(each)
        )
        older = rig["d0.c0"].move_to(50.0, wait=False)
        wait_until(lambda: not late)
        newer = rig["d0.c0"].move_to(20.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        go.set()
        assert isinstance(older.exception(2), cosmic.MoveCancelled)
        assert newer.wait(2) == 20.0
        assert [call[2] for call in controller.of("move_to")] == [20.0]


def test_a_stop_waits_for_no_answer_and_nothing_moves_when_it_comes(monkeypatch):
    with waiting(monkeypatch) as (rig, controller, checker, movement):
        began_s = WALL.now_s()
        rig.application.manager.stop("test")
        assert WALL.now_s() - began_s < 0.2
        assert {call[1] for call in controller.of("stop")} >= {X, Y}
        rig.application.manager.reset_stop()
        checker.go.set()
        assert isinstance(movement.exception(2), cosmic.StoppedError)
        assert not controller.of("move_to")


def test_a_movement_that_is_being_checked_is_checked_again_for_a_new_holder(monkeypatch):
    with waiting(monkeypatch) as (rig, controller, checker, movement):
        station = StationLease()
        rig.application.manager.lease.join(station)
        station.take("vision", "t" * 32, in_process=True)
        checker.go.set()
        error = movement.exception(5.0)
        assert error.verdict.reason is Reason.NO_LEASE
        assert "vision controls the platform now" in str(error)
        assert not controller.of("move_to")
        station.take_over()
        assert rig["d0.c0"].move_to(50.0) == 50.0


def test_where_something_was_moved_meanwhile_the_answer_counts_for_nothing(monkeypatch):
    with waiting(monkeypatch) as (rig, controller, checker, movement):
        controller.position[Y] = 7.0  # by the hand control unit
        wait_until(lambda: rig["d1.c1"].position_um == 7.0)
        checker.go.set()
        assert movement.wait(2) == 50.0
        assert len(checker.asked) == 2
        assert checker.asked[1]["d1.c1"].low == 7.0


def test_what_changes_on_and_on_is_refused_with_words(monkeypatch):
    with waiting(monkeypatch) as (rig, controller, checker, movement):
        manager = rig.application.manager
        real = manager.gate._states

        def states():
            controller.position[Y] = controller.position.get(Y, 0.0) + 1.0
            wait_until(lambda: real()["d1.c1"].position == controller.position[Y])
            return real()

        manager.gate._states = states
        checker.go.set()
        verdict = movement.exception(5).verdict
        assert verdict.reason is Reason.NO_ANSWER
        assert "changed while the collision check looked at it" in verdict.text
        assert not controller.of("move_to")


def test_an_answer_that_is_too_late_is_refused_in_words():
    class Hangs:
        def check(self, spans, ignored=frozenset()):
            raise LateAnswerError("within 5 s")

    verdict = CollisionManager(two_arms(), process=Hangs()).check({})
    assert verdict.reason is Reason.NO_ANSWER
    assert verdict.text == (
        "Collision check did not answer within 5 s. The move was refused. "
        "Press Rescan if it happens again."
    )


def test_what_is_watched_again_meanwhile_is_checked_again():
    asked = []

    class Changes:
        def check(self, spans, ignored=frozenset()):
            asked.append((spans, ignored))
            if len(asked) == 1:
                manager.take_in("left.x")
            return SweepAnswer(clear=True)

    manager = CollisionManager(two_arms(), process=Changes())
    manager.take_out("left.x")
    spans = {"left.x": AxisSpan(0.0, 9.0, 0.0, moving=True)}
    assert manager.check(spans).allowed
    assert [each[0]["left.x"].free for each in asked] == [True, False]


# What goes on meanwhile, on the axes of the same device


@contextmanager
def going(**changes):
    """A platform whose axis d0.c1 moves, and whose check answers until the test says no more."""
    with mico(("LLN",), instant=False, **changes) as (rig, controller):
        checker = Slow()
        rig.application.manager.gate._checker = checker
        try:
            yield rig, controller, checker
        finally:
            checker.go.set()


def test_positions_are_published_while_a_verdict_is_awaited():
    with going() as (rig, controller, checker):
        rig["d0.c1"].move_to(50.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 1)
        checker.go.clear()
        rig["d0.c0"].move_to(20.0, wait=False)
        wait_until(lambda: len(checker.asked) == 2)
        heard = listen(rig.application.manager.devices[0].position_changed)
        for number in range(1, 4):
            controller.position[Channel(0, 1)] = 10.0 * number
            wait_until(lambda at=10.0 * number: ("d0.c1", at) in positions_in(heard), timeout_s=2.0)
        assert len(controller.of("move_to")) == 1


def positions_in(heard):
    return [(each.name, each.position) for each in heard]


def test_a_movement_lands_while_a_verdict_is_awaited():
    with going() as (rig, controller, checker):
        first = rig["d0.c1"].move_to(50.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 1)
        checker.go.clear()
        second = rig["d0.c0"].move_to(20.0, wait=False)
        wait_until(lambda: len(checker.asked) == 2)
        controller.end(Channel(0, 1), 50.0)
        assert first.wait(2.0) == 50.0
        assert not second.done


@pytest.mark.parametrize("awaited", ["its own next packet", "the move of another axis"])
def test_a_dead_man_s_movement_ends_while_a_verdict_is_awaited(awaited):
    with going() as (rig, controller, checker):
        jog = rig["d0.c1"].jog(1, speed=100.0)
        wait_until(lambda: len(controller.of("move_to")) == 1)
        checker.go.clear()
        if awaited != "its own next packet":
            rig["d0.c0"].move_to(20.0, wait=False)
        wait_until(lambda: ("stop", Channel(0, 1)) in controller.calls, timeout_s=2.0)
        controller.end(Channel(0, 1), 5.0)
        jog.movement.wait(2.0)
        checker.go.set()
        wait_until(lambda: "d0.c1" not in rig.application.manager.gate.held())
        assert len([call for call in controller.of("move_to") if call[1] == Channel(0, 1)]) == 1


def test_a_jog_that_is_held_goes_on_after_a_verdict_that_took_long():
    with going() as (rig, controller, checker):
        jog = rig["d0.c1"].jog(1, speed=100.0)
        wait_until(lambda: len(controller.of("move_to")) == 1)
        checker.go.clear()
        until_s = WALL.now_s() + 0.6
        while WALL.now_s() < until_s:
            jog.renew()
            WALL.sleep(0.02)
        sent = len(controller.of("move_to"))
        checker.go.set()
        while len(controller.of("move_to")) <= sent:
            assert WALL.now_s() < until_s + 5.0
            jog.renew()
            WALL.sleep(0.02)
        assert not jog.done


@pytest.mark.parametrize("how", ["cancelled", "halted", "closed"])
def test_what_is_ended_before_it_was_checked_ends_at_once_and_never_begins(how):
    with going() as (rig, controller, checker):
        checker.go.clear()
        movement = rig["d0.c0"].move_to(20.0, wait=False)
        wait_until(lambda: bool(checker.asked))
        manager = rig.application.manager
        if how == "cancelled":
            movement.cancel()
        elif how == "halted":
            rig["d0.c0"].stop()
        else:
            manager.devices[0].request_end()
        assert isinstance(movement.exception(2.0), cosmic.MoveCancelled)
        checker.go.set()
        wait_until(lambda: "d0.c0" not in manager.gate.held())
        assert not controller.of("move_to")


@pytest.mark.parametrize("when", ["while it is checked", "when it was reserved"])
def test_a_question_that_is_taken_back_holds_nothing(when):
    with going() as (rig, _, checker):
        manager = rig.application.manager
        gate, query = manager.gate, GateQuery()
        request = Request("d0.c0", MoveTo(20.0, "um"), manager.lease.local_token)
        checker.go.clear()
        answers = []
        asking = Thread(target=lambda: answers.append(gate.decide([request], query)))
        asking.start()
        wait_until(lambda: bool(checker.asked))
        if when == "while it is checked":
            gate.withdraw_query(query)
        checker.go.set()
        asking.join(5.0)
        if when == "when it was reserved":
            assert gate.held()
            gate.withdraw_query(query)
        assert not gate.held()
        assert not gate.targets()
        assert answers[0][0].allowed


def test_a_device_that_is_lost_while_a_verdict_is_awaited_stops_everything():
    with going() as (rig, controller, checker):
        lost = listen(rig.application.manager.device_lost)
        checker.go.clear()
        movement = rig["d0.c0"].move_to(20.0, wait=False)
        wait_until(lambda: len(checker.asked) == 1)
        controller.broken = DeviceError("the cable is out", fault=DeviceFault.COMMUNICATION)
        wait_until(lambda: len(lost) == 1)
        assert isinstance(movement.exception(2.0), cosmic.CosmicError)
        assert rig.application.manager.latch.state.latched
        assert lost[0].in_motion
