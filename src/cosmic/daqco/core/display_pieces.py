"""Samples for a display: the same ones in fewer and larger pieces."""

from collections.abc import Callable
from typing import Final

import numpy as np

from cosmic.daqco.core.chunk import DataChunk

DISPLAY_S: Final = 0.032
"""How much time of the wall a piece covers at least."""


class DisplayPieces:
    """Joins chunks that follow on each other; `take` in the acquisition thread.

    Parameters
    ----------
    receiver : callable
        Takes the pieces.
    display_s : float
        How much platform time a piece covers at least.
    """

    def __init__(self, receiver: Callable[[DataChunk], object], display_s: float) -> None:
        self._receiver = receiver
        self._display_s = display_s
        self._waiting: list[DataChunk] = []

    def take(self, chunk: DataChunk) -> None:
        """Hand on what has come, once it is long enough."""
        last = self._waiting[-1] if self._waiting else None
        if last is not None and chunk.first_sample != last.first_sample + last.samples:
            self._waiting.clear()  # there are no gaps, so it is another acquisition
        elif last is not None and last.scales != chunk.scales:
            self._flush()
        self._waiting.append(chunk)
        first = self._waiting[0].first_sample
        samples = chunk.first_sample + chunk.samples - first
        if samples >= self._display_s * chunk.rate_hz:
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
        self._receiver(joined)
