"""Mode ECM: a detour is planned for a blocked move, and driven after Go."""

import logging
from pathlib import Path
from shutil import copytree

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import QCheckBox, QLabel, QPushButton, QToolButton
from pytestqt.qtbot import QtBot

from cosmic.app.configuration.platform_file import load_platform
from cosmic.app.panels.path_preview import PathPreview, PreviewState, path_text, poses_along
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.mico.api.planned_path import PlannedPath
from gui.app.windows import Make, card, mico, scene
from gui.mico.panels import click, enter, field, part, position, wait_for_position

LEFT = Qt.MouseButton.LeftButton
BLOCKED_FROM = {"left.x": 4000.0, "left.y": -2000.0, "right.x": -4500.0}
"""Where the right gripper stands between left.y -2000 and 2000."""


@pytest.fixture
def blocked(window: OperatorWindow, qtbot: QtBot) -> OperatorWindow:
    """A window in ECM, with the right gripper in the way of the left one."""
    place(window, qtbot)
    choose_mode(window, qtbot, "ECM")
    return window


def bar(window: OperatorWindow) -> PathPreview:
    return part(window, "pathPreview", PathPreview)


def place(window: OperatorWindow, qtbot: QtBot) -> None:
    """Bring the right gripper between the left one and where it is to go."""
    for axis, target in BLOCKED_FROM.items():
        mico(window).mico[axis].move_to(target, wait=False)
        wait_for_position(qtbot, card(window, axis), target)


def mode_button(window: OperatorWindow, mode: str) -> QToolButton:
    return next(
        button
        for button in window.top_bar.findChildren(QToolButton, "modeButton")
        if button.property("mode") == mode
    )


def choose_mode(window: OperatorWindow, qtbot: QtBot, mode: str) -> None:
    qtbot.mouseClick(mode_button(window, mode), LEFT)
    assert window.mode == mode


def go_to(window: OperatorWindow, qtbot: QtBot, target: str, axis: str = "left.y") -> None:
    enter(qtbot, field(card(window, axis), "target"), target)
    click(qtbot, card(window, axis), "MiCoCL_9")


def reason(window: OperatorWindow, axis: str = "left.y") -> str:
    return field(card(window, axis), "target").reason


def platform_without_scene(folder: Path) -> Path:
    """Return the shipped platform with no scene named."""
    copytree(shipped_config_dir(), folder, dirs_exist_ok=True)
    file = folder / "platform.toml"
    named = load_platform(None)[0].platform.scene
    file.write_text(file.read_text(encoding="utf-8").replace(named, ""), encoding="utf-8")
    return folder


def find(window: OperatorWindow, qtbot: QtBot, target: str = "2000") -> PathPreview:
    """Have a way found, as far as the offer."""
    go_to(window, qtbot, target)
    shown = bar(window)
    qtbot.waitUntil(lambda: shown.state is PreviewState.FOUND, timeout=8000)
    return shown


def moving(window: OperatorWindow) -> bool:
    return any(axis.details.in_motion for axis in mico(window).mico)


def where(window: OperatorWindow) -> dict[str, float | None]:
    return {axis.key: axis.details.position for axis in mico(window).mico}


def test_in_mcm_a_blocked_move_is_refused_with_a_hint(window: OperatorWindow, qtbot: QtBot) -> None:
    place(window, qtbot)
    assert window.mode == "MCM"
    go_to(window, qtbot, "2000")
    qtbot.waitUntil(lambda: bool(reason(window)))
    assert "right_" in reason(window)
    assert "In mode Guided a detour can be planned" in reason(window)
    assert bar(window).state is PreviewState.NONE
    assert position(card(window, "left.y")) == pytest.approx(-2000.0, abs=1.0)


def test_a_refusal_that_no_detour_would_help_has_no_hint(
    window: OperatorWindow, qtbot: QtBot
) -> None:
    go_to(window, qtbot, "9 m")
    qtbot.waitUntil(lambda: bool(reason(window)))
    assert "Guided" not in reason(window)


