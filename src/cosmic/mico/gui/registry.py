"""Which card shows which kind of positioner; a new kind is one class and one line here."""

from typing import Final

from cosmic.mico.gui.closed_loop_gui import ClosedLoopGUI
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from cosmic.mico.hw.interface import PositionerKind

POSITIONER_GUIS: Final[dict[PositionerKind, type[PositionerBaseGUI]]] = {
    PositionerKind.OPEN_LOOP: PositionerBaseGUI,
    PositionerKind.LINEAR: ClosedLoopGUI,
    PositionerKind.ROTARY: ClosedLoopGUI,
}


def gui_class(kind: PositionerKind) -> type[PositionerBaseGUI]:
    """Return the class for `kind`; what nobody knows better is shown as open-loop."""
    return POSITIONER_GUIS.get(kind, PositionerBaseGUI)
