"""`UDaqMainWidget`: menus, dock and window, export and limits."""

import numpy as np
import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import QApplication, QDialogButtonBox, QFileDialog, QPushButton

from cosmic.daqco.core.settings import LimitSettings
from cosmic.daqco.gui.configure_dialog import UDaqConfigureDialog
from cosmic.daqco.gui.limit_dialog import LimitDialog
from cosmic.daqco.gui.main_widget import UDaqMainWidget
from cosmic.frame.errors import ConfigError
from cosmic.frame.gui.server_gui import CosmicServerGui
from gui.daqco.fake_port import FakePort, Limited, Recorded, many, settings

Button = QDialogButtonBox.StandardButton


@pytest.fixture
def main(qtbot, port):
    made = UDaqMainWidget(port)
    qtbot.addWidget(made)
    made.resize(1000, 700)
    made.show()
    return made


def menus(main):
    return {
        action.text().replace("&", ""): [
            each.text().replace("&", "") for each in action.menu().actions() if each.text()
        ]
        for action in main.menu_bar.actions()
    }


def test_there_are_the_three_menus_of_the_thesis(main):
    assert list(menus(main)) == ["File", "Acquisition", "View"]
    assert menus(main)["File"][-1] == "Stop DAQCo"
    assert "Configure…" in menus(main)["Acquisition"]
    assert menus(main)["View"][0] == "File widget"


def test_the_view_menu_shows_and_hides_the_file_widget(main):
    main.show_files.trigger()
    assert not main.files.isVisible()
    main.show_files.trigger()
    assert main.files.isVisible()


def test_the_acquisition_menu_starts_stops_and_configures(qtbot, main, port):
    assert not main.start.isEnabled()
    main.stop.trigger()
    qtbot.waitUntil(lambda: main.state.text() == "STOPPED")
    main.start.trigger()
    qtbot.waitUntil(lambda: main.state.text() == "ACQUIRING")
    assert port.calls == [("stop",), ("start",)]
    main.configure.trigger()
    dialog = main.findChild(UDaqConfigureDialog)
    assert dialog.isVisible()
    dialog.close()


def test_stop_daqco_stops_the_acquisition_and_closes_the_window(qtbot, main, port):
    with qtbot.waitSignal(main.close_requested):
        main.quit.trigger()
    assert port.calls == [("stop",)]
    assert not main.isVisible()


def test_recording_can_be_started_and_stopped_from_the_menu(qtbot, main, port):
    main.start_recording.trigger()
    qtbot.waitUntil(main.stop_recording.isEnabled)
    assert not main.start_recording.isEnabled()
    main.stop_recording.trigger()
    assert [call[0] for call in port.calls] == ["record", "stop recording"]


def test_what_is_refused_is_reported_in_one_line(main, port):
    port.refuse = "Dev1 does not answer"
    main.stop.trigger()
    assert "Dev1 does not answer" in main.error.text()


def test_channels_and_rate_in_force_are_reported(qtbot, main, port):
    assert main.rate_text.text() == "2 × 1000 Hz"
    port.change(settings=many(32, rate_hz=7800.0))
    qtbot.waitUntil(lambda: main.rate_text.text() == "32 × 7800 Hz")


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_it_works_as_a_panel_of_the_server_window(qtbot, port, tmp_path, theme):
    store = QSettings(str(tmp_path / "layout.ini"), QSettings.Format.IniFormat)
    window = CosmicServerGui(store, theme=theme)
    qtbot.addWidget(window)
    main = UDaqMainWidget(port)
    window.add_panel("DAQCo", main)
    window.resize(1366, 768)
    window.show()
    for _ in range(100):
        port.push(np.ones((2, 10)))
    qtbot.waitUntil(lambda: main.plotter.chart.now_view().end == 1000)
    main.quit.trigger()
    assert window.isVisible()  # the panel asks; its window decides


@pytest.mark.parametrize("size", [(1000, 700), (900, 480), (420, 400), None])
def test_nothing_is_clipped_in_a_small_window(qtbot, main, size):
    main.resize(*size) if size else main.resize(main.minimumSizeHint())
    QApplication.processEvents()
    main.resize(*size) if size else main.resize(main.minimumSizeHint())
    QApplication.processEvents()
    buttons = [each for each in main.findChildren(QPushButton) if each.isVisible()]
    assert main.files.start in buttons
    for button in buttons:
        corner = button.mapTo(main, button.rect().bottomRight())
        assert main.rect().contains(corner), button.text()
    assert main.plotter.chart.box.height() >= 40


def test_a_low_panel_keeps_its_room_for_the_image(qtbot, main):
    assert main.files.base.isVisible()
    assert main.plotter.bar.rescale.isVisible()
    main.resize(900, 420)
    qtbot.waitUntil(lambda: not main.files.base.isVisible())
    assert not main.plotter.bar.rescale.isVisible()
    qtbot.mouseClick(main.files.fields, Qt.MouseButton.LeftButton)
    qtbot.mouseClick(main.plotter.bar.scales, Qt.MouseButton.LeftButton)
    main.resize(900, 430)
    QApplication.processEvents()
    assert main.files.base.isVisible()
    assert main.plotter.bar.rescale.isVisible()


# --- export -----------------------------------------------------------------------------------