def test_in_ecm_a_detour_is_offered_and_driven_after_go(
    blocked: OperatorWindow, qtbot: QtBot
) -> None:
    before = where(blocked)
    shown = find(blocked, qtbot)
    assert "left.y to 2000" in shown.text
    assert "instead of 4.0 mm" in shown.text
    assert reason(blocked) == ""
    assert scene(blocked, qtbot).content.planned
    assert not scene(blocked, qtbot).refused_text
    qtbot.wait(150)
    assert where(blocked) == pytest.approx(before, abs=1.0)

    click(qtbot, shown, "pathGo")
    assert shown.state is PreviewState.MOVING
    wait_for_position(qtbot, card(blocked, "left.y"), 2000.0)
    qtbot.waitUntil(lambda: shown.state is PreviewState.NONE, timeout=8000)
    assert not shown.isVisible()
    assert scene(blocked, qtbot).content.planned == ()
    wanted = BLOCKED_FROM | {"left.y": 2000.0, "left.z": 0.0}
    for axis, there in wanted.items():
        assert position(card(blocked, axis)) == pytest.approx(there, abs=1.0)


def test_detour_beside_a_refusal_of_the_tool_plans_one_in_manual_mode(
    make: Make, qtbot: QtBot
) -> None:
    window = make(applications=("mico", "daqco", "vico"))
    tasks, workspaces = window.tasks, window.top_bar.workspaces
    assert tasks is not None
    assert workspaces is not None
    qtbot.mouseClick(workspaces.buttons["Handle"], LEFT)
    qtbot.waitUntil(lambda: "µm" in window.top_bar.clearance_text, timeout=15_000)
    place(window, qtbot)
    tool = tasks.tool
    target = tool.findChildren(QuantityField, "toolTarget")[list(tool.axes).index("left.y")]
    target.setText("2000")
    qtbot.keyClick(target, Qt.Key.Key_Return)
    qtbot.waitUntil(tool.detour.isVisible)
    qtbot.mouseClick(tool.detour, LEFT)
    shown = bar(window)
    qtbot.waitUntil(lambda: shown.state is PreviewState.FOUND, timeout=8000)
    click(qtbot, shown, "pathGo")
    wait_for_position(qtbot, card(window, "left.y"), 2000.0)
    assert window.mode == "MCM"


def test_a_free_move_in_ecm_is_made_at_once(blocked: OperatorWindow, qtbot: QtBot) -> None:
    go_to(blocked, qtbot, "-1900")
    wait_for_position(qtbot, card(blocked, "left.y"), -1900.0)
    assert bar(blocked).state is PreviewState.NONE


def test_a_blocked_move_by_a_distance_leads_from_where_the_axis_stands(
    blocked: OperatorWindow, qtbot: QtBot
) -> None:
    card(blocked, "left.y").axis.set_zero()
    qtbot.waitUntil(lambda: abs(position(card(blocked, "left.y"))) < 1.0)
    enter(qtbot, field(card(blocked, "left.y"), "MiCoCL_8"), "4000")
    click(qtbot, card(blocked, "left.y"), "MiCoCL_6")
    shown = bar(blocked)
    qtbot.waitUntil(lambda: shown.state is PreviewState.FOUND, timeout=8000)
    click(qtbot, shown, "pathGo")
    wait_for_position(qtbot, card(blocked, "left.y"), 4000.0)
    assert card(blocked, "left.y").axis.details.position == pytest.approx(2000.0, abs=2.0)
    qtbot.waitUntil(lambda: shown.state is PreviewState.NONE, timeout=8000)


def test_a_blocked_move_in_parts_is_led_round_as_well(
    blocked: OperatorWindow, qtbot: QtBot
) -> None:
    part(card(blocked, "left.y"), "MiCoCL_10", QCheckBox).setChecked(True)
    find(blocked, qtbot)


def test_cancel_leaves_everything_where_it_is(blocked: OperatorWindow, qtbot: QtBot) -> None:
    before = where(blocked)
    shown = find(blocked, qtbot)
    click(qtbot, shown, "pathCancel")
    assert not shown.isVisible()
    assert scene(blocked, qtbot).content.planned == ()
    qtbot.wait(100)
    assert where(blocked) == pytest.approx(before, abs=1.0)


def test_enter_presses_go_only_in_the_bar(blocked: OperatorWindow, qtbot: QtBot) -> None:
    shown = find(blocked, qtbot)
    assert not shown.isAncestorOf(blocked.focusWidget())
    assert blocked.focusWidget() is not shown
    part(shown, "pathCancel", QPushButton).setFocus()
    qtbot.keyClick(part(shown, "pathCancel", QPushButton), Qt.Key.Key_Return)
    assert shown.state is PreviewState.NONE
    find(blocked, qtbot)
    shown.setFocus()
    qtbot.keyClick(shown, Qt.Key.Key_Return)
    assert shown.state is PreviewState.MOVING
    qtbot.waitUntil(lambda: shown.state is PreviewState.NONE, timeout=8000)


