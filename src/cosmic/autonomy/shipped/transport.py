"""Transport only: a fibre is taken up, carried to the probe's height and put away."""

from cosmic.autonomy.handling.safe import make_safe
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.combinators import Sequence
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.bend_test import beginning, one_fibre


def build_transport(settings: HandlingSettings | None = None) -> Procedure[FibreWork]:
    """Return the procedure for one fibre; run it again for the next, on the same work."""
    settings = settings or HandlingSettings()
    nothing = Sequence[FibreWork]("nothing is measured")
    return Procedure(
        "transport",
        Sequence("transport", *beginning(settings), one_fibre(settings, nothing)),
        make_safe=make_safe,
    )
