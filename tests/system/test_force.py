"""The whole simulated platform: the probe pushes a fibre, the force is seen, kept and guarded."""

import math
import threading
from collections.abc import Iterator
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

import cosmic
from cosmic.daqco.core.recording_file import RecordingFile
from cosmic.daqco.core.scale import Scale
from cosmic.frame.config import shipped_config_dir
from cosmic.vico.hw.peripherals import LensAxis
from unit.mico.rigs import wait_until


@pytest.fixture(scope="module")
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=4.0, applications=("mico", "daqco")) as rig:
        rig.mico.move({"left.z": -800.0, "left.x": 3600.0})
        rig.mico["probe.y"].move_to(-4900.0)
        yield rig


def force(rig: cosmic.Rig) -> float:
    return rig.daqco.latest()["force"]


def settled(rig: cosmic.Rig, target_um: float) -> float:
    rig.mico["probe.y"].move_to(target_um)
    arrived_s = rig.daqco.application.clock.now_s()
    wait_until(lambda: (chunk := rig.daqco.latest_chunk) is not None and chunk.time_s > arrived_s)
    return force(rig)


def test_the_force_rises_while_the_probe_goes_into_the_fibre_and_falls_back(
    rig: cosmic.Rig,
) -> None:
    before = settled(rig, -4940.0)
    pushed = settled(rig, -5020.0)
    further = settled(rig, -5040.0)
    back = settled(rig, -4900.0)
    assert abs(before) < 10.0
    assert 40.0 < pushed < further < 170.0
    assert abs(back) < 10.0


def test_a_recording_gives_force_over_position_and_a_stiffness(
    rig: cosmic.Rig, tmp_path: Path
) -> None:
    file = tmp_path / "push.h5"
    settled(rig, -4940.0)
    rig.mico["probe.y"].set_closed_loop_frequency(20)  # slowly, for positions are read at 20 Hz
    try:
        with rig.daqco.record(file):
            rig.mico["probe.y"].move_to(-5050.0)
            rig.daqco.mark("pushed")
            seen = rig.daqco.counters.samples
            wait_until(lambda: rig.daqco.counters.samples > seen + 500)
    finally:
        rig.mico["probe.y"].set_closed_loop_frequency(5000)
    with cosmic.open_recording(file) as recording:
        assert recording.complete
        assert recording.channels == rig.daqco.channels
        assert recording.units["force"] == "uN"
        assert not recording.overruns
        assert [event.kind for event in recording.events] == ["mark"]
        times = np.diff(recording.time_s)
        assert times == pytest.approx(np.full(times.shape, 1.0 / recording.rate_hz), rel=1e-3)
        volts, values = recording.volts("force"), recording.values("force")
        assert values == pytest.approx(-250.0 + 100.0 * volts)
        slope = recording.slope("force", "probe.y", high=-5000.0)
        assert 1.0 < -slope.value < 4.0
        assert slope.unit == "uN/um"
        assert set(recording.axes) == set(rig.mico.names)


def test_a_limit_that_is_crossed_stops_the_axes_and_stands_in_the_file(
    rig: cosmic.Rig, tmp_path: Path
) -> None:
    probe, file = rig.mico["probe.y"], tmp_path / "limit.h5"
    settled(rig, -4940.0)
    rig.daqco.arm_limit("force", high=100.0, hysteresis=10.0)
    probe.set_closed_loop_frequency(40)
    try:
        with rig.daqco.record(file):
            with pytest.raises(cosmic.StoppedError, match="force reached"):
                probe.move_to(-5300.0)
            assert rig.stopped is not None
            assert "force" in rig.stopped
    finally:
        rig.reset_stop()
        probe.set_closed_loop_frequency(5000)
    (limit,) = [each for each in rig.daqco.limits if each.settings.channel == "force"]
    assert limit.crossed
    assert limit.value is not None
    assert limit.value >= 100.0
    assert limit.reaction_ms is not None
    assert 0.0 < limit.reaction_ms < 1000.0
    settled(rig, -4900.0)
    (limit,) = [each for each in rig.daqco.limits if each.settings.channel == "force"]
    assert limit.crossed
    rig.daqco.reset_limit("force")
    rig.daqco.remove_limit("force")
    with cosmic.open_recording(file) as recording:
        (event,) = [each for each in recording.events if each.kind == "limit"]
        assert event.channel == "force"
        assert event.value == pytest.approx(limit.value)
        assert event.sample > 0


