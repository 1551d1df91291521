"""The buffer of the acquisition: who connects later hears of every chunk from then on."""

import numpy as np
from PySide6.QtCore import QObject

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import VOLTS
from cosmic.daqco.core.udaq_buffer import UDaqBuffer


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
