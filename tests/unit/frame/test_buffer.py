"""Data between threads that do not know each other."""

import gc
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QObject, QThread, Signal, Slot
from pytestqt.qtbot import QtBot
from typing_extensions import override

from cosmic.frame.buffer import ActiveBuffer, Connector, DataBuffer
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread


def test_an_empty_buffer_has_nothing() -> None:
    buffer: DataBuffer[int] = DataBuffer()
    assert (buffer.latest(), buffer.take(), len(buffer), buffer.lost) == (None, [], 0, 0)


@pytest.mark.parametrize("capacity", [0, -1])
def test_a_buffer_without_room_is_refused(capacity: int) -> None:
    with pytest.raises(ValueError, match="at least one value"):
        DataBuffer(capacity)


def test_the_latest_value_can_be_read_again_and_again() -> None:
    buffer: DataBuffer[int] = DataBuffer(3)
    buffer.put(1)
    buffer.put(2)
    assert [buffer.latest(), buffer.latest(), len(buffer)] == [2, 2, 2]


def test_the_latest_value_is_known_after_all_were_taken() -> None:
    buffer: DataBuffer[int] = DataBuffer()
    buffer.put(7)
    buffer.take()
    assert (buffer.latest(), len(buffer)) == (7, 0)


def test_a_buffer_that_is_cleared_has_nothing_and_has_lost_nothing() -> None:
    buffer: DataBuffer[int] = DataBuffer(2)
    buffer.put(7)
    buffer.clear()
    assert (buffer.latest(), buffer.take(), len(buffer), buffer.lost) == (None, [], 0, 0)


def test_a_value_that_is_none_is_a_value() -> None:
    buffer: DataBuffer[None] = DataBuffer()
    buffer.put(None)
    assert buffer.take() == [None]


@given(st.lists(st.one_of(st.integers(), st.just("take"))), st.integers(1, 5))
def test_values_come_out_in_order_and_those_overwritten_are_counted(
    steps: list[int | str], capacity: int
) -> None:
    buffer: DataBuffer[int] = DataBuffer(capacity)
    kept: list[int] = []
    lost = 0
    for step in steps:
        if isinstance(step, str):
            assert buffer.take() == kept
            kept.clear()
            continue
        buffer.put(step)
        kept.append(step)
        if len(kept) > capacity:
            del kept[0]
            lost += 1
    assert (buffer.take(), buffer.lost) == (kept, lost)


def test_nothing_is_lost_uncounted_between_threads() -> None:
    buffer: DataBuffer[tuple[int, int]] = DataBuffer(50)
    taken: list[tuple[int, int]] = []

    def fill(number: int) -> None:
        for index in range(2000):
            buffer.put((number, index))

    with ThreadPoolExecutor(3) as pool:
        jobs = [pool.submit(fill, number) for number in range(3)]
        while not all(job.done() for job in jobs):
            taken += buffer.take()
    taken += buffer.take()
    assert len(taken) + buffer.lost == 6000
    for number in range(3):
        mine = [index for who, index in taken if who == number]
        assert mine == sorted(set(mine))


class Source(WorkerThread):
    """A producer that emits from its own thread."""

    data_ready = Signal()

    def __init__(self, count: int) -> None:
        super().__init__("source", FailurePolicy())
        self.buffer: DataBuffer[int] = DataBuffer(count)
        self._count = count

    @override
    def run_body(self) -> None:
        for value in range(self._count):
            self.buffer.put(value)
            self.data_ready.emit()


class Sink(QObject):
    """A consumer that notes what it got and where."""

    done = Signal()

    def __init__(self, wanted: int) -> None:
        super().__init__()
        self.buffer: DataBuffer[int] | None = None
        self.got: list[int] = []
        self.threads: set[QThread] = set()
        self._wanted = wanted

    def set_buffer(self, buffer: DataBuffer[int]) -> None:
        self.buffer = buffer

    @Slot()
    def receive_notification(self) -> None:
        assert self.buffer is not None
        self.threads.add(QThread.currentThread())
        self.got += self.buffer.take()
        if len(self.got) >= self._wanted:
            self.done.emit()


def test_a_consumer_is_called_in_its_own_thread_and_gets_everything_in_order(qtbot: QtBot) -> None:
    source, sink = Source(100), Sink(100)
    Connector(source, sink)
    with qtbot.waitSignal(sink.done):
        source.start()
    assert source.join()
    assert sink.got == list(range(100))
    assert sink.threads == {QThread.currentThread()}


def test_producer_and_consumer_never_learn_of_each_other(qapp: QObject) -> None:
    source, sink = Source(1), Sink(1)
    before = (set(vars(source)), set(vars(sink)))
    connector = Connector(source, sink)
    assert (set(vars(source)), set(vars(sink))) == before
    assert not [each for each in gc.get_referrers(sink) if each is vars(source)]
    assert not [each for each in gc.get_referrers(source) if each is vars(sink)]
    assert vars(sink)["buffer"] is source.buffer
    connector.disconnect()


def test_a_disconnected_consumer_hears_nothing_and_the_values_stay(qapp: QObject) -> None:
    source, sink = Source(1), Sink(1)
    connector = Connector(source, sink)
    source.buffer.put(5)
    connector.disconnect()
    source.data_ready.emit()
    assert sink.got == []
    assert source.buffer.take() == [5]


class Lengths(ActiveBuffer[str, int]):
    """Turns texts into their lengths."""

    def __init__(self, capacity: int = 1) -> None:
        super().__init__(len, capacity)


def test_an_active_buffer_converts_and_notifies_by_itself(qapp: QObject) -> None:
    lengths, sink = Lengths(4), Sink(9)
    connector = Connector(lengths, sink)
    for text in ("a", "bcd", ""):
        lengths.put(text)
    assert sink.got == [1, 3, 0]
    connector.disconnect()


def test_an_active_buffer_stores_and_reports_nothing_when_it_cannot_convert(qapp: QObject) -> None:
    lengths, received = Lengths(), []
    lengths.data_ready.connect(lambda: received.append(True))
    with pytest.raises(TypeError):
        lengths.put(5)  # type: ignore[arg-type]
    assert (received, lengths.buffer.latest()) == ([], None)