def test_scales_change_while_recording_but_not_rate_or_channels(
    rig: cosmic.Rig, tmp_path: Path
) -> None:
    file = tmp_path / "scales.h5"
    before = rig.daqco.settings
    with rig.daqco.record(file):
        with pytest.raises(cosmic.NotAvailable, match="while recording"):
            rig.daqco.configure(rate_hz=500.0)
        seen = rig.daqco.counters.samples
        wait_until(lambda: rig.daqco.counters.samples > seen + 300)
        rig.daqco.set_scale("aux", Scale("doubled", "mV", (0.0, 2000.0)))
        seen = rig.daqco.counters.samples
        wait_until(lambda: rig.daqco.counters.samples > seen + 300)
    rig.daqco.apply(before)
    with cosmic.open_recording(file) as recording:
        assert len(recording.scales["aux"]) == 2
        volts, values = recording.volts("aux"), recording.values("aux")
        assert values[:50] == pytest.approx(volts[:50])
        assert values[-50:] == pytest.approx(2000.0 * volts[-50:])


def test_rates_and_recordings_that_cannot_be_are_refused(rig: cosmic.Rig, tmp_path: Path) -> None:
    daqco = rig.daqco
    for rate_hz in (9.0, 15_001.0, math.nan):
        with pytest.raises(cosmic.CosmicError):
            daqco.configure(rate_hz=rate_hz)
    assert daqco.running
    assert daqco.rate_hz == pytest.approx(1000.0)
    with pytest.raises(cosmic.CosmicError, match="does not exist"):
        daqco.start_recording(tmp_path / "nowhere" / "x.h5")
    (tmp_path / "there.h5").write_text("mine", encoding="utf-8")
    with pytest.raises(cosmic.CosmicError, match=r"there\.h5"):
        daqco.start_recording(tmp_path / "there.h5")
    assert (tmp_path / "there.h5").read_text(encoding="utf-8") == "mine"
    with pytest.raises(cosmic.ConfigError, match="no active channel"):
        daqco.arm_limit("nothing", high=1.0)


def test_a_limit_needs_a_rate_that_is_fast_enough() -> None:
    with cosmic.connect(rate=2.0, applications=("daqco",)) as rig:
        with pytest.raises(cosmic.NotAvailable, match="isarm the limit first"):
            rig.daqco.configure(rate_hz=100.0)
        rig.daqco.disarm_limit("force")
        rig.daqco.configure(rate_hz=100.0)
        with pytest.raises(cosmic.NotAvailable, match="200 Hz"):
            rig.daqco.arm_limit("force", high=100.0)
        with pytest.raises(cosmic.NotAvailable):
            _ = rig.mico
        rig.daqco.configure(rate_hz=1000.0)
        rig.daqco.arm_limit("force", high=100.0)
        rig.daqco.configure(rate_hz=2000.0)
        assert rig.daqco.limits[0].settings.armed, "another rate leaves it watched"
        rig.daqco.stop()
        assert not rig.daqco.running
        rig.daqco.start()
        wait_until(lambda: bool(rig.daqco.application.buffer.get_latest_data()))
        assert "force" in rig.daqco.latest()


def test_a_value_of_before_is_not_taken_for_one_of_now() -> None:
    with cosmic.connect(rate=2.0, applications=("daqco",)) as rig:
        wait_until(lambda: rig.daqco.latest_chunk is not None)
        rig.daqco.stop()
        stopped = "acquisition is stopped; the newest value is [0-9.]+ s old"
        with pytest.raises(cosmic.NotAvailable, match=stopped):
            rig.daqco.latest()
        assert rig.daqco.latest_chunk is not None


def test_a_board_that_was_lost_is_reported_and_acquires_again_when_it_is_back() -> None:
    with cosmic.connect(rate=2.0, applications=("daqco",)) as rig:
        faults = rig.daqco.application.library.faults  # type: ignore[attr-defined]
        faults.inject("unplugged", board="Dev1")
        wait_until(lambda: bool(rig.daqco.problem))
        assert "Dev1" in rig.daqco.problem
        faults.clear()
        rig.daqco.start()
        assert not rig.daqco.problem
        seen = rig.daqco.counters.samples
        wait_until(lambda: rig.daqco.counters.samples > seen + 100)


def test_real_boards_have_no_rate(tmp_path: Path) -> None:
    folder = tmp_path / "config"
    copytree(shipped_config_dir(), folder)
    file = folder / "platform.toml"
    text = file.read_text(encoding="utf-8")
    start = text.index("[daqco]")
    real = text[start:].replace('backend = "simulated"', 'backend = "nidaqmx"', 1)
    file.write_text(text[:start] + real, encoding="utf-8")
    with pytest.raises(cosmic.ConfigError, match=r"daqco\.backend"):
        cosmic.connect(folder, rate=2.0)


def test_the_shipped_platform_watches_the_force_of_its_probe_from_the_start() -> None:
    with cosmic.connect(applications=("daqco",)) as fresh:
        wait_until(lambda: fresh.daqco.limits[0].settings.armed)
        (limit,) = fresh.daqco.limits
        assert (limit.settings.channel, limit.settings.low, limit.settings.high) == (
            "force",
            -150.0,
            150.0,
        )