def test_without_a_path_it_says_what_blocks(blocked: OperatorWindow, qtbot: QtBot) -> None:
    before = where(blocked)
    go_to(blocked, qtbot, "-3000", "left.z")
    shown = bar(blocked)
    qtbot.waitUntil(lambda: shown.state is PreviewState.ENDED, timeout=8000)
    assert "No detour for left.z to -3000" in shown.text
    assert "plate" in shown.text
    assert "plate" in reason(blocked, "left.z")
    assert "Guided" not in reason(blocked, "left.z")
    assert "plate" in scene(blocked, qtbot).refused_text
    assert scene(blocked, qtbot).content.ghosts
    assert not part(shown, "pathGo", QPushButton).isVisible()
    assert where(blocked) == pytest.approx(before, abs=1.0)
    click(qtbot, shown, "pathCancel")
    assert not shown.isVisible()


def test_the_note_that_there_is_no_path_goes_when_the_axis_moves_again(
    blocked: OperatorWindow, qtbot: QtBot
) -> None:
    go_to(blocked, qtbot, "-3000", "left.z")
    qtbot.waitUntil(lambda: bar(blocked).state is PreviewState.ENDED, timeout=8000)
    qtbot.wait(120)
    go_to(blocked, qtbot, "300", "left.z")
    wait_for_position(qtbot, card(blocked, "left.z"), 300.0)
    qtbot.waitUntil(lambda: bar(blocked).state is PreviewState.NONE)


def test_a_stop_on_the_path_ends_it(make: Make, stored: QSettings, qtbot: QtBot) -> None:
    stored.setValue("window/mode", "ECM")
    window = make(rate=4.0)
    qtbot.waitUntil(lambda: "µm" in window.top_bar.clearance_text, timeout=8000)
    assert window.mode == "ECM"
    place(window, qtbot)
    shown = find(window, qtbot)
    click(qtbot, shown, "pathGo")
    qtbot.waitUntil(lambda: moving(window))
    qtbot.mousePress(part(window.top_bar, "stopButton", QPushButton), LEFT)
    qtbot.waitUntil(lambda: window.top_bar.latched and not moving(window))
    qtbot.waitUntil(lambda: shown.state is PreviewState.NONE, timeout=8000)
    stood = position(card(window, "left.y"))
    assert stood < 1990.0
    click(qtbot, window.top_bar, "resetButton")
    qtbot.waitUntil(lambda: not window.top_bar.latched)
    qtbot.wait(150)
    assert position(card(window, "left.y")) == pytest.approx(stood, abs=1.0)


def test_stop_takes_an_offer_away(blocked: OperatorWindow, qtbot: QtBot) -> None:
    shown = find(blocked, qtbot)
    blocked.stop("test")
    qtbot.waitUntil(lambda: shown.state is PreviewState.NONE)
    assert scene(blocked, qtbot).content.planned == ()


def test_a_cancel_while_it_moves_stops_there(make: Make, qtbot: QtBot) -> None:
    window = make(rate=4.0)
    qtbot.waitUntil(lambda: "µm" in window.top_bar.clearance_text, timeout=8000)
    place(window, qtbot)
    choose_mode(window, qtbot, "ECM")
    shown = find(window, qtbot)
    click(qtbot, shown, "pathGo")
    qtbot.waitUntil(lambda: moving(window))
    click(qtbot, shown, "pathCancel")
    qtbot.waitUntil(lambda: shown.state is PreviewState.NONE and not moving(window), timeout=8000)
    assert position(card(window, "left.y")) < 1990.0
    assert not window.top_bar.latched


