"""What the station that has the boards publishes, from the threads that acquire and record."""

import secrets
from collections.abc import Callable
from threading import Event
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.daqco.api.station_report import CHUNKS, DISPLAY, REPORTS, DaqPiece, DaqReport
from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

DISPLAY_S: Final = 0.05
"""How much time of the wall a piece for a display covers at least."""
REPORT_S: Final = 0.25
"""How often everything but the samples is told, whether it changed or not."""
_SHORTEST_S: Final = 0.03

Publish = Callable[[str, object], None]


class SampleStream:
    """Publishes what is acquired; `take` in the acquisition thread.

    Parameters
    ----------
    display_s : float
        How much platform time a piece for a display covers at least.
    """

    def __init__(self, publish: Publish, display_s: float) -> None:
        self._publish = publish
        self._display_s = display_s
        self._run, self._next = "", -1
        self._waiting: list[DataChunk] = []

    def take(self, chunk: DataChunk) -> None:
        """Publish `chunk`, and with those before it as a piece for displays."""
        if chunk.first_sample != self._next:  # there are no gaps, so it is another acquisition
            self._run = secrets.token_hex(8)
            self._waiting.clear()
        self._next = chunk.first_sample + chunk.samples
        self._publish(CHUNKS, DaqPiece(self._run, chunk))
        if self._waiting and self._waiting[-1].scales != chunk.scales:
            self._flush()
        self._waiting.append(chunk)
        if sum(each.samples for each in self._waiting) >= self._display_s * chunk.rate_hz:
            self._flush()

    def _flush(self) -> None:
        pieces, self._waiting = self._waiting, []
        first = pieces[0]
        joined = first
        if len(pieces) > 1:
            joined = DataChunk(
                first_sample=first.first_sample,
                time_s=first.time_s,
                rate_hz=first.rate_hz,
                channels=first.channels,
                volts=np.concatenate([each.volts for each in pieces], axis=1),
                scales=first.scales,
            )
        self._publish(DISPLAY, DaqPiece(self._run, joined))


class ReportSender(WorkerThread):
    """Publishes how everything stands: soon after each change, and regularly."""

    def __init__(
        self, make: Callable[[], DaqReport], publish: Publish, policy: FailurePolicy
    ) -> None:
        super().__init__("DAQCo reports", policy)
        self._make = make
        self._publish = publish
        self._changed = Event()

    def note_change(self) -> None:
        """Have it told soon; returns at once, any thread."""
        self._changed.set()

    @override
    def run_body(self) -> None:
        while not self._end_requested.wait(_SHORTEST_S):
            self._changed.wait(REPORT_S)
            self._changed.clear()
            if not self.end_requested:
                self._publish(REPORTS, self._make())

    @override
    def request_end(self) -> None:
        super().request_end()
        self._changed.set()
