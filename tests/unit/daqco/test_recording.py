"""Recordings: written block by block, read back as physical values."""

import errno
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.lib.recfunctions import repack_fields

from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.recording_file import RecordingFile, block_samples
from cosmic.daqco.core.recording_format import AxisPosition, Overrun, RecordedEvent
from cosmic.daqco.core.scale import VOLTS, Scale
from cosmic.frame.errors import RecordingError, RecordingExistsError
from unit.daqco.recording_helpers import FORCE, START_UTC, chunks, header, volts_of


def record(path, head, given, *, complete=True, size=50):
    """Write voltages, or chunks, and close the file."""
    file = RecordingFile(path, head)
    for chunk in chunks(head, given, size) if isinstance(given, np.ndarray) else given:
        file.append(chunk)
    file.close(complete=complete)
    return path


@pytest.mark.parametrize(("rate_hz", "size"), [(10.0, 1), (1000.0, 10), (15000.0, 150)])
def test_volts_come_back_bit_for_bit_however_often_they_are_flushed(tmp_path, rate_hz, size):
    head = header(rate_hz=rate_hz)
    volts = volts_of(2, 20_003)
    volts[0, :4] = np.nan, -0.0, np.inf, 5e-324
    file = RecordingFile(tmp_path / "run.h5", head)
    for number, chunk in enumerate(chunks(head, volts, size)):
        file.append(chunk)
        if number % 70 == 0:
            file.flush()
    file.close(complete=True)
    with open_recording(tmp_path / "run.h5") as found:
        assert found.complete
        assert found.samples == 20_003
        assert found.volts("force").tobytes() == volts[0].tobytes()
        assert found.volts("noise").tobytes() == volts[1].tobytes()
        np.testing.assert_array_equal(found.values("force"), FORCE.apply(volts[0]))


@settings(max_examples=25)
@given(
    sizes=st.lists(st.integers(1, 700), min_size=1, max_size=12),
    flushes=st.sets(st.integers(0, 11)),
)
def test_chunks_of_any_size_fit_together(tmp_path_factory, sizes, flushes):
    head = header()
    volts = volts_of(2, sum(sizes))
    path = tmp_path_factory.mktemp("any") / "run.h5"
    file = RecordingFile(path, head)
    at = 0
    for number, size in enumerate(sizes):
        for chunk in chunks(head, volts[:, at : at + size], size, first_sample=at):
            file.append(chunk)
        at += size
        if number in flushes:
            file.flush()
    file.close(complete=True)
    with open_recording(path) as found:
        np.testing.assert_array_equal(found.volts("noise"), volts[1])
        np.testing.assert_allclose(found.time_s, 100.0 + np.arange(at) / 1000.0, atol=1e-9)


def test_a_block_holds_about_half_a_second_and_never_very_little():
    assert block_samples(10.0) == 256
    assert block_samples(1000.0) == 512
    assert block_samples(15_000.0) == 8192
    assert block_samples(1e6) == 8192


def test_what_describes_the_recording_is_in_the_file(tmp_path):
    path = record(tmp_path / "run.h5", header(), volts_of(2, 10))
    with open_recording(path) as found:
        assert found.channels == ("force", "noise")
        assert found.units == {"force": "uN", "noise": "V"}
        assert found.inputs == {"force": "Dev1/ai0", "noise": "Dev1/ai1"}
        assert found.ranges_v["noise"] == (-5.0, 5.0)
        assert found.colours["force"] == "#E69F00"
        assert found.rate_hz == 1000.0
        assert found.start_utc == START_UTC
        assert found.start_s == 100.0
        assert found.software == "CoSMic 1.2.3"
        assert found.configuration == "[daqco]\n# µN\n"
        assert found.scales == {"force": (FORCE,), "noise": (VOLTS,)}


def test_plain_h5py_reads_a_finished_file(tmp_path):
    volts = volts_of(2, 700)
    path = record(tmp_path / "run.h5", header(), volts)
    with h5py.File(path, "r") as file:
        np.testing.assert_array_equal(file["volts"][:], volts)
        assert file["complete"][()] == 1
        assert file.attrs["rate_hz"] == 1000.0
        assert file["channels"]["name"].tolist() == [b"force", b"noise"]
        assert file["scales"][0]["coefficients"][:2].tolist() == [-12.5, 500.0]
        assert file["chunks"]["first_sample"][1] == 50


