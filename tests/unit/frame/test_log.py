"""The log's set-up and the ring of recent records."""

import gc
import logging
import re
import weakref
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from cosmic.frame.clock import ManualClock
from cosmic.frame.log import RingBufferHandler, set_up_logging
from cosmic.frame.log_folding import flush_folded

logger = logging.getLogger("cosmic.test")


@pytest.fixture
def ring() -> Iterator[RingBufferHandler]:
    handler = RingBufferHandler(capacity=3)
    undo = set_up_logging(handler)
    yield handler
    undo()


def _texts(ring: RingBufferHandler) -> list[str]:
    return [record.message for record in ring.records()]


def test_the_ring_keeps_the_newest_records_in_order(ring: RingBufferHandler) -> None:
    for number in range(5):
        logger.info("number %d", number)
    assert _texts(ring) == ["number 2", "number 3", "number 4"]


def test_hardware_calls_at_debug_level_stay_out_of_the_ring(ring: RingBufferHandler) -> None:
    logger.debug("SA_GotoPositionAbsolute_A")
    assert not ring.records()


def test_a_subscriber_hears_each_record_until_it_ends(ring: RingBufferHandler) -> None:
    heard: list[str] = []
    end = ring.subscribe(lambda record: heard.append(record.getMessage()))
    logger.info("one")
    end()
    logger.info("two")
    assert heard == ["one"]


def test_a_subscriber_that_fails_does_not_fail_what_was_logged(
    ring: RingBufferHandler, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(logging, "raiseExceptions", True)
    ring.subscribe(lambda _record: 1 // 0)  # type: ignore[arg-type, return-value]
    logger.warning("the text")
    assert _texts(ring) == ["the text"]
    assert "ZeroDivisionError" in capsys.readouterr().err


class _Window:
    """Stands for what a traceback's frames hold."""


def test_the_ring_keeps_the_traceback_as_text_and_no_object_alive(
    ring: RingBufferHandler, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger("cosmic"), "propagate", False)  # pytest keeps records

    def fail() -> weakref.ref[_Window]:
        window = _Window()
        try:
            raise ValueError("deep down")
        except ValueError:
            logger.exception("failed on %s", window)
        return weakref.ref(window)

    window = fail()
    gc.collect()
    (record,) = ring.records()
    assert window() is None
    assert "ValueError: deep down" in (record.exc_text or "")
    assert record.message.startswith("failed on <")


def test_the_ring_takes_records_from_many_threads() -> None:
    ring = RingBufferHandler(capacity=1000)
    undo = set_up_logging(ring)
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda number: logger.info("%d", number), range(400)))
    undo()
    assert sorted(int(text) for text in _texts(ring)) == list(range(400))


def test_the_file_has_the_record_and_its_traceback(tmp_path: Path) -> None:
    path = tmp_path / "logs" / "cosmic.log"
    undo = set_up_logging(RingBufferHandler(), file=path)
    try:
        raise ValueError("5 µm")
    except ValueError:
        logger.exception("while moving")
    undo()
    text = path.read_text(encoding="utf-8")
    assert "ERROR   cosmic.test: while moving" in text
    assert "ValueError: 5 µm" in text


def test_the_terminal_shows_records_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    undo = set_up_logging(RingBufferHandler(), console=True)
    logger.info("hello")
    undo()
    assert "INFO    cosmic.test: hello" in capsys.readouterr().err


def test_undoing_the_set_up_leaves_logging_as_it_was() -> None:
    root = logging.getLogger("cosmic")
    before = (root.level, list(root.handlers))
    ring = RingBufferHandler()
    undo = set_up_logging(ring, console=True)
    assert root.handlers != before[1]
    undo()
    logger.warning("to nobody")
    assert (root.level, list(root.handlers)) == before
    assert not ring.records()


# --- floods


def _flood(path: Path, clock: ManualClock, seconds: int, per_second: int) -> int:
    """Log refused greetings at that rate, and something else in the middle; return how many."""
    for second in range(seconds):
        for number in range(per_second):
            logger.warning("%s refused %s: %s", "fibres", f"rude/{number}", "greet first")
            if second == seconds // 2 and number == 17:
                logger.warning("left.x does not answer")
        clock.advance(1.0)
    return seconds * per_second


def test_a_flood_of_refused_greetings_is_reported_in_few_lines_with_the_right_count(
    tmp_path: Path,
) -> None:
    path, clock = tmp_path / "cosmic.log", ManualClock()
    undo = set_up_logging(file=path, clock=clock)
    sent = _flood(path, clock, seconds=20, per_second=500)
    undo()
    text = path.read_text(encoding="utf-8")
    assert len(text) < 50_000
    assert "left.x does not answer" in text, "another message passes"
    counted = [int(each) for each in re.findall(r"repeated (\d+) times in", text)]
    single = text.count("refused rude/") - len(counted)
    assert single + sum(counted) == sent
    assert single >= 50, "the first are kept as they are"


def test_a_flood_that_has_ended_is_reported_though_nothing_else_is_logged() -> None:
    ring, clock = RingBufferHandler(), ManualClock()
    undo = set_up_logging(ring, clock=clock)
    for _ in range(862):
        logger.warning("cable out")
    flush_folded()
    assert _texts(ring) == ["cable out"] * 50
    clock.advance(10.0)
    flush_folded()
    assert _texts(ring)[50:] == ["cable out ... repeated 812 times in 10 s"]
    clock.advance(10.0)
    flush_folded()
    logger.warning("cable out")
    assert _texts(ring)[51:] == ["cable out"], "afterwards it is new again"
    undo()


def test_an_error_that_is_new_passes_in_any_flood_of_errors() -> None:
    ring, clock = RingBufferHandler(), ManualClock()
    undo = set_up_logging(ring, clock=clock)
    for number in range(1000):
        logger.error("%s", "device 1 hangs")
        if number % 100 == 99:
            logger.error("%s", f"device 2 hangs at {number}")
    assert sum("device 2" in text for text in _texts(ring)) == 10
    assert len(ring.records()) == 60
    undo()
    assert _texts(ring)[60:] == ["device 1 hangs ... repeated 950 times in 1 s"]


def test_errors_whose_text_never_repeats_are_a_flood_too() -> None:
    ring = RingBufferHandler()
    undo = set_up_logging(ring, clock=ManualClock())
    for number in range(3000):
        logger.error("packet %d is broken", number)
    assert len(ring.records()) == 200
    undo()
    assert "repeated 2800 times" in _texts(ring)[-1]


def test_folding_keeps_no_object_alive_and_forgets_old_sources(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(logging.getLogger("cosmic"), "propagate", False)  # pytest keeps records
    ring = RingBufferHandler(capacity=10_000)
    undo = set_up_logging(ring, clock=ManualClock())

    def flood() -> weakref.ref[_Window]:
        window = _Window()
        for _ in range(60):
            logger.warning("closed %s", window)
        return weakref.ref(window)

    window = flood()
    gc.collect()
    assert window() is None
    for number in range(2000):
        logger.warning(f"source {number}")  # noqa: G004 - as many sources as can be
    assert any("repeated 10 times" in text for text in _texts(ring)), "told when it is forgotten"
    undo()
