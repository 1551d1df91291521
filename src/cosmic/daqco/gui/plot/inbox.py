"""Takes chunks in the acquisition thread and gives them out in the GUI thread."""

from collections import deque
from typing import Final

from cosmic.daqco.core.chunk import DataChunk

LARGEST_S: Final = 10.0
"""What waits longer than this while the window is busy is not shown."""


class ChunkInbox:
    """Holds chunks by reference until the window looks.

    A deque's ends are atomic, so the acquisition thread never waits for the window. Were the
    window to hang, the oldest chunks go: they are still recorded, only not shown, and `skipped`
    counts them, as it does what was passed over on the way from another station.
    """

    def __init__(self) -> None:
        self._chunks: deque[DataChunk] = deque()
        self._skipped = 0
        self._next: int | None = None

    @property
    def skipped(self) -> int:
        """Samples a channel that came and were never given out, or were passed over."""
        return self._skipped

    def put(self, chunk: DataChunk) -> None:
        """Keep `chunk`; acquisition thread."""
        if self._next is not None:  # numbers that begin anew are another acquisition
            self._skipped += max(0, chunk.first_sample - self._next)
        self._next = chunk.first_sample + chunk.samples
        self._chunks.append(chunk)
        held_s = len(self._chunks) * chunk.samples / chunk.rate_hz
        if held_s > LARGEST_S:
            self._drop_oldest()

    def take(self) -> list[DataChunk]:
        """Return what has come since the last time, oldest first; GUI thread."""
        found: list[DataChunk] = []
        for _ in range(len(self._chunks)):
            try:
                found.append(self._chunks.popleft())
            except IndexError:  # dropped in the meantime
                break
        return found

    def _drop_oldest(self) -> None:
        try:
            self._skipped += self._chunks.popleft().samples
        except IndexError:  # the window has just taken it
            return
