"""What a script does with ``rig.daqco`` it does the same at home and from another station."""

import itertools
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest

from contract.daqco_rig import DaqcoRig, daqco_rig, with_outputs
from contract.station_rig import wait_until
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.files import NamedFile
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import Crossing
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import declaration_of
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable, RecordingError
from cosmic.frame.file_names import NameOption

EVERYWHERE = ["home", "station"]


@pytest.fixture(params=EVERYWHERE)
def rig(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[DaqcoRig]:
    # A machine that is busy with other tests falls silent for a moment now and then.
    monkeypatch.setattr("cosmic.daqco.api.limit_watch.SILENCE_LIMIT_S", 5.0)
    with daqco_rig(request.param, with_outputs(tmp_path), may_move=True) as made:
        yield made


# --- what is known ----------------------------------------------------------------------------


def test_everything_is_known_as_it_is_locally(rig: DaqcoRig) -> None:
    daqco, home = rig.daqco, rig.home.application
    assert daqco.running
    assert daqco.problem == daqco.away == ""
    assert daqco.settings == home.settings
    assert daqco.channels == ("force", "channel1")
    assert daqco.units == {"force": "uN", "channel1": "V"}
    assert daqco.scales == home.scales()
    assert daqco.rate_hz == 1000.0
    assert daqco.highest_rate_hz() == 15_000.0
    assert [each.name for each in daqco.boards()] == ["Dev1", "Dev2"]
    assert daqco.directory == home.directory
    assert daqco.free_bytes(daqco.directory) > 0
    assert daqco.counters.lost == 0
    assert rig.daqco.latest()["force"] == pytest.approx(10.0, abs=0.1)
    rig.home.knob.level_v = 2.0
    assert wait_until(lambda: rig.daqco.latest()["force"] > 39.0)


def test_whoever_subscribes_gets_every_sample_in_order_and_read_only(rig: DaqcoRig) -> None:
    chunks: list[DataChunk] = []
    end = rig.daqco.subscribe(chunks.append)
    assert wait_until(lambda: sum(each.samples for each in list(chunks)) > 300)
    end()
    for before, after in itertools.pairwise(chunks):
        assert after.first_sample == before.first_sample + before.samples
    assert chunks[0].channels == ("force", "channel1")
    assert chunks[0].scales[0].unit == "uN"
    assert chunks[0].values[0] == pytest.approx(10.0, abs=0.1)
    assert not chunks[0].volts.flags.writeable


# --- what is commanded ------------------------------------------------------------------------


def test_a_command_is_seen_in_the_next_line_of_the_script(rig: DaqcoRig) -> None:
    daqco = rig.daqco
    daqco.configure(rate_hz=2000.0)
    assert daqco.rate_hz == daqco.settings.rate_hz == 2000.0
    daqco.set_scale("channel1", Scale("Lamp", "mW", (1.0, 2.0)))
    assert daqco.units["channel1"] == "mW"
    daqco.stop()
    assert not daqco.running
    daqco.start()
    assert daqco.running
    assert wait_until(lambda: daqco.latest_chunk is not None)
    _refused_as_at_home(rig)


def _refused_as_at_home(rig: DaqcoRig) -> None:
    daqco = rig.daqco
    before = daqco.settings
    channel = before.channel[0].model_copy(update={"board": "Dev9"})
    unknown = before.model_copy(update={"channel": (channel,)})
    with pytest.raises(CosmicError, match="Dev9") as refused:
        daqco.apply(unknown)
    assert type(refused.value).__name__ == "NotConnectedError"
    with pytest.raises(ConfigError):
        daqco.configure(rate_hz=float("nan"))
    with pytest.raises(ConfigError) as too_slow:
        daqco.configure(rate_hz=5.0)
    assert str(too_slow.value) == (
        "the sampling rate cannot be set: rate_hz should be greater than or equal to 10, not 5.0; "
        "the old one stays"
    )
    with pytest.raises(ConfigError, match="no active channel"):
        daqco.arm_limit("nothing", high=1.0)
    with pytest.raises(ConfigError):
        daqco.set_scale("nothing", Scale("Lamp", "mW", (1.0, 2.0)))
    assert daqco.settings == before
    assert daqco.running
    assert not rig.home.failures


def test_a_channel_averages_and_flies_for_a_plan(rig: DaqcoRig) -> None:
    channel = rig.daqco["force"]
    status = channel.trigger()
    assert status.exception(5.0) is None
    assert channel.read()["force"]["value"] == pytest.approx(10.0, abs=0.1)
    assert channel.kickoff().exception(5.0) is None
    assert channel.complete().exception(5.0) is None
    assert sum(len(page["time"]) for page in channel.collect_pages()) > 0


def _export_something(rig: DaqcoRig) -> None:
    file = rig.daqco.directory / "exported.h5"
    with rig.daqco.record(file):
        assert wait_until(lambda: rig.home.application.recorder.state.duration_s > 0.1)
    rig.daqco.export(file, file.with_suffix(".csv")).wait(10.0)


def _tare(rig: DaqcoRig) -> float:
    found: list[float] = []

    def tared() -> bool:
        with suppress(NotAvailable):  # a new scale began anew
            found.append(rig.daqco.tare("force"))
        return bool(found)

    assert wait_until(tared)
    return found[0]


def _play_something(rig: DaqcoRig) -> float:
    made_hz = rig.daqco.play("piezo", np.array([1.0, 2.0]), 200.0)
    assert wait_until(lambda: rig.home.library.output_level("Dev1", "ao0").at(WALL.now_s()) == 2.0)
    return made_hz


def _stop_outputs(rig: DaqcoRig) -> str:
    rig.daqco.stop_outputs("enough")
    assert wait_until(lambda: rig.daqco.outputs_stopped == "enough")
    return rig.daqco.outputs_stopped


FORCE_LIMIT = LimitSettings(channel="force", high=90.0, armed=True)
GIVEN: dict[str, Callable[[DaqcoRig], object]] = {
    "stop": lambda rig: rig.daqco.stop(),
    "start": lambda rig: rig.daqco.start(),
    "apply": lambda rig: rig.daqco.apply(
        rig.daqco.settings.model_copy(update={"refresh_hz": 10.0})
    ),
    "set_scale": lambda rig: rig.daqco.set_scale("channel1", Scale("Lamp", "mW", (1.0, 2.0))),
    "tare": _tare,
    "start_recording": lambda rig: rig.daqco.start_recording(rig.daqco.directory / "all.h5"),
    "mark": lambda rig: rig.daqco.mark("here"),
    "stop_recording": lambda rig: rig.daqco.stop_recording(),
    "folder_problem": lambda rig: rig.daqco.folder_problem(str(rig.daqco.directory)),
    "free_bytes": lambda rig: rig.daqco.free_bytes(rig.daqco.directory),
    "name_recording": lambda rig: rig.daqco.name_recording(
        "run", NameOption.NUMBER, rig.daqco.directory, datetime(2026, 11, 23, 12, 0, tzinfo=UTC)
    ),
    "recordings": lambda rig: rig.daqco.recordings(rig.daqco.directory),
    "export": _export_something,
    "set_limit": lambda rig: rig.daqco.set_limit(FORCE_LIMIT),
    "reset_limit": lambda rig: rig.daqco.reset_limit("force"),
    "disarm_limit": lambda rig: rig.daqco.disarm_limit("force"),
    "remove_limit": lambda rig: rig.daqco.remove_limit("force"),
    "set_output": lambda rig: rig.daqco.set_output("piezo", 1.5),
    "set_line": lambda rig: rig.daqco.set_line("lamp", high=True),
    "play": _play_something,
    "stop_outputs": _stop_outputs,
    "reset_outputs": lambda rig: rig.daqco.reset_outputs(),
}


def test_a_tare_calls_the_present_force_zero_and_says_what_it_was(rig: DaqcoRig) -> None:
    assert wait_until(lambda: rig.daqco.latest_chunk is not None)
    before = rig.daqco.latest()["force"]
    assert rig.daqco.tare("force") == pytest.approx(before, abs=0.2)
    assert rig.daqco.units["force"] == "uN"
    assert wait_until(lambda: abs(rig.daqco.latest()["force"]) < 0.2)
    with pytest.raises(NotAvailable):
        rig.daqco.tare("nothing")


def test_a_tare_moves_no_other_channel_that_has_the_same_scale(rig: DaqcoRig) -> None:
    channels = tuple(
        each.model_copy(update={"scale": "Probe"}) for each in rig.daqco.settings.channel
    )
    rig.daqco.apply(rig.daqco.settings.model_copy(update={"channel": channels}))
    before = rig.daqco.scales
    assert wait_until(lambda: rig.daqco.latest_chunk is not None)
    rig.daqco.tare("force")
    assert rig.daqco.scales["force"] != before["force"]
    assert rig.daqco.scales["channel1"] == before["channel1"]
    name = rig.daqco.scales["force"].name
    rig.daqco.tare("force")
    assert rig.daqco.scales["force"].name == name


def test_a_second_tare_before_new_samples_came_finds_zero(rig: DaqcoRig) -> None:
    assert wait_until(lambda: rig.daqco.latest_chunk is not None)
    rig.home.application.stop_acquisition()  # so that none come
    rig.daqco.tare("force")
    assert rig.daqco.tare("force") == pytest.approx(0.0, abs=1e-9)


def test_a_tare_takes_no_value_of_long_ago(rig: DaqcoRig, monkeypatch: pytest.MonkeyPatch) -> None:
    assert wait_until(lambda: rig.daqco.latest_chunk is not None)
    rig.home.application.stop_acquisition()
    before = rig.daqco.scales["force"]
    newest = rig.daqco.latest_chunk
    assert newest is not None
    later = SimpleNamespace(now_s=lambda: newest.end_time_s + 6.0, rate=1.0)
    monkeypatch.setattr(rig.home.application, "clock", later)
    with pytest.raises(NotAvailable, match="no zero of now"):
        rig.daqco.tare("force")
    assert rig.daqco.scales["force"] == before


def test_recordings_are_listed_beside_a_link_that_leads_nowhere(rig: DaqcoRig) -> None:
    folder = rig.daqco.directory
    (folder / "a.h5").touch()
    (folder / "gone.h5").symlink_to(folder / "nowhere.h5")
    assert rig.daqco.recordings(folder) == (folder / "a.h5",)


@pytest.mark.parametrize("name", ["a.csv", "a", "a.tdms", "a.b", ""])
def test_a_recording_is_written_under_no_name_of_another_format(rig: DaqcoRig, name: str) -> None:
    file = rig.daqco.directory / name
    with pytest.raises(RecordingError, match=r"end.* in \.h5"), rig.daqco.record(file):
        pass
    assert not file.is_file()
    assert not rig.daqco.recording.active


def test_a_folder_is_named_by_text_or_path(rig: DaqcoRig) -> None:
    folder = rig.daqco.directory
    assert rig.daqco.folder_problem(folder) == rig.daqco.folder_problem(str(folder)) == ""
    nowhere = folder / "nowhere"
    assert rig.daqco.folder_problem("") == "type a directory"
    assert rig.daqco.folder_problem(nowhere) == rig.daqco.folder_problem(str(nowhere)) != ""


def test_a_mark_without_a_recording_is_not_lost_without_a_word(rig: DaqcoRig) -> None:
    with pytest.raises(NotAvailable, match=r"nothing is recorded.*'here'.*begin a recording"):
        rig.daqco.mark("here")
    with rig.daqco.record(rig.daqco.directory / "marked.h5") as path:
        rig.daqco.mark("here")
    with pytest.raises(NotAvailable):
        rig.daqco.mark("too late")
    with open_recording(path) as recording:
        assert [event.text for event in recording.events] == ["here"]


def test_every_command_that_is_declared_is_carried_out(rig: DaqcoRig) -> None:
    assert set(GIVEN) == set(declaration_of(Daqco).commands)
    found = {name: give(rig) for name, give in GIVEN.items()}
    folder = rig.daqco.directory
    assert found["folder_problem"] == ""
    assert found["recordings"] == (folder / "all.h5",)
    named = found["name_recording"]
    assert isinstance(named, NamedFile)
    assert named.path.parent == folder
    with open_recording(folder / "all.h5") as recording:
        assert [event.text for event in recording.events] == ["here"]
    assert rig.daqco.settings.refresh_hz == 10.0
    assert rig.daqco.limits == ()
    assert found["play"] == pytest.approx(200.0)
    library = rig.home.library
    assert wait_until(lambda: library.line_is_high("Dev1", "port0/line3") is False)  # by the stop
    assert rig.home.library.output_level("Dev1", "ao0").at(WALL.now_s()) == 0.0
    assert wait_until(lambda: rig.daqco.outputs_stopped == "")
    assert not rig.home.failures


# --- recordings -------------------------------------------------------------------------------


def test_a_recording_lies_on_the_disk_of_the_boards_and_is_complete(rig: DaqcoRig) -> None:
    daqco = rig.daqco
    file = daqco.directory / "run.h5"
    with daqco.record(file):
        assert daqco.recording.active
        assert daqco.recording.path == file
        begun = rig.home.application.buffer.samples
        assert wait_until(lambda: rig.home.application.buffer.samples > begun + 200)
        daqco.mark("half time")
        with pytest.raises(NotAvailable, match="recording"):
            daqco.configure(rate_hz=500.0)
    assert not daqco.recording.active
    with open_recording(file) as recording:
        assert recording.complete
        assert recording.samples >= 200
        assert [event.text for event in recording.events] == ["half time"]
    with pytest.raises(RecordingError):
        daqco.start_recording(file)
    task = daqco.export(file, file.with_suffix(".csv"))
    task.wait(10.0)
    assert file.with_suffix(".csv").stat().st_size > 0
    folder = daqco.directory
    with pytest.raises(RecordingError, match=r"nothing\.h5"):
        rig.daqco.export(folder / "nothing.h5", folder / "nothing.csv").wait(10.0)


# --- limits -----------------------------------------------------------------------------------


def test_a_limit_stops_where_the_board_is_and_is_heard_of_remotely(rig: DaqcoRig) -> None:
    stopped_there: list[str] = []
    stopped_here: list[str] = []
    crossings: list[Crossing] = []
    rig.home.application.guard.trip = stopped_there.append
    if rig.remote is not None:
        rig.daqco.guard.trip = stopped_here.append
    rig.daqco.on_crossing(crossings.append)
    rig.daqco.arm_limit("force", high=30.0, hysteresis=2.0)
    assert [each.settings.armed for each in rig.daqco.limits] == [True]
    assert not rig.daqco.limits[0].crossed
    rig.home.knob.level_v = 2.0
    assert wait_until(lambda: bool(crossings) and rig.daqco.limits[0].crossed)
    assert crossings[0].channel == "force"
    assert crossings[0].value == pytest.approx(40.0, abs=0.5)
    assert len(stopped_there) == 1
    assert rig.remote is None or stopped_here == stopped_there
    with pytest.raises(NotAvailable, match="still beyond"):
        rig.daqco.reset_limit("force")
    rig.home.knob.level_v = 0.5
    assert wait_until(lambda: not rig.home.application.guard.limits["force"].beyond)
    rig.daqco.reset_limit("force")
    assert not rig.daqco.limits[0].crossed
    rig.daqco.remove_limit("force")
    assert rig.daqco.limits == ()
    assert len(crossings) == 1
    changed = Event()
    rig.daqco.on_change(changed.set)
    Daqco(rig.home.application).arm_limit("force", high=50.0)  # as somebody else would
    assert wait_until(lambda: [each.settings.armed for each in rig.daqco.limits] == [True])
    assert rig.remote is None or changed.wait(5.0)
