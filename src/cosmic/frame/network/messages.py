"""The shapes of the messages between a client and a station."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.network.codec import CALL_LIMIT_BYTES, decode, encode
from cosmic.frame.network.travelling_errors import from_plain, to_plain

PUBLISH_LIMIT_BYTES = 16 * CALL_LIMIT_BYTES


class Order(StrEnum):
    """What a client asks of its handler, besides calls to applications."""

    HELLO = "hello"
    CALL = "call"
    BEAT = "beat"
    TAKE = "take lease"
    RELEASE = "release lease"
    CANCEL = "cancel"
    PUBLISH = "publish"
    BYE = "bye"


@dataclass(frozen=True, slots=True)
class Request:
    """What a client sends.

    Attributes
    ----------
    token : str
        The session's, as the station gave it; empty in the first.
    number : int
        Counts the session's requests.
    sent_s, until_s : float
        When it was sent and until when it may be begun, on the station's clock.
    application, function : str
        What is called; for other orders, what they concern.
    arguments : mapping
        By name.
    """

    order: Order
    token: str
    number: int
    sent_s: float
    until_s: float
    application: str
    function: str
    arguments: Mapping[str, Any]

    def encoded(self) -> bytes:
        """Return it as a message.

        Raises
        ------
        ProtocolError
            An argument cannot travel, or it is too large.
        """
        limit = PUBLISH_LIMIT_BYTES if self.order is Order.PUBLISH else CALL_LIMIT_BYTES
        return encode(
            [
                self.order.value,
                self.token,
                self.number,
                self.sent_s,
                self.until_s,
                self.application,
                self.function,
                dict(self.arguments),
            ],
            limit,
        )


_ORDERS = frozenset(order.value for order in Order)
_NESTING_LIMIT: Final = 32
_KINDS = (str, str, int, float, float, str, str, dict)


def read_request(message: bytes) -> Request:
    """Return what a client sent.

    Raises
    ------
    ProtocolError
        It is no request.
    """
    parts = decode(message, PUBLISH_LIMIT_BYTES)
    if not isinstance(parts, list) or [type(each) for each in parts] != list(_KINDS):
        raise ProtocolError("a broken request came")
    order, *rest = parts
    if order not in _ORDERS or not all(isinstance(name, str) for name in rest[-1]):
        raise ProtocolError("a broken request came")
    if order != Order.PUBLISH and len(message) > CALL_LIMIT_BYTES:
        raise ProtocolError(f"a call of {len(message)} bytes came; {CALL_LIMIT_BYTES} are allowed")
    if _too_deep(rest[-1]):
        raise ProtocolError(f"an argument is nested more than {_NESTING_LIMIT} times")
    return Request(Order(order), *rest)


def _too_deep(value: object) -> bool:
    """Return whether lists and dictionaries are nested so deeply that showing them would fail."""
    level: list[Any] = [value]
    for _ in range(_NESTING_LIMIT):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, (list, tuple, dict))
        ]
        if not level:
            return False
    return True


def answer(stamp_s: float, value: object) -> bytes:
    """Return an answer with the reading of the station's clock."""
    return encode([stamp_s, True, value])


def refusal_of(stamp_s: float, error: CosmicError) -> bytes:
    """Return the answer that says why not."""
    try:
        return encode([stamp_s, False, to_plain(error)])
    except ProtocolError:  # what it tells cannot travel
        return encode([stamp_s, False, to_plain(CosmicError(str(error)))])


def read_answer(message: bytes) -> tuple[float, object, CosmicError | None]:
    """Return the station's reading, the result, and the exception if it was one.

    Raises
    ------
    ProtocolError
        It is no answer.
    """
    parts = decode(message)
    if not (isinstance(parts, list) and len(parts) == 3 and isinstance(parts[0], float)):
        raise ProtocolError("a broken answer came")
    stamp_s, well, value = parts
    if well is True:
        return stamp_s, value, None
    return stamp_s, None, from_plain(value)