def test_an_export_shows_its_progress_and_its_end(qtbot, main, port, tmp_path):
    main.export_recording(tmp_path / "a.h5", tmp_path / "a.csv")
    assert port.calls == [("export", tmp_path / "a.h5", tmp_path / "a.csv")]
    port.export_task.report(0.4, "row 400")
    qtbot.waitUntil(lambda: main.export_bar.bar.value() == 400)
    assert "row 400" in main.export_bar.text.text()
    port.export_task.report(1.0, "done")
    port.export_task.finish()
    qtbot.waitUntil(lambda: main.export_bar.cancel.text() == "Close")
    assert main.export_bar.text.text().endswith("done")
    qtbot.mouseClick(main.export_bar.cancel, Qt.MouseButton.LeftButton)
    assert not main.export_bar.isVisible()


def test_an_export_can_be_cancelled(qtbot, main, port, tmp_path):
    main.export_recording(tmp_path / "a.h5", tmp_path / "a.csv")
    qtbot.mouseClick(main.export_bar.cancel, Qt.MouseButton.LeftButton)
    assert port.export_task.cancel_requested


def test_an_export_that_fails_says_why(qtbot, main, port, tmp_path):
    main.export_recording(tmp_path / "a.h5", tmp_path / "a.csv")
    port.export_task.fail(ConfigError("a.csv: the disk is full"))
    qtbot.waitUntil(lambda: "the disk is full" in main.export_bar.text.text())
    port.refuse = "a.h5 is not a recording"
    main.export_recording(tmp_path / "a.h5", tmp_path / "a.csv")
    assert "not a recording" in main.export_bar.text.text()


def test_the_menu_asks_for_recording_and_target(qtbot, main, port, tmp_path):
    (tmp_path / "a.h5").touch()
    main.export.trigger()
    source = main.findChild(QFileDialog)
    source.fileSelected.emit(str(tmp_path / "a.h5"))
    source.close()
    target = next(x for x in main.findChildren(QFileDialog) if x is not source)
    target.fileSelected.emit(str(tmp_path / "b.tdms"))
    target.close()
    assert port.calls == [("export", tmp_path / "a.h5", tmp_path / "b.tdms")]


# --- limits -----------------------------------------------------------------------------------


@pytest.fixture
def limits(qtbot, port):
    made = LimitDialog(port, "force")
    qtbot.addWidget(made)
    made.show()
    return made


def ok(qtbot, dialog):
    qtbot.mouseClick(dialog.buttons.button(Button.Ok), Qt.MouseButton.LeftButton)


def test_a_limit_is_set_in_the_unit_of_the_channel(qtbot, limits, port):
    limits.high.setText("50")
    limits.hysteresis.setText("2.5")
    ok(qtbot, limits)
    wanted = LimitSettings(channel="force", high=50.0, hysteresis=2.5, armed=True)
    assert port.calls == [("limit", wanted)]
    assert not limits.isVisible()


@pytest.mark.parametrize(
    ("low", "high", "hysteresis", "wrong"),
    [
        ("", "", "0", "high"),
        ("5", "5", "0", "high"),
        ("6", "5", "0", "high"),
        ("nan", "5", "0", "low"),
        ("", "inf", "0", "high"),
        ("", "5", "-1", "hysteresis"),
        ("", "5", "", "hysteresis"),
    ],
)
def test_a_limit_that_makes_no_sense_is_refused(qtbot, limits, port, low, high, hysteresis, wrong):
    for field, text in (
        (limits.low, low),
        (limits.high, high),
        (limits.hysteresis, hysteresis),
    ):
        field.setText(text)
    ok(qtbot, limits)
    assert getattr(limits, wrong).reason
    assert port.calls == []
    assert limits.isVisible()


def test_a_limit_that_the_application_refuses_is_reported(qtbot, limits, port):
    port.refuse = "limits need 200 Hz and more"
    limits.high.setText("5")
    ok(qtbot, limits)
    assert "200 Hz" in limits.message.text()
    assert limits.isVisible()


def test_a_limit_is_shown_changed_and_removed(qtbot, port):
    port.limits = (Limited(LimitSettings(channel="force", low=-3.0, high=50.0)),)
    dialog = LimitDialog(port, "force")
    qtbot.addWidget(dialog)
    dialog.show()
    assert (dialog.low.text(), dialog.high.text()) == ("-3", "50")
    assert not dialog.armed.isChecked()
    dialog.channel.setCurrentText("light")
    assert dialog.high.text() == ""
    assert not dialog.remove.isEnabled()
    dialog.channel.setCurrentText("force")
    qtbot.mouseClick(dialog.remove, Qt.MouseButton.LeftButton)
    assert port.calls == [("remove limit", "force")]


def test_a_channel_opens_the_dialog_at_its_limit(qtbot, main):
    main.plotter.limit_requested.emit("light")
    dialog = main.findChild(LimitDialog)
    assert dialog.channel.currentText() == "light"
    dialog.close()


def test_a_recording_that_the_application_ends_is_reported_by_the_widget(qtbot, main, port):
    failed = Recorded(path=port.directory / "x.h5", failure="the disk is full")
    port.change(recording=failed)
    qtbot.waitUntil(lambda: "the disk is full" in main.files.message.text())


def test_a_main_widget_that_goes_stops_listening(qtbot, tmp_path):
    port = FakePort(settings(), tmp_path)
    made = UDaqMainWidget(port)
    assert port.listened == 5
    made.deleteLater()
    qtbot.waitUntil(lambda: port.listened == 0)
