import threading

import pytest

import cosmic
from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import mico, wait_until

X = Channel(0, 0)


def stops(controller):
    return {call[1] for call in controller.of("stop")}


def test_stop_reaches_every_channel_and_stays():
    with mico(("LLN", "RLx"), instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        manager = rig.application.manager
        manager.stop("test")
        assert stops(controller) == {axis.details.address for axis in rig}
        with pytest.raises(cosmic.StoppedError):
            movement.wait(2)
        with pytest.raises(cosmic.StoppedError, match="test") as refused:
            rig["d0.c1"].move_to(1.0)
        assert refused.value.verdict.reason == "STOPPED"
        with pytest.raises(cosmic.StoppedError):
            rig.move({"d0.c1": 1.0})
        manager.reset_stop()
        controller.instant = True
        assert rig["d0.c1"].move_to(1.0) == 1.0


def test_what_moves_is_stopped_before_what_stands():
    with mico(("LLN", "LLL"), instant=False) as (rig, controller):
        movement = rig["d1.c1"].move_to(100.0, wait=False)
        wait_until(lambda: rig["d1.c1"].details.in_motion)
        controller.calls.clear()
        rig.application.manager.stop("test")
        first = [channel for what, channel, *_ in controller.calls if what == "stop"]
        assert first[0] == Channel(1, 1)
        assert set(first) == {axis.details.address for axis in rig}
        with pytest.raises(cosmic.StoppedError):
            movement.wait(2)


def test_the_first_reason_stays_until_the_reset():
    with mico() as (rig, _):
        manager = rig.application.manager
        manager.stop("force too high")
        manager.stop("again")
        assert manager.latch.state.reason == "force too high"


def test_stop_does_not_wait_for_a_device_thread_stuck_in_the_library_and_is_repeated():
    with mico(instant=False) as (rig, controller):
        controller.block.clear()
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        queued = rig["d0.c1"].move_to(100.0, wait=False)
        before = WALL.now_s()
        rig.application.manager.stop("test")
        assert WALL.now_s() - before < 0.5
        assert X in stops(controller)
        controller.calls.clear()
        controller.block.set()
        with pytest.raises(cosmic.StoppedError):
            movement.wait(2)
        with pytest.raises(cosmic.StoppedError):
            queued.wait(2)
        assert X in stops(controller), "the stop must be repeated after the call in flight"
        assert not controller.of("move_to")


@pytest.mark.parametrize("error", [DeviceError("no"), RuntimeError("of somebody else's code")])
def test_one_channel_that_cannot_be_stopped_does_not_keep_the_others_from_it(error):
    with mico(("LLN", "LLN")) as (rig, controller):
        real, failing, here = controller.stop, Channel(0, 0), threading.get_ident()

        def stop(channel):
            real(channel)
            if channel == failing and threading.get_ident() == here:
                raise error

        controller.stop = stop
        rig.application.manager.stop("test")
        assert len(stops(controller)) == 6


def test_a_stop_between_grant_and_start_still_counts():
    with mico() as (rig, controller):
        manager = rig.application.manager
        orders = {}
        real = manager.gate.decide

        def decide(requests, **options):
            answer = real(requests, **options)
            manager.stop("in between")
            manager.reset_stop()
            return answer

        manager.gate.decide = decide
        with pytest.raises(cosmic.StoppedError):
            rig.move({"d0.c0": 5.0})
        assert not controller.of("move_to")
        assert not orders


def test_a_stop_that_comes_while_a_movement_is_sent_ends_it_though_nobody_repeats_the_stop():
    with mico(instant=False) as (rig, controller):
        manager, real = rig.application.manager, controller.move_to

        def stopped_meanwhile(channel, target, unit, *, hold_s):
            manager.latch.set("in between")
            real(channel, target, unit, hold_s=hold_s)

        controller.move_to = stopped_meanwhile
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        assert isinstance(movement.exception(5), cosmic.StoppedError)
        assert ("stop", X) in controller.calls


def test_a_stop_that_came_and_was_reset_while_a_movement_is_sent_ends_it():
    with mico(instant=False) as (rig, controller):
        manager, real = rig.application.manager, controller.move_to

        def move_to(*args, **kwargs):
            real(*args, **kwargs)
            manager.latch.set("in between")
            manager.latch.reset()  # before the device thread can see it latched

        controller.move_to = move_to
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        with pytest.raises(cosmic.StoppedError):
            movement.wait(2)
        assert X in stops(controller)


def test_a_stop_that_is_reset_while_the_device_thread_hangs_still_ends_what_moved():
    with mico(instant=False) as (rig, controller):
        moving = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        controller.block.clear()
        hanging = rig["d0.c1"].move_to(100.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        rig.application.manager.stop("test")
        rig.application.manager.reset_stop()
        controller.calls.clear()
        controller.block.set()
        for movement in (moving, hanging):
            with pytest.raises(cosmic.StoppedError):
                movement.wait(2)
        assert X in stops(controller), "the thread repeats the stop, reset or not"


def test_stop_from_many_threads_while_all_axes_are_commanded():
    with mico(("LLL", "LLL")) as (rig, controller):
        manager = rig.application.manager
        go_on = threading.Event()
        go_on.set()

        def command(name):
            while go_on.is_set():
                try:
                    rig[name].move_by(1.0)
                    rig[name].move_by(-1.0)
                except cosmic.CosmicError:
                    pass

        threads = [threading.Thread(target=command, args=(name,)) for name in rig.names]
        for thread in threads:
            thread.start()
        for _ in range(20):
            manager.stop("test")
            settled = len(controller.of("move_to"))
            WALL.sleep(0.01)
            assert len(controller.of("move_to")) <= settled + len(rig.names)
            manager.reset_stop()
        manager.stop("end")
        go_on.clear()
        for thread in threads:
            thread.join(5)
        assert not any(thread.is_alive() for thread in threads)


def test_what_was_granted_and_never_started_holds_nothing():
    with mico(instant=False) as (rig, controller):
        controller.block.clear()
        stuck = rig["d0.c0"].move_to(1.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        group = rig.move({"d0.c1": 5.0}, wait=False)
        rig.application.manager.stop("test")
        controller.block.set()
        for movement in (stuck, group.movements["d0.c1"]):
            assert isinstance(movement.exception(2), cosmic.StoppedError)
        assert rig.application.manager.gate.held() == {}