def test_go_waits_while_an_operation_moves_the_axes(
    blocked: OperatorWindow, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    find(blocked, qtbot)
    before = where(blocked)
    application = mico(blocked).mico.application
    monkeypatch.setattr(application, "busy", lambda: "take with left moves the axes")
    click(qtbot, bar(blocked), "pathGo")
    assert "take with left moves the axes" in part(bar(blocked), "pathWords", QLabel).text()
    assert where(blocked) == before


def test_go_looks_again_when_an_axis_moved_since(blocked: OperatorWindow, qtbot: QtBot) -> None:
    shown = find(blocked, qtbot)
    go_to(blocked, qtbot, "500", "left.z")
    wait_for_position(qtbot, card(blocked, "left.z"), 500.0)
    stood = position(card(blocked, "left.y"))
    click(qtbot, shown, "pathGo")
    assert shown.state is PreviewState.PLANNING
    qtbot.waitUntil(lambda: shown.state is PreviewState.FOUND, timeout=8000)
    assert position(card(blocked, "left.y")) == pytest.approx(stood, abs=1.0)
    click(qtbot, shown, "pathGo")
    wait_for_position(qtbot, card(blocked, "left.y"), 2000.0)
    assert position(card(blocked, "left.z")) == pytest.approx(500.0, abs=1.0)
    qtbot.waitUntil(lambda: shown.state is PreviewState.NONE, timeout=8000)


def test_a_path_that_is_blocked_meanwhile_is_left_with_the_reason(
    blocked: OperatorWindow, qtbot: QtBot
) -> None:
    shown = find(blocked, qtbot)
    go_to(blocked, qtbot, "200", "right.z")
    wait_for_position(qtbot, card(blocked, "right.z"), 200.0)
    click(qtbot, shown, "pathGo")
    qtbot.waitUntil(lambda: shown.state is PreviewState.ENDED, timeout=8000)
    assert "was abandoned" in shown.text
    assert "right_" in shown.text
    assert position(card(blocked, "left.y")) < 0.0
    assert scene(blocked, qtbot).content.planned == ()


def test_a_blocked_move_while_the_axis_moves_is_refused(
    make: Make, stored: QSettings, qtbot: QtBot
) -> None:
    stored.setValue("window/mode", "ECM")
    window = make(rate=1.0)
    qtbot.waitUntil(lambda: "µm" in window.top_bar.clearance_text, timeout=8000)
    go_to(window, qtbot, "4000", "left.z")
    qtbot.waitUntil(lambda: card(window, "left.z").axis.details.in_motion)
    go_to(window, qtbot, "-3000", "left.z")
    qtbot.waitUntil(lambda: "is moving" in reason(window, "left.z"))
    assert bar(window).state is PreviewState.NONE


def test_a_newer_move_replaces_the_offer(blocked: OperatorWindow, qtbot: QtBot) -> None:
    shown = find(blocked, qtbot)
    go_to(blocked, qtbot, "-3000", "left.z")
    qtbot.waitUntil(lambda: shown.state is PreviewState.ENDED, timeout=8000)
    assert scene(blocked, qtbot).content.planned == ()
    find(blocked, qtbot, "2001")
    assert "2001" in shown.text


def test_without_a_scene_ecm_says_why_not(make: Make, qtbot: QtBot, tmp_path: Path) -> None:
    window = make(config=platform_without_scene(tmp_path))
    button = mode_button(window, "ECM")
    assert not button.isEnabled()
    assert "no collision model" in button.toolTip()
    qtbot.mouseClick(button, LEFT)
    assert window.mode == "MCM"


def test_the_mode_is_kept_shown_and_logged(
    make: Make, qtbot: QtBot, caplog: pytest.LogCaptureFixture
) -> None:
    window = make()
    with caplog.at_level(logging.INFO, logger="cosmic.app"):
        choose_mode(window, qtbot, "ECM")
    assert "control mode Guided (was Manual)" in caplog.text
    assert mode_button(window, "ECM").isChecked()
    assert not mode_button(window, "MCM").isChecked()
    window.close()
    assert make().mode == "ECM"


def test_back_in_mcm_an_offer_is_gone_and_moves_are_refused(
    blocked: OperatorWindow, qtbot: QtBot
) -> None:
    shown = find(blocked, qtbot)
    choose_mode(blocked, qtbot, "MCM")
    assert shown.state is PreviewState.NONE
    go_to(blocked, qtbot, "2000")
    qtbot.waitUntil(lambda: bool(reason(blocked)))
    assert shown.state is PreviewState.NONE


def test_a_path_is_described_in_one_line() -> None:
    way = PlannedPath({"a": 0.0}, ({"a": 1.0}, {"a": 2.0}), "detour", 9230.0, 400.0, 3.14)
    assert path_text(way) == "detour, 9.2 mm instead of 400 µm, about 3.1 s, 2 waypoints"
    assert poses_along(way, {"a": 9.0, "b": 5.0}) == [
        {"a": 0.0, "b": 5.0},
        {"a": 1.0, "b": 5.0},
        {"a": 2.0, "b": 5.0},
    ]
