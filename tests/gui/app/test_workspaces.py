"""The window by task: what each workspace shows at each size, and that nothing is cut off."""

import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime
from functools import partial
from itertools import combinations
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QRect, QSettings, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractScrollArea,
    QApplication,
    QComboBox,
    QDialogButtonBox,
    QDockWidget,
    QLabel,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QWidget,
)
from pytestqt.qtbot import QtBot

from cosmic.app.panels.tool import ToolPanel
from cosmic.app.windows.central_view import CentralView
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.app.windows.tasks import HANDLE, LOOK, MEASURE, SET_UP, TaskLayout
from cosmic.autonomy.coordinate_transform import PlatformTransform
from cosmic.daqco.gui.channel_list import ChannelList
from cosmic.daqco.gui.limit_dialog import LimitDialog
from cosmic.daqco.gui.limit_indicator import LimitIndicator
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.stop_button import StopButton
from cosmic.frame.gui.tab_bars import is_in_front
from cosmic.mico.core.sequence.report import StepState
from cosmic.mico.gui.initialisation_panel import InitialisationPanel
from cosmic.vico.api.vico import vico_of
from cosmic.vico.core.calibration import Plane
from cosmic.vico.core.calibration_fit import Sighting, fit_map
from cosmic.vico.gui.record_bar import RecordBar
from cosmic.vico.hw.peripherals import LensAxis
from gui.app.windows import Make, mico
from gui.mico.panels import part, position

SIZES = {
    "1024x600": (1024, 600),
    "1366x768": (1366, 768),
    "1920x1080 at 150 %": (1280, 720),
    "1920x1080": (1920, 1080),
}
SLOW = 2.0
"""A rate where little moves: at 20 the cameras keep a core busy with 600 images a second."""
WITH_PICTURE = (LOOK, HANDLE, MEASURE)
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def own(make: Make, qtbot: QtBot) -> OperatorWindow:
    """A window of all applications whose first image is there."""
    window = make(applications=("mico", "daqco", "vico"), rate=SLOW)
    with_image(window, qtbot)
    return window


@pytest.fixture
def whole(shared_window: OperatorWindow, qtbot: QtBot) -> OperatorWindow:
    """Such a window that other tests use too; what a test reads in it, it sets before."""
    shared_window.activateWindow()
    qtbot.waitUntil(shared_window.isActiveWindow)
    with_image(shared_window, qtbot)
    return shared_window


def with_image(window: OperatorWindow, qtbot: QtBot) -> None:
    """Wait for the first image; a camera that nobody sees draws none."""
    choose(window, qtbot, LOOK)
    qtbot.waitUntil(lambda: tasks(window).central_view.camera.view.image is not None)


def tasks(window: OperatorWindow) -> TaskLayout:
    assert window.tasks is not None
    return window.tasks


def choose(window: OperatorWindow, qtbot: QtBot, name: str) -> None:
    """Show a workspace as a click on its button does, and let it settle."""
    buttons = window.top_bar.workspaces
    assert buttons is not None
    qtbot.mouseClick(buttons.buttons[name], LEFT)
    assert window.workspaces is not None
    assert window.workspaces.current == name
    qtbot.wait(60)


def seen(window: QWidget) -> Iterator[QWidget]:
    """Yield the widgets that are shown, of panels in front."""
    for each in window.findChildren(QWidget):
        if each.isVisible() and each.window() is window and each.width() > 0:
            yield each


def clipped(window: QWidget) -> list[str]:
    """Return the widgets that are cut off, or have less room than their text needs."""
    found: list[str] = []
    kinds = (QAbstractButton, QLineEdit, QComboBox, QLabel)
    for each in seen(window):
        if not isinstance(each, kinds) or each.visibleRegion().isEmpty():
            continue
        name = f"{type(each).__name__} {each.objectName()} {getattr(each, 'text', str)()!r}"
        held = each.parentWidget()
        while held is not None and held is not window:
            if isinstance(held, QAbstractScrollArea) and not isinstance(held, QScrollArea):
                break  # a list of many lines scrolls by itself
            inside = held.rect().contains(QRect(each.mapTo(held, QPoint(0, 0)), each.size()))
            if not inside:
                found.append(f"{name} is cut off by {type(held).__name__} {held.objectName()}")
                break
            held = held.parentWidget()
        if isinstance(each, QAbstractButton) and each.text():
            needed = each.fontMetrics().horizontalAdvance(each.text().replace("&", ""))
            if each.width() < needed:
                found.append(f"{name} is {each.width()} wide and needs {needed}")
        if isinstance(each, QLabel) and not isinstance(each, ElidedLabel) and not each.wordWrap():
            needed = each.fontMetrics().horizontalAdvance(each.text())
            if each.width() + 1 < needed:
                found.append(f"{name} is {each.width()} wide and needs {needed}")
    return found


def overlapping(window: QWidget) -> list[str]:
    """Return pairs of widgets of one layout that lie over each other."""
    found: list[str] = []
    for parent in seen(window):
        if isinstance(parent, CentralView) or parent.layout() is None:
            continue
        layout = parent.layout()
        items = [layout.itemAt(row).widget() for row in range(layout.count())]
        shown = [each for each in items if each is not None and each.isVisible()]
        for one, other in combinations(shown, 2):
            if one.geometry().intersects(other.geometry()):
                found.append(f"{one.objectName() or one} over {other.objectName() or other}")
    return found


