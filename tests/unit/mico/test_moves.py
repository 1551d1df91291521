import math
import threading
from contextlib import suppress

import numpy as np
import pytest

import cosmic
from cosmic.frame.errors import DeviceError, DeviceFault, UnknownAxisError
from cosmic.mico.core.motion.positioner import Confidence, Status
from cosmic.mico.hw.interface import (
    Activity,
    Channel,
    PositionerKind,
    PositionerType,
    ReferenceKind,
    TypeRead,
)
from unit.mico.rigs import mico, wait_until

X = Channel(0, 0)
GRIPPER = Channel(0, 2)


def test_an_absolute_move_reaches_the_library_in_its_units_and_returns_the_position():
    with mico() as (rig, controller):
        assert rig["d0.c0"].move_to(120.0) == 120.0
        assert controller.of("move_to") == [("move_to", X, 120.0, "um", math.inf)]
        assert rig["d0.c0"].position_um == 120.0
        assert rig["d0.c0"].state is Status.OK


def test_texts_with_units_and_numpy_numbers_are_taken():
    with mico() as (rig, controller):
        rig["d0.c0"].move_to("0.2 mm")
        rig["d0.c0"].move_to(np.float64(7.5))
        rig["d0.c0"].move_to(np.int32(3))
        assert [call[2] for call in controller.of("move_to")] == [200.0, 7.5, 3.0]


def test_relative_moves_add_up_even_while_the_first_is_under_way():
    with mico(instant=False) as (rig, controller):
        rig["d0.c0"].move_by(100.0, wait=False)
        second = rig["d0.c0"].move_by(100.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        assert controller.of("move_to")[1][2] == 200.0
        controller.end(X, 200.0)
        assert second.wait(2) == 200.0


def test_a_replaced_movement_says_so():
    with mico(instant=False) as (rig, _):
        first = rig["d0.c0"].move_to(100.0, wait=False)
        rig["d0.c0"].move_to(50.0, wait=False)
        with pytest.raises(cosmic.MoveCancelled, match=r"d0\.c0: replaced"):
            first.wait(2)


def test_a_movement_is_sent_before_anybody_hears_that_it_replaces_another():
    with mico(instant=False) as (rig, controller):
        first = rig["d0.c0"].move_to(100.0, wait=False)
        sent: list[int] = []
        first.add_callback(lambda _: sent.append(len(controller.of("move_to"))))
        rig["d0.c0"].move_to(50.0, wait=False)
        wait_until(lambda: bool(sent))
        assert sent == [2]


def test_a_movement_replaced_by_one_that_cannot_be_sent_ends_as_well():
    def gone(*_args: object, **_more: object) -> None:
        raise DeviceError("gone", fault=DeviceFault.COMMUNICATION)

    with mico(instant=False) as (rig, controller):
        first = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: rig["d0.c0"].details.in_motion)
        controller.move_to = controller.stop = gone
        second = rig["d0.c0"].move_to(50.0, wait=False)
        assert isinstance(first.exception(2), cosmic.MoveCancelled)
        assert isinstance(second.exception(2), cosmic.NotConnectedError)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (math.nan, "NOT_FINITE"),
        (math.inf, "NOT_FINITE"),
        (-math.inf, "NOT_FINITE"),
        ("1e400", "NOT_FINITE"),
        ("abc", "NOT_FINITE"),
        ("", "NOT_FINITE"),
        (None, "NOT_FINITE"),
        (True, "NOT_FINITE"),
        ([1.0], "NOT_FINITE"),
        (10**400, "NOT_FINITE"),
        ("3 deg", "WRONG_KIND"),
        (5000.1, "LIMIT"),
        (-1e9, "LIMIT"),
    ],
)
def test_a_bad_target_is_refused_with_its_reason_and_nothing_moves(value, reason):
    with mico() as (rig, controller):
        verdict = rig.check({"d0.c0": value})
        assert (verdict.allowed, verdict.reason, verdict.axis) == (False, reason, "d0.c0")
        with pytest.raises(cosmic.MoveRefused, match=r"d0\.c0") as refused:
            rig["d0.c0"].move_to(value)
        assert refused.value.verdict.reason == reason
        assert not controller.of("move_to")
        assert rig["d0.c0"].position_um == 0.0


