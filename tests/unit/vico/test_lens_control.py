"""The thread of lens and light: commands, what it publishes, and what happens when a line fails."""

from collections.abc import Callable, Iterator
from threading import Event

import pytest
from PySide6.QtCore import Qt

from contract.peripheral_rig import PeripheralRig
from cosmic.frame.clock import WALL, RatedClock
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    MoveCancelled,
    NotAvailable,
    NotConnectedError,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import STALL_S
from cosmic.frame.network.caller import Call, Caller, carrying_out
from cosmic.frame.network.dead_man import DeadMan, Pulse
from cosmic.frame.operation import Task
from cosmic.vico.core.lens_control import PeripheralThread
from cosmic.vico.hw.factory import make_lens, make_light
from cosmic.vico.hw.navitar import NavitarLens
from cosmic.vico.hw.peripherals import LensAxis, LensState
from cosmic.vico.hw.sim_peripherals import SimPeripherals
from system.simulated_platform import wait_until

ZOOM, FOCUS = LensAxis.ZOOM, LensAxis.FOCUS


class Bench:
    """A twin fifty times faster than the wall, and the thread under test."""

    def __init__(self, *, cold: bool = False, timeout_s: float = 60.0, rate: float = 50.0) -> None:
        rig = PeripheralRig(cold=cold)
        self.clock = RatedClock(rate)
        self.lens, self.light = rig.lens, rig.light
        self.simulation = SimPeripherals(rig.lens, rig.light, self.clock)
        self.faults = self.simulation.faults
        self.thread = PeripheralThread(
            lambda: make_lens("simulated", simulation=self.simulation),
            lambda: make_light("simulated", simulation=self.simulation),
            self.clock,
            FailurePolicy(),
            timeout_s=timeout_s,
        )

    def start(self) -> "Bench":
        self.thread.start()
        wait_until(lambda: self.thread.state.light_percent is not None)
        return self

    def true_counts(self, axis: LensAxis) -> float:
        return self.lens.position_counts(axis.value, self.clock.now_s())


Make = Callable[..., Bench]


@pytest.fixture
def make() -> Iterator[Make]:
    made: list[Bench] = []

    def bench(**options: float) -> Bench:
        made.append(Bench(**options))  # type: ignore[arg-type]
        return made[-1]

    yield bench
    for each in made:
        each.thread.request_end()
        assert each.thread.join()


def failure(task: Task) -> CosmicError:
    with pytest.raises(CosmicError) as caught:
        task.wait(5.0)
    return caught.value


def test_it_publishes_what_lens_and_light_say(make: Make) -> None:
    bench = make().start()
    state = bench.thread.state
    assert state.zoom is not None and state.focus is not None
    assert (state.zoom.position_counts, state.focus.position_counts) == (0, 4000)
    assert (state.light_percent, state.lens_problem, state.light_problem) == (50.0, "", "")
    assert "generation 1" in bench.thread.lens_name
    assert "BrightLight" in bench.thread.light_name


def test_a_seek_ends_when_the_motor_is_there_and_reports_how_far_it_is(make: Make) -> None:
    bench = make().start()
    fractions: list[float] = []
    task = bench.thread.seek(ZOOM, 12000)
    task.subscribe(lambda progress: fractions.append(progress.fraction))
    task.wait(5.0)
    assert bench.true_counts(ZOOM) == pytest.approx(12000, abs=1)
    zoom = bench.thread.state.zoom
    assert zoom is not None and zoom.position_counts == 12000 and not zoom.moving
    wait_until(lambda: fractions[-1] == 1.0)
    assert fractions == sorted(fractions)


def test_movement_is_reported_at_most_twenty_times_a_second(make: Make) -> None:
    bench = make(rate=5.0).start()
    received: list[object] = []
    bench.thread.state_changed.connect(received.append, Qt.ConnectionType.DirectConnection)
    task = bench.thread.seek(ZOOM, 12000)
    task.wait(5.0)
    elapsed_s = task.progress.elapsed_s or 0.0
    assert 3 <= len(received) <= 20.0 * elapsed_s + 3


def test_on_a_fast_twin_a_short_seek_takes_no_longer_than_the_motor_needs(make: Make) -> None:
    bench = make(rate=20.0).start()
    took_s = []
    for number in range(5):
        began_s = bench.clock.now_s()
        bench.thread.seek(FOCUS, 4080 + 80 * number).wait(5.0)
        took_s.append(bench.clock.now_s() - began_s)
    # 0.15 s of the motor and one look; a look of the wall, 0.05 s, would be 1 s here.
    assert min(took_s) < 0.6


def test_a_lens_not_homed_says_so_and_can_be_homed(make: Make) -> None:
    bench = make(cold=True).start()
    refused = failure(bench.thread.seek(ZOOM, 100))
    assert isinstance(refused, NotAvailable) and "home it first" in str(refused)
    assert bench.thread.history.counts_at(ZOOM, bench.clock.now_s()) is None
    bench.thread.home().wait(5.0)
    state = bench.thread.state
    assert state.zoom is not None and state.zoom.homed
    assert state.focus is not None and state.focus.homed
    bench.thread.seek(ZOOM, 100).wait(5.0)
    assert bench.true_counts(ZOOM) == pytest.approx(100, abs=1)


