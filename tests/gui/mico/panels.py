"""Small helpers for tests that click through the MiCo panel."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPushButton, QToolButton, QWidget
from pytestqt.qtbot import QtBot

from cosmic.app.platform import build_platform
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.mico.gui.mico_widget import MicoWidget, make_mico_gui
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI

W = TypeVar("W", bound=QWidget)


@contextmanager
def simulated_panel(
    qtbot: QtBot, *, rate: float = 50.0, cold: bool = False
) -> Iterator[MicoWidget]:
    platform = build_platform(applications=("mico",), rate=rate, cold=cold, mico_gui=make_mico_gui)
    assert platform.mico is not None
    platform.initialize()
    panel = platform.mico.get_gui()
    assert isinstance(panel, MicoWidget)
    qtbot.addWidget(panel)
    show(qtbot, panel)
    try:
        yield panel
    finally:
        platform.shut_down()
        panel.close()


def show(qtbot: QtBot, widget: QWidget, width: int = 1400, height: int = 900) -> None:
    widget.resize(width, height)
    with qtbot.waitExposed(widget):
        widget.show()
    widget.activateWindow()
    qtbot.waitUntil(widget.isActiveWindow)


def part(card: QWidget, name: str, kind: type[W]) -> W:
    found = card.findChild(kind, name)
    assert found is not None, f"{card.objectName()} has no {name}"
    return found


def field(card: QWidget, name: str) -> QuantityField:
    return part(card, name, QuantityField)


def click(qtbot: QtBot, card: QWidget, name: str) -> None:
    button = card.findChild(QPushButton, name) or card.findChild(QToolButton, name)
    assert button is not None, f"{card.objectName()} has no button {name}"
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def enter(qtbot: QtBot, entry: QuantityField, text: str, *, accept: bool = False) -> None:
    """Type `text` over what stands there, as an operator does."""
    entry.setFocus()
    entry.selectAll()
    qtbot.keyClicks(entry, text)
    if accept:
        qtbot.keyClick(entry, Qt.Key.Key_Return)


def choose(card: PositionerBaseGUI, entry: str) -> None:
    """Choose an entry of the menu at the end of the card."""
    for action in part(card, "axisMenu", QToolButton).menu().actions():
        if action.text().startswith(entry):
            action.trigger()
            return
    raise AssertionError(f"the menu has no {entry!r}")


def position(card: PositionerBaseGUI) -> float:
    shown = card.axis.details.shown_position
    assert shown is not None
    return shown


def wait_for_position(
    qtbot: QtBot, card: PositionerBaseGUI, wanted: float, within: float = 1.0
) -> None:
    """Wait until the axis stands at `wanted`."""

    def arrived() -> bool:
        return abs(position(card) - wanted) <= within and not card.axis.details.in_motion

    qtbot.waitUntil(arrived, timeout=8000)


def initialise(qtbot: QtBot, panel: MicoWidget) -> None:
    """Press Initialise, and agree where it asks about what may be held."""
    click(qtbot, panel, "initialise")
    if panel.caution is not None:
        panel.caution.go.click()
