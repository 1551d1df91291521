"""The buttons above the image: what part is shown, what lies over it, what a click does."""

from typing import Final, TypeVar

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QToolButton, QWidget

from cosmic.frame.gui.build import named, retip, styled, tipped
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.theme import STEP_PX

W = TypeVar("W", bound=QWidget)

TOOLS: Final = {
    "distance": (
        "Distance",
        "Measure a distance: press, drag, release; Del deletes the selected one",
    ),
    "angle": ("Angle", "Measure an angle: click one arm, the vertex, the other arm"),
    "region": ("Region", "Read only a part of the sensor (ROI): press, drag, release"),
}
MOVE_TIP: Final = "Move a tool to the point you click in the image"


class ToolRow(QWidget):
    """Buttons in one line, or in two where it is narrow.

    Signals
    -------
    tool_chosen(str)
        "distance", "angle", "region", or empty: the mouse pans.
    target_chosen(str)
        What goes where the operator clicks next.
    """

    tool_chosen = Signal(str)
    target_chosen = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.live = named(_button("Live", "", checkable=True), "live")
        self.fit = _button("Fit", "Fit the image to the view")
        self.one_to_one = _button("1:1", "Show the image 1:1, one camera pixel per screen pixel")
        self.tools = {
            name: named(_button(text, tip, checkable=True), name)
            for name, (text, tip) in TOOLS.items()
        }
        self.go = named(_button("Move", MOVE_TIP, checkable=True), "move")
        self.menu = QMenu(self)
        self.cross = _button("Cross", "Show a crosshair in the middle", checkable=True)
        self.scale = _button("Scale", "Show the scale bar", checkable=True)
        self.found = _button("Found", "Show what machine vision found", checkable=True)
        self.more = named(
            _button("Settings", "Contrast, camera and machine vision", checkable=True), "settings"
        )
        self.scale.setChecked(True)
        self.found.setChecked(True)
        self._flow = FlowLayout(STEP_PX // 2, self)
        for widget in self.buttons:
            self._flow.addWidget(widget)
        for name, button in self.tools.items():
            button.clicked.connect(
                lambda checked, name=name: self._on_tool(name if checked else "")
            )
        self.go.clicked.connect(self._on_move)
        self.menu.triggered.connect(self._on_target)

    @property
    def buttons(self) -> tuple[QToolButton, ...]:
        """All of them, in order."""
        shown = (self.cross, self.scale, self.found)
        return (
            self.live,
            self.fit,
            self.one_to_one,
            *self.tools.values(),
            self.go,
            *shown,
            self.more,
        )

    def add(self, widget: W) -> W:
        """Put one more at the end."""
        self._flow.addWidget(widget)
        return widget

    def choose(self, name: str) -> None:
        """Show which tool is chosen: one of `TOOLS`, "move", or empty."""
        for each, button in self.tools.items():
            button.setChecked(each == name)
        self.go.setChecked(name == "move")

    def show_running(self, running: bool, problem: str) -> None:
        """Show whether images are taken."""
        self.live.setChecked(running)
        retip(self.live, "Stop the camera" if running else problem or "Start the camera")

    def show_targets(self, targets: tuple[str, ...], problem: str) -> None:
        """Offer what can be moved; a problem disables the button and stands in its tooltip."""
        problem = problem or ("" if targets else "Nothing can be moved from here")
        self.go.setEnabled(not problem)
        retip(self.go, f"Not now: {problem}" if problem else MOVE_TIP)
        if tuple(action.text() for action in self.menu.actions()) != targets:
            self.menu.clear()
            for target in targets:
                self.menu.addAction(target)

    def _on_tool(self, name: str) -> None:
        self.choose(name)
        self.tool_chosen.emit(name)

    def _on_move(self, checked: bool) -> None:
        if not checked:
            self._on_tool("")
            return
        self.go.setChecked(False)  # until it is said what
        self.menu.popup(self.go.mapToGlobal(self.go.rect().bottomLeft()))

    def _on_target(self, action: QAction) -> None:
        self.choose("move")
        self.target_chosen.emit(action.text())


def _button(text: str, tip: str, *, checkable: bool = False) -> QToolButton:
    button = tipped(QToolButton(), tip)
    button.setText(text)
    button.setAccessibleName(tip if text == "1:1" else text)
    button.setCheckable(checkable)
    return styled(button, "tool")