def test_a_target_off_the_travel_is_refused_and_the_line_stays(make: Make) -> None:
    bench = make().start()
    assert isinstance(failure(bench.thread.seek(FOCUS, 9000)), ConfigError)
    assert bench.thread.state.lens_problem == ""
    bench.thread.seek(FOCUS, 4100).wait(5.0)


def test_abort_overtakes_what_waits_and_ends_every_movement(make: Make) -> None:
    bench = make(rate=1.0).start()
    moving = bench.thread.seek(ZOOM, 12000)
    wait_until(lambda: bench.true_counts(ZOOM) > 100)
    bench.thread.abort()
    assert isinstance(failure(moving), MoveCancelled)
    wait_until(lambda: not bench.thread.state.moving)
    assert bench.true_counts(ZOOM) < 12000


def test_commands_that_wait_behind_an_abort_are_cancelled(make: Make) -> None:
    bench = make()  # not started: everything waits
    waiting = bench.thread.seek(ZOOM, 5000)
    light = bench.thread.set_light(10.0)
    bench.thread.abort()
    assert isinstance(failure(waiting), MoveCancelled)
    bench.start()
    light.wait(5.0)
    assert bench.true_counts(ZOOM) == 0.0


def test_cancelling_a_task_stops_the_motor(make: Make) -> None:
    bench = make(rate=1.0).start()
    task = bench.thread.seek(FOCUS, 8000)
    wait_until(lambda: bench.thread.state.moving)
    task.cancel()
    assert isinstance(failure(task), MoveCancelled)
    wait_until(lambda: not bench.thread.state.moving)
    assert bench.true_counts(FOCUS) < 8000


def test_a_newer_target_replaces_the_older_one(make: Make) -> None:
    bench = make(rate=5.0).start()
    older = bench.thread.seek(FOCUS, 8000)
    newer = bench.thread.seek(FOCUS, 5000)
    assert isinstance(failure(older), MoveCancelled)
    newer.wait(5.0)
    assert bench.true_counts(FOCUS) == pytest.approx(5000, abs=1)


def test_of_many_brightnesses_the_last_counts(make: Make) -> None:
    bench = make()
    tasks = [bench.thread.set_light(percent) for percent in (10.0, 20.0, 30.0)]
    bench.start()
    tasks[-1].wait(5.0)
    assert bench.thread.history.light_at(bench.clock.now_s()) == 30.0
    assert [isinstance(each.failure, MoveCancelled) for each in tasks] == [True, True, False]
    assert bench.thread.state.light_percent == 30.0
    assert bench.light.percent(bench.clock.now_s()) == 30.0
    assert isinstance(failure(bench.thread.set_light(float("nan"))), ConfigError)


def test_a_lost_line_fails_its_task_goes_grey_with_the_reason_and_can_be_reopened(
    make: Make,
) -> None:
    bench = make(rate=1.0).start()
    task = bench.thread.seek(ZOOM, 12000)
    wait_until(lambda: bench.thread.state.moving)
    bench.faults.inject("unplugged")
    lost = failure(task)
    assert isinstance(lost, DeviceError) and lost.fault == DeviceFault.COMMUNICATION
    state = bench.thread.state
    assert state.zoom is None and "the line is lost" in state.lens_problem
    assert state.light_percent == 50.0 and state.light_problem == ""
    assert bench.thread.history.counts_at(ZOOM, bench.clock.now_s()) is None
    assert isinstance(failure(bench.thread.seek(ZOOM, 1)), NotAvailable)
    assert isinstance(failure(bench.thread.reopen()), NotAvailable)
    bench.faults.clear()
    bench.thread.reopen().wait(5.0)
    assert bench.thread.state.zoom is not None and bench.thread.state.lens_problem == ""


def test_a_silent_light_leaves_the_lens_alone(make: Make) -> None:
    bench = make().start()
    bench.faults.inject("silent", where="light")
    assert isinstance(failure(bench.thread.set_light(5.0)), DeviceTimeout)
    assert bench.thread.state.light_percent is None and bench.thread.state.light_problem
    bench.thread.seek(ZOOM, 50).wait(5.0)


def test_a_device_missing_at_the_start_is_reported_and_kept_apart() -> None:
    rig = PeripheralRig()

    def missing() -> None:
        raise NotConnectedError("serial port 'X' is not there")

    thread = PeripheralThread(
        missing,
        lambda: make_light("simulated", simulation=rig.simulation),
        rig.clock,
        FailurePolicy(),
    )
    thread.start()
    try:
        wait_until(lambda: thread.state.light_percent is not None)
        assert thread.state.lens_problem == "serial port 'X' is not there"
        assert thread.state.zoom is None and thread.lens_name == ""
        thread.abort()
        thread.set_light(1.0).wait(5.0)
    finally:
        thread.request_end()
        assert thread.join()


