"""`ImageRecorder`: never holds up the camera, and no image is missing in silence."""

import logging
import shutil
import threading
from collections import namedtuple

import numpy as np
import pytest
from PySide6.QtCore import Qt

from cosmic.frame.clock import WALL
from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.file_names import RESERVE_BYTES
from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.image_recorder import ImageRecorder
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.hw.interface import FrameStatus, PixelFormat
from unit.vico.recording.image_helpers import (
    AXES,
    image,
    images,
    noise,
    settings,
    wait_until,
)

Usage = namedtuple("Usage", "total used free")


class Heard:
    """What a recorder said."""

    def __init__(self, policy):
        self.stats, self.errors, self.closed, self.stops = [], [], [], []
        policy.on_safe_stop(self.stops.append)

    def listen(self, recorder):
        direct = Qt.ConnectionType.DirectConnection
        recorder.recorded.connect(self.stats.append, direct)
        recorder.failed.connect(self.errors.append, direct)
        recorder.closed.connect(self.closed.append, direct)


class Gate:
    """Holds up writing, as a slow disk does."""

    def __init__(self, monkeypatch):
        self.open = threading.Event()
        self.reached = threading.Event()
        append = ImageFile.append

        def slow(file, data, row):
            self.reached.set()
            assert self.open.wait(10.0)
            append(file, data, row)

        monkeypatch.setattr(ImageFile, "append", slow)


@pytest.fixture
def policy():
    return FailurePolicy()


@pytest.fixture
def heard(policy):
    return Heard(policy)


@pytest.fixture
def recorders(tmp_path, policy, heard):
    made = []

    def make(name="run", image_format=ImageFormat.FFV1, *, start=True, **how):
        how.setdefault("settings", settings())
        recorder = ImageRecorder(tmp_path / name, image_format, policy=policy, axes=AXES, **how)
        heard.listen(recorder)
        made.append(recorder)
        if start:
            recorder.start()
        return recorder

    yield make
    for recorder in made:
        if not recorder.isRunning() and not recorder.isFinished():
            recorder.start()
        recorder.request_end()
        assert recorder.join()


def end(recorder):
    recorder.request_end()
    assert recorder.join()


@pytest.mark.parametrize("image_format", ImageFormat)
def test_everything_put_before_the_end_is_in_the_file(recorders, heard, image_format):
    recorder = recorders("run", image_format)
    assert all(recorder.put(each) for each in images(40))
    end(recorder)
    assert recorder.error is None
    assert heard.errors == []
    assert heard.closed == [recorder.path]
    stats = heard.stats[-1]
    assert (stats.written, stats.dropped, stats.waiting, stats.waiting_bytes) == (40, 0, 0, 0)
    assert stats.duration_s == pytest.approx(39 / 20.0)
    assert stats.file_bytes > 0
    assert stats.left_s > 0.0
    with open_image_recording(recorder.path) as found:
        assert found.complete
        assert [each.row.frame_id for each in found] == list(range(40))


def test_a_full_queue_drops_images_and_reports_which(recorders, heard, monkeypatch, caplog):
    gate = Gate(monkeypatch)
    data = noise()
    recorder = recorders(queue_bytes=3 * data.nbytes)
    assert recorder.put(image(0, data))
    assert gate.reached.wait(10.0)
    with caplog.at_level(logging.WARNING):
        began_s = WALL.now_s()
        taken = [recorder.put(image(number, data)) for number in range(1, 10)]
        assert WALL.now_s() - began_s < 1.0
        assert taken == [True, True] + [False] * 7
        assert (recorder.stats.dropped, recorder.stats.waiting) == (7, 3)
        assert recorder.stats.waiting_bytes == 3 * data.nbytes
        gate.open.set()
        wait_until(lambda: recorder.stats.waiting == 0)
        assert recorder.put(image(10, data))
        wait_until(lambda: any("7 images dropped" in each for each in caplog.messages))
    end(recorder)
    assert heard.stats[-1].dropped == 7
    assert heard.errors == []
    with open_image_recording(recorder.path) as found:
        assert found.complete
        assert [each.row.frame_id for each in found] == [0, 1, 2, 10]
        assert found.dropped == 7
        status = {row.frame_id: (row.index, row.status, row.dropped) for row in found.rows}
        assert status[9] == (-1, "dropped", 7)
        assert status[10] == (3, "complete", 7)
        assert len(status) == 11


def test_an_image_larger_than_the_queue_is_written_when_nothing_waits(recorders):
    recorder = recorders(queue_bytes=10)
    for number in range(3):
        assert recorder.put(image(number))
        wait_until(lambda: recorder.stats.waiting == 0)
    end(recorder)
    assert recorder.stats.written == 3


