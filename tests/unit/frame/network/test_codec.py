"""Values as bytes: what travels, what does not, and what breaks nothing."""

from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.network.codec import decode, encode
from cosmic.frame.network.transfer import transferable
from cosmic.frame.network.travelling_errors import from_plain, to_plain
from cosmic.frame.verdict import MoveVerdict, Reason


@transferable
@dataclass(frozen=True)
class Sighting:
    """Something that travels."""

    label: str
    place_um: tuple[float, float]
    image: np.ndarray[Any, Any]


class Unknown(Enum):
    ONE = 1


@dataclass
class NotListed:
    value: int = 1


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False)
    | st.text(max_size=20)
    | st.binary(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=8,
)


@given(PLAIN)
def test_plain_values_come_back_as_they_were(value: Any) -> None:
    assert decode(encode(value)) == value


@given(st.binary(max_size=200))
def test_no_bytes_do_more_than_be_refused(data: bytes) -> None:
    for message in (data, b"\xc5\x01\0\0\0" + bytes([len(data)]) + data):
        try:
            decode(message)
        except ProtocolError:
            continue


@given(st.data())
def test_a_changed_message_does_no_more_than_be_refused(data: st.DataObject) -> None:
    good = bytearray(encode([Sighting("a", (1.0, 2.0), np.zeros((2, 3))), Reason.LIMIT, (1,)]))
    for _ in range(3):
        good[data.draw(st.integers(0, len(good) - 1))] = data.draw(st.integers(0, 255))
    try:
        decode(bytes(good))
    except ProtocolError:
        return


def test_a_dataclass_with_an_array_comes_back() -> None:
    sent = Sighting("tip", (1.0, -2.5), np.arange(12, dtype=np.uint16).reshape(3, 4))
    back = decode(encode({"seen": [sent]}))["seen"][0]
    assert (back.label, back.place_um) == (sent.label, sent.place_um)
    assert np.array_equal(back.image, sent.image)


def test_arrays_lie_in_the_message_and_cannot_be_written_to() -> None:
    message = encode([np.ones(1000), np.zeros((2, 3), ">i2")])
    first, second = decode(message)
    assert not first.flags.writeable
    assert not first.flags.owndata
    assert second.dtype == np.dtype(">i2")
    assert len(message) < 8000 + 12 + 200


def test_an_array_that_is_not_in_one_piece_travels() -> None:
    part = np.arange(100).reshape(10, 10)[::2, 1:3]
    assert np.array_equal(decode(encode(part)), part)


@pytest.mark.parametrize(
    "value",
    [
        object(),
        {1, 2},
        Unknown.ONE,
        NotListed(),
        2**64,
        np.array([object()], dtype=object),
        np.zeros(1, dtype=[("a", "i4")]),
        datetime(2026, 1, 1),
        len,
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_not_listed_does_not_travel(value: Any) -> None:
    with pytest.raises(ProtocolError):
        encode([value])


def test_a_message_has_a_limit_both_ways() -> None:
    with pytest.raises(ProtocolError, match="too large"):
        encode(b"x" * 100, limit_bytes=100)
    with pytest.raises(ProtocolError, match="are allowed"):
        decode(encode(b"x" * 100), limit_bytes=100)


def test_another_version_is_refused() -> None:
    message = bytearray(encode(1))
    message[1] = 9
    with pytest.raises(ProtocolError, match="version 9"):
        decode(bytes(message))


def _message(head: bytes, arrays: bytes = b"") -> bytes:
    prefix = b"\xc5\x01" + len(head).to_bytes(4, "big") + head
    return prefix + b"\0" * (-len(prefix) % 16) + arrays


def _array(*description: object) -> bytes:
    return msgpack.packb(msgpack.ExtType(1, msgpack.packb(list(description))))


@pytest.mark.parametrize(
    "description",
    [
        ("<f8", [2**40], 0),
        ("<f8", [-1], 0),
        ("<f8", [2**62, 2**62], 0),
        ("|O", [1], 0),
        ("no type", [1], 0),
        ("<f8", [1.0], 0),
        ("<f8", [1] * 20, 0),
        ("<f8", [1], 5),
        ("<f8", "x", 0),
        ("<f8",),
    ],
)
def test_an_array_that_is_not_there_is_refused(description: tuple[object, ...]) -> None:
    with pytest.raises(ProtocolError):
        decode(_message(_array(*description), b"\0" * 8))


def test_nesting_has_a_limit() -> None:
    value: Any = 1
    for _ in range(40):
        value = (value,)
    with pytest.raises(ProtocolError, match="nested"):
        encode(value)
    packed = msgpack.packb([1])
    for _ in range(40):
        packed = msgpack.packb([msgpack.ExtType(5, packed)])
    with pytest.raises(ProtocolError):
        decode(_message(packed))
    with pytest.raises(ProtocolError):
        decode(_message(b"\x91" * 60_000))


def test_the_fields_of_a_dataclass_are_checked_on_arrival() -> None:
    def said(*values: object) -> bytes:
        inner = msgpack.packb(["MoveVerdict", list(values)])
        return _message(msgpack.packb(msgpack.ExtType(4, inner)))

    with pytest.raises(ProtocolError, match="another version"):
        decode(said(True))
    wrong = ["yes", *[None] * 9, ""]
    with pytest.raises(ProtocolError, match="broken MoveVerdict"):
        decode(said(*wrong))


def test_two_classes_of_one_name_cannot_both_travel() -> None:
    with pytest.raises(TypeError, match="another class"):
        transferable(dataclass(type("MoveVerdict", (), {})))
    with pytest.raises(TypeError, match="only enumerations, dataclasses and settings"):
        transferable(int)


class OddError(CosmicError):
    """Known here only."""


def test_an_exception_unknown_here_becomes_the_nearest_one_above_it() -> None:
    said: Any = to_plain(OddError("hm"))
    said[0][0] = "SomethingElse"
    back = from_plain(said)
    assert type(back) is CosmicError
    assert str(back) == "hm"


@pytest.mark.parametrize(
    "said",
    [
        None,
        [],
        ["CosmicError", "text", {}],
        [["SystemExit"], 1, {}],
        [["LimitError"], "text", {}],
        [["LimitError"], "text", {"verdict": "no"}],
    ],
)
def test_a_broken_exception_is_refused(said: Any) -> None:
    with pytest.raises(ProtocolError):
        from_plain(said)


def test_an_exception_brings_no_attributes_of_its_own_choice() -> None:
    back = from_plain([["SystemExit", "CosmicError"], "hm", {"__class__": 1, "args": 2, "x": 3}])
    assert type(back) is CosmicError
    assert not vars(back)
    verdict = MoveVerdict(allowed=False, reason=Reason.LIMIT)
    back = from_plain([["LimitError"], "hm", {"verdict": verdict}])
    assert vars(back) == {"verdict": verdict}
