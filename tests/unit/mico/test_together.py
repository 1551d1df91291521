"""Axes that move together: linked, started back to back, arriving at the same time."""

import math
import sys
import threading

import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from pydantic import ValidationError

import cosmic
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.core.motion.group import Leg, matched_frequencies
from cosmic.mico.core.motion.group_start import GroupStart
from cosmic.mico.core.motion.links import LinkTable
from cosmic.mico.core.motion.orders import MoveBy, MoveTo
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import listen, mico, settings, wait_until

TWO = ("LLN", "LLL")
LEFT, RIGHT = "d0.c0", "d1.c0"
LINK = {"link": [{"first": LEFT, "second": RIGHT}]}


# Links


def test_a_linked_axis_follows_to_and_by_a_position_in_either_direction():
    with mico(TWO) as (rig, controller):
        rig.link(LEFT, RIGHT, ratio=-0.5)
        assert rig[LEFT].move_to(100.0) == 100.0
        assert rig[RIGHT].position_um == -50.0
        assert rig[RIGHT].move_by(10.0) == -40.0
        assert rig[LEFT].position_um == 80.0
        assert rig.move({LEFT: 0.0}) == {LEFT: 0.0, RIGHT: 0.0}
        assert len(controller.of("move_to")) == 6


def test_links_with_an_axis_in_common_make_a_chain():
    with mico(TWO) as (rig, _):
        rig.link(LEFT, RIGHT, 2.0)
        rig.link(RIGHT, "d1.c1", 3.0)
        assert rig[LEFT].linked_to == {RIGHT: 2.0, "d1.c1": 6.0}
        rig["d1.c1"].move_to(60.0)
        assert [rig[name].position_um for name in (LEFT, RIGHT)] == pytest.approx([10.0, 20.0])
        with pytest.raises(cosmic.NotAvailable, match="linked already"):
            rig.link("d1.c1", LEFT)
        rig.unlink(RIGHT)
        assert not rig.links
        rig[LEFT].move_to(0.0)
        assert rig[RIGHT].position_um == pytest.approx(20.0)


@pytest.mark.parametrize("ratio", [math.nan, math.inf, 0.0, -1e4])
def test_a_ratio_that_makes_no_sense_links_nothing(ratio: float) -> None:
    with mico(TWO) as (rig, _):
        with pytest.raises(cosmic.NotAvailable, match=r"the ratio .* is not within 0\.001 to 1000"):
            rig.link(LEFT, RIGHT, ratio=ratio)
        assert not rig.links


def test_both_are_decided_together_and_neither_moves_where_one_may_not():
    with mico(TWO, **LINK) as (rig, controller):
        rig.link(RIGHT, "d1.c1", 100.0)
        assert rig[LEFT].check(60.0).axis == "d1.c1"
        with pytest.raises(cosmic.LimitError, match=r"d1\.c1"):
            rig[LEFT].move_to(60.0)
        assert not controller.of("move_to")


def test_what_would_move_a_linked_axis_alone_is_refused_with_the_reason():
    with mico(TWO, **LINK) as (rig, controller):
        axis = rig[LEFT]
        for act in (axis.reference, axis.calibrate, lambda: axis.steps(5)):
            with pytest.raises(cosmic.MoveRefused, match=r"linked to d1\.c0.*unlink it first"):
                act()
        jogging = axis.jog(1)
        assert "linked" in str(jogging.movement.exception(2))
        sent = axis.commander.move_absolute(0, 5.0, "um")  # past the API
        assert "linked" in str(sent.exception(2))
        assert not [
            call for call in controller.calls if call[0] in ("step", "move_to", "reference")
        ]


def test_an_axis_that_is_named_itself_does_what_is_asked_of_it():
    with mico(TWO, **LINK) as (rig, _):
        assert rig.move({LEFT: 10.0, RIGHT: -7.0}) == {LEFT: 10.0, RIGHT: -7.0}


def test_initialising_moves_linked_axes_one_by_one():
    with mico(TWO, **LINK) as (rig, controller):
        rig.initialise()
        assert len(controller.of("reference")) == 5
        assert rig.links


