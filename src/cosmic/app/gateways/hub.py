"""`Hub`: what a station publishes, made into text once for all programs that follow it."""

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Any, Final

from cosmic.app.gateways.plain import to_json
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import Declared, declaration_of
from cosmic.frame.network.host import STATE
from cosmic.frame.network.ongoing import StateMessage
from cosmic.frame.network.station import LEASE_TOPIC, Station
from cosmic.frame.network.transport import Rule, Subscription

logger = logging.getLogger(__name__)

SHORTEST_S: Final = 0.05
"""What only the newest counts of is told no more often."""
MOST_PUBLISHED_S: Final = 200.0
"""So many messages of such a topic are told a second, however many follow it."""
LONGEST_S: Final = 0.25
"""It is told that often all the same."""

Text = str | bytes
Follower = Callable[[str, bool, Text], object]
"""`follower(topic, each, text)`; `each` says that every one counts. It must return at once."""
Encode = Callable[[object], Text | None]


@dataclass
class _Topic:
    rule: Rule
    encode: Encode
    followers: tuple[Follower, ...] = ()
    subscription: Subscription | None = None
    due_s: float = float("-inf")
    newest: Text | None = None


def message(topic: str, payload: object) -> str:
    """Return a message about a topic as JSON."""
    return json.dumps({"topic": topic, "payload": to_json(payload)}, separators=(",", ":"))


def published_every_s(followers: int) -> float:
    """Return how often what only the newest counts of is told to so many."""
    return min(max(SHORTEST_S, followers / MOST_PUBLISHED_S), LONGEST_S)


class Hub:
    """Topics of a station for many followers; any thread. At last `close`.

    A topic is received while somebody follows it, and encoded once however many do.
    """

    def __init__(self, station: Station, served: Mapping[str, Declared]) -> None:
        self._station = station
        self._served = dict(served)
        self._lock = Lock()
        self._topics: dict[str, _Topic] = {}

    def rule_of(self, topic: str) -> Rule | None:
        """Return how a topic is followed; None where there is none of that name."""
        if topic == LEASE_TOPIC:
            return Rule.LATEST
        application, *steps = topic.split("/")
        place: Any = self._served.get(application)
        if place is not None and steps == [STATE]:
            return Rule.LATEST
        # Down to an object that is there: each topic that is followed has a thread of its own.
        while place is not None and len(steps) > 1:
            found = declaration_of(type(place)).parts.get(steps.pop(0))
            place = None if found is None else getattr(place, found.name)
            if found is not None and found.keyed:
                place = (place or {}).get(steps.pop(0))
        if place is None or len(steps) != 1:
            return None
        streams = declaration_of(type(place)).streams.values()
        return next((each.rule for each in streams if each.topic == steps[0]), None)

    def follow(self, topic: str, follower: Follower, encode: Encode | None = None) -> "Unfollow":
        """Have `follower` called with what is published to a topic, the newest at once.

        Parameters
        ----------
        encode : callable or None
            Makes the text of a payload; JSON by default. Followers of one topic share it.

        Raises
        ------
        KeyError
            There is no such topic.
        """
        rule = self.rule_of(topic)
        if rule is None:
            raise KeyError(topic)
        with self._lock:
            found = self._topics.get(topic)
            if found is None:
                coded = encode or (lambda payload: message(topic, _stated(payload)))
                found = self._topics[topic] = _Topic(rule, coded)
            found.followers = (*found.followers, follower)
            if found.subscription is None:
                made = found
                found.subscription = self._station.bus.subscribe(
                    topic, rule, lambda payload: self._publish(topic, made, payload)
                )
        if found.newest is not None and rule is Rule.LATEST:
            follower(topic, False, found.newest)
        return Unfollow(self, topic, follower)

    def unfollow(self, topic: str, follower: Follower) -> None:
        """End it; harmless the second time."""
        with self._lock:
            found = self._topics.get(topic)
            if found is None:
                return
            found.followers = tuple(each for each in found.followers if each is not follower)
            ended = self._topics.pop(topic) if not found.followers else None
        if ended is not None and ended.subscription is not None:
            ended.subscription.close()

    def close(self) -> None:
        """Receive nothing any more."""
        with self._lock:
            ended, self._topics = list(self._topics.values()), {}
        for each in ended:
            each.followers = ()
            if each.subscription is not None:
                each.subscription.close()

    def _publish(self, topic: str, found: _Topic, payload: object) -> None:
        each = found.rule is Rule.ALL
        now_s = WALL.now_s()
        if not each:
            if now_s < found.due_s:
                WALL.sleep(found.due_s - now_s)  # in a thread of this topic; newer ones replace it
            found.due_s = WALL.now_s() + published_every_s(len(found.followers))
        text = found.encode(payload)
        if text is None:
            return
        found.newest = text
        for follower in found.followers:
            follower(topic, each, text)


class Unfollow:
    """Ends that a topic is followed."""

    def __init__(self, hub: Hub, topic: str, follower: Follower) -> None:
        self._hub, self._topic, self._follower = hub, topic, follower

    def __call__(self) -> None:
        """End it; harmless the second time."""
        self._hub.unfollow(self._topic, self._follower)


def _stated(payload: object) -> Any:
    return payload.values if isinstance(payload, StateMessage) else payload
