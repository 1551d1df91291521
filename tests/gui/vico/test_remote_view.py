"""The widgets of ViCo over a camera of another station."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import QWidget

from contract.station_rig import connected, free_port
from contract.vico_rig import VicoRig, following, hosted, used_locally, vico_rig
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.theme import State
from cosmic.frame.network.application import RemoteApplication
from cosmic.frame.threads import declare_gui_thread
from cosmic.vico.api.vico import Vico
from cosmic.vico.gui.vico_gui import VicoGui, make_vico_gui

SIZE_PX = (320, 240)


@pytest.fixture(params=["station"])
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


def soon(qtbot, condition: Callable[[], object]) -> None:
    """Wait until `condition` holds, however busy the computer is."""
    qtbot.waitUntil(lambda: bool(condition()), timeout=30_000)


def ramp() -> np.ndarray:
    across = np.linspace(30, 220, SIZE_PX[0], dtype=np.uint8)
    return np.tile(across, (SIZE_PX[1], 1))


def made_gui(remote: RemoteApplication[Vico] | None, own: Callable[[QWidget], None]) -> VicoGui:
    assert remote is not None
    gui = make_vico_gui(remote)
    for widget in (*gui.cameras.values(), gui.lens):
        own(widget)
        widget.resize(900, 700)
        widget.show()
    return gui


def test_the_live_view_shows_the_images_of_another_station(qtbot, own, rig, window) -> None:
    view = made_gui(rig.remote, own).cameras["top"]
    assert view.windowTitle() == "From above"

    def shown() -> bool:
        rig.home.camera.keep_coming(ramp())
        return view.view.image is not None

    soon(qtbot, shown)
    assert np.array_equal(view.view.image.data, ramp())
    view.read_out()
    assert view.status.badge.state is State.OK
    assert view.recorder.record.isEnabled()
    assert not view.recorder.files.browse.isEnabled()
    assert "station" in view.recorder.files.browse.toolTip()


def test_what_is_set_in_the_window_is_set_there(qtbot, own, rig, window, tmp_path) -> None:
    gui = made_gui(rig.remote, own)
    view, thread = gui.cameras["top"], rig.home.application.unit("top").thread
    view.form.exposure.committed.emit(20.0)
    soon(qtbot, lambda: thread.settings.exposure_s == pytest.approx(0.02))
    view.row.live.click()
    soon(qtbot, lambda: not view.row.live.isChecked() and not thread.running)
    view.row.live.click()
    soon(qtbot, lambda: thread.running)
    soon(qtbot, lambda: view.recorder.record.isEnabled())
    view.recorder.record.click()
    recordings = rig.home.application.unit("top").recordings
    soon(qtbot, lambda: recordings.state.active)
    soon(qtbot, lambda: view.recorder.record.text() == "■ Stop")
    view.recorder.record.click()
    soon(qtbot, lambda: not recordings.state.active)
    gui.lens.light.committed.emit(33.0)
    soon(qtbot, lambda: rig.home.application.peripherals.state.light_percent == 33.0)


def test_a_movement_that_is_refused_is_reported_in_the_panel(qtbot, own, rig, window) -> None:
    lens = made_gui(rig.remote, own).lens
    soon(qtbot, lambda: lens.home.isEnabled())
    lens.home.click()
    soon(qtbot, lambda: "the right to move" in lens.tasks.text.text())
    lens.abort.click()


def test_the_panels_are_grey_while_the_station_is_away(qtbot, own, window, tmp_path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        home = stack.enter_context(used_locally(tmp_path, SIZE_PX))
        first = stack.enter_context(ExitStack())
        first.enter_context(hosted(home, endpoint))
        client = stack.enter_context(connected(endpoint))
        remote = stack.enter_context(following(client, FailurePolicy()))
        gui = made_gui(remote, own)
        view, lens = gui.cameras["top"], gui.lens

        def shown() -> bool:
            home.camera.keep_coming(ramp())
            return view.view.image is not None

        soon(qtbot, shown)
        soon(qtbot, lambda: lens.home.isEnabled())
        first.close()
        soon(qtbot, lambda: "fibres is away" in view.note.text)
        assert not view.recorder.record.isEnabled()
        assert not view.recorder.snap.isEnabled()
        assert "fibres is away" in view.recorder.snap.toolTip()
        soon(qtbot, lambda: not lens.home.isEnabled())
        assert "fibres is away" in lens.home.toolTip()
        stack.enter_context(hosted(home, endpoint))
        soon(qtbot, lambda: lens.home.isEnabled())

        def live() -> bool:
            home.camera.keep_coming(ramp())
            return not view.note.text and view.recorder.record.isEnabled()

        soon(qtbot, live)
