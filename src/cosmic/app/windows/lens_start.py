"""Lens and light belong to Initialise: the lens is homed, and a lamp that is off is lit."""

from typing import Final

from PySide6.QtCore import QObject, Signal

from cosmic.app.rig import Rig
from cosmic.frame.errors import CosmicError
from cosmic.vico.hw.peripherals import LensAxis

USUAL_LIGHT_PERCENT: Final = 50.0


class LensStart(QObject):
    """Begins what lens and light need when the axes are initialised; GUI thread.

    Their motors move nothing that could collide, so they need not wait for the axes.

    Signals
    -------
    said(str)
        What was begun, or why it could not be.
    """

    said = Signal(str)

    def __init__(self, rig: Rig, parent: QObject) -> None:
        super().__init__(parent)
        self._rig = rig

    def begin(self) -> None:
        """Home the lens where it does not know its position, and light the lamp where it is off."""
        lens, lamp = self._rig.vico.lens, self._rig.vico.light
        begun = []
        try:
            if lens is not None and not lens.problem and not self._homed():
                lens.home()
                begun.append("the lens is homed")
            if lamp is not None and not lamp.problem and not lamp.percent:
                lamp.set_percent(USUAL_LIGHT_PERCENT)
                begun.append(f"the light is set to {USUAL_LIGHT_PERCENT:.0f} %")
        except CosmicError as exc:
            begun.append(str(exc))
        if begun:
            self.said.emit(f"Initialise: {', '.join(begun)}")

    def _homed(self) -> bool:
        lens = self._rig.vico.lens
        states = [lens.state(axis) for axis in LensAxis] if lens is not None else []
        return all(state is not None and (state.homed or state.moving) for state in states)