def scrolled(window: QWidget) -> list[str]:
    """Return the panels that do not fit into their place."""
    return [
        f"{area.widget().objectName() or type(area.widget()).__name__}: "
        f"{area.horizontalScrollBar().maximum()}, {area.verticalScrollBar().maximum()}"
        for area in window.findChildren(QScrollArea, "dockScroll")
        if area.isVisible()
        and not area.visibleRegion().isEmpty()
        and (area.horizontalScrollBar().maximum() or area.verticalScrollBar().maximum())
    ]


def all_of(looks: Iterable[Callable[[QWidget], list[str]]], window: QWidget) -> list[str]:
    return [found for look in looks for found in look(window)]


def settled(qtbot: QtBot, look: Callable[[], list[str]]) -> list[str]:
    """Return what is wrong once the layout has settled: on a busy computer that takes a while."""
    for _ in range(30):
        found = look()
        qtbot.wait(100)
        if not found:
            found = look()  # a text that came late makes a panel scroll a moment later
            if not found:
                return []
    return found


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
@pytest.mark.parametrize("theme", ["dark", pytest.param("light", marks=pytest.mark.slow)])
def test_the_picture_has_most_of_the_window_and_nothing_is_cut_off(
    make: Make, qtbot: QtBot, size: tuple[int, int], theme: str
) -> None:
    window = make(applications=("mico", "daqco", "vico"), rate=SLOW, size=size)
    with_image(window, qtbot)
    window.set_theme(theme)
    assert window.workspaces is not None
    for name in [each.name for each in window.workspaces.all]:
        choose(window, qtbot, name)
        if name == LOOK:  # its longest text, which comes a moment later
            words = part(window.findChild(QWidget, "coach"), "coachWords", QLabel)
            qtbot.waitUntil(lambda words=words: "needs a calibration" in words.text())
        assert (window.width(), window.height()) == size, name
        looks = [clipped, overlapping]
        if name in (*WITH_PICTURE, SET_UP):
            looks.append(scrolled)
        # All at once, for each waits until the layout has settled.
        assert settled(qtbot, partial(all_of, looks, window)) == [], name
        if name in WITH_PICTURE:
            drawn = tasks(window).central_view.picture_rect()
            share = drawn.width() * drawn.height() / (size[0] * size[1])
            assert share >= 0.45, f"{name}: {share:.1%}"
        stop = window.top_bar.findChild(StopButton)
        place = QRect(stop.mapTo(window, QPoint(0, 0)), stop.size())
        assert window.rect().contains(place)


def test_initialise_homes_the_lens_and_lights_a_lamp_that_is_off(make: Make, qtbot: QtBot) -> None:
    window = make(applications=("mico", "daqco", "vico"), cold=True)
    with_image(window, qtbot)
    vico = window.platform.vico
    assert vico is not None
    lens, lamp = vico_of(vico).lens, vico_of(vico).light
    assert lens is not None
    assert lamp is not None
    lamp.set_percent(0.0).wait(10.0)
    zoom = lens.state(LensAxis.ZOOM)
    assert zoom is not None
    assert not zoom.homed
    mico(window).initialisation_begun.emit()
    qtbot.waitUntil(lambda: lamp.percent == 50.0)

    def homed() -> bool:
        states = [lens.state(axis) for axis in LensAxis]
        return all(each is not None and each.homed for each in states)

    qtbot.waitUntil(homed, timeout=15_000)
    assert "the lens is homed" in window.drawer.line.text()


def test_the_force_is_shown_with_its_limit_and_greyed_when_it_is_not_measured(
    own: OperatorWindow, qtbot: QtBot
) -> None:
    choose(own, qtbot, MEASURE)
    force = tasks(own).force
    assert force is not None
    qtbot.waitUntil(lambda: "ARMED ±150" in force.limit.text() and "to go" in force.limit.text())
    assert force.value.isEnabled()
    application = own.platform.daqco
    assert application is not None
    application.stop_acquisition()
    qtbot.waitUntil(lambda: not force.value.isEnabled())
    assert "not measured" in force.title.text()


def shown(window: OperatorWindow) -> set[str]:
    """Return the panels that have a place in the window and are not hidden."""
    docks = window.findChildren(QDockWidget)
    return {each.windowTitle() for each in docks if each.isVisible()}


def test_a_wide_panel_gets_room_while_it_is_in_front(own: OperatorWindow, qtbot: QtBot) -> None:
    own.resize(*SIZES["1366x768"])
    own.workspaces.choose(HANDLE)
    tool, wide = own.dock("Tool"), own.dock("Trajectories")
    qtbot.waitUntil(lambda: tool.isVisible() and own.width() == 1366)
    qtbot.waitUntil(lambda: tool.width() == round(0.165 * 1366))
    before_px = tool.width()
    own.raise_panel("Trajectories")
    qtbot.waitUntil(lambda: wide.width() > before_px)
    (scrolled,) = [each for each in wide.findChildren(QScrollArea) if each.isVisible()][:1]
    qtbot.waitUntil(lambda: not scrolled.horizontalScrollBar().isVisible())
    own.raise_panel("Tool")
    qtbot.waitUntil(lambda: abs(tool.width() - before_px) < 10)


