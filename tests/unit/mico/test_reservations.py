"""A reservation is the gate's own: for one motion of one axis, used once, ended by a stop."""

import threading
from contextlib import contextmanager
from dataclasses import replace

import pytest

import cosmic
from cosmic.frame.verdict import Reason
from cosmic.mico.core.motion.checks import Request
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.orders import Jog, MoveBy, MoveTo, Reservation
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import listen, mico, wait_until

NAME = "d0.c0"


@contextmanager
def platform(**options):
    with mico(**options) as (rig, controller):
        yield rig.application.manager, controller


def reserved(manager, motion, axis=NAME):
    verdict, reservations = manager.gate.decide([Request(axis, motion, manager.lease.local_token)])
    assert verdict.allowed
    return reservations[axis]


def submit(manager, motion, reservation, channel=0):
    order = Order(channel, motion, manager.lease.local_token, "attack", reservation=reservation)
    manager.devices[0].submit(order)
    return order.movement


def refused(movement):
    error = movement.exception(2)
    assert isinstance(error, cosmic.MoveRefused)
    return error.verdict


def test_the_gates_own_reservation_moves_the_axis_once():
    with platform() as (manager, controller):
        motion = MoveTo(5.0, "um")
        reservation = reserved(manager, motion)
        assert submit(manager, motion, reservation).wait(2) == 5.0
        orders = manager.groups.order_together({NAME: MoveTo(0.0, "um")}, source="test")
        orders[NAME].movement.wait(2)
        verdict = refused(submit(manager, motion, reservation))
        assert verdict.reason is Reason.NO_LEASE
        assert "used" in str(verdict)
        assert [call[2] for call in controller.of("move_to")] == [5.0, 0.0]


def test_an_order_is_carried_out_once_and_what_it_began_goes_on():
    with platform() as (manager, controller):
        order = Order(0, MoveBy(5.0, "um"), manager.lease.local_token, "attack")
        manager.devices[0].submit(order)
        with pytest.raises(cosmic.MoveRefused, match=f"d0.c0: order {order.number} was submitted"):
            manager.devices[0].submit(order)
        assert order.movement.wait(2) == 5.0
        with pytest.raises(cosmic.MoveRefused, match="give a new one"):
            manager.devices[0].submit(order._replace(motion=MoveBy(-5.0, "um")))
        assert [call[2] for call in controller.of("move_to")] == [5.0]


def test_an_order_made_before_a_stop_does_not_move_after_its_reset():
    with platform() as (manager, controller):
        before = manager.gate.stop_state.epoch
        order = Order(0, MoveBy(5.0, "um"), manager.lease.local_token, "attack", epoch=before)
        manager.stop("a test")
        manager.reset_stop()
        manager.devices[0].submit(order)
        verdict = refused(order.movement)
        assert verdict.reason is Reason.STOPPED
        assert "a stop came after the order was made" in str(verdict)
        assert not controller.of("move_to")


FORGED = {
    "made up": lambda reservation: Reservation(NAME, 987654, 0, 90.0),
    "made up with a number that was given": lambda reservation: Reservation(
        NAME, reservation.number, 0, 90.0
    ),
    "a copy": replace,
    "a copy with another target": lambda reservation: replace(reservation, target=90.0),
    "no number": lambda reservation: Reservation(NAME, "x", 0, 90.0),
    "no reservation at all": lambda reservation: object(),
}


@pytest.mark.parametrize("forge", FORGED.values(), ids=FORGED)
def test_what_the_gate_did_not_give_moves_nothing_and_spoils_nothing(forge, caplog):
    with platform() as (manager, controller):
        refusals = listen(manager.devices[0].movement_refused)
        motion = MoveTo(5.0, "um")
        reservation = reserved(manager, motion)
        verdict = refused(submit(manager, motion, forge(reservation)))
        assert (verdict.reason, verdict.axis) == (Reason.NO_LEASE, NAME)
        assert "was not given" in verdict.text or "before" in verdict.text
        assert str(verdict) in caplog.text
        wait_until(lambda: refusals == [verdict])
        assert not controller.of("move_to")
        assert NAME in manager.gate.held(), "the true one still holds its interval"
        assert submit(manager, motion, reservation).wait(2) == 5.0


