"""What a review of the core found, each as it was reproduced."""

import threading

import pytest

import cosmic
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.threads import running_threads
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.positioner import Status
from cosmic.mico.hw.interface import Activity, Channel
from unit.mico.rigs import mico, wait_until

X, Y = Channel(0, 0), Channel(0, 1)


def under_way(rig, controller, target=4000.0):
    movement = rig["d0.c0"].move_to(target, wait=False)
    wait_until(lambda: bool(controller.of("move_to")))
    return movement


@pytest.mark.parametrize("how", ["halt", "stop"])
def test_a_relative_move_never_goes_on_from_a_target_that_was_abandoned(how):
    with mico(instant=False) as (rig, controller):
        movement = under_way(rig, controller)
        controller.position[X] = 450.0
        if how == "halt":
            rig["d0.c0"].halt()
        else:
            rig.application.manager.stop("test")
            rig.application.manager.reset_stop()
        assert movement.exception(2) is not None
        controller.instant = True
        assert rig["d0.c0"].move_by(10.0) == 460.0


def test_what_was_queued_before_a_stop_or_ordered_during_it_does_not_start_after_the_reset():
    with mico(instant=False) as (rig, controller):
        controller.block.clear()
        under_way(rig, controller)
        queued = rig["d0.c1"].move_to(1.0, wait=False)
        manager = rig.application.manager
        manager.stop("test")
        during = rig["d0.c1"].move_to(2.0, wait=False)
        manager.reset_stop()
        controller.block.set()
        assert isinstance(queued.exception(2), cosmic.StoppedError)
        assert isinstance(during.exception(2), cosmic.StoppedError)
        assert len(controller.of("move_to")) == 1


def test_what_was_queued_before_a_halt_does_not_start():
    with mico(instant=False) as (rig, controller):
        controller.block.clear()
        under_way(rig, controller)
        queued = rig["d0.c1"].move_to(1.0, wait=False)
        rig["d0.c1"].halt()
        controller.block.set()
        assert isinstance(queued.exception(2), cosmic.MoveCancelled)
        assert len(controller.of("move_to")) == 1


def test_a_stop_that_was_not_taken_is_repeated_until_the_axis_stands():
    with mico(instant=False) as (rig, controller):
        movement = under_way(rig, controller)
        real, refused = controller.stop, []

        def stop(channel):
            if len(refused) < 12:
                refused.append(channel)
                raise DeviceError("busy", fault=DeviceFault.BUSY)
            real(channel)

        controller.stop = stop
        rig.application.manager.stop("test")
        assert isinstance(movement.exception(3), cosmic.StoppedError)
        assert controller.activity[X] is Activity.STOPPED


def test_closing_stops_past_a_thread_that_hangs():
    with mico(instant=False) as (rig, controller):
        under_way(rig, controller)
        controller.block.clear()
        rig["d0.c1"].move_to(1.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        closing = threading.Thread(target=rig.application.shut_down)
        closing.start()
        wait_until(lambda: ("stop", X) in controller.calls, 1.0)
        controller.block.set()
        closing.join(8)
        assert not closing.is_alive()


def test_a_device_that_comes_and_goes_is_joined_once():
    with mico(("L", "L")) as (rig, controller):
        for _ in range(5):
            controller.broken = DeviceError("usb gone", fault=DeviceFault.COMMUNICATION)
            wait_until(lambda: rig["d0.c0"].state is Status.UNKNOWN)
            wait_until(lambda: rig["d1.c0"].state is Status.UNKNOWN)
            controller.broken = None
            rig.rescan()
        controller.calls.clear()
        assert rig["d0.c0"].move_to(5.0) == 5.0
        assert len(controller.of("move_to")) == 1


def test_a_rescan_keeps_zero_speed_and_counted_position():
    with mico() as (rig, controller):
        rig["d0.c0"].move_to(3000.0)
        rig["d0.c0"].set_zero()
        rig["d0.c0"].set_closed_loop_frequency(100)
        rig["d0.c2"].steps(200)
        counted = rig["d0.c2"].position_um
        controller.calls.clear()
        rig.rescan()
        assert rig["d0.c0"].position_um == 0.0
        assert ("frequency", X, 100) in controller.calls
        assert rig["d0.c2"].position_um == counted
        assert rig["d0.c0"].move_to(10.0) == 10.0
        assert controller.of("move_to")[-1][2] == 3010.0


def test_an_axis_that_gave_no_answer_recovers_when_it_answers_again():
    with mico(instant=False, watch={"stall_s": 0.5}) as (rig, controller):
        movement = under_way(rig, controller)
        wait_until(lambda: controller.position.get(X) is None)
        controller.muted = True
        assert movement.exception(6) is not None
        assert rig.application.manager.gate.held()
        controller.muted = False
        wait_until(lambda: not rig.application.manager.gate.held())
        controller.instant = True
        assert rig["d0.c0"].move_to(5.0) == 5.0


def test_a_refused_calibration_is_a_failure():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].calibrate(wait=False)
        wait_until(lambda: bool(controller.of("calibrate")))
        controller.fail(X, DeviceFault.UNSUPPORTED)
        with pytest.raises(DeviceError, match="not supported"):
            movement.wait(2)


