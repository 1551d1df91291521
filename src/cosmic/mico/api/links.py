"""Which axes may be linked to each other."""

from cosmic.frame.errors import NotAvailable
from cosmic.mico.core.ports import ManagerPort
from cosmic.mico.hw.interface import PositionerKind


def check_linkable(manager: ManagerPort, first: str, second: str) -> None:
    """Raise where two axes cannot move together.

    Raises
    ------
    UnknownAxisError
        One of them does not exist.
    NotAvailable
        They have no sensor, or are not of one kind.
    """
    kinds = {manager.state(name).kind for name in (first, second)}
    if len(kinds) > 1 or PositionerKind.OPEN_LOOP in kinds:
        text = f"{first} and {second} cannot be linked: both must be linear, or both rotary"
        raise NotAvailable(text)
