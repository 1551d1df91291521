"""A wire in memory, on which a test can hold messages back."""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any

from cosmic.frame.network.delivery import Backlog, Inbox
from cosmic.frame.network.errors import StationAway, StationTimeout
from cosmic.frame.network.transport import Rule


class MemoryQuestion:
    def __init__(self, key: str, message: bytes) -> None:
        self.key = key
        self.message = message
        self.answers: SimpleQueue[bytes] = SimpleQueue()

    def answer(self, message: bytes) -> None:
        self.answers.put(message)


class MemoryOutlet:
    def __init__(self, inlets: list[Backlog[bytes]]) -> None:
        self._inlets = inlets

    @property
    def wanted(self) -> bool:
        return bool(self._inlets)

    def put(self, message: bytes) -> None:
        for each in self._inlets:
            each.put(message)

    def close(self) -> None:
        pass


class MemoryInlet(Backlog[bytes]):
    def __init__(self, rule: Rule, inlets: list[Backlog[bytes]]) -> None:
        super().__init__(rule)
        self._inlets = inlets
        inlets.append(self)

    def close(self) -> None:
        super().close()
        if self in self._inlets:
            self._inlets.remove(self)


class MemoryToken:
    def __init__(self, take_away: Callable[[], None]) -> None:
        self.close = take_away


class MemoryHub:
    """Where the ends of a line meet.

    `tamper` is given each question before it is handed on, and returns those to hand on.
    """

    def __init__(self) -> None:
        self.asked: dict[str, Backlog[MemoryQuestion]] = {}
        self.inlets: dict[str, list[Backlog[bytes]]] = {}
        self.watchers: dict[str, list[Backlog[tuple[str, bool]]]] = {}
        self.tokens: set[str] = set()
        self.tamper: Callable[[MemoryQuestion], list[MemoryQuestion]] = lambda each: [each]

    def find(self, key: str) -> Backlog[MemoryQuestion] | None:
        if key in self.asked:
            return self.asked[key]
        wild = [
            each for each in list(self.asked) if each.endswith("/**") and key.startswith(each[:-2])
        ]
        return self.asked[wild[0]] if wild else None


class MemoryWire:
    """One end."""

    def __init__(self, hub: MemoryHub) -> None:
        self._hub = hub
        self._inboxes: list[Backlog[Any]] = []

    def ask(self, key: str, message: bytes, *, timeout_s: float) -> bytes:
        question = MemoryQuestion(key, message)
        handed_on = self._hub.tamper(question)
        for each in handed_on:
            inbox = self._hub.find(each.key)
            if inbox is None:
                raise StationAway("no answer")
            inbox.put(each)
        if question not in handed_on:
            raise StationTimeout(f"no answer came within {timeout_s:g} s")
        try:
            return question.answers.get(timeout=timeout_s)
        except Empty:
            raise StationTimeout(f"no answer came within {timeout_s:g} s") from None

    def questions(self, keys: str) -> Inbox[MemoryQuestion]:
        made = self._hub.asked[keys] = self._inbox()
        return made

    def outlet(self, key: str, rule: Rule) -> MemoryOutlet:
        return MemoryOutlet(self._hub.inlets.setdefault(key, []))

    def inlet(self, key: str, rule: Rule) -> Inbox[bytes]:
        made = MemoryInlet(rule, self._hub.inlets.setdefault(key, []))
        self._inboxes.append(made)
        return made

    def liveliness(self, key: str) -> MemoryToken:
        self._hub.tokens.add(key)

        def take_away() -> None:
            if key in self._hub.tokens:
                self._hub.tokens.discard(key)
                for keys, inboxes in self._hub.watchers.items():
                    if key.startswith(keys.removesuffix("**")):
                        for each in inboxes:
                            each.put((key, False))

        return MemoryToken(take_away)

    def watch_liveliness(self, keys: str) -> Inbox[tuple[str, bool]]:
        made: Backlog[tuple[str, bool]] = self._inbox()
        self._hub.watchers.setdefault(keys, []).append(made)
        return made

    def close(self) -> None:
        for each in self._inboxes:
            each.close()

    def _inbox(self, rule: Rule = Rule.ALL) -> Backlog:  # type: ignore[type-arg]
        made: Backlog[object] = Backlog(rule)
        self._inboxes.append(made)
        return made