def test_the_failure_of_one_stops_the_other_and_fails_the_movement():
    with mico(TWO, instant=False, **LINK) as (rig, controller):
        movement = rig[LEFT].move_to(50.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        controller.fail(Channel(1, 0), DeviceFault.OVERHEATED)
        error = movement.exception(3)
        assert isinstance(error, DeviceError)
        assert error.fault is DeviceFault.OVERHEATED
        assert ("stop", Channel(0, 0)) in controller.calls


def test_cancelling_a_linked_movement_stops_all():
    with mico(TWO, instant=False, **LINK) as (rig, controller):
        movement = rig[RIGHT].move_to(50.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        movement.cancel()
        assert isinstance(movement.exception(3), cosmic.MoveCancelled)
        assert {call[1] for call in controller.of("stop")} == {Channel(0, 0), Channel(1, 0)}


def test_a_move_in_parts_takes_the_linked_axis_along_part_by_part():
    with mico(TWO, **LINK) as (rig, controller):
        StepwiseMove(rig[LEFT], 100.0, 40.0).movement.wait(5)
        targets = [call[2] for call in controller.of("move_to") if call[1] == Channel(1, 0)]
        assert targets == [40.0, 80.0, 100.0]


@pytest.mark.parametrize(
    ("link", "said"),
    [
        ({"first": LEFT, "second": LEFT}, "linked with itself"),
        ({"first": LEFT, "second": RIGHT, "ratio": 0.0}, "the ratio 0"),
        ({"first": LEFT, "second": "nobody"}, "no positioner 'nobody'"),
        ({"first": LEFT, "second": "d0.c2"}, "no sensor"),
        ({"first": LEFT, "second": "d2.c0"}, "not of one kind"),
    ],
)
def test_a_link_that_makes_no_sense_is_refused_in_file_and_script(link, said):
    layout = ("LLN", "LLL", "R")
    with pytest.raises(ValidationError, match=said):
        settings(layout, link=[link])
    with mico(layout) as (rig, _), pytest.raises(cosmic.CosmicError):
        rig.link(*link.values())


def test_a_loop_of_links_in_the_file_is_refused():
    loop = [(LEFT, RIGHT), (RIGHT, "d1.c1"), ("d1.c1", LEFT)]
    with pytest.raises(ValidationError, match="linked already"):
        settings(TWO, link=[{"first": one, "second": other} for one, other in loop])


@hypothesis_settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(-100, 100), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))))
def test_what_remains_after_each_movement_does_not_add_up(ways):
    links = LinkTable()
    links.add("a", "b", 2.0)
    stands = {"a": 0.0, "b": 0.0}
    total = 0.0
    for distance, rest_a, rest_b in ways:
        total += distance
        sent = links.expanded({"a": MoveBy(distance, "um")}, stands, 2.0)
        targets = {name: motion.target for name, motion in sent.items()}
        links.sent(targets)
        stands = {"a": targets["a"] + rest_a, "b": targets["b"] + rest_b}
        assert targets["b"] == pytest.approx(2.0 * targets["a"], abs=1e-6)
        assert targets["a"] == pytest.approx(total, abs=1e-6)


def test_an_axis_that_was_moved_otherwise_counts_from_where_it_stands():
    links = LinkTable()
    links.add("a", "b")
    links.sent({"a": 0.0, "b": 0.0})
    sent = links.expanded({"a": MoveTo(10.0, "um")}, {"a": 0.3, "b": 500.0}, 2.0)
    assert sent["b"].target == pytest.approx(510.0)