def test_incomplete_images_are_counted_and_kept_out_of_the_file(recorders):
    recorder = recorders()
    for number in range(6):
        status = FrameStatus.INCOMPLETE if number in {2, 3} else FrameStatus.COMPLETE
        lost = 4 if number == 5 else 0
        assert recorder.put(image(number, status=status, lost_before=lost)) is (
            status is FrameStatus.COMPLETE
        )
    end(recorder)
    stats = recorder.stats
    assert (stats.written, stats.incomplete, stats.dropped, stats.lost) == (4, 2, 0, 4)
    with open_image_recording(recorder.path) as found:
        assert [each.row.frame_id for each in found] == [0, 1, 4, 5]
        assert (found.incomplete, found.lost) == (2, 4)
        assert found.rows[2].status == "incomplete"
        assert found.rows[2].index == -1


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (image(3, noise(width=36)), "36 x 23 px Mono8, where .* begun with 37 x 23 px Mono8"),
        (image(3, pixel_format=PixelFormat.MONO12), "37 x 23 px Mono12, where"),
        (image(3, noise(PixelFormat.RGB8)), "cannot be recorded"),
    ],
)
def test_another_size_or_pixel_format_ends_the_recording_in_good_order(
    recorders, heard, other, said
):
    recorder = recorders()
    for each in images(3):
        recorder.put(each)
    recorder.put(other)
    wait_until(lambda: recorder.error is not None)
    assert not recorder.put(image(4))
    end(recorder)
    with pytest.raises(RecordingError, match=said):
        raise heard.errors[0]
    assert len(heard.errors) == 1
    assert heard.stops == []
    with open_image_recording(recorder.path) as found:
        assert not found.complete
        assert len(found) == 3
        assert found.rows[3].status == "dropped"
        for shot, read in zip(images(3), found, strict=True):
            np.testing.assert_array_equal(read.data, shot.data)


def test_a_disk_that_is_full_at_the_start_forbids_it(tmp_path, recorders, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**9, 0, RESERVE_BYTES + 100))
    with pytest.raises(RecordingError, match="the disk is full"):
        recorders()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("image_format", [ImageFormat.FFV1, ImageFormat.TIFF])
def test_a_disk_that_fills_ends_the_recording_in_good_order(
    recorders, heard, monkeypatch, image_format
):
    recorder = recorders("run", image_format)
    for each in images(5):
        assert recorder.put(each)
    wait_until(lambda: recorder.stats.written == 5)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**9, 0, RESERVE_BYTES))
    wait_until(lambda: heard.closed)
    assert "the disk is full" in str(heard.errors[0])
    assert heard.stops == []
    with open_image_recording(recorder.path) as found:
        assert not found.complete
        assert len(found) == 5


def test_what_waits_when_writing_fails_is_reported_as_dropped(recorders, heard, monkeypatch):
    gate = Gate(monkeypatch)
    recorder = recorders()
    for each in images(5):
        assert recorder.put(each)
    assert gate.reached.wait(10.0)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("cosmic.vico.core.recording.video_writer.VideoWriter.write", full)
    gate.open.set()
    wait_until(lambda: heard.closed)
    assert "No space left on device" in str(heard.errors[0])
    assert heard.stats[-1].dropped == 5
    with open_image_recording(recorder.side_path) as found:
        assert [(row.status, row.dropped) for row in found.rows] == [
            ("dropped", number) for number in range(1, 6)
        ]


@pytest.mark.parametrize(
    ("image_format", "taken"),
    [
        (ImageFormat.FFV1, "run.mkv"),
        (ImageFormat.FAST, "run.csv"),
        (ImageFormat.PNG, "run"),
    ],
)
def test_a_file_that_is_taken_away_is_reported(tmp_path, recorders, heard, image_format, taken):
    recorder = recorders("run", image_format)
    recorder.put(image(0))
    wait_until(lambda: recorder.stats.written == 1)
    path = tmp_path / taken
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    recorder.put(image(1))
    wait_until(lambda: heard.closed)
    assert "taken away" in str(heard.errors[0]) or "writing failed" in str(heard.errors[0])
    assert heard.stops == []


def test_a_recording_that_is_there_stays_unless_it_may_go(recorders):
    for overwrite in (False, True):
        recorder = recorders(overwrite=overwrite)
        recorder.put(image(0))
        end(recorder)
        with pytest.raises(RecordingExistsError):
            recorders(start=False)


def test_pixels_that_a_format_cannot_keep_are_refused_at_the_start(tmp_path, recorders):
    with pytest.raises(
        RecordingError, match=r"small cannot keep .* ffv1, fast, stack, zarr, tiff, png"
    ):
        recorders("run", ImageFormat.SMALL, settings=settings(PixelFormat.MONO12))
    assert list(tmp_path.iterdir()) == []


def test_images_pass_while_it_is_paused(recorders):
    recorder = recorders()
    recorder.put(image(0))
    recorder.pause()
    assert recorder.stats.paused
    assert not recorder.put(image(1))
    recorder.resume()
    recorder.put(image(2))
    end(recorder)
    with open_image_recording(recorder.path) as found:
        assert [row.frame_id for row in found.rows] == [0, 2]
        assert found.complete


@pytest.mark.parametrize("image_format", ImageFormat)
def test_a_recording_without_an_image_is_complete_and_empty(recorders, image_format):
    recorder = recorders("run", image_format)
    end(recorder)
    with open_image_recording(recorder.path) as found:
        assert found.complete
        assert len(found) == 0
        assert list(found) == []


def test_a_running_recording_can_be_read(recorders, heard):
    recorder = recorders()
    data = noise(width=400, height=300)
    for number in range(60):
        recorder.put(image(number, data))
    wait_until(lambda: recorder.stats.written == 60)
    seen = len(heard.stats)
    wait_until(lambda: len(heard.stats) > seen)
    with open_image_recording(recorder.path) as found:
        assert not found.complete
        assert len(found) >= 55
        assert found.time_s.size == len(found)
        for read in found:
            np.testing.assert_array_equal(read.data, data)


def test_a_recorder_that_was_asked_to_end_takes_no_more(recorders):
    recorder = recorders(start=False)
    recorder.put(image(0))
    recorder.request_end()
    assert not recorder.put(image(1))
    recorder.start()
    assert recorder.join()
    assert recorder.stats.written == 1
