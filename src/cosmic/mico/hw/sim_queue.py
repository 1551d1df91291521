"""The packets that a simulated device has for its client: one FIFO, some of it still under way."""

import heapq
import logging
import math

logger = logging.getLogger(__name__)

Packet = tuple[int, int, int, int, int]
"""Type, channel, data1, data2, data3."""


class PacketQueue:
    """Packets in the order they reach the client; not thread-safe, its device is.

    Parameters
    ----------
    name : str
        Whose packets, for the log.
    capacity : int
        From this length on the device takes no more commands, so that nothing is ever dropped.
    """

    def __init__(self, name: str, capacity: int) -> None:
        self._name = name
        self._capacity = capacity
        self._heap: list[tuple[float, int, Packet]] = []
        self._number = 0
        self._last_due_s: dict[int, float] = {}
        self._warned = False

    def __len__(self) -> int:
        return len(self._heap)

    @property
    def full(self) -> bool:
        """Whether the client has left too much unread; told to the log once."""
        full = len(self._heap) >= self._capacity
        if full and not self._warned:
            logger.warning(
                "%s: %d packets unread, no more commands are taken", self._name, len(self._heap)
            )
        self._warned = full
        return full

    def push(self, packet: Packet, due_s: float) -> None:
        """Add a packet that arrives at `due_s`, or right after the last one of its channel."""
        channel = packet[1]
        due_s = max(due_s, self._last_due_s.get(channel, 0.0))
        self._last_due_s[channel] = due_s
        self._number += 1
        heapq.heappush(self._heap, (due_s, self._number, packet))

    def head(self, now_s: float) -> Packet | None:
        """Return the oldest packet that has arrived."""
        if self._heap and self._heap[0][0] <= now_s:
            return self._heap[0][2]
        return None

    def pop(self, now_s: float) -> None:
        """Drop the oldest packet that has arrived, if any."""
        if self._heap and self._heap[0][0] <= now_s:
            heapq.heappop(self._heap)

    def next_s(self, now_s: float) -> float:
        """Return when the next packet arrives; inf when the head has arrived or none comes."""
        if self._heap and self._heap[0][0] > now_s:
            return self._heap[0][0]
        return math.inf

    def clear(self) -> None:
        """Drop everything, packets under way too."""
        self._heap.clear()
        self._last_due_s.clear()
        self._warned = False