@pytest.mark.parametrize("size", list(SIZES.values())[:2], ids=list(SIZES)[:2])
def test_no_panel_that_comes_to_the_front_scrolls_sideways(
    own: OperatorWindow, qtbot: QtBot, size: tuple[int, int]
) -> None:
    own.resize(*size)
    assert own.workspaces is not None
    for workspace in (each for each in own.workspaces.all if each.middle):
        choose(own, qtbot, workspace.name)
        for title in [each.title for each in workspace.placements]:
            own.raise_panel(title)
            assert settled(qtbot, partial(sideways, own)) == [], title


def test_the_fields_of_a_file_fit_into_a_narrow_column(own: OperatorWindow, qtbot: QtBot) -> None:
    own.resize(*SIZES["1024x600"])
    choose(own, qtbot, LOOK)
    recorder = tasks(own).central_view.camera.recorder
    qtbot.mouseClick(recorder.more, LEFT)
    qtbot.waitUntil(recorder.files.base.isVisible)
    assert settled(qtbot, partial(sideways, own)) == []
    assert recorder.files.directory.width() > 60


def sideways(window: QWidget) -> list[str]:
    """Return the panels that are wider than their place."""
    areas = window.findChildren(QScrollArea)
    return [
        f"{area.widget().objectName() or type(area.widget()).__name__} by {beyond} px"
        for area in areas
        if not area.visibleRegion().isEmpty() and (beyond := area.horizontalScrollBar().maximum())
    ]


def test_a_layout_kept_in_a_larger_window_comes_back_in_a_smaller_one(
    own: OperatorWindow, qtbot: QtBot
) -> None:
    own.resize(*SIZES["1366x768"])
    choose(own, qtbot, HANDLE)
    own.raise_panel("Recorder")
    choose(own, qtbot, LOOK)
    own.raise_panel("Camera")
    qtbot.waitUntil(own.dock("Camera").isVisible)
    small = SIZES["1024x600"]
    own.resize(*small)
    qtbot.waitUntil(lambda: (own.width(), own.height()) == small)
    for name in (HANDLE, LOOK, HANDLE):
        choose(own, qtbot, name)
        qtbot.wait(100)
        assert (own.width(), own.height()) == small, name


def test_a_panel_from_the_view_menu_comes_in_front(own: OperatorWindow, qtbot: QtBot) -> None:
    choose(own, qtbot, LOOK)
    lens = own.dock("Lens and light")
    lens.toggleViewAction().trigger()
    qtbot.waitUntil(own.dock("Camera").isVisible)
    qtbot.wait(300)
    lens.toggleViewAction().trigger()
    qtbot.wait(300)  # in the first moment it is where it was, whoever is in front
    assert not lens.visibleRegion().isEmpty()


def test_a_workspace_comes_back_with_the_panel_that_was_in_front(
    own: OperatorWindow, qtbot: QtBot
) -> None:
    choose(own, qtbot, SET_UP)
    own.raise_panel("First day")
    day, axes = own.dock("First day"), own.dock("Axes")
    qtbot.waitUntil(lambda: is_in_front(own, day))
    choose(own, qtbot, HANDLE)
    choose(own, qtbot, SET_UP)
    assert is_in_front(own, day)
    assert not is_in_front(own, axes)
    own.reset_layout()
    qtbot.waitUntil(lambda: is_in_front(own, axes))


def test_a_narrow_bar_on_the_image_leaves_out_before_it_cuts(
    own: OperatorWindow, qtbot: QtBot
) -> None:
    own.resize(*SIZES["1024x600"])
    choose(own, qtbot, HANDLE)
    bar = own.findChild(QWidget, "imageBar")
    assert bar is not None
    light = next(each for each in bar.findChildren(QWidget) if each.accessibleName() == "Light")
    qtbot.waitUntil(light.isVisible)
    own.raise_panel("Recorder")
    qtbot.waitUntil(lambda: not light.isVisible())
    assert settled(qtbot, partial(clipped, bar)) == []
    own.raise_panel("Tool")
    qtbot.waitUntil(light.isVisible)


def test_columns_keep_their_share_when_the_window_changes_its_size(
    own: OperatorWindow, qtbot: QtBot
) -> None:
    choose(own, qtbot, SET_UP)
    for size in ((1366, 768), (1920, 1080), (1024, 600)):
        own.resize(*size)
        coach = own.dock("Next step")
        qtbot.waitUntil(lambda coach=coach, size=size: coach.width() < 0.25 * size[0])
    own.resize(1366, 768)
    choose(own, qtbot, HANDLE)
    own.raise_panel("Trajectories")
    wide = own.dock("Trajectories")
    qtbot.waitUntil(lambda: wide.width() > 350)
    own.resize(1380, 768)
    qtbot.wait(200)
    assert wide.width() > 350
    choose(own, qtbot, LOOK)
    choose(own, qtbot, HANDLE)
    qtbot.waitUntil(lambda: wide.width() > 350)


