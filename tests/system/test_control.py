"""Control loops on the whole simulated platform: a force is held, and every end stops the axis."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from shutil import copytree
from threading import Event, Thread

import pytest

import cosmic
from cosmic.app import platform as platform_module
from cosmic.autonomy.control.handle import ControlHandle
from cosmic.autonomy.control.pid import PidGains
from cosmic.autonomy.control.sink import AxisSink
from cosmic.daqco.core.scale import Scale
from cosmic.frame.clock import WALL
from cosmic.frame.config import shipped_config_dir
from cosmic.twin.scene import Scene
from unit.mico.rigs import wait_until

RATE = 2.0


@dataclass
class Bench:
    """A rig in front of its fibre, and the truth of its twin."""

    rig: cosmic.Rig
    scene: Scene

    def truth_um(self, axis: str = "probe.y") -> float:
        return self.scene.stages[axis].position(self.rig.mico.application.manager.clock.now_s())

    def hold(self, setpoint_un: float = 50.0, **changes: object) -> ControlHandle:
        return self.rig.control.hold_force(
            "force",
            "probe.y",
            setpoint_un,
            direction=-1,
            **changes,  # type: ignore[arg-type]
        )


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    # A busy computer that runs tests may be late with samples for longer than a real one.
    folder = tmp_path_factory.mktemp("control") / "config"
    copytree(shipped_config_dir(), folder)
    file = folder / "platform.toml"
    slack = "\n[control]\nstale_s = 0.9\nlatency_s = 0.1\nresponse_s = 0.4\n"
    file.write_text(file.read_text(encoding="utf-8") + slack, encoding="utf-8")
    scenes: list[Scene] = []
    make = Scene.from_settings

    def keep(*args: object, **named: object) -> Scene:
        scenes.append(make(*args, **named))  # type: ignore[arg-type]
        return scenes[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(platform_module.Scene, "from_settings", keep)
        with cosmic.connect(folder, rate=RATE, applications=("mico", "daqco")) as rig:
            rig.mico.move({"left.z": -800.0, "left.x": 3600.0})
            rig.daqco.disarm_limit("force")  # what ends a loop here changes the scale as well
            yield Bench(rig, scenes[0])


@pytest.fixture
def far(bench: Bench) -> Iterator[Bench]:
    """The probe half a millimetre away from the fibre, so that an approach takes long."""
    bench.rig.mico["probe.y"].move_to(-4500.0)
    yield bench
    bench.rig.control.stop()
    wait_until(lambda: not bench.rig.control.loops)


@pytest.fixture
def lazy(far: Bench) -> Iterator[Bench]:
    """The same, with an axis that is slower than its loop: what is not stopped moves on."""
    axis = far.rig.mico["probe.y"]
    axis.set_closed_loop_frequency(10)
    yield far
    axis.set_closed_loop_frequency(5000)


@pytest.fixture
def near(bench: Bench) -> Iterator[Bench]:
    """The probe a few micrometres away from the fibre."""
    bench.rig.mico["probe.y"].move_to(-4975.0)
    yield bench
    bench.rig.control.stop()
    wait_until(lambda: not bench.rig.control.loops)


def test_a_force_is_held_within_its_tolerance_and_another_one_after_it(near: Bench) -> None:
    with near.hold(50.0) as loop:
        assert loop.wait_settled(timeout_s=20.0) == pytest.approx(50.0, abs=2.5)
        loop.aim(20.0)
        assert loop.wait_settled(2.0, timeout_s=20.0) == pytest.approx(20.0, abs=2.0)
        peak_un = loop.trace(20.0).measured.max()
        assert peak_un < 55.0
        pace = loop.statistics.pace
        assert pace.cycles > 100
        assert pace.period_p50_s == pytest.approx(0.005, abs=0.002)
        if pace.period_p99_s < 0.01:  # else it saw forces of another moment than its positions
            assert loop.stiffness_un_um == pytest.approx(2.1, rel=0.5)
    assert loop.ending == "asked to"
    assert loop.state == "ended"


def test_a_position_is_held_by_the_same_loop(far: Bench) -> None:
    gains = PidGains(4.0)
    with far.rig.control.hold(
        "probe.x", "probe.x", 30.0, gains, speed=100.0, travel=200.0, tolerance=2.0, dead_band=0.5
    ) as loop:
        assert loop.wait_settled(timeout_s=15.0) == pytest.approx(30.0, abs=2.0)
        assert loop.unit == "um"
        assert loop.stiffness_un_um is None
    far.rig.mico["probe.x"].move_to(0.0)


# Every way of ending


def by_stop(bench: Bench, loop: ControlHandle) -> None:
    loop.stop()


def by_stop_button(bench: Bench, loop: ControlHandle) -> None:
    bench.rig.stop("pressed")


def by_halt(bench: Bench, loop: ControlHandle) -> None:
    bench.rig.mico["probe.y"].halt()


def by_limit_of_the_loop(bench: Bench, loop: ControlHandle) -> None:
    bench.rig.faults.inject("sensor_saturated")


def by_limit_of_the_channel(bench: Bench, loop: ControlHandle) -> None:
    bench.rig.daqco.arm_limit("force", high=0.1, hysteresis=0.0)


def by_another_unit(bench: Bench, loop: ControlHandle) -> None:
    bench.rig.daqco.set_scale("force", Scale("other", "mN", (-0.25, 0.1)))


def by_another_scale(bench: Bench, loop: ControlHandle) -> None:
    bench.rig.daqco.set_scale("force", Scale("a fifth", "uN", (-50.0, 20.0)))


def by_silence(bench: Bench, loop: ControlHandle) -> None:
    library = bench.rig.daqco.application.library
    library.faults.inject("stalled", board="Dev1")  # type: ignore[attr-defined]


def by_dead_thread(bench: Bench, loop: ControlHandle) -> None:
    def fail(*_args: object) -> None:
        raise RuntimeError("a defect in the law")

    loop._loop.law.step = fail  # type: ignore[assignment,method-assign]


def undo(bench: Bench) -> None:
    rig = bench.rig
    rig.faults.clear()
    rig.daqco.application.library.faults.clear()  # type: ignore[attr-defined]
    rig.daqco.remove_limit("force")
    rig.daqco.set_scale("force", rig.daqco.settings.scales()["FT-S540"])
    rig.reset_stop()


WAYS: dict[Callable[[Bench, ControlHandle], None], str] = {
    by_stop: "asked to",
    by_stop_button: "stopped",
    by_halt: "interrupted",
    by_limit_of_the_loop: "limit",
    by_limit_of_the_channel: "stopped",
    by_another_unit: "device",
    by_another_scale: "device",
    by_silence: "no data",
    by_dead_thread: "defect",
}


@pytest.mark.defects
@pytest.mark.parametrize("end", WAYS, ids=lambda each: each.__name__)
def test_however_it_ends_the_axis_stands(
    end: Callable[[Bench, ControlHandle], None], lazy: Bench
) -> None:
    loop = lazy.hold()
    start_um = lazy.truth_um()
    wait_until(lambda: lazy.truth_um() < start_um - 2.0, 10.0)
    try:
        end(lazy, loop)
        # Silence is one once it has lasted, and until then the loop goes on.
        WALL.sleep(0.1 if end is not by_silence else 0.4)
        then_um = lazy.truth_um()
        assert loop.wait(5.0) == WAYS[end]
        WALL.sleep(0.1)
        assert lazy.truth_um() == pytest.approx(then_um, abs=0.3)
        assert loop.ending is not None
        assert loop.reason
        if WAYS[end] != "asked to":
            with pytest.raises(cosmic.CosmicError):
                loop.wait_settled()
        wait_until(lambda: not lazy.rig.mico["probe.y"].details.in_motion)
    finally:
        undo(lazy)


def test_a_computer_that_is_late_with_a_simulated_board_ends_no_loop(lazy: Bench) -> None:
    late, began, packets = Event(), Event(), 0

    def hinder(_chunk: object) -> None:
        began.set()
        late.wait(5.0)

    with lazy.hold() as loop:
        wait_until(lambda: loop.statistics.packets > 2)
        forget = lazy.rig.daqco.subscribe(hinder)
        try:
            assert began.wait(5.0)
            WALL.sleep(1.5 * lazy.rig.control.settings.stale_s)
            packets = loop.statistics.packets
            WALL.sleep(0.2)
            assert loop.running, loop.reason
            assert loop.statistics.packets == packets, "the axis waits"
        finally:
            late.set()
            forget()
        wait_until(lambda: loop.statistics.packets > packets)


def test_who_commands_the_axis_meanwhile_has_it(far: Bench) -> None:
    loop = far.hold()
    wait_until(lambda: loop.statistics.packets > 2)
    assert far.rig.mico["probe.y"].move_to(-4400.0) == pytest.approx(-4400.0, abs=1.0)
    assert loop.wait(1.0) == "interrupted"


def test_a_loop_that_rests_ends_when_its_axis_is_moved_or_everything_was_stopped(
    near: Bench,
) -> None:
    loop = near.hold(20.0)
    loop.wait_settled(timeout_s=20.0)
    axis = near.rig.mico["probe.y"]
    axis.move_to(-4900.0)
    assert loop.wait(5.0) == "interrupted"
    assert near.truth_um() == pytest.approx(-4900.0, abs=1.0)
    loop = near.hold(1.5)
    wait_until(lambda: loop.state == "holding")
    near.rig.stop("pressed")
    near.rig.reset_stop()
    assert loop.wait(5.0) == "stopped"
    loop = near.hold(1.5)
    wait_until(lambda: loop.state == "holding")
    axis.move_by(-100.0)
    assert loop.wait(5.0) == "interrupted"


def test_a_slow_axis_is_never_far_behind_its_last_move(lazy: Bench) -> None:
    lead_um = []
    with lazy.hold() as loop:
        start_um = lazy.truth_um()
        while lazy.truth_um() > start_um - 8.0:
            lead_um.append(lazy.truth_um() - loop._loop.sink.target)
            WALL.sleep(0.01)
    assert max(lead_um) < 2.2 * 0.1 * lazy.rig.control.settings.speed_um_s


def test_it_goes_no_farther_than_it_may(far: Bench) -> None:
    loop = far.hold(travel_um=5.0)
    with pytest.raises(cosmic.LimitError, match="travel"):
        loop.wait_settled(timeout_s=10.0)
    assert loop.ending == "limit"
    assert -4505.5 < far.truth_um() < -4502.0


def test_the_gate_decides_every_move_of_a_loop(far: Bench) -> None:
    axis = far.rig.mico["probe.x"]
    axis.move_to(5495.0)
    loop = far.rig.control.hold(
        "probe.x", "probe.x", 5600.0, PidGains(1.0), speed=50.0, travel=200.0, tolerance=1.0
    )
    with pytest.raises(cosmic.LimitError, match=r"probe\.x"):
        loop.wait_settled(timeout_s=10.0)
    assert far.truth_um("probe.x") <= 5500.5
    axis.move_to(0.0)


def test_all_loops_are_stopped_at_once_while_another_one_begins(
    far: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    running = far.hold()
    entered, released, begin = Event(), Event(), AxisSink.begin

    def slow(sink: AxisSink) -> None:
        entered.set()
        released.wait(10.0)
        begin(sink)

    monkeypatch.setattr(AxisSink, "begin", slow)
    control, begun = far.rig.control, list[ControlHandle]()

    def another() -> None:
        gains = PidGains(1.0)
        held = control.hold(
            "probe.x", "probe.x", 0.0, gains, speed=10.0, travel=50.0, tolerance=1.0
        )
        begun.append(held)

    begins, stops = Thread(target=another), Thread(target=control.stop)
    begins.start()
    try:
        assert entered.wait(5.0)
        stops.start()
        assert running.wait(1.0) == "asked to"
        assert not begun
    finally:
        released.set()
        begins.join()
        stops.join()
    assert begun[0].wait(5.0) == "asked to"


def test_a_position_is_not_held_by_driving_it_away(far: Bench) -> None:
    with pytest.raises(cosmic.ConfigError, match=r"probe\.x: its own position rises"):
        far.rig.control.hold(
            "probe.x",
            "probe.x",
            100.0,
            PidGains(1.0),
            direction=-1,
            speed=50.0,
            travel=200.0,
            tolerance=1.0,
        )
    assert far.rig.control.loops == ()


def test_a_new_set_point_beyond_the_limits_is_refused_and_the_old_one_stays(far: Bench) -> None:
    with far.hold(limit_un=60.0) as loop:
        with pytest.raises(cosmic.LimitError, match="does not lie inside"):
            loop.aim(61.0)
        assert loop.set_point == 50.0
        assert loop.limits == (-60.0, 60.0)
        assert loop.running
        with pytest.raises(cosmic.NotAvailable, match="already uses it"):
            far.hold(20.0)
        with pytest.raises(cosmic.DeviceTimeout, match="was not held"):
            loop.wait_settled(timeout_s=0.05)
    assert far.rig.control.newest is loop
    assert far.rig.control.loops == ()


def test_numbers_that_make_no_sense_are_named_in_plain_words(far: Bench) -> None:
    with pytest.raises(cosmic.ConfigError) as refused:
        far.rig.control.hold_force(
            "force", "left.y", 50.0, direction=-1, travel_um=-1.0, ramp_un_s=0.0
        )
    assert str(refused.value) == (
        "a loop cannot be made: travel_um should be greater than 0, not -1.0; "
        "ramp_un_s should be greater than 0, not 0.0"
    )


@pytest.mark.parametrize(
    ("asked", "error"),
    [
        ({"channel": "nothing"}, cosmic.ConfigError),
        ({"channel": "aux"}, cosmic.ConfigError),
        ({"axis": "nothing"}, cosmic.UnknownAxisError),
        ({"axis": "left.gripper"}, cosmic.NotAvailable),
        ({"axis": "table.rotation"}, cosmic.ConfigError),
        ({"setpoint_un": 151.0}, cosmic.LimitError),
        ({"setpoint_un": math.nan}, cosmic.LimitError),
        ({"direction": 0}, cosmic.ConfigError),
        ({"limit_un": math.inf}, cosmic.ConfigError),
        ({"setpoint_un": 5000.0, "limit_un": 10_000.0}, cosmic.ConfigError),
        ({"setpoint_un": 240.0, "limit_un": 260.0}, cosmic.ConfigError),
        ({"travel_um": -1.0}, cosmic.ConfigError),
        ({"ramp_un_s": math.nan}, cosmic.ConfigError),
        ({"tolerance_un": 0.0}, cosmic.ConfigError),
    ],
)
def test_what_cannot_be_is_refused_before_anything_moves(
    asked: dict[str, object], error: type[Exception], far: Bench
) -> None:
    usual = {"channel": "force", "axis": "probe.y", "setpoint_un": 50.0, "direction": -1}
    with pytest.raises(error):
        far.rig.control.hold_force(**(usual | asked))  # type: ignore[arg-type]
    assert far.rig.control.loops == ()
    assert far.truth_um() == pytest.approx(-4500.0, abs=1.0)


def test_a_value_that_its_channel_cannot_measure_is_refused(far: Bench) -> None:
    with pytest.raises(cosmic.LimitError, match="cannot be held: it measures from -250 to 250 uN"):
        far.rig.control.hold(
            "force", "probe.y", 300.0, PidGains(0.1), speed=10.0, travel=50.0, tolerance=1.0
        )
    assert far.rig.control.loops == ()


def test_a_stop_that_is_latched_is_reported_at_the_begin(far: Bench) -> None:
    far.rig.stop("pressed")
    with pytest.raises(cosmic.StoppedError, match="pressed"):
        far.hold()
    far.rig.reset_stop()


def test_a_device_that_is_lost_and_a_rig_that_is_closed_end_their_loops() -> None:
    with cosmic.connect(rate=RATE, applications=("mico", "daqco")) as rig:
        rig.control.settings = rig.control.settings.model_copy(update={"stale_s": 5.0})
        lost = rig.control.hold_force("force", "probe.y", 50.0, direction=-1)
        wait_until(lambda: lost.statistics.packets > 2)
        rig.faults.inject("unplugged", device=2)
        assert lost.wait(5.0) in ("device", "stopped")
        wait_until(lambda: rig.stopped is not None)  # it was lost while it moved
        rig.reset_stop()
        closed = rig.control.hold_force("force", "left.y", 50.0, direction=-1)
        wait_until(lambda: closed.statistics.packets > 2 or not closed.running)
    assert closed.wait(1.0) in ("asked to", "stopped")
    with pytest.raises(cosmic.NotAvailable, match="closed"):
        rig.control.hold_force("force", "left.y", 50.0, direction=-1)
