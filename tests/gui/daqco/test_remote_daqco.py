"""The widgets of DAQCo over a station: as at home, and never waiting for the line."""

from contextlib import ExitStack
from threading import Event

import pytest
from PySide6.QtWidgets import QDialogButtonBox

from contract.daqco_rig import connected, free_port, hosted, settings, used_locally, used_remotely
from cosmic.daqco.core.file_writer import UDaqFileWriter
from cosmic.daqco.gui.configure_dialog import UDaqConfigureDialog
from cosmic.daqco.gui.limit_dialog import LimitDialog
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.daqco.gui.station_export_dialog import StationExportDialog
from cosmic.frame.threads import declare_gui_thread

Button = QDialogButtonBox.StandardButton


class Seen:
    """A panel over a station, which can be taken off the line and put back."""

    def __init__(self, qtbot, home, main, served, endpoint):
        self.qtbot, self.home, self.main = qtbot, home, main
        self.served, self.endpoint = served, endpoint

    def down(self):
        self.served.close()

    def up(self):
        self.served.enter_context(hosted(self.home, self.endpoint))

    def wait(self, condition):
        self.qtbot.waitUntil(condition, timeout=10_000)


@pytest.fixture
def seen(qtbot, tmp_path, monkeypatch):
    # A machine that is busy with other tests falls silent for a moment now and then.
    monkeypatch.setattr("cosmic.daqco.api.limit_watch.SILENCE_LIMIT_S", 5.0)
    with ExitStack() as stack:
        home = stack.enter_context(used_locally(settings(tmp_path)))
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        served = stack.enter_context(ExitStack())
        served.enter_context(hosted(home, endpoint))
        transport = stack.enter_context(connected(endpoint))
        stack.callback(declare_gui_thread())
        remote = stack.enter_context(used_remotely(transport, initialize=False))
        main = make_daqco_gui(remote)
        qtbot.addWidget(main)
        main.resize(1000, 700)
        main.show()
        remote.initialize_later()
        made = Seen(qtbot, home, main, served, endpoint)
        made.wait(lambda: main.state.text() == "ACQUIRING")
        yield made
        main.close()


def curve(main):
    """Return how many samples are drawn, and the newest of the force."""
    view = main.plotter.chart.now_view()
    values = view.samples(max(0, view.end - 10), view.end)[1] if view.end else None
    return view.end, None if values is None or not values.size else float(values[0, -1])


def test_the_curve_of_another_station_is_drawn_as_it_comes(seen):
    main = seen.main
    seen.wait(lambda: curve(main)[1] is not None)
    assert curve(main)[1] == pytest.approx(10.0, abs=0.2)
    seen.home.knob.level_v = 2.0
    seen.wait(lambda: curve(main)[1] > 39.0)
    assert [trace.name for trace in main.plotter.chart.traces] == ["force", "channel1"]
    assert main.plotter.lost.text() == "lost 0"


def test_acquisition_is_started_stopped_and_configured_from_the_menus(seen):
    main = seen.main
    main.stop.trigger()
    seen.wait(lambda: main.state.text() == "STOPPED" and not seen.home.application.running)
    main.start.trigger()
    seen.wait(lambda: main.state.text() == "ACQUIRING" and seen.home.application.running)
    main.configure.trigger()
    dialog = main.findChild(UDaqConfigureDialog)
    dialog.rate.set_value(2000.0)
    dialog.button(Button.Ok).click()
    seen.wait(lambda: seen.home.application.rate_hz == 2000.0)
    seen.wait(lambda: "2000 Hz" in main.rate_text.text())


def test_a_limit_is_set_crossed_and_reset_and_a_refusal_is_reported(seen):
    main = seen.main
    main.edit_limit("force")
    dialog = main.findChild(LimitDialog)
    dialog.high.set_value(30.0)
    dialog.buttons.button(Button.Ok).click()
    seen.wait(lambda: "force" in seen.home.application.guard.limits)
    seen.home.knob.level_v = 2.0
    seen.wait(main.plotter.banner.isVisible)
    main.plotter.banner.reset.click()
    seen.wait(lambda: "still beyond" in main.plotter.problem.text())
    seen.home.knob.level_v = 0.5
    seen.wait(lambda: not seen.home.application.guard.limits["force"].beyond)
    main.plotter.banner.reset.click()
    seen.wait(lambda: not main.plotter.banner.isVisible())