@pytest.mark.defects
def test_a_listener_that_dies_takes_its_device_along():
    with mico() as (rig, controller):

        def explode(device, timeout_s):
            raise RuntimeError("defect in a listener")

        controller.receive = explode
        wait_until(lambda: rig["d0.c0"].state is Status.UNKNOWN)
        rig.application.manager.reset_stop()
        with pytest.raises(cosmic.MoveRefused):
            rig["d0.c0"].move_to(1.0)


def test_nonsense_from_a_commander_is_refused_and_harms_nobody():
    with mico() as (rig, _):
        manager = rig.application.manager
        commander = DeviceCommander(manager.lease.holder.token)
        manager.connect_device_commander(0, commander)
        for order in (
            commander.jog(2, 1, float("nan")),
            commander.jog(0, 0, 100.0),
            commander.jog(0, 3, 100.0),
        ):
            assert isinstance(order.movement.exception(2), cosmic.MoveRefused)
        for movement in (commander.send(0, None), commander.move_to_end_stop(0, None)):
            assert isinstance(movement.exception(2), cosmic.MoveRefused)
        assert rig["d0.c0"].move_to(5.0) == 5.0


def test_cancelling_a_replaced_movement_leaves_the_newer_one_alone():
    with mico(instant=False) as (rig, controller):
        first = under_way(rig, controller)
        second = rig["d0.c0"].move_to(7.0, wait=False)
        first.cancel()
        wait_until(lambda: len(controller.of("move_to")) == 2)
        controller.end(X, 7.0)
        assert second.wait(2) == 7.0


def test_steps_replaced_by_others_are_counted():
    with mico(instant=False) as (rig, controller):
        start = rig["d0.c2"].position_um
        rig["d0.c2"].steps(20000, frequency_hz=18500, wait=False)
        wait_until(lambda: bool(controller.of("step")))
        threading.Event().wait(0.1)
        last = rig["d0.c2"].steps(1, wait=False)
        wait_until(lambda: len(controller.of("step")) == 2)
        controller.end(Channel(0, 2))
        last.wait(2)
        assert rig["d0.c2"].position_um - start > 1000.0


def test_an_axis_outside_its_limits_may_come_back_by_small_ways():
    with mico() as (rig, _):
        rig["d0.c0"].reference()
        assert rig["d0.c0"].position_um == -6000.0
        assert rig["d0.c0"].move_by(100.0) == -5900.0
        with pytest.raises(cosmic.LimitError):
            rig["d0.c0"].move_by(-10.0)


def test_closing_during_the_search_for_devices_leaves_nothing_behind():
    for _ in range(10):
        with mico() as (rig, _):
            task = rig.rescan(wait=False)
            rig.application.shut_down()
            wait_until(lambda task=task: task.done)
            assert not [t for t in running_threads() if t.name.startswith(("device", "listener"))]
