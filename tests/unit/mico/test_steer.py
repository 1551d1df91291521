"""An axis that is steered: its speed follows a hand from packet to packet."""

from itertools import pairwise

import pytest

import cosmic
from cosmic.frame.clock import WALL
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.jog import HandLostError
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import mico, wait_until

X = Channel(0, 0)


class Hand:
    """Holds one axis as a stick would."""

    def __init__(self, rig: Mico, velocity: float, dead_man_s: float = 0.5) -> None:
        self.commander = rig["d0.c0"].commander
        self.order: Order = self.commander.steer(0, velocity, dead_man_s=dead_man_s)

    def hold(self, velocity: float, duration_s: float) -> None:
        end_s = WALL.now_s() + duration_s
        while WALL.now_s() < end_s and not self.order.movement.done:
            self.commander.steer_on(self.order, velocity)
            WALL.sleep(0.003)


def targets(controller):
    return [call[2] for call in controller.of("move_to")]


def test_the_speed_of_a_steered_axis_follows_the_hand_without_a_new_order():
    with mico() as (rig, controller):
        hand = Hand(rig, 1000.0)
        began_s = WALL.now_s()
        while max(targets(controller), default=0.0) < 150.0:
            hand.hold(1000.0, 0.02)
        fast = targets(controller)
        assert fast[-1] < 1000.0 * (WALL.now_s() - began_s) + 100.0
        began_s = WALL.now_s()
        hand.hold(100.0, 0.2)
        slow = targets(controller)[len(fast) :]
        assert slow[-1] - fast[-1] < 100.0 * (WALL.now_s() - began_s) + 30.0
        assert max(after - before for before, after in pairwise([0.0, *fast])) <= 100.0
        rig["d0.c0"].halt()
        with pytest.raises(cosmic.MoveCancelled):
            hand.order.movement.wait(2)


def test_a_hand_that_turns_back_takes_the_axis_back():
    with mico() as (rig, controller):
        hand = Hand(rig, 500.0)
        while max(targets(controller), default=0.0) < 80.0:
            hand.hold(500.0, 0.02)
        furthest = max(targets(controller))
        wait_until(lambda: hand.hold(-500.0, 0.01) or targets(controller)[-1] < furthest - 60.0)
        rig["d0.c0"].halt()


def test_a_hand_that_is_lost_stops_the_axis_within_a_tenth_of_a_second():
    with mico() as (rig, controller):
        hand = Hand(rig, 500.0, dead_man_s=0.06)
        hand.hold(500.0, 0.1)
        lost_s = WALL.now_s()
        with pytest.raises(HandLostError):
            hand.order.movement.wait(2)
        assert ("stop", X) in controller.calls
        assert WALL.now_s() - lost_s < 0.5
        assert rig["d0.c0"].position_um < 200.0


def test_a_steered_axis_is_commanded_more_than_a_hundred_times_a_second_and_nothing_queues():
    with mico() as (rig, controller):
        hand = Hand(rig, 100.0)
        wait_until(lambda: bool(targets(controller)))
        before, began_s, velocity = len(targets(controller)), WALL.now_s(), 100.0
        while WALL.now_s() - began_s < 0.5:
            velocity += 1.0
            hand.commander.steer_on(hand.order, velocity)
            WALL.sleep(0.001)
        sent = len(targets(controller)) - before
        rig["d0.c0"].halt()
        still = len(targets(controller))
        assert sent > 25, "fewer than half of them on a loaded machine"
        hand.order.movement.exception(2)
        assert len(targets(controller)) <= still + 1


def test_a_steered_axis_ends_at_its_limit():
    with mico() as (rig, controller):
        rig["d0.c0"].move_to(4950.0)
        hand = Hand(rig, 1000.0)
        hand.hold(1000.0, 1.0)
        assert hand.order.movement.wait(2) == 5000.0
        assert max(targets(controller)) == 5000.0
