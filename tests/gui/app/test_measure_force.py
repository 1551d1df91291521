"""The tutorial "measure a force", done in the window."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings, Qt
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.app.instrument_panels import DAQCO
from cosmic.app.operator_window import OperatorWindow
from cosmic.app.platform import build_platform
from cosmic.daqco.gui.main_widget import UDaqMainWidget, make_daqco_gui
from cosmic.frame.log import RingBufferHandler
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from gui.mico.panels import click, enter, field, show, wait_for_position

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> Iterator[OperatorWindow]:
    platform = build_platform(
        applications=("mico", "daqco"),
        rate=4.0,
        mico_gui=make_mico_gui,
        daqco_gui=make_daqco_gui,
    )
    stored = QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat)
    window = OperatorWindow(platform, stored, RingBufferHandler(), console=False)
    qtbot.addWidget(window)
    show(qtbot, window)
    window.open_hardware()
    qtbot.waitUntil(lambda: "µm" in window.top_bar.clearance_text, timeout=8000)
    yield window
    window.close()


def daqco(window: OperatorWindow) -> UDaqMainWidget:
    found = window.findChild(UDaqMainWidget)
    assert found is not None
    window.dock(DAQCO).raise_()
    return found


def card(window: OperatorWindow, axis: str) -> PositionerBaseGUI:
    assert window.mico_gui is not None
    return window.mico_gui.cards[axis]


def go_to(window: OperatorWindow, qtbot: QtBot, axis: str, target_um: float) -> None:
    enter(qtbot, field(card(window, axis), "MiCoCL_8"), str(target_um))
    click(qtbot, card(window, axis), "MiCoCL_9")


def drive(window: OperatorWindow, qtbot: QtBot, axis: str, target_um: float) -> None:
    go_to(window, qtbot, axis, target_um)
    wait_for_position(qtbot, card(window, axis), target_um)


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
