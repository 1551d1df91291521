from itertools import pairwise

import pytest

import cosmic
from cosmic.frame.clock import WALL
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import mico, wait_until

X = Channel(0, 0)


def keep_alive(jog, duration_s):
    end = WALL.now_s() + duration_s
    while WALL.now_s() < end and not jog.done:
        jog.renew()
        WALL.sleep(0.01)


def test_a_jog_is_made_of_packets_of_at_most_a_tenth_of_a_second():
    with mico() as (rig, controller):
        with rig["d0.c0"].jog(1, speed=1000.0) as jog:
            keep_alive(jog, 0.4)
        with pytest.raises(cosmic.MoveCancelled):
            jog.movement.wait(2)
        targets = [0.0, *(call[2] for call in controller.of("move_to"))]
        ways = [after - before for before, after in pairwise(targets)]
        assert len(ways) > 4
        assert max(ways) <= 100.0 + 1e-6
        assert min(ways) >= 0.0
        assert 250.0 < targets[-1] < 700.0
        assert ("stop", X) in controller.calls


def test_a_jog_that_nobody_renews_stops_by_itself():
    with mico() as (rig, controller):
        jog = rig["d0.c0"].jog(-1, speed=1000.0)
        began = WALL.now_s()
        jog.movement.wait(3)
        assert 0.2 < WALL.now_s() - began < 1.0
        assert ("stop", X) in controller.calls
        assert -500.0 < rig["d0.c0"].position_um < -100.0


def test_letting_go_stops_at_once():
    with mico() as (rig, controller):
        jog = rig["d0.c0"].jog(1)
        wait_until(lambda: bool(controller.of("move_to")))
        jog.end()
        assert ("stop", X) in controller.calls
        with pytest.raises(cosmic.MoveCancelled):
            jog.movement.wait(2)


def test_a_jog_ends_at_the_soft_limit_and_not_beyond():
    with mico() as (rig, controller):
        rig["d0.c0"].move_to(4950.0)
        jog = rig["d0.c0"].jog(1, speed=1000.0)
        keep_alive(jog, 1.0)
        assert jog.movement.wait(2) == 5000.0
        assert max(call[2] for call in controller.of("move_to")) == 5000.0
        with pytest.raises(cosmic.LimitError):
            rig["d0.c0"].jog(1, speed=1000.0).movement.wait(2)


def test_a_stop_ends_a_jog_and_none_begins_while_it_is_latched():
    with mico() as (rig, controller):
        jog = rig["d0.c0"].jog(1)
        wait_until(lambda: bool(controller.of("move_to")))
        rig.application.manager.stop("test")
        with pytest.raises(cosmic.StoppedError):
            jog.movement.wait(2)
        sent = len(controller.of("move_to"))
        jog.renew()
        with pytest.raises(cosmic.StoppedError):
            rig["d0.c0"].jog(1).movement.wait(2)
        assert len(controller.of("move_to")) == sent


def test_an_axis_without_sensor_jogs_by_short_bursts_of_steps():
    with mico() as (rig, controller):
        with rig["d0.c2"].jog(-1, speed=300) as jog:
            keep_alive(jog, 0.3)
        jog.movement.exception(2)
        bursts = controller.of("step")
        assert len(bursts) > 3
        assert all(call[2] == -30 and call[4] == 300 for call in bursts)


@pytest.mark.parametrize(("direction", "speed"), [(0, 1.0), (2, 1.0), (1, 0.0), (1, float("nan"))])
def test_a_senseless_jog_is_refused(direction, speed):
    with mico() as (rig, controller), pytest.raises(cosmic.MoveRefused):
        rig["d0.c0"].jog(direction, speed)
    assert not controller.of("move_to")


