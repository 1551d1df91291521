"""`UDaqFileWriter`: loses nothing, and never holds up who gives it samples."""

import os
import shutil
import signal
import subprocess
import sys
from collections import namedtuple
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.file_writer import UDaqFileWriter
from cosmic.daqco.core.recording_file import RecordingFile
from cosmic.daqco.core.recording_format import AxisPosition, RecordedEvent
from cosmic.daqco.core.scale import VOLTS, Scale
from cosmic.frame.clock import WALL
from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.file_names import RESERVE_BYTES
from unit.daqco.recording_helpers import FORCE, chunks, header, volts_of

Usage = namedtuple("Usage", "total used free")


class Heard:
    """What a writer said, and every failure, in the order of coming."""

    def __init__(self, policy):
        self.stats, self.errors, self.closed, self.failures, self.stops = [], [], [], [], []
        policy.subscribe(self.failures.append)
        policy.on_safe_stop(self.stops.append)

    def listen(self, writer):
        from PySide6.QtCore import Qt

        direct = Qt.ConnectionType.DirectConnection
        writer.recorded.connect(self.stats.append, direct)
        writer.failed.connect(self.errors.append, direct)
        writer.closed.connect(self.closed.append, direct)


@pytest.fixture
def policy():
    return FailurePolicy()


@pytest.fixture
def heard(policy):
    return Heard(policy)


@pytest.fixture
def writers(policy, heard):
    made = []

    def make(path, head=None, *, start=True, **how):
        writer = UDaqFileWriter(path, head or header(), policy, **how)
        heard.listen(writer)
        made.append(writer)
        if start:
            writer.start()
        return writer

    yield make
    for writer in made:
        if not writer.isRunning() and not writer.isFinished():
            writer.start()
        writer.request_end()
        assert writer.join()


def end(writer):
    writer.request_end()
    assert writer.join()


def wait_until(condition, timeout_s=10.0):
    until_s = WALL.now_s() + timeout_s
    while not condition():
        assert WALL.now_s() < until_s, "it did not come true in time"
        WALL.sleep(0.005)


def test_everything_put_before_the_end_is_in_the_file(tmp_path, writers, heard):
    head = header()
    volts = volts_of(2, 5000)
    writer = writers(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts):
        writer.put(chunk)
    writer.add_event(RecordedEvent(101.0, 1000, "mark", "here"))
    writer.add_positions([AxisPosition(101.0, "probe.x", 3.5)])
    end(writer)
    assert writer.error is None
    assert heard.closed == [tmp_path / "run.h5"]
    assert heard.failures == []
    assert (heard.stats[-1].samples, heard.stats[-1].backlog) == (5000, 0)
    assert heard.stats[-1].duration_s == 5.0
    with open_recording(tmp_path / "run.h5") as found:
        assert found.complete
        np.testing.assert_array_equal(found.volts("noise"), volts[1])
        assert found.events[0].text == "here"
        assert found.positions("probe.x")[1].tolist() == [3.5]


def test_samples_are_readable_within_half_a_second_without_an_end(tmp_path, writers):
    head = header()
    writer = writers(tmp_path / "run.h5", head)
    WALL.sleep(0.1)
    for chunk in chunks(head, volts_of(2, 30)):
        writer.put(chunk)
    began_s = WALL.now_s()

    def visible():
        with open_recording(tmp_path / "run.h5") as found:
            return found.samples == 30

    wait_until(visible)
    assert WALL.now_s() - began_s < 2.0  # 0.25 s on a machine that has nothing else to do


def test_it_says_how_the_recording_stands(tmp_path, writers, heard):
    head = header()
    writer = writers(tmp_path / "run.h5", head)
    writer.put(next(chunks(head, volts_of(2, 10))))
    wait_until(lambda: heard.stats and heard.stats[-1].samples == 10)
    stats = heard.stats[-1]
    assert stats.path == tmp_path / "run.h5"
    assert stats.file_bytes > 0
    free = shutil.disk_usage(tmp_path).free
    assert stats.left_s == pytest.approx((free - RESERVE_BYTES) / 40_000.0, rel=0.2)