@pytest.mark.parametrize("named", [True, False])
def test_a_reset_lasts_and_a_layout_as_at_the_start_can_be_kept(
    make: Make, qtbot: QtBot, stored: QSettings, named: bool
) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    spaces = window.workspaces
    assert spaces is not None
    if named:
        spaces.save_as("mine")
    assert spaces.layouts == (("usual", "mine") if named else ("usual",))
    choose(window, qtbot, HANDLE)
    usual = shown(window)
    window.dock("Next step").hide()
    spaces.save()
    window.reset_layout()
    window.close()
    again = make(applications=("mico", "daqco", "vico"), hardware=False)
    choose(again, qtbot, HANDLE)
    assert shown(again) == usual


def test_the_tab_key_goes_to_what_is_in_sight(own: OperatorWindow, qtbot: QtBot) -> None:
    choose(own, qtbot, SET_UP)
    own.activateWindow()
    qtbot.waitUntil(own.isActiveWindow)
    own.setFocus()
    met = set()
    for _ in range(60):
        qtbot.keyClick(QApplication.focusWidget() or own, Qt.Key.Key_Tab)
        now = QApplication.focusWidget()
        assert now is not None
        dock = holder_of(now)
        assert dock is None or not dock.visibleRegion().isEmpty(), now.objectName()
        met.add(now)
    assert len(met) > 30, "it goes round among a few"
    own.raise_panel("Force channels")
    dock = own.dock("Force channels")
    qtbot.waitUntil(lambda: not dock.visibleRegion().isEmpty())
    channels = dock.findChild(ChannelList)
    assert channels is not None
    channels.setFocus()
    qtbot.keyClick(channels, Qt.Key.Key_Tab)
    assert not channels.hasFocus()


def holder_of(widget: QWidget | None) -> QDockWidget | None:
    while widget is not None and not isinstance(widget, QDockWidget):
        widget = widget.parentWidget()
    return widget


@pytest.mark.parametrize(("space", "title"), [(HANDLE, "Tool"), (LOOK, "Next step")])
def test_a_panel_that_floats_is_whole_and_says_its_name(
    own: OperatorWindow, qtbot: QtBot, space: str, title: str
) -> None:
    own.resize(*SIZES["1366x768"])
    choose(own, qtbot, space)
    dock = own.dock(title)
    dock.setFloating(True)

    def cut() -> list[str]:
        name = next(each for each in dock.findChildren(QLabel) if each.text() == title)
        needed = name.fontMetrics().horizontalAdvance(title)
        return [*sideways(dock), *([] if name.width() >= needed else [f"{name.width()} {needed}"])]

    assert settled(qtbot, cut) == []
    dock.setFloating(False)


def test_the_step_of_the_table_is_in_degrees(own: OperatorWindow, qtbot: QtBot) -> None:
    choose(own, qtbot, HANDLE)
    tool = tasks(own).tool
    qtbot.mouseClick(tool.choices["table"], LEFT)
    assert tool.step.unit == "deg"
    assert "°" in tool.step.toolTip()
    qtbot.mouseClick(tool.choices["left"], LEFT)
    assert tool.step.unit == "um"


def test_a_layout_is_kept_by_name_and_reset(make: Make, qtbot: QtBot, stored: QSettings) -> None:
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    spaces = window.workspaces
    assert spaces is not None
    choose(window, qtbot, HANDLE)
    usual = shown(window)
    window.dock("Next step").hide()
    spaces.save_as("mine")
    window.reset_layout()
    assert shown(window) == usual
    spaces.use("mine")
    assert shown(window) == usual - {"Next step"}
    window.close()
    again = make(applications=("mico", "daqco", "vico"), hardware=False)
    assert again.workspaces is not None
    assert again.workspaces.layout_name == "mine"
    assert again.workspaces.current == HANDLE
    assert shown(again) == usual - {"Next step"}


class Actions:
    """Counts what a hand does."""

    def __init__(self, qtbot: QtBot) -> None:
        self.count = 0
        self._qtbot = qtbot

    def click(self, widget: QWidget) -> None:
        self.count += 1
        assert widget.isVisible()
        assert widget.isEnabled()
        self._qtbot.mouseClick(widget, LEFT)

    def enter(self, field: QLineEdit, text: str) -> None:
        self.count += 1
        assert field.isVisible()
        field.setFocus()  # else the letters are keys that jog
        field.selectAll()
        self._qtbot.keyClicks(field, text)


