"""The log of a session: kept beside the recordings, with the platform's time."""

import logging
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cosmic.app.results.session_log import SessionLog, log_lines
from cosmic.frame.clock import ManualClock
from cosmic.frame.log import RingBufferHandler


def record(text: str, level: int = logging.INFO) -> logging.LogRecord:
    return logging.LogRecord("cosmic.mico.core", level, "", 0, text, None, None)


def test_lines_from_before_and_after_the_first_recording_are_kept(tmp_path: Path) -> None:
    ring, clock = RingBufferHandler(), ManualClock()
    begun = datetime.now(UTC)
    log = SessionLog(ring, clock)
    ring.handle(record("left X moves to 20 um"))
    log.begin(tmp_path)
    clock.advance(3.0)
    ring.handle(record("a tab\tand a\nline end", logging.WARNING))
    log.close()
    ring.handle(record("nobody keeps this"))
    lines = log_lines(tmp_path, 0.0, 10.0, begun)
    assert [each.text for each in lines] == ["left X moves to 20 um", "a tab and a line end"]
    assert [round(each.time_s) for each in lines] == [0, 3]
    assert lines[1].level == "WARNING"
    assert lines[1].where == "mico.core"


def test_only_the_lines_of_a_recording_are_shown_beside_it(tmp_path: Path) -> None:
    ring, clock = RingBufferHandler(), ManualClock()
    begun = datetime.now(UTC)
    log = SessionLog(ring, clock)
    log.begin(tmp_path)
    for text in ("before", "meanwhile", "after"):
        ring.handle(record(text))
        clock.advance(10.0)
    log.close()
    assert [each.text for each in log_lines(tmp_path, 9.0, 12.0, begun)] == ["meanwhile"]
    assert log_lines(tmp_path, 9.0, 12.0, begun + timedelta(hours=1)) == ()


def test_a_line_that_was_cut_off_and_a_folder_without_log_are_no_error(tmp_path: Path) -> None:
    now = datetime.now(UTC)
    assert log_lines(tmp_path, 0.0, 1.0, now) == ()
    text = f"time_s\tutc\tlevel\twhere\tmessage\n0.5\t{now.isoformat()}\tINFO\tmico\tmoves\n0.6\t20"
    (tmp_path / "log.tsv").write_text(text)
    assert [each.text for each in log_lines(tmp_path, 0.0, 1.0, now)] == ["moves"]


def test_a_folder_that_cannot_be_written_costs_one_line_in_the_log(tmp_path: Path) -> None:
    ring = RingBufferHandler()
    log = SessionLog(ring, ManualClock())
    log.begin(tmp_path / "missing")
    log.begin(tmp_path / "missing")
    ring.handle(record("goes on"))
    log.close()
    assert [each.message for each in ring.records()] == ["goes on"]


def test_a_line_with_the_name_of_a_file_that_is_no_text_is_kept(tmp_path: Path) -> None:
    ring, begun = RingBufferHandler(), datetime.now(UTC)
    log = SessionLog(ring, ManualClock())
    ring.handle(record("recorded to fibre\udcff.h5"))
    log.begin(tmp_path)
    ring.handle(record("recorded to other\udcff.h5"))
    log.close()
    lines = [each.text for each in log_lines(tmp_path, 0.0, 1.0, begun)]
    assert lines == [r"recorded to fibre\udcff.h5", r"recorded to other\udcff.h5"]