@pytest.mark.parametrize("speed", ["150 um/s", "0.15 mm/s", "150", " 150 µm/s "])
def test_a_speed_may_be_said_with_its_unit(speed):
    with mico() as (rig, controller):
        rig["d0.c0"].jog(1, speed=speed).movement.wait(2)
        steered = rig["d0.c0"].steer(f"-{speed.strip()}", dead_man_s=0.2).movement
        assert steered.exception(2.0) is not None, "nobody renewed it"
        speeds = [call[2] for call in controller.of("frequency") if call[1] == X]
        assert speeds[1::2] == [150, 750], "a hand that steers may catch up"
        targets = [call[2] for call in controller.of("move_to")]
        assert targets[-1] < max(targets), "the other way"


@pytest.mark.parametrize("speed", ["5 um", "5 deg/s", "5 Hz", "5 um/min"])
def test_a_speed_in_another_unit_is_refused_with_those_that_fit(speed):
    with mico() as (rig, controller), pytest.raises(cosmic.MoveRefused, match="use one of nm/s"):
        rig["d0.c0"].jog(1, speed)
    assert not controller.of("move_to")


def test_a_jog_limits_the_speed_while_it_lasts_and_gives_it_back():
    with mico() as (rig, controller):
        rig["d0.c0"].set_closed_loop_frequency(4000)
        jog = rig["d0.c0"].jog(1, speed=150.0)
        jog.movement.wait(2)
        wait_until(lambda: len(controller.of("frequency")) >= 5)
        assert [call[2] for call in controller.of("frequency") if call[1] == X] == [
            5000,
            4000,
            150,
            4000,
        ]


@pytest.mark.parametrize("direction", [1, -1])
def test_an_axis_left_outside_its_limits_jogs_back_to_the_inside_and_no_further_out(direction):
    with mico(watch={"idle_poll_s": 0.1}) as (rig, controller):
        axis = rig["d0.c0"]
        controller.position[X] = -5972.0 * direction
        wait_until(lambda: axis.position_um == -5972.0 * direction)
        with axis.jog(direction, speed=4000.0) as jog:
            keep_alive(jog, 0.5)
        assert isinstance(jog.movement.exception(2), cosmic.MoveCancelled)
        targets = [call[2] * direction for call in controller.of("move_to")]
        assert len(targets) > 5
        assert targets == sorted(targets)
        assert targets[-1] > -5000.0
        controller.position[X] = -5972.0 * direction
        wait_until(lambda: axis.position_um == -5972.0 * direction)
        with pytest.raises(cosmic.LimitError):
            axis.jog(-direction, speed=4000.0).movement.wait(2)
        axis.move_by(20.0 * direction)
        assert axis.move_to(-5900.0 * direction) == -5900.0 * direction
        with pytest.raises(cosmic.LimitError):
            axis.move_to(-5901.0 * direction)


def test_an_axis_without_sensor_jogs_no_faster_than_it_is_asked_to():
    with mico() as (rig, controller):
        began_s = WALL.now_s()
        with rig["d0.c2"].jog(1, speed=4) as jog:
            keep_alive(jog, 0.6)
            asked = 4 * (WALL.now_s() - began_s)
        jog.movement.exception(2)
        assert 2 <= sum(call[2] for call in controller.of("step")) <= asked + 1


def test_the_steps_of_a_steered_axis_without_sensor_are_counted_as_they_are_made():
    with mico() as (rig, _):
        axis = rig["d0.c2"]
        steering = axis.steer(200.0, dead_man_s=0.5)
        until_s = WALL.now_s() + 0.5
        while WALL.now_s() < until_s:
            steering.renew(-200.0)
            WALL.sleep(0.01)
        steering.end()
        steering.movement.exception(2)
        assert -250.0 < axis.position_um < -75.0, "100 steps of 1.5 um back"


def test_an_axis_without_sensor_that_is_steered_at_no_speed_makes_no_step():
    with mico() as (rig, controller):
        steering = rig["d0.c2"].steer(200.0, dead_man_s=0.5)
        wait_until(lambda: len(controller.of("step")) > 1)
        steering.renew(0.0)
        steering.movement.wait(2)
        assert all(call[2] > 0 for call in controller.of("step"))