def test_the_limit_itself_is_allowed_and_beyond_it_names_value_and_limit():
    with mico() as (rig, _):
        assert rig["d0.c0"].move_to(5000.0) == 5000.0
        with pytest.raises(cosmic.LimitError) as refused:
            rig["d0.c0"].move_by(0.5)
        verdict = refused.value.verdict
        assert (verdict.value, verdict.limit, verdict.unit) == (5000.5, 5000.0, "um")


def test_an_angle_is_not_for_a_linear_axis_nor_a_length_for_a_rotary_one():
    with mico(("LRN",)) as (rig, controller):
        rig["d0.c1"].move_to(12.5)
        assert controller.of("move_to")[0][3] == "deg"
        assert rig["d0.c1"].angle_deg == 12.5
        with pytest.raises(cosmic.NotAvailable, match="use angle_deg"):
            _ = rig["d0.c1"].position_um
        with pytest.raises(cosmic.MoveRefused) as refused:
            rig["d0.c1"].move_to("1 mm")
        assert refused.value.verdict.reason == "WRONG_KIND"


def test_a_sensorless_axis_makes_steps_but_has_no_position_to_go_to():
    with mico() as (rig, controller):
        gripper = rig["d0.c2"]
        assert gripper.kind is PositionerKind.OPEN_LOOP
        gripper.steps(-50, amplitude_v=80.0, frequency_hz=500)
        assert controller.of("step") == [("step", GRIPPER, -50, 80.0, 500)]
        with pytest.raises(cosmic.MoveRefused, match="no sensor") as refused:
            gripper.move_to(10.0)
        assert refused.value.verdict.reason == "WRONG_KIND"
        assert gripper.confidence is Confidence.ESTIMATED


@pytest.mark.parametrize(
    ("steps", "volts", "hertz", "ok"),
    [
        (29999, 100, 18500, True),
        (-29999, 15, 1, True),
        (30000, 100, 1000, False),
        (-30000, 100, 1000, False),
        (10, 14.9, 1000, False),
        (10, 100.1, 1000, False),
        (10, 100, 0, False),
        (10, 100, 18501, False),
        (10.5, 100, 1000, False),
        (math.nan, 100, 1000, False),
        (10, math.nan, 1000, False),
    ],
)
def test_steps_stay_in_their_ranges_and_30000_is_never_sent(steps, volts, hertz, ok):
    with mico() as (rig, controller):
        if ok:
            rig["d0.c2"].steps(steps, amplitude_v=volts, frequency_hz=hertz, wait=False)
            wait_until(lambda: len(controller.of("step")) == 1)
        else:
            with pytest.raises(cosmic.MoveRefused):
                rig["d0.c2"].steps(steps, amplitude_v=volts, frequency_hz=hertz)
            assert not controller.of("step")


def test_open_loop_steps_of_a_sensor_axis_must_not_be_able_to_leave_its_limits():
    with mico() as (rig, controller):
        rig["d0.c0"].steps(100)
        with pytest.raises(cosmic.LimitError, match="could reach"):
            rig["d0.c0"].steps(20000)
        assert len(controller.of("step")) == 1


def test_an_unknown_axis_is_named_with_those_there_are():
    with mico() as (rig, _):
        with pytest.raises(UnknownAxisError, match=r"'left\.q'.*d0\.c0") as unknown:
            _ = rig["left.q"]
        assert isinstance(unknown.value, KeyError)
        assert isinstance(unknown.value, cosmic.CosmicError)


def test_an_unknown_position_needs_consent_or_a_reference():
    def power_up(controller):
        controller.known = False

    with mico(prepare=power_up) as (rig, controller):
        axis = rig["d0.c0"]
        assert axis.confidence is Confidence.UNKNOWN
        for move in (axis.move_to, axis.move_by, axis.steps):
            with pytest.raises(cosmic.MoveRefused, match="unknown") as refused:
                move(10)
            assert refused.value.verdict.reason == "POSITION_UNKNOWN"
        with pytest.raises(cosmic.MoveRefused, match="consent"):
            axis.reference()
        assert not controller.of("move_to") + controller.of("step") + controller.of("reference")
        assert axis.move_to(10.0, consent=True) == 10.0
        axis.reference(consent=True)
        assert axis.confidence is Confidence.KNOWN


