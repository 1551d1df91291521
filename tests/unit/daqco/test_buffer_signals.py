"""The buffer of the acquisition: who connects later hears of every chunk from then on."""

from threading import Thread

import numpy as np
from PySide6.QtCore import QObject, QThread, Signal, Slot
from pytestqt.qtbot import QtBot

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import VOLTS
from cosmic.daqco.core.udaq_buffer import UDaqBuffer
from cosmic.frame.buffer import Connector, DataBuffer


def chunk(number: int) -> DataChunk:
    return DataChunk(2 * number, 0.002 * number, 1000.0, ("force",), np.zeros((1, 2)), (VOLTS,))


def test_who_connects_later_gets_every_chunk_from_then_on(qapp: QObject) -> None:
    buffer, taken, notified, subscribed = UDaqBuffer(), [], [], []
    buffer.subscribe(lambda each: subscribed.append(each.first_sample))
    buffer.put(chunk(0))
    buffer.data_chunk_ready.connect(lambda each: taken.append(each.first_sample))
    buffer.put(chunk(1))
    buffer.data_ready.connect(lambda: notified.append(True))
    buffer.put(chunk(2))
    assert taken == [2, 4]
    assert notified == [True]
    assert subscribed == [0, 2, 4]
    assert buffer.samples == 6


class Newest(QObject):
    """A consumer that notes the newest chunk it found, and in which thread."""

    looked = Signal()

    def set_buffer(self, buffer: DataBuffer[DataChunk]) -> None:
        self._buffer = buffer
        self.found: list[int] = []
        self.threads: set[QThread] = set()

    @Slot()
    def receive_notification(self) -> None:
        chunk = self._buffer.latest()
        assert chunk is not None
        self.found.append(chunk.first_sample)
        self.threads.add(QThread.currentThread())
        self.looked.emit()


def test_a_consumer_finds_the_newest_chunk_in_its_own_thread(qtbot: QtBot) -> None:
    buffer, newest = UDaqBuffer(), Newest()
    connector = Connector(buffer, newest)
    with qtbot.waitSignal(newest.looked):
        acquisition = Thread(target=lambda: [buffer.put(chunk(n)) for n in range(3)])
        acquisition.start()
        acquisition.join()
    assert newest.found[0] == 4
    assert newest.threads == {QThread.currentThread()}
    connector.disconnect()


def test_what_was_there_before_is_forgotten_when_another_acquisition_begins() -> None:
    buffer = UDaqBuffer()
    buffer.put(chunk(0))
    buffer.clear()
    assert (buffer.latest_chunk, buffer.samples, buffer.get_latest_data()) == (None, 0, {})
