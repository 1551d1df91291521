"""The widgets of ViCo over a camera of another station."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QWidget

from contract.station_rig import connected, free_port
from contract.vico_rig import VicoRig, at_home, following, hosted, vico_rig
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.theme import State
from cosmic.frame.threads import declare_gui_thread
from cosmic.vico.api.remote_application import RemoteVicoApplication
from cosmic.vico.gui.vico_gui import VicoGui, make_vico_gui

SIZE_PX = (320, 240)


@pytest.fixture(params=["in-process", "zenoh"])
def rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[VicoRig]:
    with vico_rig(request.param, tmp_path, SIZE_PX) as made:
        yield made
    assert not made.home.failures


@pytest.fixture
def window() -> Iterator[None]:
    """Nothing may block this thread, as in a real window."""
    take_back = declare_gui_thread()
    yield
    take_back()


def ramp() -> np.ndarray:
    across = np.linspace(30, 220, SIZE_PX[0], dtype=np.uint8)
    return np.tile(across, (SIZE_PX[1], 1))


def made_gui(remote: RemoteVicoApplication | None, own: Callable[[QWidget], None]) -> VicoGui:
    assert remote is not None
    gui = make_vico_gui(remote)
    for widget in (*gui.cameras.values(), gui.lens):
        own(widget)
        widget.resize(900, 700)
        widget.show()
    return gui


def test_the_live_view_shows_the_pictures_of_another_station(qtbot, own, rig, window) -> None:
    view = made_gui(rig.remote, own).cameras["top"]
    assert view.windowTitle() == "From above"

    def shown() -> bool:
        rig.home.camera.push(ramp())
        return view.view.picture is not None

    qtbot.waitUntil(shown)
    assert np.array_equal(view.view.picture.data, ramp())
    view.read_out()
    assert view.status.badge.state is State.OK
    assert view.recorder.record.isEnabled()
    assert not view.recorder.files.browse.isEnabled()
    assert "station" in view.recorder.files.browse.toolTip()


def test_what_is_set_in_the_window_is_set_there(qtbot, own, rig, window, tmp_path) -> None:
    gui = made_gui(rig.remote, own)
    view, thread = gui.cameras["top"], rig.home.application.unit("top").thread
    view.form.exposure.committed.emit(20.0)
    qtbot.waitUntil(lambda: thread.settings.exposure_s == pytest.approx(0.02))
    view.row.live.click()
    qtbot.waitUntil(lambda: not view.row.live.isChecked() and not thread.running)
    view.row.live.click()
    qtbot.waitUntil(lambda: thread.running)
    qtbot.waitUntil(lambda: view.recorder.record.isEnabled())
    view.recorder.record.click()
    recordings = rig.home.application.unit("top").recordings
    qtbot.waitUntil(lambda: recordings.state.active)
    qtbot.waitUntil(lambda: view.recorder.record.text() == "■ Stop")
    view.recorder.record.click()
    qtbot.waitUntil(lambda: not recordings.state.active)
    gui.lens.light.committed.emit(33.0)
    qtbot.waitUntil(lambda: rig.home.application.peripherals.state.light_percent == 33.0)


def test_a_movement_that_is_refused_is_told_in_the_panel(qtbot, own, rig, window) -> None:
    lens = made_gui(rig.remote, own).lens
    qtbot.waitUntil(lambda: lens.home.isEnabled())
    lens.home.click()
    qtbot.waitUntil(lambda: "the right to move" in lens.tasks.text.text())
    lens.abort.click()


def test_the_panels_are_grey_while_the_station_is_away(qtbot, own, window, tmp_path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        home = stack.enter_context(at_home(tmp_path, SIZE_PX))
        first = stack.enter_context(ExitStack())
        first.enter_context(hosted(home, endpoint))
        client = stack.enter_context(connected(endpoint))
        remote = stack.enter_context(following(client, FailurePolicy()))
        gui = made_gui(remote, own)
        view, lens = gui.cameras["top"], gui.lens

        def shown() -> bool:
            home.camera.push(ramp())
            return view.view.picture is not None

        qtbot.waitUntil(shown)
        qtbot.waitUntil(lambda: lens.home.isEnabled())
        first.close()
        qtbot.waitUntil(lambda: "fibres is away" in view.note.text)
        assert not view.recorder.record.isEnabled()
        assert not view.recorder.snap.isEnabled()
        assert "fibres is away" in view.recorder.snap.toolTip()
        qtbot.waitUntil(lambda: not lens.home.isEnabled())
        assert "fibres is away" in lens.home.toolTip()
        stack.enter_context(hosted(home, endpoint))
        qtbot.waitUntil(lambda: lens.home.isEnabled(), timeout=10_000)

        def live() -> bool:
            home.camera.push(ramp())
            return not view.note.text and view.recorder.record.isEnabled()

        qtbot.waitUntil(live, timeout=10_000)
