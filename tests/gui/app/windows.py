"""What tests look at in a window of the operator."""

from collections.abc import Callable

from pytestqt.qtbot import QtBot

from cosmic.app.panels.scene import ScenePanel
from cosmic.app.windows.operator_window import MICO, SCENE, OperatorWindow
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from cosmic.mico.gui.scene.scene_widget import SceneWidget
from gui.mico.panels import click, enter, field, wait_for_position

Make = Callable[..., OperatorWindow]


def wait_until_ready(window: OperatorWindow, qtbot: QtBot, timeout_ms: int = 15_000) -> None:
    """Wait for the scene, and for the axes: only then is a distance told."""
    scene(window, qtbot)
    qtbot.waitUntil(lambda: "µm" in window.top_bar.clearance_text, timeout=timeout_ms)


def mico(window: OperatorWindow) -> MicoWidget:
    assert window.mico_gui is not None
    return window.mico_gui


def card(window: OperatorWindow, axis: str) -> PositionerBaseGUI:
    return mico(window).cards[axis]


def scene_panel(window: OperatorWindow) -> ScenePanel:
    assert window.scene_panel is not None
    return window.scene_panel


def scene(window: OperatorWindow, qtbot: QtBot) -> SceneWidget:
    """Wait for the drawing of the scene, which is made when it is first seen."""
    window.raise_panel(SCENE)
    qtbot.waitUntil(lambda: scene_panel(window).scene is not None)
    found = scene_panel(window).scene
    assert found is not None
    return found


def go_to(window: OperatorWindow, qtbot: QtBot, axis: str, target_um: float) -> None:
    """Send an axis to a place, as the operator does."""
    if window.tasks is not None:
        window.raise_panel(MICO)
        mico(window).show_cards(True)
    enter(qtbot, field(card(window, axis), "target"), str(target_um))
    click(qtbot, card(window, axis), "MiCoCL_9")


def drive(window: OperatorWindow, qtbot: QtBot, axis: str, target_um: float) -> None:
    """Send an axis to a place, and wait until it is there."""
    go_to(window, qtbot, axis, target_um)
    wait_for_position(qtbot, card(window, axis), target_um)