def test_each_sample_is_converted_by_the_scale_in_force_when_it_came(tmp_path):
    head = header()
    volts = volts_of(2, 300)
    other = Scale("after cleaning", "uN", (3.0, 480.0, 0.25))
    first = chunks(head, volts[:, :120], 40)
    then = chunks(head, volts[:, 120:], 60, first_sample=120, scales=(other, VOLTS))
    path = record(tmp_path / "run.h5", head, [*first, *then])
    wanted = np.concatenate([FORCE.apply(volts[0, :120]), other.apply(volts[0, 120:])])
    with open_recording(path) as found:
        assert found.scales == {"force": (FORCE, other), "noise": (VOLTS,)}
        np.testing.assert_array_equal(found.values("force"), wanted)
        np.testing.assert_array_equal(
            found.values("force", start_s=100.1, end_s=100.14), wanted[100:140]
        )
        np.testing.assert_array_equal(found.values("noise"), volts[1])


def test_a_unit_that_changed_on_the_way_is_not_hidden(tmp_path):
    head = header()
    volts = volts_of(2, 100)
    milli = Scale("in mN", "mN", (0.0, 0.5))
    then = chunks(head, volts, 50, first_sample=100, scales=(milli, VOLTS))
    path = record(tmp_path / "run.h5", head, [*chunks(head, volts), *then])
    with open_recording(path) as found:
        assert found.units == {"force": "uN|mN", "noise": "V"}


def test_missing_samples_are_counted_and_leave_a_gap_in_time(tmp_path):
    head = header()
    volts = volts_of(2, 100)
    late = chunks(head, volts, 50, first_sample=137)
    path = record(tmp_path / "run.h5", head, [*chunks(head, volts), *late])
    with open_recording(path) as found:
        assert found.overruns == (
            Overrun(sample=137, lost=37, time_s=pytest.approx(100.1), column=100),
        )
        assert found.samples == 200
        assert found.time_s[99] == pytest.approx(100.099)
        assert found.time_s[100] == pytest.approx(100.137)
        assert found.volts("noise", start_s=100.1, end_s=100.138).tolist() == [volts[1, 0]]


def test_an_acquisition_that_began_again_is_placed_by_the_clock(tmp_path):
    head = header()
    volts = volts_of(2, 100)
    again = [replace(each, time_s=each.time_s + 2.0) for each in chunks(head, volts)]
    path = record(tmp_path / "run.h5", head, [*chunks(head, volts), *again])
    with open_recording(path) as found:
        (gap,) = found.overruns
        assert gap == Overrun(sample=0, lost=1900, time_s=pytest.approx(100.1), column=100)
        assert found.time_s[gap.column] == pytest.approx(102.0)


def test_gaps_of_a_file_that_does_not_say_where_they_are_are_placed_by_the_clock(tmp_path):
    head = header()
    volts = volts_of(2, 100)
    parts = [
        replace(each, time_s=each.time_s + after_s)
        for after_s in (0.0, 2.0, 5.0)
        for each in chunks(head, volts)
    ]
    path = record(tmp_path / "run.h5", head, parts)
    with h5py.File(path, "r+") as file:
        rows = file["overruns"][:][["sample", "lost", "time_s"]]
        del file["overruns"]
        file["overruns"] = repack_fields(rows)
    with open_recording(path) as found:
        assert [gap.column for gap in found.overruns] == [100, 200]


def test_the_last_sample_number_may_exceed_32_bit(tmp_path):
    head = header()
    path = record(tmp_path / "run.h5", head, chunks(head, volts_of(2, 10), first_sample=2**40))
    with open_recording(path) as found:
        assert found.time_s[0] == pytest.approx(100.0 + 2**40 / 1000.0)


