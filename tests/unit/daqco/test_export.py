"""Recordings as CSV and TDMS, read back by pandas and npTDMS."""

import numpy as np
import pandas as pd
import pytest
from nptdms import TdmsFile

from cosmic.daqco.api import export
from cosmic.daqco.api.export import export_csv, export_file, export_tdms
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.recording_file import RecordingFile
from cosmic.daqco.core.recording_format import AxisPosition, RecordedEvent
from cosmic.frame.errors import ExportCancelled, RecordingError, RecordingExistsError
from unit.daqco.recording_helpers import FORCE, START_UTC, chunks, header, volts_of


@pytest.fixture
def recorded(tmp_path):
    """A recording with a gap, a mark and positions, and its voltages."""
    head = header()
    volts = volts_of(2, 5000)
    file = RecordingFile(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts[:, :3000]):
        file.append(chunk)
    for chunk in chunks(head, volts[:, 3000:], first_sample=3100):
        file.append(chunk)
    file.add_event(RecordedEvent(101.0, 1000, "mark", 'he said "now", µ', "force", 3.5))
    file.add_positions([AxisPosition(100.0, "probe.x", 1.5), AxisPosition(100.5, "probe.x", 2.5)])
    file.add_positions([AxisPosition(100.0, "table.rotation", -3.0, "deg", "estimated")])
    file.close(complete=True)
    return tmp_path / "run.h5", volts


def test_pandas_reads_the_csv(recorded):
    path, volts = recorded
    assert export_file(path, "csv") == path.with_suffix(".csv")
    found = pd.read_csv(path.with_suffix(".csv"))
    assert list(found.columns) == ["time_s", "force_uN", "noise_V"]
    assert len(found) == 5000
    np.testing.assert_allclose(found["force_uN"], FORCE.apply(volts[0]), rtol=1e-8)
    np.testing.assert_allclose(found["noise_V"], volts[1], rtol=1e-8, atol=1e-12)
    assert found["time_s"][3000] == pytest.approx(103.1, abs=1e-7)


def test_positions_and_events_lie_beside_the_csv(recorded):
    path, _ = recorded
    export_file(path, "csv")
    positions = pd.read_csv(path.with_name("run.positions.csv"))
    assert positions["axis"].tolist() == ["probe.x", "probe.x", "table.rotation"]
    assert positions["position"].tolist() == [1.5, 2.5, -3.0]
    assert positions["unit"].tolist() == ["um", "um", "deg"]
    assert positions["confidence"].tolist() == ["known", "known", "estimated"]
    events = pd.read_csv(path.with_name("run.events.csv"))
    assert events["kind"].tolist() == ["mark", "overrun"]
    assert events["text"][0] == 'he said "now", µ'
    assert events["value"].tolist() == [3.5, 100.0]


def test_nothing_lies_beside_a_csv_without_positions_and_events(tmp_path):
    head = header()
    file = RecordingFile(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts_of(2, 10)):
        file.append(chunk)
    file.close(complete=True)
    export_file(tmp_path / "run.h5", "csv")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["run.csv", "run.h5"]


def test_nptdms_reads_the_tdms(recorded, monkeypatch):
    path, volts = recorded
    monkeypatch.setattr(export, "READ_SAMPLES", 700)  # several segments
    export_file(path, "tdms", path.with_name("other.tdms"))
    found = TdmsFile.read(path.with_name("other.tdms"))
    samples = found["samples"]
    np.testing.assert_array_equal(samples["force"][:], FORCE.apply(volts[0]))
    np.testing.assert_array_equal(samples["noise"][:], volts[1])
    assert samples["time_s"][3000] == pytest.approx(103.1)
    assert samples["force"].properties["unit_string"] == "uN"
    assert "wf_increment" not in samples["force"].properties  # a waveform has no gaps
    assert found.properties["rate_hz"] == 1000.0
    assert found["positions"]["axis"][:].tolist() == ["probe.x", "probe.x", "table.rotation"]
    assert found["positions"]["position"][:].tolist() == [1.5, 2.5, -3.0]
    assert found["events"]["kind"][:].tolist() == ["mark", "overrun"]


def test_a_tdms_without_gaps_is_a_waveform(tmp_path):
    head = header()
    file = RecordingFile(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts_of(2, 20), first_sample=2000):
        file.append(chunk)
    file.close(complete=True)
    export_file(tmp_path / "run.h5", "tdms")
    force = TdmsFile.read(tmp_path / "run.tdms")["samples"]["force"]
    assert force.properties["wf_increment"] == 0.001
    began = np.datetime64(START_UTC.replace(tzinfo=None)) + np.timedelta64(2, "s")
    assert abs(force.properties["wf_start_time"] - began) < np.timedelta64(1, "ms")


@pytest.mark.parametrize("to", ["csv", "tdms"])
def test_an_empty_recording_can_be_exported(tmp_path, to):
    RecordingFile(tmp_path / "run.h5", header()).close(complete=True)
    path = export_file(tmp_path / "run.h5", to)
    assert path.stat().st_size > 0
    if to == "csv":
        assert pd.read_csv(path).empty


@pytest.mark.parametrize("to", ["csv", "tdms"])
def test_progress_rises_to_one(recorded, monkeypatch, to):
    path, _ = recorded
    monkeypatch.setattr(export, "READ_SAMPLES", 1000)
    fractions = []
    export_file(path, to, None, fractions.append)
    assert fractions == [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]


