"""The tutorial "measure a force", done in the window."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.app.panels.instruments import DAQCO
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.daqco.gui.main_widget import UDaqMainWidget
from gui.app.windows import Make, card, drive, go_to, wait_until_ready

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def window(make: Make, qtbot: QtBot) -> OperatorWindow:
    window = make(applications=("mico", "daqco"), rate=4.0)
    wait_until_ready(window, qtbot)
    return window


def daqco(window: OperatorWindow) -> UDaqMainWidget:
    found = window.findChild(UDaqMainWidget)
    assert found is not None
    window.dock(DAQCO).raise_()
    return found


def test_the_probe_is_pushed_recorded_and_stopped_by_its_limit(
    window: OperatorWindow, qtbot: QtBot, tmp_path: Path
) -> None:
    for axis, target_um in (("left.z", -800.0), ("left.x", 3600.0), ("probe.y", -4940.0)):
        drive(window, qtbot, axis, target_um)
    panel = daqco(window)
    qtbot.waitUntil(lambda: panel.state.text() == "ACQUIRING", timeout=5000)
    application = window.platform.daqco
    assert application is not None

    def force_un() -> float:
        return application.buffer.get_latest_data()["force"]

    panel.files.directory.setText(str(tmp_path))
    panel.files.base.setText("push")
    qtbot.waitUntil(panel.files.start.isEnabled)
    panel.start_recording.trigger()
    qtbot.waitUntil(lambda: application.recorder.state.active)
    drive(window, qtbot, "probe.y", -5020.0)
    qtbot.waitUntil(lambda: force_un() > 40.0)
    panel.stop_recording.trigger()
    qtbot.waitUntil(lambda: not application.recorder.state.active)
    (file,) = tmp_path.glob("push*.h5")
    with cosmic.open_recording(file) as recording:
        assert recording.complete
        assert recording.values("force").max() > 40.0

    cosmic.Rig(window.platform).daqco.arm_limit("force", high=110.0, hysteresis=10.0)
    card(window, "probe.y").axis.set_closed_loop_frequency(60)
    go_to(window, qtbot, "probe.y", -5300.0)
    qtbot.waitUntil(lambda: window.top_bar.latched, timeout=15_000)
    qtbot.waitUntil(lambda: panel.plotter.banner.isVisibleTo(panel))
    assert "force" in panel.plotter.banner.text.text()
    window.top_bar.reset_requested.emit()
    card(window, "probe.y").axis.set_closed_loop_frequency(5000)
    drive(window, qtbot, "probe.y", -4900.0)
    qtbot.waitUntil(lambda: abs(force_un()) < 15.0)
    qtbot.mouseClick(panel.plotter.banner.reset, LEFT)
    qtbot.waitUntil(lambda: not panel.plotter.banner.isVisibleTo(panel))