def test_a_named_recording_takes_three_actions_and_its_slope_is_read_with_two_more(
    own: OperatorWindow, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks(own).folder, "_folder", tmp_path)
    monkeypatch.setattr(tasks(own).folder, "home", tmp_path)
    buttons = own.top_bar.workspaces
    force = tasks(own).force
    assert buttons is not None
    assert force is not None
    hand = Actions(qtbot)
    hand.click(buttons.buttons[MEASURE])
    qtbot.waitUntil(force.record.isEnabled)
    hand.enter(force.name, "soft pulp")
    hand.click(force.record)
    assert hand.count <= 3
    daqco = own.platform.daqco
    assert daqco is not None
    qtbot.waitUntil(lambda: daqco.recorder.state.active and daqco.recorder.state.duration_s > 0.5)
    qtbot.mouseClick(force.record, LEFT)
    qtbot.waitUntil(lambda: not daqco.recorder.state.active)
    qtbot.waitUntil(lambda: "written" in force.message.text())

    hand = Actions(qtbot)
    hand.click(buttons.buttons["Results"])
    results = tasks(own).results
    found = results.sessions.list
    qtbot.waitUntil(lambda: results.sessions.row_of("soft pulp") is not None)
    item = results.sessions.row_of("soft pulp")
    assert item is not None
    hand.count += 1
    qtbot.mouseClick(found.viewport(), LEFT, pos=found.visualItemRect(item).center())
    assert hand.count <= 6
    qtbot.waitUntil(lambda: "slope" in results.viewer.slope.text())


def test_the_log_lies_beside_what_was_recorded(
    own: OperatorWindow, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks(own).folder, "_folder", tmp_path)
    monkeypatch.setattr(tasks(own).folder, "home", tmp_path)
    choose(own, qtbot, MEASURE)
    force = tasks(own).force
    assert force is not None
    qtbot.waitUntil(force.record.isEnabled)
    qtbot.mouseClick(force.record, LEFT)
    qtbot.waitUntil(lambda: force.record.isChecked())
    daqco = own.platform.daqco
    assert daqco is not None
    qtbot.waitUntil(lambda: daqco.recorder.state.duration_s > 0.5)
    qtbot.mouseClick(force.record, LEFT)
    qtbot.waitUntil(lambda: "written" in force.message.text())
    choose(own, qtbot, "Results")
    results = tasks(own).results
    qtbot.waitUntil(lambda: results.sessions.row_of("push") is not None)
    item = results.sessions.row_of("push")
    assert item is not None
    place = results.sessions.list.visualItemRect(item).center()
    qtbot.mouseClick(results.sessions.list.viewport(), LEFT, pos=place)
    qtbot.waitUntil(lambda: results.viewer.pictures.scene is not None)
    assert (tmp_path / "log.tsv").read_text().startswith("time_s\tutc")


