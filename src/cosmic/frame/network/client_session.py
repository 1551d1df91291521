"""A client's questions to a station: numbered, dated, and answered."""

import logging
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Any, Final

from cosmic.frame.clock import Clock
from cosmic.frame.errors import ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.addresses import asks, client_liveliness, greetings, session_events
from cosmic.frame.network.delivery import InboxReader
from cosmic.frame.network.direct_line import DirectLine, LineLost
from cosmic.frame.network.direct_lines import DirectLines
from cosmic.frame.network.errors import StationAway, StationTimeout
from cosmic.frame.network.freshness import StationTime
from cosmic.frame.network.messages import Order, Request, read_answer
from cosmic.frame.network.station import checked_name
from cosmic.frame.network.transport import Rule
from cosmic.frame.network.wire import Liveliness, Wire, WithLine

logger = logging.getLogger(__name__)

GREETING_LIMIT_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class What:
    """What is asked.

    Attributes
    ----------
    valid_s : float
        How long it may take until it is begun there.
    at_once : bool
        It overtakes every other call.
    """

    order: Order
    application: str
    function: str
    arguments: Mapping[str, object]
    valid_s: float
    at_once: bool = False


class ClientSession:
    """From one greeting to the next; any thread.

    Parameters
    ----------
    name : str
        How the station knows the client.
    on_event : callable
        Receives what the station tells this client alone.
    """

    def __init__(
        self,
        station: str,
        name: str,
        policy: FailurePolicy,
        clock: Clock,
        on_event: Callable[[bytes], None],
    ) -> None:
        self._station = checked_name(station)
        self._name = checked_name(name)
        self._policy = policy
        self._clock = clock
        self._on_event = on_event
        self._time = StationTime(clock)
        self._lock = Lock()
        self._key = ""
        self._number = 0
        self._token = ""
        self._answered_s = float("-inf")
        self._liveliness: Liveliness | None = None
        self._events: InboxReader[bytes] | None = None
        self._direct: DirectLines | None = None

    @property
    def unanswered_s(self) -> float:
        """How long no answer has come."""
        return self._clock.now_s() - self._answered_s

    def begin(self, wire: Wire) -> Any:
        """Greet the station as somebody new and return what it hosts.

        Raises
        ------
        StationAway, StationTimeout
            There was no answer.
        CallRefused
            It does not let this client in.
        """
        self.end()
        client = f"{self._name}/{secrets.token_hex(8)}"
        with self._lock:
            self._time.forget()
            self._key, self._number, self._token = greetings(self._station, client), 0, ""
        self._liveliness = wire.liveliness(client_liveliness(self._station, client))
        inbox = wire.inlet(session_events(self._station, client), Rule.ALL)
        name = f"{self._station} tells"
        self._events = InboxReader(name, self._policy, inbox, self._on_event)
        self._events.start()
        hello = What(Order.HELLO, "", "", {}, valid_s=GREETING_LIMIT_S)
        said = self.ask(wire, hello, GREETING_LIMIT_S)
        if not isinstance(said, dict) or not isinstance(said.get("token"), str):
            raise ProtocolError("the station greets in a way that this program does not know")
        self._token, self._key = said["token"], asks(self._station, client)
        self._find_handler(wire)
        self._direct = self._opened_directly(wire, client, said.get("direct"))
        return said.get("hosted")

    def _opened_directly(self, wire: Wire, client: str, port: object) -> DirectLines | None:
        """Return lines for calls alone; None where the station offers none, or a wall stands."""
        if not isinstance(wire, WithLine) or type(port) is not int or not 0 < port < 65536:
            return None
        line, token = wire.line, self._token

        def opened(urgent: bool) -> DirectLine:
            return DirectLine(line, port, client, token, urgent=urgent, clock=self._clock)

        try:
            return DirectLines(opened)
        except LineLost as exc:
            logger.info("%s: calls use the slower connection: %s", self._station, exc)
            return None

    def _find_handler(self, wire: Wire) -> None:
        """Wait until what we ask reaches the handler, which has only just been made."""
        until_s = self._clock.now_s() + GREETING_LIMIT_S
        beat = What(Order.BEAT, "", "", {}, valid_s=GREETING_LIMIT_S)
        while True:
            try:
                self.ask(wire, beat, GREETING_LIMIT_S)
            except StationAway:
                if self._clock.now_s() > until_s:
                    raise
                self._clock.sleep(0.005)
            else:
                return

    def end(self) -> None:
        """Take back what shows the station that this client is here; it notices at once."""
        direct, self._direct = self._direct, None
        if direct is not None:
            direct.close()
        liveliness, self._liveliness = self._liveliness, None
        if liveliness is not None:
            liveliness.close()
        events, self._events = self._events, None
        if events is not None:
            events.request_end()
            events.join()

    def ask(self, wire: Wire, what: What, timeout_s: float) -> object:
        """Ask the station and return its answer; raises the exception that it answers with.

        Raises
        ------
        StationAway, StationTimeout
            There was no answer.
        ProtocolError
            Something cannot travel.
        """
        try:
            answer = self._ask_directly(what, timeout_s)
            if answer is None:
                message = self._request(what).encoded()
                answer = wire.ask(self._key, message, timeout_s=timeout_s)
        except StationTimeout as exc:
            where = f"{what.application}.{what.function}".strip(".") or what.order.value
            raise StationTimeout(f"{self._station}, {where}: {exc}") from exc
        stamp_s, result, error = read_answer(answer)
        self._time.note(stamp_s)
        self._answered_s = self._clock.now_s()
        if error is not None:
            raise error
        return result

    def _ask_directly(self, what: What, timeout_s: float) -> bytes | None:
        """Return the answer over a direct line; None where the engine has to ask."""
        direct = self._direct
        if direct is None or what.order is not Order.CALL:
            return None
        try:
            message = self._request(what).encoded()
            return direct.ask(message, timeout_s, urgent=what.at_once)
        except LineLost as exc:
            if what.at_once:
                return None  # a stop may be carried out twice, and is not left out
            raise StationAway(
                f"the line was lost ({exc}); whether the call was carried out is not known"
            ) from exc

    def _request(self, what: What) -> Request:
        with self._lock:
            self._number += 1
            number, token = self._number, self._token
        sent_s = self._time.now_s()
        return Request(
            what.order,
            token,
            number,
            sent_s,
            sent_s + what.valid_s,
            what.application,
            what.function,
            what.arguments,
        )


def read_hosted(said: Any) -> dict[tuple[str, str], tuple[bool, bool]]:
    """Return which functions there are, and of each whether it moves and whether it overtakes."""
    found = {}
    try:
        for application, functions in said.items():
            for function, (moves, at_once) in functions.items():
                found[application, function] = (bool(moves), bool(at_once))
    except (AttributeError, TypeError, ValueError) as exc:
        raise ProtocolError("the station lists its applications in an unknown way") from exc
    return found
