"""Which card shows which positioner; a new type is one class, announced with its driver."""

from importlib import import_module
from typing import Final

from cosmic.mico.core.motion.positioner import known_driver
from cosmic.mico.gui.closed_loop_gui import ClosedLoopGUI
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from cosmic.mico.hw.interface import PositionerKind, PositionerType

POSITIONER_GUIS: Final[dict[PositionerKind, type[PositionerBaseGUI]]] = {
    PositionerKind.OPEN_LOOP: PositionerBaseGUI,
    PositionerKind.LINEAR: ClosedLoopGUI,
    PositionerKind.ROTARY: ClosedLoopGUI,
}


TYPE_GUIS: Final[dict[int, type[PositionerBaseGUI]]] = {}
"""Cards of positioner types, by the vendor's number, that need more than that of their kind."""


def gui_class(kind: PositionerKind, found: PositionerType | None = None) -> type[PositionerBaseGUI]:
    """Return the class for the type that was found, or else for `kind`.

    What nobody knows better is shown as open-loop.
    """
    fallback = POSITIONER_GUIS.get(kind, PositionerBaseGUI)
    driver = known_driver(found)
    if driver is not None and driver.card:
        module, _, name = driver.card.partition(":")
        card: type[PositionerBaseGUI] = getattr(import_module(module), name)
        return card
    return fallback if found is None else TYPE_GUIS.get(found.code, fallback)