def test_an_unknown_axis_without_a_reference_is_not_sent_to_the_initialisation():
    def power_up(controller):
        controller.known = False
        controller.ask_type = lambda channel: controller.emit(
            TypeRead(channel, PositionerType(0, "own", PositionerKind.LINEAR, ReferenceKind.NONE))
        )

    with mico(("L",), prepare=power_up) as (rig, _):
        with pytest.raises(cosmic.MoveRefused, match="no reference to look for; give consent"):
            rig["d0.c0"].move_to(10.0)
        assert rig["d0.c0"].move_to(10.0, consent=True) == 10.0


def test_initialise_references_in_the_configured_order_and_takes_the_start_pose():
    def power_up(controller):
        controller.known = False

    steps = [("reference", "d0.c1"), ("reference", "d0.c0"), ("move", "d0.c0"), ("move", "d0.c1")]
    order = {"step": [{"do": do, "axes": [name]} for do, name in steps]}
    seen = []
    with mico(prepare=power_up, initialisation=order) as (rig, controller):
        rig.initialise(progress=seen.append)
        assert [call[1].channel for call in controller.of("reference")] == [1, 0]
        assert [call[1].channel for call in controller.of("move_to")] == [0, 1]
        assert rig["d0.c0"].position_um == 0.0
        assert rig["d0.c0"].confidence is Confidence.KNOWN
    assert seen[-1].done
    assert seen[-1].fraction == 1.0


def test_an_initialisation_that_fails_stops_and_says_where():
    with mico(("LLN",), instant=False) as (rig, controller):
        task = rig.initialise(wait=False)
        wait_until(lambda: len(controller.of("reference")) == 1)
        controller.fail(X, DeviceFault.REFERENCE)
        with pytest.raises(DeviceError, match="referencing failed"):
            task.wait(3)
        assert len(controller.of("reference")) == 1


def test_an_initialisation_can_be_cancelled():
    with mico(("LLN",), instant=False) as (rig, controller):
        task = rig.initialise(wait=False)
        wait_until(lambda: len(controller.of("reference")) == 1)
        with pytest.raises(cosmic.NotAvailable, match="is running"):
            rig.initialise()
        task.cancel()
        with pytest.raises(cosmic.MoveCancelled):
            task.wait(3)
        assert controller.of("stop")


def test_a_users_zero_shifts_what_is_shown_and_never_the_gate():
    with mico() as (rig, controller):
        axis = rig["d0.c0"]
        axis.move_to(1000.0)
        axis.set_zero()
        assert axis.position_um == 0.0
        assert axis.limits == (-6000.0, 4000.0)
        axis.move_to(10.0)
        assert controller.of("move_to")[-1][2] == 1010.0
        with pytest.raises(cosmic.LimitError) as refused:
            axis.move_to(4000.5)
        assert (refused.value.verdict.value, refused.value.verdict.limit) == (4000.5, 4000.0)
        axis.clear_zero()
        assert axis.position_um == 1010.0


def test_a_group_moves_only_if_all_may():
    with mico() as (rig, controller):
        assert rig.move({"d0.c0": 10.0, "d0.c1": -10.0}) == {"d0.c0": 10.0, "d0.c1": -10.0}
        with pytest.raises(cosmic.LimitError, match=r"d0\.c1"):
            rig.move({"d0.c0": 20.0, "d0.c1": 99999.0})
        with pytest.raises(UnknownAxisError):
            rig.move_by({"d0.c0": 20.0, "nowhere": 1.0})
        assert len(controller.of("move_to")) == 2


