"""Lenses and lamps to test, each over an object in this process or over a pseudo-terminal."""

import os
import select
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager

from cosmic.frame.clock import ManualClock
from cosmic.twin.lens import TwinLens
from cosmic.twin.lens_settings import LensSettings
from cosmic.twin.light import TwinLight
from cosmic.twin.settings import shipped_settings
from cosmic.vico.hw.sim_line import SimLine
from cosmic.vico.hw.sim_peripherals import SimPeripherals


def lens_settings(generation: int = 1) -> LensSettings:
    return shipped_settings().lens.model_copy(update={"generation": generation})


class PeripheralRig:
    """A twin's lens and lamp, and the time, which the test moves."""

    def __init__(self, *, generation: int = 1, cold: bool = False) -> None:
        self.clock = ManualClock()
        self.lens = TwinLens(lens_settings(generation), cold=cold)
        self.light = TwinLight(shipped_settings().light)
        self.simulation = SimPeripherals(self.lens, self.light, self.clock)


class Terminal:
    """A pseudo-terminal with a simulated line behind it; `path` is what pyserial opens."""

    def __init__(self, line: SimLine) -> None:
        self._line = line
        self._device, self._computer = os.openpty()
        self._wake_read, self._wake = os.pipe()
        tty.setraw(self._device)
        tty.setraw(self._computer)
        self.path = os.ttyname(self._computer)
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def close(self) -> None:
        if self._thread.is_alive():
            os.write(self._wake, b"x")
            self._thread.join(5.0)
        for each in (self._device, self._computer, self._wake_read, self._wake):
            if each >= 0:
                os.close(each)
        self._device = self._computer = self._wake_read = self._wake = -1

    def _carry(self) -> None:
        while True:
            ready, _, _ = select.select([self._device, self._wake_read], [], [])
            if self._wake_read in ready:
                return
            answer = self._line.exchange(os.read(self._device, 256))
            if answer:
                os.write(self._device, answer)


@contextmanager
def terminal(line: SimLine) -> Iterator[Terminal]:
    """Open a pseudo-terminal to `line`."""
    made = Terminal(line)
    try:
        yield made
    finally:
        made.close()
