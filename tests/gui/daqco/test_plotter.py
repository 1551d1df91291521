"""`UDaqPlotter` as its operator sees it (thesis, Table F.1)."""

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QFontMetricsF, QWheelEvent
from PySide6.QtWidgets import QApplication

from cosmic.daqco.core.settings import LimitSettings
from cosmic.daqco.gui.plot.units import AxisRange
from cosmic.daqco.gui.plotter import UDaqPlotter
from cosmic.frame.gui.theme import apply_theme
from gui.daqco.fake_port import Counted, FakePort, Limited, channel, many, settings


@pytest.fixture
def plotter(qtbot, port):
    return shown(qtbot, port)


def shown(qtbot, port):
    made = UDaqPlotter(port)
    qtbot.addWidget(made)
    made.resize(900, 500)
    made.show()
    qtbot.waitExposed(made)
    return made


def acquire(port, volts, seconds=1.0):
    """Acquire constant volts, one a channel, in chunks of 10 ms."""
    samples = round(port.rate_hz * 0.01)
    for _ in range(round(seconds * 100)):
        port.push(np.repeat(np.array(volts, float)[:, None], samples, axis=1))


def texts(plotter, column):
    model = plotter.channels.channels
    return [model.index(row, column).data() for row in range(model.rowCount())]


def tick(plotter, row, state):
    model = plotter.channels.channels
    model.setData(model.index(row, 0), state.value, Qt.ItemDataRole.CheckStateRole)


def colours(plotter):
    image = plotter.chart.raster.image
    return {
        image.pixelColor(x, y).name().upper()
        for x in range(0, image.width(), 3)
        for y in range(image.height())
    }


