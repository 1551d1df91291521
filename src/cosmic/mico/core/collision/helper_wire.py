"""How the gate's process and its client write to each other; known to both, without Qt.

Both ends are started from the same installation by the same user, and nobody else can write to
the pipe between them, so that pickles are safe here.
"""

import pickle
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final

from cosmic.frame.errors import ProtocolError
from cosmic.mico.core.collision.answer import AxisSpan, Spans

if sys.platform == "win32":
    from multiprocessing.connection import PipeConnection as _PipeEnd
else:
    from multiprocessing.connection import Connection as _PipeEnd

if TYPE_CHECKING:  # the classes take no arguments at run time
    End = _PipeEnd[Any, Any]
else:
    End = _PipeEnd

PROTOCOL: Final = 5
READY: Final = 0
"""Number of the first message of the process, which answers no question."""
LONGEST_ANSWER: Final = 1 << 26

PackedSpans = Mapping[str, tuple[Any, ...]]

# Tuples are written and read faster than objects.
_values_of: Final = attrgetter(*(each.name for each in fields(AxisSpan)))


def pack_spans(spans: Spans) -> PackedSpans:
    """Return `spans` as plain tuples."""
    return {axis: _values_of(span) for axis, span in spans.items()}


def unpack_spans(packed: PackedSpans) -> Spans:
    """Return what `pack_spans` packed."""
    return {axis: AxisSpan(*values) for axis, values in packed.items()}


@dataclass(frozen=True, slots=True)
class Reply:
    """What the process answered to the question of that number.

    Attributes
    ----------
    good : bool
        False when it could not answer; `value` is then the reason as text.
    """

    number: int
    good: bool
    value: object


def encode(parts: Iterable[object]) -> bytes:
    """Return a message for the pipe."""
    return pickle.dumps(tuple(parts), protocol=PROTOCOL)


def decode_reply(message: bytes) -> Reply:
    """Read what the process answered.

    Raises
    ------
    ProtocolError
        It is no answer.
    """
    try:
        number, good, value = pickle.loads(message)
    except Exception as exc:  # pickle raises nearly anything over rubbish
        raise ProtocolError("the answer cannot be read") from exc
    if not (isinstance(number, int) and isinstance(good, bool)):
        raise ProtocolError("the answer carries no number")
    return Reply(number, good, value)
