"""The tutorial "look at a fibre and measure it", done in the window."""

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtWidgets import QCheckBox
from pytestqt.qtbot import QtBot

from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.vico.api.vico import Vico
from cosmic.vico.gui.camera_view import CameraView
from cosmic.vico.gui.lens_panel import LensPanel
from gui.app.windows import Make, drive, wait_until_ready

LEFT = Qt.MouseButton.LeftButton
PIXEL = (1250.0, 640.0)


@pytest.fixture
def window(make: Make, qtbot: QtBot) -> OperatorWindow:
    window = make(applications=("mico", "vico"), rate=6.0, size=(1600, 1000))
    wait_until_ready(window, qtbot)
    return window


def zoom(api: Vico) -> float | None:
    return api.lens.zoom if api.lens is not None else None


def tick(qtbot: QtBot, box: QCheckBox) -> None:
    qtbot.waitUntil(lambda: box.isVisible() and box.height() > 8)
    qtbot.mouseClick(box, LEFT, pos=QPoint(8, box.height() // 2))


def test_a_fibre_is_measured_and_a_gripper_calibrated_and_sent_to_a_pixel(
    window: OperatorWindow, qtbot: QtBot
) -> None:
    lens = window.findChild(LensPanel)
    views = {each.windowTitle(): each for each in window.findChildren(CameraView)}
    view = views["Microscope"]
    window.raise_panel("Camera")
    window.raise_panel("Microscope")
    vico, mico = window.platform.vico, window.platform.mico
    assert lens is not None
    assert vico is not None
    assert mico is not None
    api = Vico(vico)
    camera = api.camera()
    qtbot.waitUntil(lambda: view.view.image is not None, timeout=15_000)
    assert not view.row.go.isEnabled(), "nothing is calibrated yet"

    qtbot.waitUntil(lambda: "2x" in lens.steps and lens.steps["2x"].isEnabled())
    qtbot.mouseClick(lens.steps["2x"], LEFT)
    qtbot.waitUntil(lambda: zoom(api) == pytest.approx(2.0, abs=1e-3), timeout=15_000)

    window.raise_panel("Camera")
    tick(qtbot, view.chain.ticks["fibres"])
    assert view.chain.ticks["fibres"].isChecked()

    def whole_fibre() -> bool:
        seen = camera.analysis
        lengths = [] if seen is None else [each.length_px for each in seen.fibres if each.certain]
        return any(abs(each * 2.2 - 1200.0) < 6.0 for each in lengths)

    qtbot.waitUntil(whole_fibre, timeout=15_000)
    tick(qtbot, view.chain.ticks["fibres"])

    drive(window, qtbot, "right.x", -3000.0)
    drive(window, qtbot, "right.z", -1450.0)
    actions = {action.text(): action for action in view.calibrate.menu().actions()}
    actions["Move right"].trigger()
    qtbot.waitUntil(view.row.go.isEnabled, timeout=20_000)
    assert "µm a pixel" in view.calibrate.lines()[0]
    qtbot.waitUntil(lambda: "residual" in view.message.text)
    qtbot.waitUntil(lambda: vico.running_task is not None and vico.running_task.done)
    height_um = mico.manager.state("right.z").position
    actions = {action.text(): action for action in view.row.menu.actions()}
    actions["right"].trigger()
    window.raise_panel("Microscope")
    there = view.view.to_screen.map(QPointF(*PIXEL)).toPoint()
    qtbot.mouseClick(view.view.viewport(), LEFT, pos=there)
    assert "Right gripper moves to x" in view.message.text
    clicked_px = view.view.pixel_at(QPointF(there))
    wanted = camera.platform_um(clicked_px)
    assert wanted is not None

    def off_um() -> float:
        at = [mico.manager.state(f"right.{axis}").position or 0.0 for axis in "xy"]
        return float(np.hypot(at[0] + 4000.0 - wanted[0], at[1] - wanted[1]))

    qtbot.waitUntil(lambda: off_um() < 5.0, timeout=10_000)
    assert mico.manager.state("right.z").position == height_um
