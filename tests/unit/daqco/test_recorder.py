"""A recorder over an acquisition of chunks given by hand: what belongs to a chunk is with it."""

import threading
from collections.abc import Callable
from pathlib import Path
from threading import Lock
from types import SimpleNamespace

import numpy as np
import pytest
from PySide6.QtCore import Qt

from cosmic.daqco.api.recorder import Recorder
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.file_writer import UDaqFileWriter
from cosmic.daqco.core.limits import LimitGuard
from cosmic.daqco.core.recording_format import AxisPosition, RecordedEvent
from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotAvailable
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy
from unit.daqco.recording_helpers import chunks, header, volts_of

HEAD = header()


class StartsFirst:
    """A lock before which a recording begins, as another thread may have it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self.begin: Callable[[], None] | None = None

    def __enter__(self) -> None:
        begin, self.begin = self.begin, None
        if begin is not None:
            begin()
        self._lock.acquire()

    def __exit__(self, *_error: object) -> None:
        self._lock.release()


def recorder_of_chunks() -> tuple[Recorder, Event[DataChunk]]:
    """Return a recorder, and what hands it a chunk."""
    came: Event[DataChunk] = Event()
    settings = SimpleNamespace(channel=HEAD.channels)
    scales = dict(zip((each.name for each in HEAD.channels), HEAD.scales, strict=True))
    acquisition = SimpleNamespace(
        clock=SimpleNamespace(now_s=lambda: HEAD.start_s + 1.0, rate=1.0),
        running=True,
        rate_hz=HEAD.rate_hz,
        clock_agreement=(),
        settings=settings,
        buffer=SimpleNamespace(subscribe=came.subscribe, samples=0),
        guard=LimitGuard(WALL),
        scales=lambda: scales,
        exposures_in=lambda _chunk: (),
        before_change=lambda _check: None,
    )
    return Recorder(acquisition, FailurePolicy()), came  # type: ignore[arg-type]


@pytest.mark.parametrize("begins", ["between two chunks", "while a chunk comes"])
def test_the_only_chunk_of_a_recording_has_positions(tmp_path: Path, begins: str) -> None:
    recorder, came = recorder_of_chunks()
    where_um = [5.0]
    recorder.position_source = lambda: [
        AxisPosition(WALL.now_s(), "probe.y", where_um[0], "um", "known")
    ]
    recorder._handing_over = lock = StartsFirst()  # type: ignore[assignment]
    given = chunks(HEAD, volts_of(2, 30))
    came.emit(next(given))  # positions are not due again for a while
    path = tmp_path / "one.h5"
    if begins == "between two chunks":
        recorder.start(path)
    else:
        lock.begin = lambda: recorder.start(path)
    came.emit(next(given))
    where_um[0] = 6.0  # and no chunk comes any more
    recorder.stop()
    with open_recording(path) as recording:
        times_s, where, _ = recording.positions("probe.y")
        assert times_s[0] <= times_s[1]
        np.testing.assert_array_equal(where, [5.0, 6.0])


def test_a_mark_is_refused_while_the_file_is_being_closed(tmp_path: Path) -> None:
    recorder, came = recorder_of_chunks()
    came.emit(next(chunks(HEAD, volts_of(2, 30))))
    recorder.start(tmp_path / "one.h5")
    recorder.mark("kept")
    refused: list[str] = []

    def mark_late() -> list[AxisPosition]:  # asked for when the file is closed
        assert recorder.state.active
        with pytest.raises(NotAvailable, match="is being closed, so the mark 'late'") as late:
            recorder.mark("late")
        refused.append(str(late.value))
        return []

    recorder.position_source = mark_late
    recorder.stop()
    assert refused
    with pytest.raises(NotAvailable, match="nothing is recorded, so the mark 'after'"):
        recorder.mark("after")
    with open_recording(tmp_path / "one.h5") as recording:
        assert [each.text for each in recording.events if each.kind == "mark"] == ["kept"]


def test_a_mark_after_a_failed_write_is_refused_with_the_failure(tmp_path: Path) -> None:
    recorder, came = recorder_of_chunks()
    given = chunks(HEAD, volts_of(2, 30))
    recorder.start(tmp_path / "one.h5")
    failed = threading.Event()
    writer = recorder._writer
    assert writer is not None
    writer.failed.connect(lambda _error: failed.set(), Qt.ConnectionType.DirectConnection)
    (tmp_path / "one.h5").unlink()
    came.emit(next(given))
    assert failed.wait(10.0)
    for text in ("at once", "later"):
        with pytest.raises(NotAvailable, match=f"taken away .* so the mark '{text}'"):
            recorder.mark(text)
        recorder.stop()


def test_a_writer_takes_no_event_after_its_end(tmp_path: Path) -> None:
    writer = UDaqFileWriter(tmp_path / "one.h5", HEAD, FailurePolicy())
    writer.start()
    assert writer.add_event(RecordedEvent(101.0, 1, "mark", "kept"))
    writer.request_end()
    assert not writer.add_event(RecordedEvent(101.0, 2, "mark", "late"))
    assert writer.join()
