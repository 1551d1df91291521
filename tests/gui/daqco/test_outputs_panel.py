"""The panel of outputs: what each gives, and nothing given by accident."""

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt

from cosmic.daqco.core.output_control import OutputState
from cosmic.daqco.gui.main_widget import UDaqMainWidget
from cosmic.daqco.gui.outputs_panel import OutputsPanel

PIEZO = OutputState(
    name="piezo", place="Dev1/ao0", analog=True, value=0.0, playing=False, safe=0.0,
    low_v=0.0, high_v=5.0, stops=True,
)  # fmt: skip
LAMP = replace(PIEZO, name="lamp", place="Dev1/port0/line0", analog=False, high_v=1.0, stops=False)


@pytest.fixture
def panel(qtbot, port):
    port.outputs = (PIEZO, LAMP)
    made = OutputsPanel(port)
    qtbot.addWidget(made)
    made.show()
    return made


def test_where_the_configuration_names_no_output_there_is_no_panel(qtbot, port):
    main = UDaqMainWidget(port)
    qtbot.addWidget(main)
    main.show()
    assert not main.outputs.isVisible()
    port.change(outputs=(PIEZO,))
    qtbot.waitUntil(main.outputs.isVisible)


def test_each_output_is_shown_with_what_it_gives(qtbot, panel, port):
    assert panel.rows["piezo"].shown.text() == "0 V"
    assert panel.rows["lamp"].shown.text() == "low"
    assert "0 to 5 V" in panel.rows["piezo"].name.toolTip()
    assert "left alone by a stop" in panel.rows["lamp"].name.toolTip()
    port.change(outputs=(replace(PIEZO, value=None, playing=True), replace(LAMP, value=1.0)))
    qtbot.waitUntil(lambda: panel.rows["piezo"].shown.text() == "waveform")
    assert panel.rows["lamp"].shown.text() == "high"


def test_a_voltage_is_given_by_enter_or_the_button_and_not_by_leaving_the_field(qtbot, panel, port):
    field = panel.rows["piezo"].field
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, "2.5")
    panel.safe.setFocus()
    assert not port.calls
    qtbot.mouseClick(panel.rows["piezo"].button, Qt.MouseButton.LeftButton)
    assert port.calls == [("set output", "piezo", 2.5)]
    field.selectAll()
    qtbot.keyClicks(field, "3")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert port.calls[-1] == ("set output", "piezo", 3.0)
    assert panel.rows["piezo"].shown.text() == "3 V"


def test_what_is_no_number_is_refused_at_the_field(qtbot, panel, port):
    field = panel.rows["piezo"].field
    field.selectAll()
    qtbot.keyClicks(field, "two")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert not port.calls and field.reason


def test_a_refusal_is_shown(qtbot, panel, port):
    port.refuse = "output piezo: 6 V asked; its limits are 0 to 5 V"
    qtbot.mouseClick(panel.rows["piezo"].button, Qt.MouseButton.LeftButton)
    assert "its limits are 0 to 5 V" in panel.refusal.text()


def test_a_line_is_switched(qtbot, panel, port):
    button = panel.rows["lamp"].button
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert port.calls == [("set line", "lamp", True)] and button.text() == "Switch off"
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert port.calls[-1] == ("set line", "lamp", False)


def test_after_a_stop_nothing_can_be_set_before_the_reset(qtbot, panel, port):
    qtbot.mouseClick(panel.safe, Qt.MouseButton.LeftButton)
    assert port.calls == [("stop outputs",)]
    assert panel.state.text() == "OUTPUTS STOPPED"
    for row in panel.rows.values():
        assert not row.button.isEnabled()
    qtbot.mouseClick(panel.reset, Qt.MouseButton.LeftButton)
    assert panel.state.text() == "OUTPUTS"
    assert panel.rows["piezo"].button.isEnabled() and not panel.reset.isVisible()


def test_a_board_that_does_not_answer_is_named(qtbot, panel, port):
    port.change(outputs=(replace(PIEZO, value=None, problem="Dev1: the board is gone"), LAMP))
    qtbot.waitUntil(lambda: "the board is gone" in panel.refusal.text())
    assert panel.rows["piezo"].shown.text() == "■ no answer"


def test_a_stop_that_another_window_reset_is_not_shown_any_more(qtbot, panel, port):
    port.change(outputs_stopped="STOP button")
    qtbot.waitUntil(lambda: "STOP button" in panel.refusal.text())
    port.change(outputs_stopped="")
    qtbot.waitUntil(lambda: panel.state.text() == "OUTPUTS")
    assert panel.refusal.text() == ""