def test_the_failure_of_one_axis_stops_the_others_of_its_group():
    with mico(instant=False) as (rig, controller):
        group = rig.move({"d0.c0": 10.0, "d0.c1": -10.0}, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        controller.fail(X, DeviceFault.END_STOP)
        with pytest.raises(DeviceError, match="end stop"):
            group.wait(3)
        assert ("stop", Channel(0, 1)) in controller.calls


def test_an_end_stop_fails_the_movement_and_marks_the_axis():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(10.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        controller.fail(X, DeviceFault.END_STOP)
        with pytest.raises(DeviceError) as failed:
            movement.wait(3)
        assert failed.value.fault is DeviceFault.END_STOP
        assert rig["d0.c0"].state is Status.ERROR
        controller.instant = True
        rig["d0.c0"].move_to(5.0)
        assert rig["d0.c0"].state is Status.OK


def test_a_lost_completion_is_noticed_and_a_doubled_one_is_not_counted():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(10.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        controller.position[X], controller.activity[X] = 10.0, Activity.HOLDING
        assert movement.wait(3) == 10.0
        controller.end(X, 10.0)
        controller.end(X, 10.0)
        movement = rig["d0.c0"].move_to(20.0, wait=False)
        controller.end(X, 10.0)
        assert not movement.done or movement.exception(1) is not None


def test_standing_short_of_the_target_is_a_failure():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        controller.end(X, 50.0)
        with pytest.raises(DeviceError, match=r"stopped at 50\.0 µm instead of 100\.0 µm"):
            movement.wait(3)


def test_an_axis_that_says_too_early_that_it_is_stationary_is_stopped():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: controller.of("move_to"))
        controller.end(X, 3.0)
        with pytest.raises(DeviceError, match=r"stopped at 3.0 µm instead of 100.0 µm"):
            movement.wait(5)
        assert ("stop", X) in controller.calls


def test_an_axis_that_moves_without_an_order_is_stopped_and_says_so():
    with mico() as (rig, controller):
        controller.activity[X] = Activity.TARGETING
        wait_until(lambda: ("stop", X) in controller.calls)
        wait_until(lambda: "without an order" in (rig["d0.c0"].details.error or ""))
        assert rig["d0.c0"].move_to(5.0) == 5.0
        assert not rig["d0.c0"].details.error


def test_a_channel_that_makes_no_progress_is_stopped():
    with mico(instant=False, watch={"stall_s": 0.5}) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        with pytest.raises(cosmic.DeviceTimeout, match="no progress"):
            movement.wait(5)
        assert ("stop", X) in controller.calls


def test_cancel_stops_the_axis():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(100.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        movement.cancel()
        with pytest.raises(cosmic.MoveCancelled):
            movement.wait(3)
        assert ("stop", X) in controller.calls


def test_moves_from_many_threads_all_end():
    with mico(("LLL", "LLL")) as (rig, _):

        def work(name):
            for target in range(20):
                with suppress(cosmic.MoveCancelled):
                    rig[name].move_to(float(target))

        threads = [threading.Thread(target=work, args=(name,)) for name in rig.names * 2]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(20)
        assert not any(thread.is_alive() for thread in threads)


def test_every_interval_is_given_back_when_its_movement_has_ended():
    with mico(instant=False) as (rig, controller):
        gate = rig.application.manager.gate
        first = rig["d0.c0"].move_to(10.0, wait=False)
        group = rig.move({"d0.c0": 20.0, "d0.c1": 5.0}, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 3)
        assert first.done
        assert gate.held()["d0.c0"].high == 20.0
        controller.end(Channel(0, 1), 5.0)
        wait_until(lambda: group.movements["d0.c1"].done)
        assert list(gate.held()) == ["d0.c0"]
        controller.end(X, 20.0)
        group.wait(2)
        assert gate.held() == {}


def test_an_interval_stays_held_while_its_device_is_gone():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(10.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        controller.broken = DeviceError("usb gone", fault=DeviceFault.COMMUNICATION)
        with pytest.raises(cosmic.NotConnectedError):
            movement.wait(3)
        assert rig.application.manager.gate.held()["d0.c0"].high == 10.0


def test_a_part_that_follows_another_gives_way_to_any_newer_command():
    with mico(instant=False) as (rig, controller):
        axis = rig["d0.c0"]
        first = axis.move_to(10.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 1)
        controller.end(X, 10.0)
        first.wait(2)
        second = axis.continue_to(20.0, first)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        newer = axis.move_to(-5.0, wait=False)
        with pytest.raises(cosmic.MoveCancelled, match="newer"):
            axis.continue_to(30.0, second).wait(2)
        controller.end(X, -5.0)
        assert newer.wait(2) == -5.0
        axis.halt()
        with pytest.raises(cosmic.MoveCancelled, match="newer"):
            axis.continue_to(30.0, newer).wait(2)
        assert len(controller.of("move_to")) == 3
