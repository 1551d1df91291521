"""What an axis with sensor can be asked besides moving: the menu at the end of its card."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QToolButton

from cosmic.frame.gui.build import named, styled, tipped


class AxisMenu(QObject):
    """Each entry only asks; the card acts.

    Signals
    -------
    more_toggled(bool)
        The part with steps and speed shall be shown or hidden.
    """

    zero_set = Signal()
    zero_cleared = Signal()
    reference_requested = Signal()
    calibrate_requested = Signal()
    end_stop_requested = Signal(str)
    more_toggled = Signal(bool)

    def __init__(self, axis_name: str, forward: str, backward: str, parent: QObject) -> None:
        super().__init__(parent)
        self.button = named(QToolButton(), "axisMenu")
        self.button.setText("⋯")
        tipped(
            self.button, f"Zero, reference, calibration, end stops, steps and speed: {axis_name}"
        )
        self.button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.menu = QMenu(self.button)
        self.menu.setToolTipsVisible(True)
        self.button.setMenu(self.menu)
        styled(self.button, "menu")
        self.button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self._add(
            "Set zero here",
            "Count positions from here; limits stay where they are",
            self.zero_set.emit,
        )
        self._add("Clear zero", "Count positions as the controller does", self.zero_cleared.emit)
        self.menu.addSeparator()
        self._add(
            "Find reference",
            "Find the reference; may sweep the whole travel",
            self.reference_requested.emit,
        )
        self._add(
            "Calibrate sensor",
            "Moves millimetres in both directions",
            self.calibrate_requested.emit,
        )
        self._add(
            f"To the end stop: {forward}", "Drive forwards until the travel ends", self._on_forward
        )
        self._add(
            f"To the end stop: {backward}",
            "Drive backwards until the travel ends",
            self._on_backward,
        )
        self.menu.addSeparator()
        self.more = self._add(
            "Show steps and speed", "Move by steps or in several steps, and set the speed", None
        )
        self.more.setCheckable(True)
        self.more.toggled.connect(self.more_toggled)

    def _add(self, text: str, tip: str, act: Callable[[], None] | None) -> QAction:
        action = self.menu.addAction(text)
        action.setToolTip(tip)
        if act is not None:
            action.triggered.connect(act)
        return action

    def _on_forward(self) -> None:
        self.end_stop_requested.emit("forward")

    def _on_backward(self) -> None:
        self.end_stop_requested.emit("backward")

    def action(self, text: str) -> QAction:
        """Return the entry that begins with `text`."""
        return next(each for each in self.menu.actions() if each.text().startswith(text))
