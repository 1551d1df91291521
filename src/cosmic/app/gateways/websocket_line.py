"""`WebSocketLine`: what waits to be sent to one WebSocket."""

import asyncio
import json
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from starlette.websockets import WebSocket

from cosmic.app.gateways.http_server import BEAT_S
from cosmic.app.gateways.hub import Text

_BACKLOG: Final = 256


class Handover:
    """From threads that publish into a loop: it is woken once for the lines of all."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._waiting: deque[Callable[[], None]] = deque()
        self._woken = False

    def put(self, action: Callable[[], None]) -> None:
        """Have `action` called in the loop, in order; any thread, returns at once."""
        self._waiting.append(action)
        # What is appended before `_hand_on` lets others wake it, it takes along.
        if not self._woken:
            self._woken = True
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._hand_on)

    def _hand_on(self) -> None:
        self._woken = False
        while self._waiting:
            self._waiting.popleft()()


class WebSocketLine:
    """The newest of each topic, or each of a few; in the loop of its socket but for `put`."""

    def __init__(self, socket_: WebSocket, handover: Handover) -> None:
        self._socket = socket_
        self._handover = handover
        self._woken = asyncio.Event()
        self._newest: dict[str, Text] = {}
        self._all: list[Text] = []
        self._lost = 0
        self._over = False

    def put(self, topic: str, each: bool, text: Text) -> None:
        """Have it sent; any thread, returns at once."""
        self._handover.put(lambda: self._put(topic, each, text))

    def _put(self, topic: str, each: bool, text: Text) -> None:
        if not each:
            self._newest[topic] = text
        elif len(self._all) < _BACKLOG:
            self._all.append(text)
        else:
            self._lost += 1
        self._woken.set()

    def end(self) -> None:
        """Let `run` end: a cancellation alone can be lost in `wait_for` before Python 3.12."""
        self._over = True
        self._woken.set()

    async def run(self, beat: Callable[[], None]) -> None:
        """Send what comes, until cancelled; `beat` is called while the line stands."""
        while not self._over:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._woken.wait(), BEAT_S)
            beat()
            self._woken.clear()
            waiting, self._all = self._all, []
            newest, self._newest = self._newest, {}
            if self._lost:
                waiting.append(json.dumps({"topic": "lost", "payload": self._lost}))
                self._lost = 0
            for text in (*waiting, *newest.values()):
                await self.send(text)

    async def send(self, text: Text) -> None:
        """Send one message."""
        if isinstance(text, bytes):
            await self._socket.send_bytes(text)
        else:
            await self._socket.send_text(text)
