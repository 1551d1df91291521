"""Joins the link switches of the cards with the links in force."""

from cosmic.frame.errors import CosmicError
from cosmic.mico.api.mico import Mico
from cosmic.mico.gui.closed_loop_gui import ClosedLoopGUI
from cosmic.mico.hw.interface import PositionerKind


def join_links(card: ClosedLoopGUI, mico: Mico) -> None:
    """Have the switch of a card link its axis and unlink it."""
    name = card.settings.name

    def link(other: str, ratio: float) -> None:
        try:
            mico.link(name, other, ratio)
        except CosmicError as exc:
            card.say_refused(str(exc))

    def unlink() -> None:
        mico.unlink(name)

    card.link_wanted.connect(link)
    card.unlink_wanted.connect(unlink)


def show_links(card: ClosedLoopGUI, mico: Mico) -> None:
    """Show on a card what its axis is linked with."""
    axis = card.axis
    others = [
        each.key
        for each in mico
        if each.key != axis.key
        and each.kind is axis.kind
        and each.kind is not PositionerKind.OPEN_LOOP
    ]
    card.show_links(axis.linked_to, others)
