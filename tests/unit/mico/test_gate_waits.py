"""A collision check that is long in coming: what may happen until it answers."""

from contextlib import contextmanager
from threading import Event

import cosmic
from cosmic.frame.clock import WALL
from cosmic.frame.verdict import ALLOWED, Reason
from cosmic.mico.core import gate as gate_module
from cosmic.mico.core.collision.answer import AxisSpan, SweepAnswer
from cosmic.mico.core.collision.checker import CollisionChecker
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.helper_link import LateAnswerError
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import mico, wait_until
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


def test_what_is_watched_again_meanwhile_is_judged_again():
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