def test_a_rotary_axis_that_was_halted_goes_on_from_where_it_stands():
    with mico(("RRN",)) as (rig, controller):
        first, second = rig["d0.c0"], rig["d0.c1"]
        rig.link(first.key, second.key)
        controller.instant = False
        movement = first.move_to(1.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        for axis in (first, second):
            controller.position[axis.details.address] = 0.4
        first.halt()
        with pytest.raises(cosmic.MoveCancelled):
            movement.wait(5)
        wait_until(lambda: not (first.details.in_motion or second.details.in_motion))
        controller.instant = True
        first.move_by(0.1)
        assert (first.angle_deg, second.angle_deg) == pytest.approx((0.5, 0.5))


# Arriving together


@hypothesis_settings(max_examples=50)
@given(
    st.dictionaries(
        st.sampled_from("abcdef"),
        st.builds(
            Leg,
            distance=st.floats(0.0, 1e5),
            step=st.floats(0.01, 10.0),
            approach=st.floats(0.0, 50.0),
            top_hz=st.integers(1, 18500),
        ),
    )
)
def test_matched_speeds_are_within_what_was_set_and_end_together(legs):
    found = matched_frequencies(legs)
    moving = {name: leg for name, leg in legs.items() if leg.distance > 0.0}
    assert found.keys() == moving.keys()
    longest_s = max((leg.steps / leg.top_hz for leg in moving.values()), default=0.0)
    for name, hertz in found.items():
        leg = moving[name]
        assert 1 <= hertz <= leg.top_hz
        assert leg.steps / hertz <= longest_s * (1 + 1e-6)
        # One hertz less would be too slow.
        assert hertz == 1 or leg.steps / (hertz - 1) >= longest_s * (1 - 1e-6)


def test_matching_slows_the_shorter_move_down_and_restores_the_speed():
    with mico(TWO) as (rig, controller):
        controller.calls.clear()
        rig.move({LEFT: 980.0, RIGHT: 480.0}, match_arrival=True)
        speeds = {}
        for _, channel, hertz in controller.of("frequency"):
            speeds.setdefault(channel.device, []).append(hertz)
        assert speeds == {0: [5000, 5000], 1: [2500, 5000]}


def test_a_newer_move_gets_the_usual_speed_back():
    with mico(TWO, instant=False) as (rig, controller):
        rig.move({LEFT: 980.0, RIGHT: 480.0}, match_arrival=True, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 2)
        rig[RIGHT].move_to(0.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 3)
        right = [call for call in controller.of("frequency") if call[1] == Channel(1, 0)]
        assert right[-1][2] == 5000


# Starting together


def test_the_skew_of_a_start_is_measured_and_published():
    with mico(TWO) as (rig, _):
        heard = listen(rig.application.manager.group_started)
        group = rig.move({LEFT: 1.0, RIGHT: 1.0, "d0.c1": 1.0}, wait=False)
        group.wait(3)
        assert 0.0 < group.start_skew_ms < 1000.0
        assert heard[0].skew_ms == group.start_skew_ms
        assert set(heard[0].names) == {LEFT, RIGHT, "d0.c1"}
        assert rig.move({LEFT: 2.0}, wait=False).start_skew_ms == 0.0


def test_no_axis_starts_before_all_are_ready():
    with mico(TWO, instant=False) as (rig, controller):
        controller.block.clear()
        rig["d1.c1"].move_to(3.0, wait=False)  # its device hangs in this call
        wait_until(lambda: len(controller.of("move_to")) == 1)
        group = rig.move({LEFT: 1.0, RIGHT: 1.0}, wait=False)
        wait_until(lambda: rig[LEFT].details.in_motion)
        assert len(controller.of("move_to")) == 1
        assert group.start_skew_ms is None
        controller.block.set()
        wait_until(lambda: group.start_skew_ms is not None)
        assert len(controller.of("move_to")) == 3


@pytest.mark.parametrize("how", ["halt", "stop", "cancel"])
def test_an_axis_that_is_stopped_while_it_waits_never_starts_nor_do_the_others(how):
    with mico(TWO, instant=False) as (rig, controller):
        controller.block.clear()
        rig["d1.c1"].move_to(3.0, wait=False)
        wait_until(lambda: len(controller.of("move_to")) == 1)
        group = rig.move({LEFT: 1.0, RIGHT: 1.0}, wait=False)
        wait_until(lambda: rig[LEFT].details.in_motion)
        if how == "halt":
            rig[LEFT].halt()
        elif how == "stop":
            rig.application.manager.stop("test")
        else:
            group.cancel()
        wait_until(lambda: group.movements[LEFT].done)
        controller.block.set()
        wait_until(lambda: group.done)
        assert not group.success
        assert len(controller.of("move_to")) == 1


def test_axes_moved_together_by_distances_go_on_from_where_they_stand():
    with mico(TWO) as (rig, controller):
        rig.move({LEFT: 10.0, RIGHT: 20.0})
        rig.move_by({LEFT: 1.0, RIGHT: -1.0})
        assert sorted(call[2] for call in controller.of("move_to")) == [10.0, 11.0, 19.0, 20.0]


def test_the_failure_of_an_axis_that_waits_ends_the_others_before_they_are_ready():
    with mico(TWO, instant=False) as (rig, controller):
        manager = rig.application.manager
        controller.block.clear()
        rig["d1.c1"].move_to(3.0, wait=False)  # its device hangs in this call
        wait_until(lambda: len(controller.of("move_to")) == 1)
        motions = {LEFT: MoveTo(1.0, "um"), RIGHT: MoveTo(1.0, "um")}
        orders = manager.groups.order_together(motions, source="test")
        wait_until(lambda: rig[LEFT].details.in_motion)
        manager.device(LEFT).halt(manager.address(LEFT).channel, "halted")
        wait_until(lambda: orders[LEFT].movement.done)
        controller.block.set()
        assert isinstance(orders[RIGHT].movement.exception(5), cosmic.MoveCancelled)
        assert len(controller.of("move_to")) == 1


def test_an_axis_started_for_another_thread_stops_at_once_when_a_stop_overtook_its_call():
    with mico(TWO, instant=False) as (rig, controller):
        manager, sends = rig.application.manager, controller.move_to
        asks, ready, hangs, free = controller.ask_position, *(threading.Event() for _ in range(3))

        def send(channel, target, unit, *, hold_s):
            if channel == Channel(1, 1):
                ready.wait(10)
            elif channel == Channel(0, 0):
                manager.stop("overtakes the call")
                controller.calls.clear()
            sends(channel, target, unit, hold_s=hold_s)

        def ask(channel, unit):
            if hangs.is_set() and channel.device == 0:
                controller.calls.append(("hangs",))
                free.wait(10)
            asks(channel, unit)

        controller.move_to, controller.ask_position = send, ask
        rig["d1.c1"].move_to(3.0, wait=False)
        motions = {LEFT: MoveTo(1.0, "um"), RIGHT: MoveTo(1.0, "um")}
        orders = manager.groups.order_together(motions, source="test")
        wait_until(lambda: rig[LEFT].details.in_motion)
        hangs.set()
        wait_until(lambda: ("hangs",) in controller.calls)
        ready.set()
        sent = ("move_to", Channel(0, 0), 1.0)
        wait_until(lambda: any(call[:3] == sent for call in controller.calls))
        try:
            wait_until(lambda: ("stop", Channel(0, 0)) in controller.calls, 5)
        finally:
            free.set()
        for order in orders.values():
            assert isinstance(order.movement.exception(10), cosmic.StoppedError)


def test_an_axis_that_gets_another_target_while_it_waits_goes_there_only():
    with mico(TWO, instant=False) as (rig, controller):
        real, free = controller.move_to, threading.Event()

        def hangs_once(channel, target, unit, *, hold_s):
            if channel.device == 1:
                free.wait(5)
            real(channel, target, unit, hold_s=hold_s)

        controller.move_to = hangs_once
        rig["d1.c1"].move_to(3.0, wait=False)
        group = rig.move({LEFT: 1.0, RIGHT: 1.0}, wait=False)
        wait_until(lambda: rig[LEFT].details.in_motion)
        newer = rig[LEFT].move_to(9.0, wait=False)
        wait_until(lambda: group.movements[LEFT].done)
        free.set()
        wait_until(lambda: group.done)
        assert not newer.done
        assert [call[2] for call in controller.of("move_to")] == [9.0, 3.0]


def test_a_device_that_refuses_the_call_fails_its_axis_and_stops_the_others():
    with mico(TWO, instant=False) as (rig, controller):
        real = controller.move_to

        def picky(channel, target, unit, *, hold_s):
            if channel.device == 1:
                raise DeviceError("not today", fault=DeviceFault.PARAMETER)
            real(channel, target, unit, hold_s=hold_s)

        controller.move_to = picky
        group = rig.move({LEFT: 1.0, RIGHT: 1.0}, wait=False)
        with pytest.raises(DeviceError, match="not today"):
            group.wait(3)
        assert ("stop", Channel(0, 0)) in controller.calls


class _Axis:
    def __init__(self, name, log, *, sent=True):
        self.name, self._log, self._sent = name, log, sent

    def go(self):
        self._log.append(("go", self.name))
        return self._sent

    def report(self):
        self._log.append(("report", self.name))


def test_whoever_comes_last_starts_all_and_reports_afterwards():
    log, heard = [], []
    start = GroupStart(3, heard.append)
    threads = [
        threading.Thread(target=start.arrive, args=(_Axis(name, log),)) for name in ("a", "b", "c")
    ]
    for thread in threads:
        thread.start()
        thread.join()
    assert log == [(what, name) for what in ("go", "report") for name in "abc"]
    assert heard[0].names == ("a", "b", "c")


def test_nothing_lets_other_threads_in_more_often_between_the_calls_of_a_start():
    usual_s = sys.getswitchinterval()

    class Watching(_Axis):
        def go(self):
            self._log.append(sys.getswitchinterval())
            return super().go()

    log = []
    start = GroupStart(2, lambda _started: None)
    for name in ("a", "b"):
        start.arrive(Watching(name, log))
    intervals_s = [each for each in log if isinstance(each, float)]
    assert intervals_s == [usual_s, usual_s]


def test_a_start_of_which_all_was_withdrawn_is_none():
    log, heard = [], []
    start = GroupStart(1, heard.append)
    start.arrive(_Axis("a", log, sent=False))
    assert start.skew_ms is None
    assert not heard
