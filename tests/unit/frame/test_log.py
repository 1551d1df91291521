"""The log's set-up and the ring of recent records."""

import gc
import logging
import weakref
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from cosmic.frame.log import RingBufferHandler, set_up_logging

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