def test_events_and_positions_come_back(tmp_path):
    file = RecordingFile(tmp_path / "run.h5", header())
    file.add_event(RecordedEvent(100.5, 500, "limit", "over 900 µN", "force", 901.5))
    file.add_event(RecordedEvent(100.6, 600, "mark", "ü" * 400))
    file.add_positions([AxisPosition(100.0, "probe.x", 12.5), AxisPosition(100.0, "t", 3.0, "deg")])
    file.flush()
    file.add_positions([AxisPosition(100.1, "probe.x", float("nan"), "um", "unknown")])
    file.close(complete=True)
    with open_recording(tmp_path / "run.h5") as found:
        limit, mark = found.events
        assert limit == RecordedEvent(100.5, 500, "limit", "over 900 µN", "force", 901.5)
        assert mark.text == "ü" * 254 + "…"
        assert np.isnan(mark.value)
        assert found.axes == {"probe.x": "um", "t": "deg"}
        times, positions, confidence = found.positions("probe.x")
        assert times.tolist() == [100.0, 100.1]
        assert positions[0] == 12.5
        assert confidence.tolist() == ["known", "unknown"]
        with pytest.raises(RecordingError, match=r"no axis 'probe\.y'; recorded: probe\.x, t"):
            found.positions("probe.y")
        with pytest.raises(RecordingError, match="no channel 'torque'; recorded: force, noise"):
            found.values("torque")


def pushed_fibre(path, stiffness=40.0, noise_v=0.002):
    """Record a probe that rests, then moves at 10 um/s against a spring, read 20 times a second."""
    head = header(("force",), rate_hz=1000.0)
    time_s = np.arange(5000) / 1000.0
    position = 10.0 * np.clip(time_s - 1.0, 0.0, 3.0)
    force = stiffness * position
    volts = (force + 12.5) / 500.0
    volts += np.random.default_rng(1).normal(0.0, noise_v, volts.size)
    file = RecordingFile(path, head)
    for chunk in chunks(head, volts[np.newaxis, :]):
        file.append(chunk)
    for at in range(0, 5000, 50):
        file.add_positions([AxisPosition(100.0 + at / 1000.0, "probe.x", position[at])])
    file.close(complete=True)


def test_force_over_position_gives_the_stiffness_with_its_error(tmp_path):
    pushed_fibre(tmp_path / "run.h5")
    with open_recording(tmp_path / "run.h5") as found:
        there, force = found.curve("force", "probe.x")
        assert there.shape == force.shape == (4951,)  # none after the last reading
        np.testing.assert_allclose(force, 40.0 * there, atol=6.0)
        slope = found.slope("force", "probe.x", low=2.0, high=28.0)
        assert slope.unit == "uN/um"
        assert slope.value == pytest.approx(40.0, abs=5 * slope.standard_error)
        assert 0.001 < slope.standard_error < 0.01
        assert slope.residual == pytest.approx(1.0, rel=0.1)
        part = found.slope("force", "probe.x", start_s=101.5, end_s=102.0)
        assert part.samples == 500


def test_a_slope_without_travel_is_refused(tmp_path):
    pushed_fibre(tmp_path / "run.h5")
    with open_recording(tmp_path / "run.h5") as found:
        with pytest.raises(RecordingError, match="all 500 samples lie at 0"):
            found.slope("force", "probe.x", end_s=100.5)
        with pytest.raises(RecordingError, match="at least 3 samples, there are 0"):
            found.slope("force", "probe.x", low=1000.0)


def test_a_position_that_goes_back_in_time_is_left_out(tmp_path):
    head = header()
    file = RecordingFile(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts_of(2, 1000), 50):
        file.append(chunk)
    for time_s, position in ((100.0, 1.0), (-321.5, 0.0), (100.2, 2.0), (100.2, 3.0)):
        file.add_positions([AxisPosition(time_s, "left.gripper", position)])
    file.close(complete=True)
    with open_recording(tmp_path / "run.h5") as found:
        times, positions, confidence = found.positions("left.gripper")
    assert times.tolist() == [100.0, 100.2, 100.2]
    assert positions.tolist() == [1.0, 2.0, 3.0]
    assert confidence.size == 3


