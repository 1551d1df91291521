"""A movement of the window that something stands in the way of (ECM, thesis 3.4.2)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import MoveVerdict

HINT = "In mode Guided a detour can be planned."
"""Said with a refusal where mode Guided would do something about it."""


@dataclass(frozen=True, slots=True)
class DetourRequest:
    """A way round is wanted, since the straight one was refused.

    Attributes
    ----------
    axis : str
        What was to move.
    target : float
        Where to, in gate coordinates, um or deg.
    where : str
        The target as the operator gave it, from the user's zero and with its unit.
    verdict : MoveVerdict
        Why the straight way was refused.
    note : callable
        Shows a line on the card of the axis; empty takes it away.
    refuse : callable
        Refuses the movement after all, at the field it came from.
    others : mapping of str to float
        Targets of further axes that move with it.
    """

    axis: str
    target: float
    where: str
    verdict: MoveVerdict
    note: Callable[[str], None]
    refuse: Callable[[MoveVerdict], None]
    others: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Goal:
    """Where a command leads.

    Attributes
    ----------
    target : float
        In gate coordinates.
    shown : float
        From the user's zero.
    unit : str
        "um" or "deg".
    """

    target: float
    shown: float
    unit: str

    @property
    def text(self) -> str:
        """The target for the operator."""
        return format_quantity(self.shown, self.unit)