def test_images_lie_beside_what_was_recorded(
    make: Make, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    window = make(applications=("mico", "vico"), rate=SLOW)
    layout = tasks(window)
    choose(window, qtbot, LOOK)
    (recorder,) = (each for each in window.findChildren(RecordBar) if each.isVisible())
    qtbot.waitUntil(recorder.snap.isEnabled, timeout=15_000)
    qtbot.waitUntil(lambda: "disk lasts" in recorder.message.text())
    assert not layout.folder.path.exists(), "before anything is written"
    qtbot.mouseClick(recorder.snap, LEFT)
    qtbot.waitUntil(lambda: any(layout.folder.path.glob("*.png")), timeout=15_000)
    (image,) = layout.folder.path.glob("*.png")
    choose(window, qtbot, "Results")
    qtbot.waitUntil(lambda: layout.results.sessions.row_of(image.stem) is not None)


def test_images_go_where_the_platform_file_says(make: Make, qtbot: QtBot, tmp_path: Path) -> None:
    config = tmp_path / "config"
    shutil.copytree(shipped_config_dir(), config)
    file = config / "platform.toml"
    text = file.read_text(encoding="utf-8")
    named = text.replace('[vico]\ndirectory = ""', f'[vico]\ndirectory = "{tmp_path}"')
    assert named != text
    file.write_text(named, encoding="utf-8")
    window = make(applications=("mico", "vico"), rate=SLOW, config=config)
    recorder = window.findChild(RecordBar)
    assert recorder is not None
    assert recorder.files.folder == tmp_path


def test_a_force_limit_is_set_by_three_actions(own: OperatorWindow, qtbot: QtBot) -> None:
    choose(own, qtbot, MEASURE)
    force = tasks(own).force
    assert force is not None
    hand = Actions(qtbot)
    hand.click(force.arm)
    dialog = force.findChild(LimitDialog)
    assert dialog is not None
    hand.enter(dialog.high, "90")
    hand.click(dialog.buttons.button(QDialogButtonBox.StandardButton.Ok))
    assert hand.count <= 3
    qtbot.waitUntil(lambda: "-150 to 90" in force.limit.text())
    qtbot.waitUntil(lambda: "/90 ARMED" in own.top_bar.findChild(LimitIndicator).text())


def test_a_change_of_theme_reaches_what_is_shown_and_what_is_shown_later(
    own: OperatorWindow, qtbot: QtBot
) -> None:
    choose(own, qtbot, MEASURE)
    own.set_theme("light")
    qtbot.wait(50)
    ground = own.grab().toImage().pixelColor(own.width() - 30, own.height() - 60)
    assert ground.lightness() > 200
    own.set_theme("dark")
    for name in (SET_UP, "Results", MEASURE):
        choose(own, qtbot, name)
        image = own.grab().toImage()
        shades = [
            image.pixelColor(x, y).lightness()
            for x in range(4, own.width(), 40)
            for y in range(70, own.height(), 40)
        ]
        assert sum(shade > 200 for shade in shades) < 0.05 * len(shades), name


# Over one window, which is there from here on. What starts a thread of the window for good needs
# one of its own: such a thread would be left behind.


def test_all_eleven_axes_are_seen_at_once_in_set_up(
    whole: OperatorWindow, qtbot: QtBot, request: pytest.FixtureRequest
) -> None:
    request.addfinalizer(partial(whole.resize, whole.size()))
    whole.resize(1366, 768)
    choose(whole, qtbot, SET_UP)
    assert (whole.width(), whole.height()) == (1366, 768)
    rows = mico(whole).table.rows
    assert len(rows) == 11
    for row in rows.values():
        for cell in row.cells:
            if cell.isVisible():
                assert cell.visibleRegion().boundingRect() == cell.rect(), row.name.text()


def test_a_change_of_theme_costs_much_less_than_all_rules_looked_for_again(
    whole: OperatorWindow, qtbot: QtBot, qapp: QApplication
) -> None:
    choose(whole, qtbot, MEASURE)

    def cost_s(change: Callable[[], object]) -> float:
        begun = time.thread_time()
        change()
        return time.thread_time() - begun

    fast = min(cost_s(partial(whole.set_theme, name)) for name in ("light", "dark"))
    slow = cost_s(lambda: qapp.setStyleSheet(qapp.styleSheet()))
    assert fast < 0.6 * slow


def test_a_row_moves_its_axis_through_the_gate(whole: OperatorWindow, qtbot: QtBot) -> None:
    choose(whole, qtbot, SET_UP)
    row = mico(whole).table.rows["left.x"]
    qtbot.waitUntil(row.forward.isEnabled)
    qtbot.mouseClick(row.forward, LEFT)
    qtbot.waitUntil(lambda: abs(position(row.card) - 100.0) < 1.0)
    row.target.setText("9 mm")
    qtbot.mouseClick(row.go_to, LEFT)
    qtbot.waitUntil(lambda: "9" in row.target.reason)
    qtbot.waitUntil(lambda: "REFUSED" in row.line.text())


def test_a_pose_is_kept_by_a_name_and_offered_with_a_picture(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, HANDLE)
    tool = tasks(whole).tool
    qtbot.waitUntil(lambda: mico(whole).cards["left.x"].axis.details.present)
    qtbot.mouseClick(tool.keep, LEFT)
    tool.pose_name.setText("before the probe")
    qtbot.keyClick(tool.pose_name, Qt.Key.Key_Return)
    assert tool.poses.currentText() == "before the probe"
    tool.poses.showPopup()
    assert not tool.poses.itemIcon(0).isNull()
    assert tool.poses.view().iconSize().width() > 0
    qtbot.keyClick(tool.poses.view(), Qt.Key.Key_Escape)
    assert tool.poses.iconSize().width() == 0, "beside the name there is no room for a picture"


def test_a_pose_is_replaced_on_the_second_word_only(whole: OperatorWindow, qtbot: QtBot) -> None:
    choose(whole, qtbot, HANDLE)
    tool, poses = tasks(whole).tool, mico(whole).mico.poses
    qtbot.waitUntil(lambda: mico(whole).cards["left.x"].axis.details.present)
    poses.teach("twice", ["right.x"])
    qtbot.mouseClick(tool.keep, LEFT)
    tool.pose_name.setText("twice")
    qtbot.keyClick(tool.pose_name, Qt.Key.Key_Return)
    assert "There is a pose twice already" in tool.line.text()
    assert list(poses["twice"].positions) == ["right.x"]
    qtbot.keyClick(tool.pose_name, Qt.Key.Key_Return)
    assert list(poses["twice"].positions) == ["left.x", "left.y", "left.z"]
    assert not tool.pose_name.isVisible()
    poses.remove("twice")


def test_a_name_in_a_message_is_shown_as_it_was_typed(whole: OperatorWindow, qtbot: QtBot) -> None:
    choose(whole, qtbot, HANDLE)
    tool = tasks(whole).tool
    qtbot.mouseClick(tool.keep, LEFT)
    tool.pose_name.setText("<b>x</b>")
    qtbot.keyClick(tool.pose_name, Qt.Key.Key_Return)
    assert "<b>x</b>" in tool.line.text()
    assert tool.line.textFormat() == Qt.TextFormat.PlainText
    qtbot.mouseClick(tool.keep, LEFT)


def test_one_key_swaps_image_and_scene(whole: OperatorWindow, qtbot: QtBot) -> None:
    choose(whole, qtbot, HANDLE)
    central_view = tasks(whole).central_view
    before = central_view.camera.geometry()
    qtbot.keyClick(whole, Qt.Key.Key_F6)
    assert central_view.large == "Scene"
    assert central_view.camera.width() < before.width() / 2
    qtbot.keyClick(whole, Qt.Key.Key_F6)
    assert central_view.large == "Microscope"
    assert central_view.camera.geometry() == before


def test_the_drawer_opens_over_the_picture_and_escape_closes_it(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, MEASURE)
    before = tasks(whole).central_view.picture_rect()
    whole.raise_panel("Log")
    QApplication.processEvents()
    assert whole.drawer.open_page == "Log"
    assert tasks(whole).central_view.picture_rect() == before
    whole.setFocus()
    qtbot.keyClick(whole, Qt.Key.Key_Escape)
    assert whole.drawer.open_page == ""
    assert not whole.top_bar.latched


def test_an_open_drawer_stays_above_the_panels_of_another_workspace(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, SET_UP)
    whole.raise_panel("Log")
    choose(whole, qtbot, HANDLE)
    body = whole.findChild(QWidget, "drawerBody")
    corners = (body.rect().bottomLeft(), body.rect().bottomRight())
    for corner in corners:
        at = body.mapTo(whole, corner) + QPoint(4 if corner.x() == 0 else -4, -4)
        found = whole.childAt(at)
        assert found is not None
        assert found is body or body.isAncestorOf(found)
    whole.drawer.show_page("")


def test_an_open_drawer_follows_the_size_of_the_window(whole: OperatorWindow, qtbot: QtBot) -> None:
    before = whole.size()
    whole.raise_panel("Log")
    body = whole.findChild(QWidget, "drawerBody")
    assert isinstance(body, QWidget)
    try:
        for page, shrunk in (("Log", 40), ("Alarms", 80)):
            whole.drawer.show_page(page)
            whole.resize(before.width() - shrunk, before.height() - shrunk)
            qtbot.waitUntil(lambda: body.width() == whole.width())
            edge = whole.drawer.mapTo(whole, whole.drawer.rect().topLeft()).y()
            assert body.geometry().bottom() + 1 == edge
    finally:
        whole.drawer.show_page("")
        whole.resize(before)


def test_the_pad_moves_the_chosen_tool_by_the_step(whole: OperatorWindow, qtbot: QtBot) -> None:
    choose(whole, qtbot, HANDLE)
    tool = tasks(whole).tool
    card = mico(whole).cards["right.y"]
    qtbot.waitUntil(lambda: card.axis.details.present)
    qtbot.mouseClick(tool.choices["right"], LEFT)
    tool.step.setText("25")
    qtbot.mouseClick(tool.pad["y", -1], LEFT)
    qtbot.waitUntil(lambda: abs(position(card) + 25.0) < 1.0)
    tool.step.setText("-25")
    qtbot.mouseClick(tool.pad["y", -1], LEFT)
    assert "no sign" in tool.step.reason


def test_a_stop_is_shown_beside_the_tool_and_the_coach_resets_it(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, HANDLE)
    coach = whole.findChild(QWidget, "coach")
    button = part(coach, "coachButton", QPushButton)
    whole.stop("a hand on the button")
    qtbot.waitUntil(lambda: "STOPPED" in tasks(whole).tool.line.text())
    qtbot.waitUntil(lambda: button.text() == "Reset")
    qtbot.mouseClick(button, LEFT)
    qtbot.waitUntil(lambda: not whole.top_bar.latched)
    assert "STOPPED" not in tasks(whole).tool.line.text()


def test_after_a_stop_in_its_middle_the_coach_asks_to_initialise_again(
    own: OperatorWindow, qtbot: QtBot
) -> None:
    choose(own, qtbot, SET_UP)
    coach = own.findChild(QWidget, "coach")
    words, button = part(coach, "coachWords", QLabel), part(coach, "coachButton", QPushButton)
    qtbot.waitUntil(lambda: "All axes are ready" in words.text(), timeout=30_000)
    panel = part(own, "initialisationPanel", InitialisationPanel)
    panel.start_anyway()
    qtbot.waitUntil(lambda: any(e.state is StepState.RUNNING for e in panel.report.steps))
    qtbot.waitUntil(lambda: "being initialised" in words.text())
    own.stop("a hand on the button")
    qtbot.waitUntil(lambda: any(e.state is StepState.FAILED for e in panel.report.steps))
    qtbot.waitUntil(lambda: button.text() == "Reset")
    qtbot.mouseClick(button, LEFT)
    qtbot.waitUntil(lambda: "initialisation ended early" in words.text())
    assert button.text() == "Initialise"


def test_the_coach_says_what_a_calibration_high_above_the_plate_is_not_good_for(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, LOOK)
    words = part(whole.findChild(QWidget, "coach"), "coachWords", QLabel)
    qtbot.waitUntil(lambda: "needs a calibration" in words.text())
    camera = tasks(whole).central_view.camera.camera
    transform = whole.platform.vico.transform if whole.platform.vico is not None else None
    assert isinstance(transform, PlatformTransform)
    places = [(x, y) for x in (-300.0, 0.0, 300.0) for y in (-300.0, 0.0, 300.0)]
    seen = [Sighting((x, y), (800.0 + x / 2.0, 600.0 - y / 2.0)) for x, y in places]
    newest = camera.latest()
    zoom = newest.circumstances.zoom_counts if newest is not None else None
    assert zoom is not None
    plane = Plane(zoom, 1500.0, fit_map(seen), datetime.now(UTC))
    transform.calibrations.add_plane(camera.name, "left", plane)
    qtbot.waitUntil(lambda: "Not calibrated for what lies on the plate" in words.text())
    assert "height 0 µm lies outside what was measured (1500 µm)" in words.text()
    assert "Bring a tool down" in words.text()


def test_a_refused_move_offers_how_far_it_may_go(whole: OperatorWindow, qtbot: QtBot) -> None:
    choose(whole, qtbot, HANDLE)
    tool = tasks(whole).tool
    card = mico(whole).cards["left.z"]
    qtbot.waitUntil(lambda: card.axis.details.present)
    qtbot.mouseClick(tool.choices["left"], LEFT)
    tool.step.setText("4000")
    qtbot.mouseClick(tool.pad["z", -1], LEFT)
    qtbot.waitUntil(tool.nearest.isVisible)
    assert "plate" in tool.line.text()
    wanted = float(tool.nearest.text().removeprefix("Go to "))
    qtbot.mouseClick(tool.nearest, LEFT)
    qtbot.waitUntil(lambda: abs(position(card) - wanted) < 2.0)


def test_what_a_refusal_offered_is_gone_when_the_axis_was_moved(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, HANDLE)
    tool = tasks(whole).tool
    card = mico(whole).cards["left.z"]
    qtbot.waitUntil(lambda: card.axis.details.present)
    qtbot.mouseClick(tool.choices["left"], LEFT)
    tool.step.setText("4000")
    qtbot.mouseClick(tool.pad["z", -1], LEFT)
    qtbot.waitUntil(tool.nearest.isVisible)
    card.axis.move_by(300.0, wait=False)
    qtbot.waitUntil(lambda: not tool.nearest.isVisible())
    assert tool.line.text() == ""
    qtbot.waitUntil(lambda: not card.axis.details.in_motion)


def targets_of(tool: ToolPanel, qtbot: QtBot) -> dict[str, QuantityField]:
    """Return the fields of the chosen tool by the names of its axes."""

    def fields() -> list[QuantityField]:
        return tool.findChildren(QuantityField, "toolTarget")

    qtbot.waitUntil(lambda: len(fields()) == 3, timeout=5000)
    return dict(zip(tool.axes, fields(), strict=False))


def test_go_to_brings_no_axis_back_that_was_moved_by_other_means(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, HANDLE)
    tool = tasks(whole).tool
    cards = mico(whole).cards
    qtbot.waitUntil(lambda: cards["left.x"].axis.details.present)
    qtbot.mouseClick(tool.choices["right"], LEFT)
    qtbot.mouseClick(tool.choices["left"], LEFT)
    targets = targets_of(tool, qtbot)
    before = position(cards["left.x"]), position(cards["left.y"])
    tool.step.setText("500")
    qtbot.mouseClick(tool.pad["x", 1], LEFT)
    qtbot.waitUntil(lambda: abs(position(cards["left.x"]) - before[0] - 500.0) < 2.0)
    moved = position(cards["left.x"])
    qtbot.waitUntil(lambda: abs(targets["left.x"].value() - moved) < 2.0)
    wanted = float(round(before[1]) + 30)
    targets["left.y"].selectAll()
    qtbot.keyClicks(targets["left.y"], f"{wanted:.0f}")
    qtbot.mouseClick(tool.go, LEFT)
    qtbot.waitUntil(lambda: abs(position(cards["left.y"]) - wanted) < 2.0)
    assert position(cards["left.x"]) == pytest.approx(moved, abs=2.0)
    assert targets["left.y"].value() == pytest.approx(wanted), "what was typed stays"


def test_a_target_typed_waits_while_another_axis_moves(whole: OperatorWindow, qtbot: QtBot) -> None:
    choose(whole, qtbot, HANDLE)
    tool = tasks(whole).tool
    cards = mico(whole).cards
    qtbot.waitUntil(lambda: cards["left.x"].axis.details.present)
    qtbot.mouseClick(tool.choices["right"], LEFT)
    qtbot.mouseClick(tool.choices["left"], LEFT)
    targets = targets_of(tool, qtbot)
    wanted = round(position(cards["left.y"])) + 40
    targets["left.y"].selectAll()
    qtbot.keyClicks(targets["left.y"], str(wanted))
    x_before = position(cards["left.x"])
    tool.step.setText("60")
    qtbot.mouseClick(tool.pad["x", 1], LEFT)
    qtbot.waitUntil(lambda: abs(position(cards["left.x"]) - x_before - 60.0) < 2.0)
    assert targets["left.y"].text() == str(wanted)
    qtbot.mouseClick(tool.go, LEFT)
    qtbot.waitUntil(lambda: abs(position(cards["left.y"]) - wanted) < 2.0)


def test_the_table_of_axes_shows_a_target_with_its_sign(
    whole: OperatorWindow, qtbot: QtBot
) -> None:
    choose(whole, qtbot, SET_UP)
    target = next(e for e in whole.findChildren(QLineEdit, "rowTarget") if e.isVisible())
    before, width_px = target.text(), target.width()
    target.setText("-5500.0")
    shown = ink(target)
    target.setFixedWidth(2 * width_px)
    wanted = ink(target)
    target.setFixedWidth(width_px)
    target.setText(before)
    assert shown == wanted


def ink(field: QLineEdit) -> int:
    """Return how many pixels inside a field are written on."""
    image = field.grab(field.rect().adjusted(4, 4, -4, -4)).toImage()
    rows, columns = range(image.height()), range(image.width())
    return sum(image.pixelColor(x, y).lightness() > 110 for x in columns for y in rows)