def test_what_came_before_the_click_is_recorded_too(rig: cosmic.Rig, tmp_path: Path) -> None:
    daqco = rig.daqco
    wait_until(lambda: daqco.counters.samples > 3000)
    now_s = daqco.application.clock.now_s()
    rig.mico["probe.y"].move_by(5.0)
    daqco.start_recording(tmp_path / "late.h5", before_s=2.0)
    seen = daqco.counters.samples
    wait_until(lambda: daqco.counters.samples > seen + 500)
    daqco.stop_recording()
    with cosmic.open_recording(tmp_path / "late.h5") as recording:
        times = recording.time_s
        assert recording.start_s == pytest.approx(times[0], abs=0.01)
        assert np.diff(times) == pytest.approx(1.0 / recording.rate_hz, abs=1e-4)
        assert times[-1] - times[0] > 2.3
        assert times[0] < now_s + 1.0
        assert recording.overruns == ()
        when, _, _ = recording.positions("probe.y")
        assert when[0] < times[0] + 0.5
    with pytest.raises(cosmic.ConfigError, match="0 to 5 s"):
        daqco.start_recording(tmp_path / "other.h5", before_s=60.0)
    begun_s = daqco.application.clock.now_s()
    daqco.start_recording(tmp_path / "usual.h5")
    wait_until(lambda: daqco.recording.duration_s > 0.1)
    daqco.stop_recording()
    with cosmic.open_recording(tmp_path / "usual.h5") as recording:
        assert recording.time_s[0] > begun_s - 0.2


def test_the_shortest_recording_says_where_the_axes_were(rig: cosmic.Rig, tmp_path: Path) -> None:
    for number in range(8):
        file = tmp_path / f"{number}.h5"
        with rig.daqco.record(file):
            begun = rig.daqco.counters.samples
            wait_until(lambda least=begun: rig.daqco.counters.samples > least)
        with cosmic.open_recording(file) as recording:
            times, where, _ = recording.positions("probe.y")
            assert len(times) > 0
            assert np.isfinite(where).all()


def test_a_recording_is_active_until_its_file_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closing, go_on = threading.Event(), threading.Event()
    close = RecordingFile.close

    def slow(file: RecordingFile, *, complete: bool) -> None:
        closing.set()
        assert go_on.wait(10.0)
        close(file, complete=complete)

    monkeypatch.setattr(RecordingFile, "close", slow)
    with cosmic.connect(applications=("daqco",)) as rig:
        rig.daqco.start()
        rig.daqco.start_recording(tmp_path / "push.h5")
        stopping = threading.Thread(target=rig.daqco.stop_recording)
        stopping.start()
        try:
            assert closing.wait(10.0)
            state = rig.daqco.recording
            assert (state.active, state.path) == (True, tmp_path / "push.h5")
        finally:
            go_on.set()
            stopping.join()
        assert not rig.daqco.recording.active
    with cosmic.open_recording(tmp_path / "push.h5") as found:
        assert found.complete


def test_a_side_of_a_limit_that_is_not_given_stays_watched() -> None:
    with cosmic.connect(applications=("daqco",)) as rig:
        (before,) = [each.settings for each in rig.daqco.limits if each.settings.channel == "force"]
        rig.daqco.arm_limit("force", high=120.0)
        (limit,) = [each.settings for each in rig.daqco.limits if each.settings.channel == "force"]
        assert (limit.low, limit.high) == (before.low, 120.0)
        assert limit.hysteresis == before.hysteresis
        assert limit.armed
        with pytest.raises(cosmic.ConfigError, match="low must lie below high") as refused:
            rig.daqco.arm_limit("force", high=-1000.0)
        assert "http" not in str(refused.value)
        rig.daqco.set_limit(limit.model_copy(update={"low": None}))
        assert rig.daqco.limits[0].settings.low is None
        for forget in (rig.daqco.reset_limit, rig.daqco.remove_limit):
            with pytest.raises(cosmic.ConfigError, match="no active channel 'forse'"):
                forget("forse")


def test_the_lens_has_two_motors_and_no_other() -> None:
    with cosmic.connect(rate=50.0) as rig:
        lens = rig.vico.lens
        assert lens is not None
        lens.zoom_to(6.0).wait(30.0)
        by_name, by_axis = lens.state("zoom"), lens.state(LensAxis.ZOOM)  # type: ignore[arg-type]
        assert by_name == by_axis
        assert lens.state("focus") != by_name  # type: ignore[arg-type]
        with pytest.raises(cosmic.ConfigError, match="no motor 'foo'"):
            lens.state("foo")  # type: ignore[arg-type]
