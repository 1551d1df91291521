"""What a procedure would measure of the fibres and standards of a sealed session."""

from typing import Final

from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.plan import plan_spans
from cosmic.autonomy.bending.span import Span
from oracles.sealed_session import Fibre, Session, pushes

SCALE: Final = 1e-18
"""N m² in each µN µm²."""


def spans_of(session: Session, fibre: Fibre, *, shown_deg: float = 0.0) -> list[Span]:
    """Return the spans, with the shape turned by `shown_deg` as it is seen."""
    plan = plan_spans(min(fibre.free_um, 900.0), fibre.ei * SCALE)
    line = fibre.line(shown_deg)
    return [
        Span(
            nominal_um=each.place_um,
            probe_x_um=each.place_um,
            hold_x_um=0.0,
            probe_um=each.way_um,
            force_un=each.force_un,
            force_std_un=each.std_un,
            time_s=each.time_s,
            loading=each.loading,
            shape=NaturalShape(line[:, 0], line[:, 1], each.place_um),
        )
        for each in pushes(session, fibre, [(one.span_um, one.stroke_um) for one in plan])
    ]
