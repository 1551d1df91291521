"""The panel that holds a force, over the simulated platform."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetricsF
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.app.panels.control import ControlPanel, ControlPlot, make_control_panel
from cosmic.frame.gui.theme import number_font

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture(scope="module")
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=4.0, applications=("mico", "daqco")) as rig:
        # A busy computer that runs tests may be late with samples.
        rig.control.settings = rig.control.settings.model_copy(
            update={"stale_s": 20.0, "latency_s": 0.1, "response_s": 0.4}
        )
        rig.mico.move({"left.z": -800.0, "left.x": 3600.0, "probe.y": -4500.0})
        yield rig


@pytest.fixture
def panel(rig: cosmic.Rig, qtbot: QtBot) -> Iterator[ControlPanel]:
    panel = make_control_panel(rig)
    qtbot.addWidget(panel)
    panel.show()
    qtbot.waitExposed(panel)
    yield panel
    panel.close()
    qtbot.waitUntil(lambda: not rig.control.loops)


def click(qtbot: QtBot, panel: ControlPanel, name: str) -> None:
    qtbot.mouseClick(getattr(panel, name), LEFT)


def test_figures_at_the_axes_of_the_two_fields_do_not_touch(qtbot: QtBot) -> None:
    plot = ControlPlot()
    qtbot.addWidget(plot)
    plot.resize(700, 400)
    plot.show()
    qtbot.waitExposed(plot)
    above, below = (box.sceneBoundingRect() for box in (plot.value_box, plot.output_box))
    figures = QFontMetricsF(number_font(11)).height()
    gap = below.top() - above.bottom()
    assert gap >= figures - 1.0, "half of each figure lies outside its field"


def test_it_offers_channels_of_force_and_linear_axes(panel: ControlPanel) -> None:
    form = panel.form
    channels = [form.channel.itemText(at) for at in range(form.channel.count())]
    axes = [form.axis.itemText(at) for at in range(form.axis.count())]
    assert channels == ["force", "spare"]
    assert "probe.y" in axes
    assert "table.rotation" not in axes
    assert "left.gripper" not in axes
    assert form.axis.currentText() == "probe.y"
    assert form.direction.currentData() == -1


def test_no_loop_is_started_under_an_operation_that_moves_the_axes(
    rig: cosmic.Rig, qtbot: QtBot
) -> None:
    before = rig.control.newest
    panel = make_control_panel(rig, busy=lambda: "take with left moves the axes")
    qtbot.addWidget(panel)
    panel.show()
    click(qtbot, panel, "start")
    assert panel.state.text() == "refused"
    assert panel.reason.text() == "take with left moves the axes"
    assert rig.control.newest is before
    panel.close()


def test_a_loop_is_started_shown_changed_and_ended(
    rig: cosmic.Rig, panel: ControlPanel, qtbot: QtBot
) -> None:
    panel.form.set_point.set_value(30.0)
    panel.form.limit.set_value(90.0)
    click(qtbot, panel, "start")
    handle = rig.control.newest
    assert handle is not None
    assert handle.limits == (-90.0, 90.0)
    qtbot.waitUntil(lambda: panel.state.text() == "approaching")
    assert not panel.start.isEnabled()
    assert not panel.form.axis.isEnabled()
    qtbot.waitUntil(lambda: len(panel.plot.value.getData()[0]) > 50)
    assert len(panel.plot.output.getData()[0]) == len(panel.plot.set_point.getData()[0])
    assert "µN of 30.0 µN" in panel.readout.text()
    qtbot.waitUntil(lambda: "missed" in panel.pace.text())
    panel.form.set_point.set_value(40.0)
    click(qtbot, panel, "aim")
    assert handle.set_point == 40.0
    panel.form.set_point.set_value(95.0)
    click(qtbot, panel, "aim")
    assert "does not lie inside" in panel.form.set_point.reason
    assert handle.set_point == 40.0
    click(qtbot, panel, "stop")
    assert not handle.running
    qtbot.waitUntil(lambda: panel.state.text() == "ended")
    assert panel.start.isEnabled()
    assert panel.reason.text() == "asked to"


def test_what_is_refused_is_reported_and_begins_nothing(
    rig: cosmic.Rig, panel: ControlPanel, qtbot: QtBot
) -> None:
    panel.form.set_point.set_value(500.0)
    click(qtbot, panel, "start")
    assert panel.state.text() == "refused"
    assert "does not lie inside" in panel.reason.text()
    panel.form.set_point.setText("many")
    click(qtbot, panel, "start")
    assert panel.form.set_point.reason
    assert not rig.control.loops


def test_a_loop_begun_by_a_script_is_shown_and_can_be_ended(
    rig: cosmic.Rig, panel: ControlPanel, qtbot: QtBot
) -> None:
    handle = rig.control.hold_force("force", "probe.y", 20.0, direction=-1)
    qtbot.waitUntil(lambda: panel.reason.text() == "force by probe.y")
    click(qtbot, panel, "stop")
    assert handle.wait(20.0) == "asked to"


def test_why_a_loop_ended_stays_in_the_panel(
    rig: cosmic.Rig, panel: ControlPanel, qtbot: QtBot
) -> None:
    click(qtbot, panel, "start")
    qtbot.waitUntil(lambda: panel.state.text() == "approaching")
    rig.stop("pressed")
    qtbot.waitUntil(lambda: "pressed" in panel.reason.text())
    rig.reset_stop()
    assert panel.state.text() == "ended"


def test_closing_the_panel_ends_its_loop(
    rig: cosmic.Rig, panel: ControlPanel, qtbot: QtBot
) -> None:
    click(qtbot, panel, "start")
    handle = rig.control.newest
    assert handle is not None
    assert handle.running
    panel.close()
    assert handle.wait(20.0) == "asked to"


def test_its_plot_follows_the_theme(panel: ControlPanel, qtbot: QtBot) -> None:
    from PySide6.QtWidgets import QApplication

    from cosmic.frame.gui.palette import LIGHT
    from cosmic.frame.gui.theme import apply_theme

    app = QApplication.instance()
    assert isinstance(app, QApplication)
    apply_theme(app, "light")
    try:
        pen = panel.plot.set_point.opts["pen"]
        assert pen.color().name().lower() == LIGHT.text.lower()
    finally:
        apply_theme(app, "dark")
