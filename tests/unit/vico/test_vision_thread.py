"""Images are analysed for those who want to know, and for nobody else."""

from collections.abc import Iterator
from threading import Event

import numpy as np
import pytest

from cosmic.frame.failure import FailurePolicy
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.vision_thread import VisionThread
from cosmic.vico.hw.interface import Frame


class Bench:
    """The thread, and the numbers of the images that it analysed."""

    def __init__(self) -> None:
        self.analysed: list[int] = []
        self.thread: VisionThread[int] = VisionThread("cam", self._analyse, FailurePolicy())
        self.thread.start()

    def _analyse(self, image: CameraImage) -> int:
        self.analysed.append(image.frame.frame_id)
        return image.frame.frame_id

    def put(self, number: int) -> None:
        frame = Frame(np.zeros((4, 4), np.uint8), number, 0.1 * number, 0.1 * number)
        self.thread.put(CameraImage("cam", frame, Circumstances()))


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.thread.request_end()
    assert bench.thread.join()


def test_images_that_nobody_asks_about_are_not_analysed(bench: Bench) -> None:
    for number in range(20):
        bench.put(number)
    assert bench.thread.newest == 19  # the first look waits, and is for the newest image
    assert bench.analysed == [19]
    assert bench.thread.passed_over == 0


def test_images_are_analysed_as_they_come_after_a_look(bench: Bench) -> None:
    bench.put(1)
    assert bench.thread.newest == 1
    found = Event()
    bench.thread.subscribe(lambda number: number == 2 and found.set(), lambda: False)
    bench.put(2)
    while bench.thread.newest != 2:
        assert not found.wait(0.001)  # and whoever does not want it is not told


def test_images_are_analysed_while_a_listener_wants_them(bench: Bench) -> None:
    received, heard = list[int](), Event()

    def listen(number: int) -> None:
        received.append(number)
        heard.set()

    wanted = [False]
    bench.thread.subscribe(listen, lambda: wanted[0])
    bench.put(1)
    wanted[0] = True
    bench.put(2)
    assert heard.wait(5.0)
    assert (received, bench.analysed) == ([2], [2])