def test_samples_between_unknown_positions_are_left_out_of_a_curve(tmp_path):
    head = header()
    file = RecordingFile(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts_of(2, 100)):
        file.append(chunk)
    known = ["known", "estimated", "unknown", "known", "known"]
    for number, word in enumerate(known):
        file.add_positions([AxisPosition(100.0 + number * 0.02, "probe.x", number, "um", word)])
    file.close(complete=True)
    with open_recording(tmp_path / "run.h5") as found:
        there, _ = found.curve("force", "probe.x")
        assert not np.any((there > 1.01) & (there < 2.99))
        assert 0.0 <= there.min() < there.max() <= 4.0


def test_the_error_of_a_slope_grows_where_neighbours_resemble_each_other(tmp_path):
    rng = np.random.default_rng(3)
    path = tmp_path / "run.h5"
    found, std_errors = [], []
    for number in range(60):
        noise = np.convolve(rng.normal(0.0, 0.01, 1020), np.ones(20) / 20, "valid")[:1000]
        volts = np.linspace(0.0, 1.0, 1000) + noise
        head = header(("v",))
        file = RecordingFile(path, head, overwrite=number > 0)
        for chunk in chunks(head, volts[np.newaxis, :], 500):
            file.append(chunk)
        rows = [AxisPosition(100.0, "x", 0.0), AxisPosition(101.0, "x", 1.0)]
        file.add_positions(rows)
        file.close(complete=True)
        with open_recording(path) as recording:
            slope = recording.slope("v", "x")
        found.append(slope.value)
        std_errors.append(slope.standard_error)
    assert np.std(found) < 2.0 * np.mean(std_errors)


@pytest.mark.parametrize(
    ("start_s", "end_s", "first", "last"),
    [
        (None, None, 0, 300),
        (100.1, 100.2, 100, 200),
        (100.1001, 100.2001, 101, 201),
        (0.0, 100.05, 0, 50),
        (100.25, 1e9, 250, 300),
        (101.0, 102.0, 300, 300),
        (100.2, 100.1, 200, 200),
    ],
)
def test_a_part_is_read_by_time(tmp_path, start_s, end_s, first, last):
    volts = volts_of(2, 300)
    path = record(tmp_path / "run.h5", header(), volts)
    with open_recording(path) as found:
        part = found.volts("force", start_s=start_s, end_s=end_s)
        np.testing.assert_array_equal(part, volts[0, first:last])
        times = found.times(start_s=start_s, end_s=end_s)
        np.testing.assert_allclose(times, 100.0 + np.arange(first, last) / 1000.0)


def test_every_sample_is_found_by_its_own_time(tmp_path):
    head = header(rate_hz=15_000.0, start_s=86_400.123)
    path = record(tmp_path / "run.h5", head, volts_of(2, 3000), size=150)
    with open_recording(path) as found:
        times = found.time_s
        for at in range(0, 3000, 7):
            assert found.times(start_s=times[at]).size == 3000 - at


def test_a_time_that_is_no_number_is_refused(tmp_path):
    path = record(tmp_path / "run.h5", header(), volts_of(2, 10))
    with open_recording(path) as found, pytest.raises(ValueError, match="finite"):
        found.volts("force", start_s=float("nan"))


def test_a_chunk_of_which_a_part_is_missing_is_left_out(tmp_path):
    volts = volts_of(2, 200)
    path = record(tmp_path / "run.h5", header(), volts)
    with h5py.File(path, "r+") as file:
        file["volts"].resize(130, axis=1)
    with open_recording(path) as found:
        np.testing.assert_array_equal(found.volts("force"), volts[0, :100])
        assert found.time_s.size == 100


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="room is taken otherwise")
def test_a_full_disk_is_noticed_between_two_flushes(tmp_path, monkeypatch):
    head = header(rate_hz=15_000.0)
    file = RecordingFile(tmp_path / "run.h5", head)

    def full(*_):
        raise OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(RecordingError, match=r"cannot grow .*make room"):
        for chunk in chunks(head, volts_of(2, 3_000_000), 3000):
            file.append(chunk)
    file.close(complete=False)
    with open_recording(tmp_path / "run.h5") as found:
        assert found.samples > 300_000


