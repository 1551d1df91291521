"""`LensPanel`: zoom, focus, home, light and autofocus."""

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt

from contract import vico_rig
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.theme import State
from cosmic.vico.api.vico import Vico
from cosmic.vico.core.settings import MotorLensSettings
from cosmic.vico.gui.lens_panel import LensPanel
from cosmic.vico.hw.peripherals import LensAxis


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def enter(qtbot, field, text):
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, text)
    qtbot.keyClick(field, Qt.Key.Key_Return)


@pytest.fixture
def panel(own, port):
    made = LensPanel(port)
    own(made)
    made.show()
    return made


@pytest.fixture
def lens(port):
    return port.lens


def test_zoom_steps_are_buttons_and_the_present_one_is_marked(qtbot, panel, lens):
    assert list(panel.steps) == ["0.7x", "1x", "2x", "4.5x"]
    assert [name for name, button in panel.steps.items() if button.isChecked()] == ["2x"]
    click(qtbot, panel.steps["4.5x"])
    assert lens.calls == [("zoom", 4.5)]
    lens.zoom = 4.5
    qtbot.waitUntil(panel.steps["4.5x"].isChecked)
    assert panel.zoom.text() == "4.5"


def test_a_zoom_between_the_steps_can_be_typed(qtbot, panel, lens):
    enter(qtbot, panel.zoom, "3.1")
    assert lens.calls == [("zoom", 3.1)]
    enter(qtbot, panel.zoom, "9")
    assert "highest" in panel.zoom.reason
    qtbot.keyClick(panel.zoom, Qt.Key.Key_Escape)
    assert len(lens.calls) == 1


def test_focus_is_typed_dragged_or_stepped(qtbot, panel, lens):
    enter(qtbot, panel.focus.field, "700")
    click(qtbot, panel.focus_steps[-10])
    click(qtbot, panel.focus_steps[100])
    assert lens.calls == [("focus", 700), ("focus", 490), ("focus", 600)]
    panel.focus.slider.setValue(500)
    qtbot.waitUntil(lambda: lens.calls[-1] == ("focus", 1000))


def test_a_step_beyond_the_end_is_refused_in_words(qtbot, panel, lens):
    lens.states[LensAxis.FOCUS] = replace(lens.states[LensAxis.FOCUS], position_counts=50)
    click(qtbot, panel.focus_steps[-100])
    assert lens.calls == []
    assert "outside 0 to 2000" in panel.tasks.text.text()


def test_what_the_lens_refuses_stands_at_the_field(qtbot, panel, lens):
    lens.refuse = "the lens is moving"
    enter(qtbot, panel.zoom, "3")
    assert panel.zoom.reason == "the lens is moving"
    assert panel.zoom.text() == "3"


def test_a_lens_that_is_not_homed_can_only_be_homed(qtbot, panel, lens):
    lens.states[LensAxis.ZOOM] = replace(lens.states[LensAxis.ZOOM], homed=False)
    qtbot.waitUntil(lambda: panel.badge.state is State.UNKNOWN)
    for widget in (panel.zoom, panel.focus.field, panel.autofocus, *panel.steps.values()):
        assert not widget.isEnabled()
        assert "Home the lens first" in widget.toolTip()
    click(qtbot, panel.home)
    assert lens.calls == [("home",)]
    assert panel.badge.state is State.BUSY


def test_the_autofocus_shows_how_far_it_is_and_can_be_ended(qtbot, panel, lens):
    click(qtbot, panel.autofocus)
    assert lens.calls == [("autofocus", "top")]
    lens.task.report(0.4, "at 620 counts")
    qtbot.waitUntil(lambda: panel.tasks.bar.value() == 400)
    click(qtbot, panel.tasks.cancel)
    assert lens.task.cancel_requested
    lens.task.fail(CosmicError("cancelled"))
    qtbot.waitUntil(lambda: "cancelled" in panel.tasks.text.text())


def test_abort_stops_the_motors_and_what_moves_them(qtbot, panel, lens):
    click(qtbot, panel.home)
    click(qtbot, panel.abort)
    assert lens.calls[-1] == ("abort",)
    assert lens.task.cancel_requested
    lens.task.finish()


def test_light_is_set_in_percent(qtbot, panel, port):
    assert panel.light.field.text() == "40"
    enter(qtbot, panel.light.field, "55")
    assert port.light.calls == [55.0]
    enter(qtbot, panel.light.field, "101")
    assert "highest" in panel.light.field.reason
    assert port.light.calls == [55.0]


def test_without_lens_and_lamp_everything_says_why(qtbot, panel, port):
    port.lens = port.light = None
    port.publish()
    qtbot.waitUntil(lambda: not panel.home.isEnabled())
    assert "no motorised lens" in panel.home.toolTip()
    assert "no lamp" in panel.light.field.toolTip()


def test_a_lens_that_is_lost_says_so(qtbot, panel, lens):
    lens.problem = "no answer on /dev/ttyUSB0"
    qtbot.waitUntil(lambda: panel.badge.state is State.ERROR)
    assert panel.name.text() == "no answer on /dev/ttyUSB0"
    assert not panel.home.isEnabled()


def test_a_lens_without_a_table_of_magnifications_can_be_focused(own, qtbot, tmp_path, monkeypatch):
    bare = MotorLensSettings(backend="simulated", homed=True)
    made = vico_rig.settings(tmp_path).model_copy(update={"lens": bare})
    monkeypatch.setattr(vico_rig, "settings", lambda _: made)
    with vico_rig.used_locally(tmp_path) as home:
        panel = LensPanel(Vico(home.application))
        own(panel)
        panel.show()
        assert not panel.zoom.isEnabled()
        assert "no zoom position has a magnification" in panel.zoom.toolTip()
        qtbot.waitUntil(panel.focus.isEnabled)
        enter(qtbot, panel.focus.field, "700")
        thread = home.application.peripherals
        qtbot.waitUntil(lambda: thread.state.focus.position_counts == 700)
