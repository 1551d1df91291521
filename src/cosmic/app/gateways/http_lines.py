"""`HttpLines`: who is connected over HTTP; who shows no token keeps nobody else out."""

import asyncio
from dataclasses import dataclass
from typing import Any, Final

from cosmic.frame.clock import WALL

STRANGER_S: Final = 10.0
"""So long a line without a token is kept."""
MOST_STRANGERS: Final = 64
"""So many of them are kept; one more, and the oldest ends."""
MOST_LINES: Final = 64
"""So many lines one client has."""

Address = tuple[str, int]


@dataclass(frozen=True, slots=True)
class _Line:
    transport: asyncio.Transport
    since_s: float


class HttpLines:
    """Lines by the address of their other end; in the loop of the server."""

    def __init__(self) -> None:
        self._strangers: dict[Address, _Line] = {}
        self._known: dict[Address, tuple[_Line, object]] = {}

    def come(self, address: Address | None, transport: asyncio.Transport) -> None:
        """Take note of a line; the oldest without a token ends where there are too many."""
        if address is None:
            return
        self._strangers.pop(address, None)  # of a line that is gone, by the same port
        self._known.pop(address, None)
        self._strangers[address] = _Line(transport, WALL.now_s())
        if len(self._strangers) > MOST_STRANGERS:
            self.look()
        while len(self._strangers) > MOST_STRANGERS:
            self._strangers.pop(next(iter(self._strangers))).transport.abort()

    def know(self, address: Any, who: object) -> bool:
        """Note whose line it is; False where the client has too many."""
        at = None if address is None else (address[0], address[1])
        if at is None or at not in self._strangers:
            return True
        self._known = {
            each: (line, of)
            for each, (line, of) in self._known.items()
            if not line.transport.is_closing()
        }
        if sum(of is who for _, of in self._known.values()) >= MOST_LINES:
            return False
        self._known[at] = self._strangers.pop(at), who
        return True

    def look(self) -> None:
        """End what has shown no token for too long; returns at once."""
        before_s = WALL.now_s() - STRANGER_S
        for address, line in list(self._strangers.items()):
            if line.transport.is_closing() or line.since_s < before_s:
                del self._strangers[address]
                line.transport.abort()