def test_a_movement_that_takes_too_long_is_stopped_and_fails(make: Make) -> None:
    bench = make(rate=2.0, timeout_s=0.5).start()
    late = failure(bench.thread.seek(FOCUS, 8000))
    assert isinstance(late, DeviceTimeout) and "0.5 s" in str(late)
    wait_until(lambda: not bench.thread.state.moving)
    assert bench.true_counts(FOCUS) < 8000


def test_closing_stops_what_moves_and_refuses_what_comes_later(make: Make) -> None:
    bench = make(rate=1.0).start()
    task = bench.thread.seek(FOCUS, 8000)
    wait_until(lambda: bench.thread.state.moving)
    bench.thread.request_end()
    assert bench.thread.join()
    assert isinstance(failure(task), MoveCancelled)
    assert bench.lens.position_counts("focus", bench.clock.now_s() + 60.0) < 8000
    assert isinstance(failure(bench.thread.set_light(1.0)), NotAvailable)


def test_the_past_can_be_looked_up_as_it_truly_was(make: Make) -> None:
    bench = make(rate=1.0).start()
    before_s = bench.clock.now_s()
    bench.thread.seek(ZOOM, 3000).wait(10.0)
    after_s = bench.clock.now_s()
    history = bench.thread.history
    assert history.counts_at(ZOOM, before_s) == 0.0
    assert history.counts_at(ZOOM, after_s) == 3000.0
    assert history.counts_at(ZOOM, -1.0) is None
    for part in range(1, 20):
        time_s = before_s + part * (after_s - before_s) / 20
        reckoned = history.counts_at(ZOOM, time_s)
        true = bench.lens.position_counts("zoom", time_s)
        assert reckoned == pytest.approx(true, abs=400)  # 50 ms at 8000 counts/s
    assert history.light_at(after_s) == 50.0


def test_a_motor_that_stops_short_of_its_target_is_said_at_once(make: Make) -> None:
    bench = make(rate=1.0).start()
    task = bench.thread.seek(FOCUS, 8000)
    wait_until(lambda: bench.thread.state.moving)
    bench.lens.abort("focus", bench.clock.now_s())  # somebody at the controller's own keys
    stranded = failure(task)
    assert isinstance(stranded, DeviceError) and "instead of 8000" in str(stranded)
    assert bench.thread.state.lens_problem == "", "the line is well"


def test_homing_that_somebody_stops_is_said(make: Make) -> None:
    bench = make(cold=True, rate=1.0).start()
    task = bench.thread.home(FOCUS)
    wait_until(lambda: bench.lens.counter("focus", bench.clock.now_s()) < -100)
    bench.lens.abort("focus", bench.clock.now_s())
    stranded = failure(task)
    assert isinstance(stranded, DeviceError) and stranded.fault == DeviceFault.REFERENCE
    assert bench.thread.state.focus is not None and not bench.thread.state.focus.homed


def test_a_remote_movement_stops_when_whoever_commanded_it_is_gone(make: Make) -> None:
    bench = make(rate=1.0).start()
    pulse = Pulse("vision", limit_s=5.0, clock=WALL)
    with carrying_out(Call(Caller("vision", "secret"), DeadMan(pulse, 5.0))):
        task = bench.thread.seek(FOCUS, 7900)
    wait_until(lambda: bench.thread.state.moving)
    pulse.end("vision is gone")
    error = failure(task)
    assert isinstance(error, MoveCancelled)
    assert "vision is gone" in str(error)
    wait_until(lambda: not bench.thread.state.moving)
    assert bench.true_counts(FOCUS) < 7800
    with carrying_out(Call(Caller("vision", "secret"), DeadMan(pulse, 5.0))):
        assert "not started: vision is gone" in str(failure(bench.thread.home()))
    assert not bench.thread.state.moving


def test_a_line_that_hangs_is_named_and_nobody_waits_for_it(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, hung, released = make().start(), Event(), Event()
    whole = NavitarLens.state

    def hangs(lens: NavitarLens, axis: LensAxis) -> LensState:
        hung.set()
        released.wait(10.0)
        return whole(lens, axis)

    monkeypatch.setattr(NavitarLens, "state", hangs)
    thread = bench.thread
    under_way, waiting = thread.home(), thread.set_light(20.0)
    try:
        assert hung.wait(5.0)
        thread.heartbeat.look(0.5)
        thread.heartbeat.look(STALL_S)
        for task in (under_way, waiting, thread.home()):
            assert "a driver has not returned from a call for 5 s" in str(failure(task))
        state = thread.state
        assert state.zoom is state.focus is state.light_percent is None
        assert "whether the lens moves is unknown" in state.lens_problem
    finally:
        released.set()
    wait_until(lambda: thread.heartbeat.look(0.0) or not thread.state.lens_problem)
    assert thread.set_light(30.0).wait(5.0) is None
    assert thread.state.zoom is not None