def turn_wheel(plotter, notches, *, ctrl=False):
    view = plotter.chart
    place = view.mapFromScene(view.box.sceneBoundingRect().center())
    event = QWheelEvent(
        QPointF(place),
        QPointF(view.viewport().mapToGlobal(place)),
        QPoint(),
        QPoint(0, 120 * notches),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.ControlModifier if ctrl else Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(view.viewport(), event)


def test_acquired_signals_are_listed_with_values_in_their_units(qtbot, plotter, port):
    acquire(port, [0.5, -2.25])
    plotter.refresh()
    plotter.read_out()
    assert texts(plotter, 0) == ["force", "light"]
    assert [float(text) for text in texts(plotter, 1)] == [10.0, -2.25]
    assert [plotter.channels.channels.unit(row) for row in (0, 1)] == ["µN", "V"]


def test_each_unit_has_an_axis_of_its_own(plotter):
    assert plotter.chart.axes.units == ("uN", "V")


def test_unticking_a_channel_hides_it_and_the_axis_that_no_other_needs(plotter, port):
    plotter.bar.auto.setChecked(False)
    acquire(port, [1.0, 2.0])
    plotter.refresh()
    assert {"#E69F00", "#56B4E9"} <= colours(plotter)
    tick(plotter, 0, Qt.CheckState.Unchecked)
    assert "#E69F00" not in colours(plotter)
    assert plotter.chart.axes.units == ("V",)
    tick(plotter, 0, Qt.CheckState.Checked)
    assert "#E69F00" in colours(plotter)


def test_rescale_applies_the_fields(qtbot, plotter):
    bar = plotter.bar
    for field, text in ((bar.low, "-5"), (bar.high, "45.5"), (bar.step, "10")):
        field.selectAll()
        qtbot.keyClicks(field, text)
    assert plotter.ranges["uN"] != AxisRange(-5.0, 45.5, 10.0)
    qtbot.mouseClick(bar.rescale, Qt.MouseButton.LeftButton)
    assert plotter.ranges["uN"] == AxisRange(-5.0, 45.5, 10.0)
    assert plotter.chart.axes.axis("uN").range == [-5.0, 45.5]
    assert not bar.auto.isChecked()


@pytest.mark.parametrize(
    ("low", "high", "step", "wrong"),
    [
        ("1", "1", "1", "high"),
        ("2", "1", "1", "high"),
        ("nan", "1", "1", "low"),
        ("0", "inf", "1", "high"),
        ("0", "1e300", "1", "high"),
        ("0", "1,5", "1", "high"),
        ("0", "1", "0", "step"),
        ("0", "1", "-1", "step"),
        ("0", "1", "0.0001", "step"),
        ("0", "1", "", "step"),
    ],
)
def test_scales_that_make_no_sense_are_refused_at_the_field(plotter, qtbot, low, high, step, wrong):
    bar, before = plotter.bar, plotter.ranges
    for field, text in ((bar.low, low), (bar.high, high), (bar.step, step)):
        field.setText(text)
    qtbot.mouseClick(bar.rescale, Qt.MouseButton.LeftButton)
    assert getattr(bar, wrong).reason
    assert getattr(bar, wrong).property("refused")
    assert plotter.ranges == before
    qtbot.keyClick(getattr(bar, wrong), Qt.Key.Key_Escape)
    assert not getattr(bar, wrong).reason


def test_auto_follows_a_signal_that_leaves_the_image(plotter, port):
    acquire(port, [0.1, 0.0])
    plotter.refresh()
    plotter.read_out()
    assert plotter.ranges["uN"].high < 10.0
    acquire(port, [8.0, 0.0])
    plotter.refresh()
    plotter.read_out()
    assert plotter.ranges["uN"].high > 160.0


def test_without_auto_the_axes_stay(plotter, port):
    plotter.bar.auto.setChecked(False)
    before = plotter.ranges
    acquire(port, [0.1, 0.0])
    plotter.refresh()
    plotter.read_out()
    assert plotter.ranges == before


def test_clear_forgets_the_history(qtbot, plotter, port):
    acquire(port, [1.0, 2.0])
    plotter.refresh()
    qtbot.mouseClick(plotter.bar.clear, Qt.MouseButton.LeftButton)
    assert plotter.chart.now_view().end == 0
    assert not colours(plotter) & {"#E69F00", "#56B4E9"}
    acquire(port, [1.0, 2.0])
    plotter.refresh()
    assert "#56B4E9" in colours(plotter)


def test_pause_freezes_the_image_and_live_shows_what_came_meanwhile(qtbot, plotter, port):
    plotter.bar.auto.setChecked(False)
    acquire(port, [1.0, 2.0])
    qtbot.mouseClick(plotter.bar.pause, Qt.MouseButton.LeftButton)
    before = plotter.chart.raster.image.copy()
    acquire(port, [3.0, 4.0])
    plotter.refresh()
    assert plotter.chart.raster.image == before
    assert plotter.state.text() == "HISTORY"
    assert plotter.bar.pause.text() == "Back to live"
    qtbot.mouseClick(plotter.bar.pause, Qt.MouseButton.LeftButton)
    assert plotter.state.text() == "LIVE"
    assert plotter.chart.now_view().end == 2000
    assert plotter.chart.raster.image != before


def test_the_wheel_zooms_into_the_history_and_shows_single_samples(qtbot, plotter, port):
    acquire(port, [1.0, 2.0], seconds=9.0)
    plotter.refresh()
    turn_wheel(plotter, 3)
    begin_s, end_s = plotter.chart.window_s()
    assert plotter.chart.frozen
    assert end_s - begin_s == pytest.approx(10.0 * 0.8**3, rel=0.01)
    turn_wheel(plotter, 60)
    begin_s, end_s = plotter.chart.window_s()
    assert end_s - begin_s == pytest.approx(10 / port.rate_hz)
    assert "#56B4E9" in colours(plotter)


def test_dragging_goes_back_in_time_but_not_beyond_the_history(qtbot, plotter, port):
    for _ in range(4):
        acquire(port, [1.0, 2.0], seconds=5.0)
        plotter.refresh()
    plotter.chart.pan_time(0.5)
    assert plotter.chart.window_s() == pytest.approx((-15.0, -5.0))
    plotter.chart.pan_time(5.0)
    assert plotter.chart.window_s() == pytest.approx((-20.0, -10.0))
    plotter.chart.pan_time(-9.0)
    assert plotter.chart.window_s() == pytest.approx((-10.0, 0.0))


def test_ctrl_and_the_wheel_zoom_the_values(plotter):
    before = plotter.ranges
    turn_wheel(plotter, 2, ctrl=True)
    for unit, now in plotter.ranges.items():
        width = before[unit].high - before[unit].low
        assert now.high - now.low == pytest.approx(width * 0.64)
    assert not plotter.chart.frozen


def test_cursors_report_values_and_what_is_between_them(qtbot, plotter, port):
    acquire(port, [0.5, 1.0], seconds=5.0)
    acquire(port, [2.5, 3.0], seconds=5.0)
    plotter.refresh()
    qtbot.mouseClick(plotter.bar.cursors, Qt.MouseButton.LeftButton)
    first, second = plotter.cursors.lines
    first.setValue(-7.0)
    second.setValue(-2.0)
    assert [float(text) for text in texts(plotter, 2)] == [10.0, 1.0]
    assert [float(text) for text in texts(plotter, 3)] == [50.0, 3.0]
    assert [float(text) for text in texts(plotter, 4)] == [40.0, 2.0]
    assert "B − A 5.000 s" in plotter.window_text.text()
    assert not plotter.channels.isColumnHidden(3)
    qtbot.mouseClick(plotter.bar.cursors, Qt.MouseButton.LeftButton)
    assert plotter.channels.isColumnHidden(3)


def test_a_cursor_outside_of_the_history_has_no_value(qtbot, plotter, port):
    acquire(port, [0.5, 1.0])
    plotter.refresh()
    plotter.bar.cursors.setChecked(True)
    plotter.cursors.lines[0].setValue(-30.0)
    assert texts(plotter, 2) == ["–", "–"]


def test_limits_are_lines_at_their_height(qtbot, plotter, port):
    port.change(limits=(Limited(LimitSettings(channel="force", low=-20.0, high=60.0)),))
    qtbot.waitUntil(lambda: len(plotter.limit_lines.lines) == 2)
    heights = [line.value() for line in plotter.limit_lines.lines]
    assert heights == pytest.approx([plotter.ranges["uN"].share(v) for v in (-20.0, 60.0)])
    drawn = list(plotter.limit_lines.lines)
    port.change(problem="something else has changed")
    qtbot.waitUntil(lambda: "something else" in plotter.problem.text())
    assert plotter.limit_lines.lines == drawn, "they were drawn anew for nothing"
    tick(plotter, 0, Qt.CheckState.Unchecked)
    assert plotter.limit_lines.lines == []


def test_a_crossed_limit_is_reported_with_value_and_reaction_and_can_be_reset(qtbot, plotter, port):
    limit = Limited(
        LimitSettings(channel="force", high=60.0, armed=True),
        crossed=True,
        value=61.25,
        reaction_ms=6.25,
    )
    port.change(limits=(limit,))
    qtbot.waitUntil(plotter.banner.isVisible)
    assert "61.25 µN" in plotter.banner.text.text()
    assert "6.2 ms" in plotter.banner.text.text()
    qtbot.mouseClick(plotter.banner.reset, Qt.MouseButton.LeftButton)
    assert port.calls == [("reset limit", "force")]
    qtbot.waitUntil(lambda: not plotter.banner.isVisible())


def test_a_reset_that_is_refused_says_why(qtbot, plotter, port):
    limit = LimitSettings(channel="force", high=60.0, armed=True)
    port.change(limits=(Limited(limit, crossed=True),))
    qtbot.waitUntil(plotter.banner.isVisible)
    port.refuse = "force still lies beyond its limit"
    qtbot.mouseClick(plotter.banner.reset, Qt.MouseButton.LeftButton)
    assert plotter.problem.text() == port.refuse


def test_lost_samples_are_counted_where_they_are_seen(plotter, port):
    plotter.read_out()
    assert plotter.lost.text() == "lost 0"
    port.counters = Counted(lost=1200)
    plotter.read_out()
    assert plotter.lost.text() == "lost 1200"
    assert plotter.lost.property("tone") == "alarm"


def test_a_window_that_hangs_keeps_ten_seconds_and_says_what_it_left_out(plotter, port):
    plotter.inbox.take()
    acquire(port, [0.0, 0.0], seconds=15.0)
    assert plotter.inbox.skipped == 5000
    plotter.read_out()
    assert "not shown 5000" in plotter.lost.text()


def test_what_another_station_passed_over_is_reported_as_not_shown(plotter, port):
    port.push(np.zeros((2, 50)))
    port.push(np.zeros((2, 50)), lost_before=150)
    port.next_sample = 0
    port.push(np.zeros((2, 50)))
    plotter.refresh()
    plotter.read_out()
    assert plotter.lost.text() == "lost 0, not shown 150"


def test_a_lost_board_is_reported(qtbot, plotter, port):
    port.change(problem="Dev1 is gone: check its cable", running=False)
    qtbot.waitUntil(lambda: "Dev1 is gone" in plotter.problem.text())


def test_other_channels_begin_a_new_image(qtbot, plotter, port):
    acquire(port, [1.0, 2.0])
    plotter.refresh()
    port.change(settings=settings(channel=(channel(5, name="torque", scale="Probe"),)))
    port.next_sample = 0
    acquire(port, [1.0], seconds=0.5)
    plotter.refresh()
    plotter.read_out()
    assert texts(plotter, 0) == ["torque"]
    assert [float(text) for text in texts(plotter, 1)] == [20.0]
    assert plotter.chart.now_view().end == 500


def test_another_colour_keeps_the_history(qtbot, plotter, port):
    acquire(port, [1.0, 2.0])
    plotter.refresh()
    given = port.settings
    changed = given.channel[1].model_copy(update={"colour": "#CC79A7"})
    port.change(settings=given.model_copy(update={"channel": (given.channel[0], changed)}))
    qtbot.waitUntil(lambda: "#CC79A7" in colours(plotter))
    assert plotter.chart.now_view().end == 1000


def test_acquisition_begun_anew_does_not_go_on_from_the_old_samples(plotter, port):
    acquire(port, [1.0, 2.0])
    plotter.refresh()
    port.next_sample = 0
    acquire(port, [1.0, 2.0], seconds=0.2)
    plotter.refresh()
    assert plotter.chart.now_view().end == 200
    assert len(plotter.chart.now_view().segments) == 1


@pytest.mark.parametrize("rate_hz", [10.0, 200.0, 15_000.0])
@pytest.mark.parametrize("span_s", [1.0, 60.0])
def test_any_rate_and_span_can_be_drawn(qtbot, tmp_path, rate_hz, span_s):
    port = FakePort(settings(rate_hz=rate_hz), tmp_path)
    plotter = shown(qtbot, port)
    plotter.chart.set_span(span_s)
    for _ in range(20):
        port.push(np.full((2, max(1, round(rate_hz * 0.1))), 1.0))
        plotter.refresh()
    assert "#56B4E9" in colours(plotter)


def test_a_refresh_paints_once(qtbot, tmp_path):
    port = FakePort(many(32), tmp_path)
    plotter = shown(qtbot, port)
    plotter._timer.stop()
    qtbot.waitUntil(lambda: plotter.chart.strip.paints > 0)
    acquire(port, [1.0] * 32, seconds=0.1)
    QApplication.processEvents()
    before = plotter.chart.strip.paints
    for _ in range(10):
        acquire(port, [1.0] * 32, seconds=0.05)
        plotter.refresh()
        QApplication.processEvents()
    assert plotter.chart.strip.paints - before <= 11


def test_the_refresh_rate_is_that_of_the_settings_but_not_more_than_the_screen_shows(plotter, port):
    assert plotter.refresh_hz == 20.0
    port.settings = settings(refresh_hz=300.0)
    assert plotter.refresh_hz == min(300.0, plotter.screen().refreshRate())


def test_the_image_follows_by_itself(qtbot, plotter, port):
    acquire(port, [1.0, 2.0])
    qtbot.waitUntil(lambda: "#56B4E9" in colours(plotter), timeout=2000)


def test_a_plot_that_nobody_sees_paints_nothing_and_has_all_when_it_is_seen(qtbot, plotter, port):
    plotter.hide()
    before = plotter.chart.raster.painted
    acquire(port, [0.5, 1.0])
    qtbot.wait(120)
    assert plotter.chart.raster.painted == before
    plotter.show()
    assert plotter.chart.now_view().end == 1000


def test_an_exception_while_painting_is_logged_once_and_harms_nobody(qtbot, plotter, caplog):
    plotter.chart.strip.raster = None
    for _ in range(3):
        plotter.chart.strip.update()
        plotter.chart.viewport().repaint()
    assert caplog.text.count("the strip chart cannot be painted") == 1


def test_both_themes_can_be_put_on_while_it_runs(qtbot, plotter, port, qapp):
    acquire(port, [1.0, 2.0])
    plotter.refresh()
    for name, ground in (("light", "#FFFFFF"), ("dark", "#121417")):
        apply_theme(qapp, name)
        qtbot.waitUntil(lambda ground=ground: ground in colours(plotter))


def test_a_plotter_that_goes_stops_listening(qtbot, port):
    made = UDaqPlotter(port)
    assert port.listened == 2
    made.deleteLater()
    qtbot.waitUntil(lambda: port.listened == 0)
    port.push(np.zeros((2, 10)))
    port.change(problem="gone")


def test_values_that_are_not_measured_any_more_are_grey_with_their_age(qtbot, port, plotter):
    acquire(port, [1.0, 2.0], 0.3)
    plotter.refresh()
    plotter.read_out()
    assert plotter.state.text() == "LIVE"
    port.change(running=False)
    plotter.read_out()
    model = plotter.channels.channels
    assert plotter.state.text().startswith("NOT MEASURED")
    assert model.data(model.index(0, 1), Qt.ItemDataRole.ForegroundRole) is not None
    assert model.headerData(1, Qt.Orientation.Horizontal).endswith("s ago")
    port.change(running=True)
    acquire(port, [1.0, 2.0], 0.3)
    plotter.refresh()
    plotter.read_out()
    assert plotter.state.text() == "LIVE"
    assert model.data(model.index(0, 1), Qt.ItemDataRole.ForegroundRole) is None


@pytest.mark.parametrize("height_px", [130, 170, 240, 500])
def test_the_numbers_of_a_low_chart_do_not_touch(plotter, qtbot, port, height_px):
    plotter.resize(900, height_px)
    qtbot.wait(100)
    chart = plotter.chart
    (unit,) = chart.axes.units[:1]
    chart.set_ranges({each: AxisRange(0.5, 4.0, 0.5) for each in chart.axes.units})
    axis = chart.axes.axis(unit)
    height = chart.box.height()
    ((_, values), *_) = axis.tickValues(0.5, 4.0, height)
    apart_px = np.diff(values) * height / 3.5
    assert (apart_px >= QFontMetricsF(axis.style["tickFont"]).height()).all()