def test_putting_returns_at_once_while_the_disk_hangs_and_the_end_is_reported(
    tmp_path, writers, heard, monkeypatch
):
    head = header()
    volts = volts_of(2, 30_000)
    hang = wait_for_release(monkeypatch)
    writer = writers(tmp_path / "run.h5", head)
    longest_s = 0.0
    for chunk in chunks(head, volts):
        began_s = WALL.now_s()
        writer.put(chunk)
        longest_s = max(longest_s, WALL.now_s() - began_s)
    assert longest_s < 0.5
    assert "disk is too slow, 10.0 s of samples wait" in str(heard.errors[0])
    assert writer.backlog == 10_000
    hang.set()
    assert writer.join()
    with open_recording(tmp_path / "run.h5") as found:
        assert not found.complete
        np.testing.assert_array_equal(found.volts("force"), volts[0, :10_000])
        assert found.events[-1].kind == "error"
        assert "disk is too slow" in found.events[-1].text
    assert h5py.File(tmp_path / "run.h5", "r").close() is None  # closed in order
    assert heard.stops == []


def wait_for_release(monkeypatch):
    from threading import Event

    released, append = Event(), RecordingFile.append

    def hanging(self, chunk):
        assert released.wait(30.0)
        append(self, chunk)

    monkeypatch.setattr(RecordingFile, "append", hanging)
    return released


def test_the_backlog_is_bounded_in_bytes_too(tmp_path, writers, heard, monkeypatch):
    head = header(tuple(f"c{number}" for number in range(32)), rate_hz=100_000.0)
    hang = wait_for_release(monkeypatch)
    writer = writers(tmp_path / "run.h5", head)
    block = volts_of(32, 10_000)
    for number in range(40):
        writer.put(next(chunks(head, block, 10_000, first_sample=number * 10_000)))
    assert writer.backlog * 32 * 8 <= 64 * 1024 * 1024
    assert len(heard.errors) == 1
    hang.set()
    assert writer.join()


def test_the_scale_may_change_while_recording_and_the_channels_may_not(tmp_path, writers, heard):
    head = header()
    volts = volts_of(2, 100)
    other = Scale("edited", "uN", (1.0, 2.0))
    writer = writers(tmp_path / "run.h5", head)
    for chunk in chunks(head, volts):
        writer.put(chunk)
    for chunk in chunks(head, volts, first_sample=100, scales=(other, VOLTS)):
        writer.put(chunk)
    three = header(("force", "noise", "more"))
    writer.put(next(chunks(three, volts_of(3, 10), first_sample=200)))
    assert writer.join()
    assert "the channels and the rate of a recording cannot change" in str(heard.errors[0])
    assert heard.stops == []
    with open_recording(tmp_path / "run.h5") as found:
        assert not found.complete
        assert found.scales["force"] == (FORCE, other)
        wanted = [*FORCE.apply(volts[0]), *other.apply(volts[0])]
        assert found.values("force").tolist() == wanted


def test_another_rate_ends_the_recording_with_what_it_has(tmp_path, writers, heard):
    head = header()
    chunk = next(chunks(head, volts_of(2, 10)))
    writer = writers(tmp_path / "run.h5", head)
    writer.put(chunk)
    writer.put(replace(chunk, rate_hz=2000.0))
    assert writer.join()
    assert len(heard.errors) == 1
    with open_recording(tmp_path / "run.h5") as found:
        assert found.samples == 10


def test_it_ends_in_order_before_the_disk_is_full(tmp_path, writers, heard, monkeypatch):
    head = header()
    free = [RESERVE_BYTES + 10_000_000]
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**12, 0, free[0]))
    writer = writers(tmp_path / "run.h5", head)
    writer.put(next(chunks(head, volts_of(2, 10))))
    wait_until(lambda: heard.stats)
    assert heard.stats[-1].left_s == pytest.approx(10_000_000 / 40_000.0)
    free[0] = RESERVE_BYTES
    assert writer.join()
    assert "the disk is full" in str(heard.errors[0])
    assert "make room" in str(heard.errors[0])
    writer.put(next(chunks(head, volts_of(2, 10), first_sample=10)))  # acquisition goes on
    assert heard.stops == []
    with open_recording(tmp_path / "run.h5") as found:
        assert (found.samples, found.complete) == (10, False)
        assert found.events[-1].kind == "error"
    h5py.File(tmp_path / "run.h5", "r").close()


def test_a_file_taken_away_while_recording_is_reported(tmp_path, writers, heard):
    if sys.platform == "win32":
        pytest.skip("Windows does not delete an open file")
    writer = writers(tmp_path / "run.h5")
    (tmp_path / "run.h5").unlink()
    assert writer.join()
    assert "was taken away" in str(heard.errors[0])
    assert heard.stops == []


