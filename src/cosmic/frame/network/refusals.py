"""Answers to those who are not let in, so that asking again and again costs the station little."""

from collections import OrderedDict, deque
from dataclasses import dataclass
from threading import Lock
from typing import Final

from cosmic.frame.clock import Clock
from cosmic.frame.network.wire import Question

AT_ONCE: Final = 50
"""So many refusals of one name in `WINDOW_S` are answered at once: a client that waits between its
attempts, as this program does, makes fewer."""
WINDOW_S: Final = 10.0
LONGEST_S: Final = 2.0
"""The longest that an answer is held back."""
HELD_LIMIT: Final = 64
"""So many answers are held back; further ones are not given."""
_FIRST_S: Final = 0.05
_NAMES_LIMIT: Final = 256


@dataclass(slots=True)
class _Name:
    """How often somebody was refused of late."""

    since_s: float
    count: int = 0


class RefusalCount:
    """How often each name or address was refused within 10 s, for the newest few; one thread."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._names: OrderedDict[str, _Name] = OrderedDict()

    def note(self, name: str) -> int:
        """Note one more refusal and return how many there were."""
        self.of(name)
        found = self._names.setdefault(name, _Name(self._clock.now_s()))
        if len(self._names) > _NAMES_LIMIT:
            self._names.popitem(last=False)
        found.count += 1
        self._names.move_to_end(name)
        return found.count

    def of(self, name: str) -> int:
        """Return how many there were."""
        found = self._names.get(name)
        if found is None:
            return 0
        if self._clock.now_s() - found.since_s > WINDOW_S:
            del self._names[name]
            return 0
        return found.count


class Refusals:
    """Answers refused questions: the first at once, those of a flood later and later; any thread.

    Who asks and waits for the answer is slowed down by it; who does not wait gets none. Only what
    was refused comes here: a greeting that is right is never held back, whoever else uses its name.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = Lock()
        self._count = RefusalCount(clock)
        self._held: deque[tuple[float, Question, bytes]] = deque()

    def answer(self, name: str, question: Question, message: bytes) -> None:
        """Answer `question` of somebody who calls himself `name`, now or later or not at all."""
        now_s = self._clock.now_s()
        with self._lock:
            surplus = self._count.note(name) - AT_ONCE
            if surplus > 0:
                if len(self._held) < HELD_LIMIT:
                    wait_s = min(LONGEST_S, _FIRST_S * 2.0 ** min(surplus, 16))
                    self._held.append((now_s + wait_s, question, message))
                return
        question.answer(message)

    def answer_due(self) -> None:
        """Give the answers that have been held back long enough."""
        if not self._held:
            return
        now_s = self._clock.now_s()
        with self._lock:
            due = [each for each in self._held if each[0] <= now_s]
            self._held = deque(each for each in self._held if each[0] > now_s)
        for _, question, message in due:
            question.answer(message)
