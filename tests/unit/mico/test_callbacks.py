"""What people hang on to movements and tasks must not harm the threads that call it."""

import pytest

import cosmic
from cosmic.frame.errors import DeviceError, DeviceFault, WrongThreadError
from cosmic.mico.core.motion.positioner import Confidence, Status
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import mico, wait_until

X = Channel(0, 0)


def test_a_callback_that_waits_for_a_movement_is_refused(caplog):
    caught = []
    with mico() as (rig, controller):
        axis = rig["d0.c0"]

        def wait_in_callback(_):
            try:
                axis.move_to(0.0)
            except WrongThreadError as exc:
                caught.append(str(exc))

        controller.block.clear()  # it must not be over before anybody listens
        movement = axis.move_to(5.0, wait=False)
        movement.add_callback(wait_in_callback)
        controller.block.set()
        wait_until(lambda: bool(caught))
        assert "device 0" in caught[0]
        assert axis.move_to(7.0) == 7.0


def test_a_callback_may_start_the_next_movement():
    ended = []
    with mico() as (rig, _):
        axis = rig["d0.c0"]
        first = axis.move_to(5.0, wait=False)
        first.add_callback(lambda _: ended.append(axis.move_to(6.0, wait=False)))
        wait_until(lambda: bool(ended))
        assert ended[0].wait(2) == 6.0


def test_a_callback_that_raises_harms_nobody():
    heard = []
    with mico() as (rig, _):
        axis = rig["d0.c0"]
        movement = axis.move_to(5.0, wait=False)
        movement.add_callback(lambda _: 1 / 0)
        movement.add_callback(heard.append)
        wait_until(lambda: bool(heard))
        assert axis.move_to(7.0) == 7.0
        rig.initialise(progress=lambda _: 1 / 0)
        assert axis.move_to(8.0) == 8.0


def test_who_sees_a_lost_device_finds_everything_stopped():
    seen = []
    with mico(("LL", "LL"), instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(5.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        movement.add_callback(lambda _: seen.append((rig.missing, rig.check({"d1.c0": 1.0}))))
        controller.broken = DeviceError("usb gone", fault=DeviceFault.COMMUNICATION)
        wait_until(lambda: bool(seen))
        missing, verdict = seen[0]
        assert missing
        assert verdict.reason == "STOPPED"


@pytest.mark.defects
def test_a_device_whose_thread_died_is_shown_as_gone():
    with mico() as (rig, controller):

        def explode(channel):
            raise RuntimeError("defect in a driver")

        controller.ask_activity = explode
        with pytest.raises(cosmic.CosmicError):
            rig["d0.c0"].move_to(1.0)
        wait_until(lambda: rig["d0.c0"].state is Status.UNKNOWN)
        wait_until(lambda: bool(rig.missing))
        assert rig["d0.c0"].confidence is Confidence.UNKNOWN


def test_after_the_end_every_answer_says_so():
    with mico() as (rig, _):
        rig.application.shut_down()
        assert rig["d0.c0"].state is Status.UNKNOWN
        verdict = rig["d0.c0"].check(0.0)
        assert (verdict.reason, "closed" in verdict.text) == ("DEVICE", True)
        with pytest.raises(cosmic.MoveRefused, match="closed"):
            rig["d0.c0"].move_to(0.0)


def test_subscribers_hear_of_their_axis_only_until_they_leave():
    heard = []
    with mico() as (rig, _):
        leave = rig["d0.c0"].subscribe(heard.append)
        rig["d0.c1"].move_to(3.0)
        rig["d0.c0"].move_to(5.0)
        assert {state.name for state in heard} == {"d0.c0"}
        assert heard[-1].position == 5.0
        leave()
        count = len(heard)
        rig["d0.c0"].move_to(6.0)
        assert len(heard) == count


def test_small_things_of_the_api():
    with mico(("LRN",)) as (rig, _):
        assert "d0.c0" in rig
        assert "nowhere" not in rig
        assert "d0.c0" in repr(rig)
        with pytest.raises(cosmic.MoveRefused, match="forward"):
            rig["d0.c0"].move_to_end_stop("sideways")
        with pytest.raises(cosmic.MoveRefused, match="no sensor"):
            rig["d0.c2"].set_closed_loop_frequency(100)
        with pytest.raises(cosmic.MoveRefused, match="calibrating a sensor"):
            rig["d0.c2"].calibrate()
        with rig["d0.c1"].jog(1) as jog:
            wait_until(lambda: bool(jog.movement))
        assert len(rig["d0.c0"].check(1e300).text) < 120
        with pytest.raises(cosmic.MoveRefused):
            rig["d0.c0"].jog(1, "fast")