@pytest.mark.parametrize("to", ["csv", "tdms"])
def test_a_cancelled_export_leaves_nothing(recorded, monkeypatch, to):
    path, _ = recorded
    monkeypatch.setattr(export, "READ_SAMPLES", 1000)
    with pytest.raises(ExportCancelled, match="cancelled"):
        export_file(path, to, None, lambda fraction: fraction < 0.3)
    assert [each.name for each in path.parent.iterdir()] == ["run.h5"]


@pytest.mark.parametrize(("to", "there"), [("csv", "csv"), ("csv", "events.csv"), ("tdms", "tdms")])
def test_a_file_is_replaced_only_on_demand(recorded, to, there):
    path, _ = recorded
    old = path.with_name(f"run.{there}")
    old.write_text("important")
    with pytest.raises(RecordingExistsError, match="may be replaced"):
        export_file(path, to)
    assert old.read_text() == "important"
    export_file(path, to, overwrite=True)
    assert "important" not in old.read_bytes().decode("latin-1")


def test_what_cannot_be_is_refused(recorded, tmp_path):
    path, _ = recorded
    with pytest.raises(RecordingError, match=r"no exporter 'xlsx'; there are csv \(cosmic .*tdms"):
        export_file(path, "xlsx")
    with pytest.raises(RecordingError, match="does not exist; create it"):
        export_file(path, "csv", tmp_path / "none" / "run.csv")
    with pytest.raises(RecordingError, match="no such file"):
        export_file(tmp_path / "none.h5", "csv")


@pytest.mark.parametrize("export_to", [export_csv, export_tdms])
def test_a_full_disk_is_reported_and_leaves_nothing(recorded, monkeypatch, export_to):
    path, _ = recorded

    def full(*_):
        raise OSError(28, "No space left on device")

    with open_recording(path) as recording:
        monkeypatch.setattr(recording, "block", full)
        with pytest.raises(RecordingError, match="No space left on device"):
            export_to(recording, path.with_name("out"))
    assert [each.name for each in path.parent.iterdir()] == ["run.h5"]


def test_a_recording_in_progress_is_exported_as_far_as_it_is(tmp_path):
    head = header()
    file = RecordingFile(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts_of(2, 100)):
        file.append(chunk)
    file.flush()
    assert len(pd.read_csv(export_file(tmp_path / "run.h5", "csv"))) == 100
    file.close(complete=True)


def test_an_export_never_replaces_the_recording_that_it_reads(recorded, monkeypatch):
    path, _ = recorded
    before = path.read_bytes()
    linked, hard = path.with_name("linked"), path.with_name("hard")
    linked.symlink_to(path)
    hard.hardlink_to(path)
    monkeypatch.chdir(path.parent)
    for to in ("csv", "tdms"):
        for out in (path, "run.h5", "./run.h5", "../" + path.parent.name + "/run.h5", linked, hard):
            with pytest.raises(RecordingError, match="is the recording itself"):
                export_file("run.h5", to, out, overwrite=True)
    for export_to in (export_csv, export_tdms):
        with (
            open_recording(path) as recording,
            pytest.raises(RecordingError, match="is the recording itself"),
        ):
            export_to(recording, linked, overwrite=True)
    assert path.read_bytes() == before
    assert sorted(each.name for each in path.parent.iterdir()) == ["hard", "linked", "run.h5"]


@pytest.mark.parametrize(
    ("called", "out"),
    [
        ("run.positions.csv", "run.csv"),
        ("run.csv.part", "run.csv"),
        ("run.csv", "run.csv"),
    ],
)
def test_what_an_export_writes_beside_its_file_spares_the_recording(recorded, called, out):
    path, _ = recorded
    source = path.rename(path.with_name(called))
    before = source.read_bytes()
    with pytest.raises(RecordingError, match="is the recording itself"):
        export_file(source, "csv", path.with_name(out), overwrite=True)
    assert source.read_bytes() == before


@pytest.mark.parametrize(("to", "out"), [("csv", "q.tdms"), ("tdms", "q.CSV"), ("csv", "q.h5")])
def test_a_file_does_not_end_like_one_of_another_format(recorded, to, out):
    path, _ = recorded
    with pytest.raises(RecordingError, match="would be written; end it in"):
        export_file(path, to, path.with_name(out))
    assert not path.with_name(out).exists()


@pytest.mark.parametrize("folder", [".", "/"])
def test_a_folder_is_no_recording(folder):
    with pytest.raises(RecordingError, match="is a directory"):
        export_file(folder, "csv")


@pytest.mark.parametrize("name", ["x" * 300, "x" * 249])
def test_what_is_no_name_of_a_file_is_refused_as_such(recorded, tmp_path, name):
    path, _ = recorded
    with pytest.raises(RecordingError, match=r"is not the name of a file|cannot be written"):
        export_file(path, "csv", tmp_path / f"{name}.csv")


def test_a_name_too_long_for_a_file_is_refused_as_such_wherever_it_stands(recorded, tmp_path):
    path, _ = recorded
    with pytest.raises(RecordingError, match="cannot be read"):
        export_file("x" * 3000, "csv", tmp_path / "made.csv")
    with pytest.raises(RecordingError, match="is not the name of a file"):
        export_file(path, "csv", tmp_path / ("x" * 300) / "made.csv")