def test_a_closed_recording_gives_no_samples(tmp_path):
    path = record(tmp_path / "run.h5", header(), volts_of(2, 10))
    with open_recording(path) as found:
        pass
    found.close()
    with pytest.raises(RecordingError, match="was closed; open it again"):
        found.volts("force")


def test_a_recording_of_nothing_can_be_read(tmp_path):
    path = record(tmp_path / "run.h5", header(), [])
    with open_recording(path) as found:
        assert found.complete
        assert found.time_s.size == found.values("force").size == 0
        assert found.units["force"] == "uN"
        assert found.events == found.overruns == ()


def test_a_running_recording_is_read_and_read_again(tmp_path):
    head = header()
    volts = volts_of(2, 400)
    file = RecordingFile(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts[:, :130]):
        file.append(chunk)
    file.flush()
    with open_recording(tmp_path / "run.h5") as found:
        assert not found.complete
        np.testing.assert_array_equal(found.volts("force"), volts[0, :130])
        for chunk in chunks(head, volts[:, 130:], first_sample=130):
            file.append(chunk)
        file.add_event(RecordedEvent(100.2, 200, "mark"))
        file.flush()
        found.refresh()
        np.testing.assert_array_equal(found.volts("force"), volts[0])
        assert len(found.events) == 1
    file.close(complete=True)


READER = """
import sys
from cosmic.daqco.api.recording import open_recording
with open_recording(sys.argv[1]) as found:
    for line in sys.stdin:
        found.refresh()
        print(found.samples, found.complete, found.volts("force").sum(), flush=True)
"""


