"""How questions about movements are written to the gate's process; without Qt."""

from collections.abc import Mapping
from dataclasses import fields
from operator import attrgetter
from typing import Any, Final

from cosmic.mico.core.collision.answer import AxisSpan, Spans

PackedSpans = Mapping[str, tuple[Any, ...]]

# Tuples are written and read faster than objects.
_values_of: Final = attrgetter(*(each.name for each in fields(AxisSpan)))


def pack_spans(spans: Spans) -> PackedSpans:
    """Return `spans` as plain tuples."""
    return {axis: _values_of(span) for axis, span in spans.items()}


def unpack_spans(packed: PackedSpans) -> Spans:
    """Return what `pack_spans` packed."""
    return {axis: AxisSpan(*values) for axis, values in packed.items()}
