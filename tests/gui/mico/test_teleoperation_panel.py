"""The panel that steers by an input device, as an operator uses it."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from cosmic.mico.core.teleoperation.state import TeleoperationPhase as Phase
from cosmic.mico.gui.mapping_table import DIRECTION, NOW, SCALE, SPEED
from cosmic.mico.gui.teleoperation_panel import TeleoperationPanel, make_teleoperation_panel
from cosmic.testing.virtual_gamepad import VirtualGamepad
from gui.mico.panels import show
from unit.mico.rigs import mico

HAPTIC = "haptic:sim"


PROFILES = [
    {
        "name": "sticks",
        "fine_button": "right_shoulder",
        "axis": [
            {"input": "left_x", "positioner": "d0.c0"},
            {"input": "left_y", "positioner": "d0.c2"},
        ],
    },
    {
        "name": "stylus",
        "axis": [
            {"input": "x", "positioner": "d0.c0", "speed_um_s": 100.0},
            {"input": "y", "positioner": "d0.c1", "mode": "position", "travel_um": 500.0},
        ],
    },
]


@pytest.fixture
def panel(qtbot) -> Iterator[TeleoperationPanel]:
    with mico(teleoperation={"profile": PROFILES}) as (api, _):
        panel = make_teleoperation_panel(api)
        qtbot.addWidget(panel)
        show(qtbot, panel, 480, 560)
        yield panel
        panel.shut_down()


def teleoperation(panel: TeleoperationPanel):
    return panel._teleoperation


def choose(panel: TeleoperationPanel, key: str, profile: str) -> None:
    panel.devices.setCurrentIndex(panel.devices.findData(key))
    panel.profiles.setCurrentText(profile)


def press_start(qtbot, panel: TeleoperationPanel) -> None:
    qtbot.mouseClick(panel.start, Qt.MouseButton.LeftButton)


def begin(qtbot, panel: TeleoperationPanel, key: str = HAPTIC, profile: str = "stylus"):
    choose(panel, key, profile)
    press_start(qtbot, panel)
    qtbot.waitUntil(lambda: panel.indicator.words == "armed")


def haptic(panel: TeleoperationPanel):
    return teleoperation(panel).sources.haptics.haptic


def test_a_device_and_a_profile_are_chosen_and_steering_is_begun_and_ended(qtbot, panel):
    assert panel.indicator.words == "off"
    assert panel.start.text() == "Start"
    begin(qtbot, panel)
    assert panel.start.text() == "Stop"
    assert not panel.devices.isEnabled()
    assert teleoperation(panel).state.profile == "stylus"
    press_start(qtbot, panel)
    assert panel.indicator.words == "off"
    assert panel.start.text() == "Start"
    assert panel.devices.isEnabled()


def test_what_a_script_steers_is_what_the_panel_shows(qtbot, panel):
    choose(panel, HAPTIC, "stylus")
    teleoperation(panel).start("keyboard:window", "sticks")
    qtbot.waitUntil(lambda: panel.start.text() == "Stop")
    assert panel.devices.currentData() == "keyboard:window"
    assert panel.profiles.currentText() == "sticks"


def test_it_fits_the_wide_column_beside_the_image(panel):
    assert panel.minimumSizeHint().width() <= 376


def test_bars_and_velocities_follow_the_hand_and_the_force_is_shown(qtbot, panel):
    begin(qtbot, panel)
    haptic(panel).move_hand(y=0.5)
    qtbot.waitUntil(lambda: panel.bars.axes.get("y", 0.0) > 0.3)
    qtbot.waitUntil(lambda: panel.indicator.words == "steering")
    qtbot.waitUntil(lambda: "µm/s" in panel.table.item(1, NOW).text())
    teleoperation(panel).feel({"y": -0.25})
    qtbot.waitUntil(lambda: panel.force.text == "felt force 25 %")
    haptic(panel).press("grip")
    qtbot.waitUntil(lambda: panel.bars.pressed == ("grip",))
    panel.grab()


def test_a_loss_is_said_in_words_and_steering_can_be_begun_again(qtbot, panel):
    begin(qtbot, panel)
    with qtbot.waitSignal(panel.phase_changed, check_params_cb="stopped: unplugged".__eq__):
        haptic(panel).unplug()
    assert panel.indicator.words == "stopped: unplugged"
    assert panel.indicator.accessibleName() == "teleoperation stopped: unplugged"
    assert panel.start.text() == "Start"
    panel.grab()
    begin(qtbot, panel)


def test_what_is_no_longer_measured_is_no_longer_shown(qtbot, panel):
    begin(qtbot, panel)
    haptic(panel).move_hand(y=0.5)
    teleoperation(panel).feel({"y": -0.25})
    qtbot.waitUntil(lambda: panel.force.text == "felt force 25 %")
    with qtbot.waitSignal(panel.phase_changed, check_params_cb="stopped: unplugged".__eq__):
        haptic(panel).unplug()
    assert panel.force.text == "felt force 0 %"
    assert panel.bars.axes == {}


def test_nothing_takes_the_place_of_a_device_that_was_unplugged(qtbot, panel):
    with VirtualGamepad() as pad:
        panel.look_for_devices()
        choose(panel, pad.key, "sticks")
        title = panel.devices.currentText()
        pad.unplug()
        panel.look_for_devices()
        assert panel.devices.currentText() == ""
        assert not panel.start.isEnabled()
        assert title in panel.start.toolTip()
    with VirtualGamepad():
        panel.look_for_devices()
        assert panel.devices.currentText() == title
        assert panel.start.isEnabled()


def test_a_device_without_the_inputs_of_the_profile_is_refused(qtbot, panel):
    choose(panel, HAPTIC, "sticks")
    press_start(qtbot, panel)
    assert "has none of the inputs of profile 'sticks', left_x, left_y" in panel.message.text()
    panel.resize(220, 560)  # as narrow as beside the image
    qtbot.waitUntil(lambda: panel.message.height() > 2 * panel.fontMetrics().lineSpacing())
    assert panel.message.height() >= panel.message.heightForWidth(panel.message.width())
    assert panel.indicator.words == "off"


def test_a_window_out_of_focus_pauses(qtbot, panel, monkeypatch):
    begin(qtbot, panel)
    inactive = Qt.ApplicationState.ApplicationInactive
    monkeypatch.setattr(type(panel._app), "applicationState", lambda *_: inactive)
    qtbot.waitUntil(lambda: panel.indicator.words == "paused: the window is out of focus")
    assert teleoperation(panel).state.phase is Phase.PAUSED
    monkeypatch.undo()
    qtbot.waitUntil(lambda: panel.indicator.words == "armed")


def test_the_mapping_is_edited_in_the_table(qtbot, panel):
    choose(panel, HAPTIC, "sticks")
    panel.table.item(0, SCALE).setText("0.5")
    panel.table.item(0, DIRECTION).setText("-1")
    panel.table.item(0, SPEED).setText("50")
    row = teleoperation(panel).profile("sticks").axis[0]
    assert (row.scale, row.direction, row.speed_um_s) == (0.5, -1, 50.0)
    assert panel.table.item(0, SPEED).text() == "50 µm/s"
    panel.table.item(0, SPEED).setText("")
    assert teleoperation(panel).profile("sticks").axis[0].speed is None
    panel.fine_share.setText("0.25")
    panel.fine_share.editingFinished.emit()
    assert teleoperation(panel).profile("sticks").fine_share == 0.25
    assert not panel.message.isVisible()


@pytest.mark.parametrize(
    ("column", "text", "why"),
    [(SCALE, "-1", "greater than 0"), (SCALE, "big", "not a number"), (DIRECTION, "2", "-1 or 1")],
)
def test_a_wrong_entry_is_refused_in_words_and_the_old_one_is_shown_again(
    qtbot, panel, column, text, why
):
    choose(panel, HAPTIC, "sticks")
    before = panel.table.item(0, column).text()
    panel.table.item(0, column).setText(text)
    assert why in panel.message.text()
    assert panel.table.item(0, column).text() == before


def test_the_number_keys_of_the_window_steer_as_long_as_they_are_held(qtbot, panel):
    axis = teleoperation(panel)
    begin(qtbot, panel, "keyboard:window", "sticks")
    focus = QWidget(panel)
    focus.show()
    focus.setFocus()
    qtbot.keyPress(panel, Qt.Key.Key_6)
    qtbot.waitUntil(lambda: axis.state.velocities.get("d0.c0", 0.0) == 200.0)
    qtbot.keyRelease(panel, Qt.Key.Key_6)
    qtbot.waitUntil(lambda: panel.indicator.words == "armed")


def test_what_cannot_be_started_says_why(qtbot, panel):
    choose(panel, HAPTIC, "stylus")
    teleoperation(panel)._platform.stop("test")
    press_start(qtbot, panel)
    assert "reset the stop first" in panel.message.text()
    assert panel.indicator.words == "off"


def test_a_changed_profile_is_taken_back_as_it_was_configured(panel, qtbot):
    steering = teleoperation(panel)
    steering.edit_axis("sticks", 0, scale=2.0)
    panel.profiles.setCurrentText("sticks")
    qtbot.mouseClick(panel.as_configured, Qt.MouseButton.LeftButton)
    assert steering.profile("sticks").axis[0].scale == 1.0
    assert panel.table.item(0, SCALE).text() == "1"