def test_another_process_follows_a_running_recording(tmp_path):
    head = header()
    volts = volts_of(2, 1200)
    path = tmp_path / "run.h5"
    file = RecordingFile(path, head)
    with subprocess.Popen(
        [sys.executable, "-c", READER, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as reader:
        for number, chunk in enumerate(chunks(head, volts, 100), 1):
            file.append(chunk)
            file.flush()
            reader.stdin.write("look\n")
            reader.stdin.flush()
            samples, complete, total = reader.stdout.readline().split()
            assert (int(samples), complete) == (number * 100, "False")
            assert float(total) == pytest.approx(volts[0, : number * 100].sum())
        reader.stdin.close()
    file.close(complete=True)


def test_a_file_is_replaced_only_on_demand(tmp_path):
    path = record(tmp_path / "run.h5", header(), volts_of(2, 10))
    with pytest.raises(RecordingExistsError, match="there is such a file"):
        RecordingFile(path, header())
    with pytest.raises(FileExistsError):
        RecordingFile(path, header())
    RecordingFile(path, header(), overwrite=True).close(complete=True)
    with open_recording(path) as found:
        assert found.samples == 0


def test_a_file_that_is_being_recorded_cannot_be_replaced(tmp_path):
    file = RecordingFile(tmp_path / "run.h5", header())
    with pytest.raises(RecordingError, match="cannot be created"):
        RecordingFile(tmp_path / "run.h5", header(), overwrite=True)
    file.close(complete=True)


def test_a_file_that_another_program_records_to_stays_whole_when_it_cannot_be_replaced(tmp_path):
    script = (
        "import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1])\n"
        "from cosmic.daqco.core.recording_file import RecordingFile\n"
        "from cosmic.frame.errors import RecordingError\n"
        "from unit.daqco.recording_helpers import header\n"
        "try: RecordingFile(Path(sys.argv[2]), header(), overwrite=True)\n"
        "except RecordingError as exc: print(exc)\n"
    )
    head = header()
    path, volts = tmp_path / "run.h5", volts_of(2, 100)
    file = RecordingFile(path, head)
    for chunk in chunks(head, volts, 50):
        file.append(chunk)
    file.flush()
    command = [sys.executable, "-c", script, str(Path(__file__).parents[2]), str(path)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "is in use" in said
    file.close(complete=True)
    with open_recording(path) as found:
        assert np.array_equal(found.volts("force"), volts[0])


def test_half_a_letter_in_a_mark_costs_no_recording(tmp_path):
    file = RecordingFile(tmp_path / "run.h5", header())
    file.add_event(RecordedEvent(1.0, 0, "mark", "caf\udce9"))
    file.close(complete=True)
    with open_recording(tmp_path / "run.h5") as found:
        assert [each.text for each in found.events] == ["caf?"]


@pytest.mark.parametrize("content", [b"", b"no HDF5 at all", b"\x89HDF\r\n\x1a\n" + bytes(500)])
def test_a_broken_file_is_refused_by_name(tmp_path, content):
    path = tmp_path / "broken.h5"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"broken\.h5: cannot be read.*Look for a copy"):
        open_recording(path)


def test_a_missing_file_and_a_foreign_one_are_distinguished(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        open_recording(tmp_path / "none.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["data"] = 1
    with pytest.raises(RecordingError, match="not a recording by CoSMic"):
        open_recording(tmp_path / "other.h5")


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6])
def test_a_recording_that_is_cut_off_is_called_so(tmp_path, share):
    path = record(tmp_path / "run.h5", header(), volts_of(2, 2000))
    os.truncate(path, int(path.stat().st_size * share))
    with pytest.raises(RecordingError, match=r"run\.h5: is cut off.*Run cosmic repair .*run\.h5"):
        open_recording(path)


def test_a_closed_recording_that_lost_its_end_is_not_complete(tmp_path):
    path = record(tmp_path / "run.h5", header(), volts_of(2, 2000))
    with h5py.File(path, "r+", libver="latest") as file:
        file["notes"] = np.arange(5000)
    os.truncate(path, path.stat().st_size - 1000)
    with open_recording(path) as found:
        assert not found.complete


def test_a_recording_of_a_newer_format_is_refused(tmp_path):
    path = record(tmp_path / "run.h5", header(), [])
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 99
    with pytest.raises(RecordingError, match="format 99"):
        open_recording(path)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_file_that_was_cut_off_is_refused_or_read_never_garbled(tmp_path, share):
    volts = volts_of(2, 20_000)
    path = record(tmp_path / "run.h5", header(), volts)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(RecordingError, match=r"run\.h5"), open_recording(path) as found:
        found.volts("force")


@pytest.fixture
def killed(tmp_path):
    """What a killed process leaves: a file that was flushed and never closed, and its volts."""
    head = header()
    volts = volts_of(2, 20_000)
    file = RecordingFile(tmp_path / "running.h5", head)
    for number, chunk in enumerate(chunks(head, volts, 50)):
        file.append(chunk)
        if number % 50 == 0:
            file.flush()
    file.flush()
    path = tmp_path / "killed.h5"
    path.write_bytes((tmp_path / "running.h5").read_bytes()[: file.size_bytes])
    file.close(complete=True)
    return path, volts


def test_a_file_that_was_never_closed_is_read(killed):
    path, volts = killed
    with open_recording(path) as found:
        assert not found.complete
        np.testing.assert_array_equal(found.volts("noise"), volts[1])


@pytest.mark.timeout(20)
@pytest.mark.parametrize("share", [0.01, 0.1, 0.3, 0.6, 0.9, 0.99])
def test_an_unclosed_file_that_lost_its_end_fails_at_once(killed, share):
    path, volts = killed
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    try:
        with open_recording(path) as found:
            np.testing.assert_array_equal(found.volts("force"), volts[0, : found.samples])
    except RecordingError as exc:
        assert "killed.h5" in str(exc)


@pytest.mark.timeout(20)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 160), st.sampled_from([b"\0", b"\xff"]))
def test_an_unclosed_file_with_a_lost_page_is_read_or_fails_at_once(killed, page, byte):
    path, _ = killed
    data = bytearray(path.read_bytes())
    first = min(4096 * page, len(data) - 4096)
    data[first : first + 4096] = byte * 4096
    other = path.with_name("other.h5")
    other.write_bytes(data)
    try:
        with open_recording(other) as found:
            found.values("force")
            found.curve("noise", "none")
    except RecordingError as exc:
        assert "other.h5" in str(exc)
