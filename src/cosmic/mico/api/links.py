"""Which axes may be linked to each other."""

from collections.abc import Collection

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
        They have no sensor, are not of one kind, or one of them moves.
    """
    check_links_may_change(manager, {first, second})
    kinds = {manager.state(name).kind for name in (first, second)}
    if len(kinds) > 1 or PositionerKind.OPEN_LOOP in kinds:
        text = f"{first} and {second} cannot be linked: both must be linear, or both rotary"
        raise NotAvailable(text)


def check_links_may_change(manager: ManagerPort, names: Collection[str]) -> None:
    """Raise where one of `names`, or an axis linked to one, moves.

    Raises
    ------
    NotAvailable
        A link that changed in mid-movement would leave one of its axes to move alone.
    """
    linked = {other for name in names for other in manager.links.companions(name)}
    moving = sorted(name for name in {*names, *linked} if manager.state(name).in_motion)
    if moving:
        text = f"{', '.join(moving)} is moving; change the links when it is stationary"
        raise NotAvailable(text)