@pytest.mark.parametrize("path", ["none/run.h5", "file/run.h5", "con", "a:b.h5", "a*.h5", "x."])
def test_a_name_or_directory_that_cannot_be_is_refused(tmp_path, policy, path):
    (tmp_path / "file").write_text("no directory")
    with pytest.raises(RecordingError):
        UDaqFileWriter(tmp_path / path, header(), policy)
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_an_existing_file_is_replaced_only_when_that_was_said(tmp_path, writers, policy):
    (tmp_path / "run.h5").write_text("important")
    with pytest.raises(RecordingExistsError, match="may be replaced"):
        UDaqFileWriter(tmp_path / "run.h5", header(), policy)
    assert (tmp_path / "run.h5").read_text() == "important"
    end(writers(tmp_path / "run.h5", overwrite=True))
    with open_recording(tmp_path / "run.h5") as found:
        assert found.complete


def test_a_full_disk_forbids_the_start(tmp_path, policy, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**12, 0, RESERVE_BYTES))
    with pytest.raises(RecordingError, match="disk is full"):
        UDaqFileWriter(tmp_path / "run.h5", header(), policy)
    assert not (tmp_path / "run.h5").exists()


FULL_RATE = """
import resource, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from unit.daqco.recording_helpers import chunks, header, volts_of
from cosmic.daqco.core import preallocation
from cosmic.daqco.core.file_writer import UDaqFileWriter
from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy

preallocation.STEP_BYTES = 1024 * 1024
limit, limited_from = int(sys.argv[3]), int(sys.argv[4])
head = header(tuple(f"c{number}" for number in range(32)), rate_hz=15_000.0)
volts = volts_of(32, 15_000)
policy, stops = FailurePolicy(), []
policy.on_safe_stop(stops.append)
writer = UDaqFileWriter(Path(sys.argv[1]), head, policy)
writer.start()
began_s = WALL.now_s()
for number in range(400):
    if limit and number == limited_from:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    WALL.sleep(began_s + number * 0.01 - WALL.now_s())
    at = number * 150
    part = volts[:, at % 15_000 :][:, :150]
    writer.put(next(chunks(head, part, 150, first_sample=at)))
    print(at + 150, flush=True)
    if limit and writer.error is not None:
        break
writer.request_end()
print("joined", writer.join(), "stopped", stops, "error", writer.error, flush=True)
"""
TESTS = str(Path(__file__).resolve().parents[2])


def test_a_process_killed_at_full_rate_loses_at_most_half_a_second(tmp_path):
    path = tmp_path / "run.h5"
    put = 0
    command = [sys.executable, "-c", FULL_RATE, str(path), TESTS, "0", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            put = int(line)
            if put >= 2 * 15_000:
                os.kill(process.pid, signal.SIGKILL)
                break
        put = int([line for line in (str(put), *process.stdout) if line.strip()][-1])
    with open_recording(path) as found:
        assert not found.complete
        assert put - 7500 <= found.samples <= put + 150
        volts = np.tile(volts_of(32, 15_000), 4)
        for row in (0, 31):
            np.testing.assert_array_equal(found.volts(f"c{row}"), volts[row, : found.samples])
        assert len(found.time_s) == found.samples
    with h5py.File(path, "r", swmr=True) as file:  # as anybody else would read it
        assert file["volts"].shape[1] >= found.samples


def limited(path, limit, limited_from):
    """Record in a process whose files may be `limit` bytes long; return its last words."""
    command = [sys.executable, "-c", FULL_RATE, str(path), TESTS, str(limit), str(limited_from)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_a_file_that_cannot_grow_is_closed_in_order(tmp_path):
    path = tmp_path / "run.h5"
    last = limited(path, 24_000_000, 0)
    assert last.startswith("joined True stopped [] error ")
    assert f"{path}: cannot grow (File too large); make room" in last
    assert path.stat().st_size < 16_000_000  # without the room that was taken ahead
    h5py.File(path, "r").close()
    with open_recording(path) as found:
        assert not found.complete
        assert found.events[-1].kind == "error"
        assert_what_is_there_is_right(found)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_a_disk_that_fails_ends_the_recording_and_nothing_else(tmp_path):
    path = tmp_path / "run.h5"
    last = limited(path, 2_000_000, 100)
    assert last.startswith("joined True stopped [] error ")
    assert f"{path}: writing failed (File too large)" in last
    with open_recording(path) as found:
        assert not found.complete
        assert_what_is_there_is_right(found)


def assert_what_is_there_is_right(found):
    assert found.samples > 3500
    volts = np.tile(volts_of(32, 15_000), 4)
    np.testing.assert_array_equal(found.volts("c31"), volts[31, : found.samples])