def test_a_reservation_of_another_axis_or_motion_moves_nothing():
    with platform() as (manager, controller):
        motion = MoveTo(5.0, "um")
        reservation = reserved(manager, motion)
        assert "is for d0.c0" in str(refused(submit(manager, motion, reservation, channel=1)))
        for other in (MoveTo(4900.0, "um"), MoveTo(5.0, "um"), MoveBy(9.0, "um"), Jog(1, 50.0)):
            assert "another motion" in str(refused(submit(manager, other, reservation)))
        assert not controller.of("move_to")
        assert submit(manager, motion, reservation).wait(2) == 5.0


@pytest.mark.parametrize("reset", [False, True])
def test_a_stop_ends_a_reservation(reset):
    with platform() as (manager, controller):
        motion = MoveTo(5.0, "um")
        reservation = reserved(manager, motion)
        manager.stop("test")
        if reset:
            manager.reset_stop()
        assert refused(submit(manager, motion, reservation)).reason is Reason.STOPPED
        assert not controller.of("move_to")
        assert NAME not in manager.gate.held()


def test_a_release_and_a_rescan_end_a_reservation():
    with platform() as (manager, controller):
        motion = MoveTo(5.0, "um")
        reservation = reserved(manager, motion)
        manager.gate.release(reservation)
        assert refused(submit(manager, motion, reservation)).reason is Reason.NO_LEASE
        reservation = reserved(manager, motion)
        manager.rescan()
        assert not refused(submit(manager, motion, reservation)).allowed
        assert not controller.of("move_to")
        assert manager.gate.held() == {}


def test_orders_cannot_release_what_a_running_movement_holds():
    with platform(instant=False) as (manager, controller):
        motion = MoveTo(500.0, "um")
        orders = manager.groups.order_together({NAME: motion}, source="test")
        wait_until(lambda: bool(controller.of("move_to")))
        used = orders[NAME].reservation
        for reservation in (used, replace(used)):
            lost = Order(1, motion, manager.lease.local_token, reservation=reservation)
            lost.movement.cancel()
            manager.devices[0].submit(lost)
            assert lost.movement.exception(2)
            assert manager.gate.held()[NAME].high == 500.0
            assert not refused(submit(manager, motion, reservation)).allowed
            assert manager.gate.held()[NAME].high == 500.0
        assert len(controller.of("move_to")) == 1
        controller.end(Channel(0, 0), 500.0)
        assert orders[NAME].movement.wait(2) == 500.0


def test_of_many_threads_with_one_reservation_one_is_heard():
    with platform() as (manager, _):
        gate, motion = manager.gate, MoveTo(5.0, "um")
        for _round in range(50):
            reservation = reserved(manager, motion)
            ready, claims = threading.Barrier(8), []

            def claim(reservation=reservation, ready=ready, claims=claims):
                ready.wait()
                claims.append(gate.claim(reservation, NAME, motion))

            threads = [threading.Thread(target=claim) for _ in range(8)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            assert claims.count(None) == 1
            gate.release(reservation)


def test_an_axis_that_moved_meanwhile_is_checked_again():
    with platform() as (manager, _):
        gate, motion = manager.gate, MoveTo(10.0, "um")
        late = reserved(manager, motion)
        away = manager.groups.order_together({NAME: MoveTo(1000.0, "um")}, source="test")
        away[NAME].movement.wait(2)
        checked = []
        real = gate.decide_promptly
        gate.decide_promptly = lambda requests: checked.append(requests) or real(requests)
        assert submit(manager, motion, late).wait(2) == 10.0
        assert len(checked) == 1, "the way from 1000 um was never looked at"


class Keeps:
    """A group start of somebody who means to start the axis again and again."""

    skew_ms = None
    line = None

    def __init__(self):
        self.axes = []

    def arrive(self, axis):
        self.axes.append(axis)
        axis.go()
        axis.report()


def test_a_start_that_is_repeated_sends_nothing():
    with platform() as (manager, controller):
        motion, keeps = MoveTo(5.0, "um"), Keeps()
        order = Order(0, motion, manager.lease.local_token, start=keeps)
        manager.devices[0].submit(order)
        assert order.movement.wait(2) == 5.0
        assert keeps.axes[0].go() is False
        keeps.axes[0].report()
        assert len(controller.of("move_to")) == 1