def test_a_recording_is_made_on_the_disk_of_the_station(seen, tmp_path):
    files = seen.main.files
    seen.wait(lambda: files.directory.text() == str(tmp_path))
    assert not files.browse.isEnabled()
    assert "at the station fibres" in files.browse.toolTip()
    seen.wait(files.start.isEnabled)
    files.start.click()
    seen.wait(lambda: seen.home.application.recorder.state.active)
    seen.wait(files.stop.isEnabled)
    files.stop.click()
    seen.wait(lambda: not seen.home.application.recorder.state.active)
    seen.wait(files.start.isEnabled)
    assert len(list(tmp_path.glob("recording_*.h5"))) == 1
    _export(seen, tmp_path)
    files.directory.setText("/")
    seen.wait(lambda: "other stations may use" in files.room.text())
    assert not files.start.isEnabled()


def _export(seen, tmp_path):
    main = seen.main
    main.export.trigger()
    seen.wait(lambda: main.findChild(StationExportDialog) is not None)
    dialog = main.findChild(StationExportDialog)
    assert dialog.files.count() == 1
    dialog.buttons.button(Button.Ok).click()
    seen.wait(lambda: "done" in main.export_bar.text.text())
    assert len(list(tmp_path.glob("recording_*.csv"))) == 1


def test_a_station_that_goes_greys_the_panel_with_the_reason(seen):
    main = seen.main
    seen.down()
    seen.wait(lambda: main.state.text() == "AWAY")
    assert not main.plotter.isEnabled()
    assert not main.files.isEnabled()
    assert main.error.text()
    for action in (main.start, main.stop, main.configure, main.limits, main.start_recording):
        assert not action.isEnabled()
    seen.up()
    seen.wait(lambda: main.state.text() == "ACQUIRING")
    assert main.plotter.isEnabled()
    before = curve(main)[0]
    seen.wait(lambda: curve(main)[0] > before)


# --- at home ----------------------------------------------------------------------------------


def test_the_window_does_not_wait_for_a_slow_disk_to_close_the_file(qtbot, tmp_path, monkeypatch):
    closing, go_on = Event(), Event()
    join = UDaqFileWriter.join

    def slow_join(writer, timeout_s=5.0):
        closing.set()
        go_on.wait(10.0)
        return join(writer, timeout_s)

    monkeypatch.setattr(UDaqFileWriter, "join", slow_join)
    with used_locally(settings(tmp_path)) as home:
        main = make_daqco_gui(home.application)
        qtbot.addWidget(main)
        files = main.files
        qtbot.waitUntil(files.start.isEnabled)
        files.start.click()
        qtbot.waitUntil(files.stop.isEnabled)
        files.stop.click()
        qtbot.waitUntil(closing.is_set)
        files.refresh()
        assert not files.start.isEnabled()
        assert files.start.toolTip() == "The file is being closed"
        go_on.set()
        qtbot.waitUntil(files.start.isEnabled)
        assert not home.application.recorder.state.active
        main.close()


@pytest.mark.defects
def test_a_mistake_in_what_is_carried_out_aside_is_reported_and_shown(qtbot, tmp_path):
    results = []
    with used_locally(settings(tmp_path)) as home:
        home.application.carry_out(lambda: 1 / 0, lambda *how: results.append(how), slow=True)
        qtbot.waitUntil(lambda: bool(results))
        assert "ZeroDivisionError" in str(results[0][1])
        assert [each.defect for each in home.failures] == [True]
    home.application.carry_out(lambda: 1, lambda *how: results.append(how), slow=True)
    assert "closed" in str(results[1][1])
