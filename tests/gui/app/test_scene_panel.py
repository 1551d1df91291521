"""The panel "Scene" in the operator's window."""

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from cosmic.app.panels.scene import bodies_moved_by
from cosmic.app.platform import build_platform
from cosmic.app.windows.operator_window import SCENE, OperatorWindow
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.log import RingBufferHandler
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.mico.gui.scene.scene_widget import SceneWidget
from gui.app.windows import Make, mico, scene, scene_panel
from gui.mico.panels import click, enter, field, part, position, show, wait_for_position


def model(window: OperatorWindow) -> CollisionManager:
    found = mico(window).mico.application.collision
    assert found is not None
    return found


def height_um(window: OperatorWindow, body: str) -> float:
    """Return how high `body` is drawn."""
    assert scene_panel(window).scene is not None
    return float(scene_panel(window).scene.content.poses[body][2, 3]) * 1000.0


def refuse_left_z(window: OperatorWindow, qtbot: QtBot) -> SceneWidget:
    card = mico(window).cards["left.z"]
    enter(qtbot, field(card, "target"), "-5000")
    click(qtbot, card, "MiCoCL_9")
    shown = scene(window, qtbot)
    qtbot.waitUntil(lambda: bool(shown.refused_text), timeout=20_000)
    return shown


def test_the_scene_is_made_once_the_window_was_painted(qtbot: QtBot, stored: QSettings) -> None:
    platform = build_platform(applications=("mico",), rate=20.0, mico_gui=make_mico_gui)
    window = OperatorWindow(platform, stored, RingBufferHandler(), console=False)
    qtbot.addWidget(window)
    try:
        qtbot.wait(50)
        assert scene_panel(window).scene is None
        assert part(scene_panel(window), "sceneWait", QLabel).text()
        show(qtbot, window)
        scene(window, qtbot)
        qtbot.waitUntil(lambda: scene_panel(window).findChild(QLabel, "sceneWait") is None)
    finally:
        window.close()


def test_the_bodies_follow_the_axes(window: OperatorWindow, qtbot: QtBot) -> None:
    before = height_um(window, "left_jaw_a")
    card = mico(window).cards["left.z"]
    enter(qtbot, field(card, "target"), "500")
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, 500.0)
    qtbot.waitUntil(lambda: abs(height_um(window, "left_jaw_a") - before - 500.0) < 2.0)


def test_a_zero_of_the_user_moves_no_body(window: OperatorWindow, qtbot: QtBot) -> None:
    card = mico(window).cards["left.z"]
    enter(qtbot, field(card, "target"), "500")
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, 500.0)
    qtbot.wait(120)
    before = height_um(window, "left_jaw_a")
    card.axis.set_zero()
    qtbot.waitUntil(lambda: position(card) == pytest.approx(0.0, abs=2.0))
    qtbot.wait(120)
    assert abs(height_um(window, "left_jaw_a") - before) < 2.0


def test_nothing_is_drawn_while_the_panel_is_hidden(window: OperatorWindow, qtbot: QtBot) -> None:
    shown = scene(window, qtbot)
    window.dock(SCENE).close()
    before, frames = height_um(window, "left_jaw_a"), shown.view.frames
    card = mico(window).cards["left.z"]
    enter(qtbot, field(card, "target"), "500")
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, 500.0)
    assert height_um(window, "left_jaw_a") == before
    assert shown.view.frames == frames
    window.raise_panel(SCENE)
    qtbot.waitUntil(lambda: abs(height_um(window, "left_jaw_a") - before - 500.0) < 2.0)


def test_bar_and_scene_name_the_nearest_pair(window: OperatorWindow, qtbot: QtBot) -> None:
    nearest = mico(window).mico.clearance()
    one, other = nearest.bodies
    assert f"{nearest.distance_um:.0f} µm  {one} – {other}" in window.top_bar.clearance_text
    shown = scene(window, qtbot)
    qtbot.waitUntil(lambda: f"{one} – {other}" in shown.nearest_text)


def test_the_bar_warns_when_something_comes_near(window: OperatorWindow, qtbot: QtBot) -> None:
    free = model_limit(window)
    mico(window).mico["left.z"].move_to(free, wait=False)
    words = window.top_bar.findChildren(QLabel)
    qtbot.waitUntil(lambda: any(each.text() == "▲ close" for each in words), timeout=8000)


def model_limit(window: OperatorWindow) -> float:
    """Return how far down left.z may go."""
    verdict = mico(window).mico.check({"left.z": -5000.0})
    assert verdict.limit is not None
    return verdict.limit


def test_a_refused_move_is_shown_as_a_ghost(window: OperatorWindow, qtbot: QtBot) -> None:
    shown = refuse_left_z(window, qtbot)
    verdict = mico(window).mico.check({"left.z": -5000.0})
    assert "left_jaw" in shown.refused_text
    assert set(verdict.bodies) & set(shown.content.ghosts)
    assert shown.content.refused is not None
    assert shown.content.refused.approach.margin_um == 5.0
    assert shown.content.refused.approach.pose["left.z"] < -500.0
    assert verdict.bodies == shown.content.refused.approach.bodies
    assert not any(body.startswith("right") for body in shown.content.ghosts)
    reason = field(mico(window).cards["left.z"], "target").reason
    assert "left_jaw" in reason


def test_a_jog_that_ends_in_front_of_something_shows_why(
    window: OperatorWindow, qtbot: QtBot
) -> None:
    shown = scene(window, qtbot)
    card = mico(window).cards["left.z"]
    start = model_limit(window) + 20.0
    card.axis.move_to(start, wait=False)
    wait_for_position(qtbot, card, start)
    assert not shown.refused_text
    part(mico(window), "initialise", QPushButton).setFocus()
    for _ in range(10):  # where the window gets no core for a while, the axis stops as it should
        qtbot.keyPress(mico(window).focusWidget(), Qt.Key.Key_F)
        qtbot.waitUntil(lambda: card.axis.details.in_motion or "plate" in shown.refused_text)
        qtbot.waitUntil(lambda: not card.axis.details.in_motion or "plate" in shown.refused_text)
        qtbot.keyRelease(mico(window).focusWidget(), Qt.Key.Key_F)
        if "plate" in shown.refused_text:
            break
    assert "plate" in shown.refused_text
    qtbot.waitUntil(lambda: not card.axis.details.in_motion)
    qtbot.wait(120)
    assert shown.refused_text  # its own end does not count as the next movement


def test_a_move_of_another_axis_leaves_the_ghost(window: OperatorWindow, qtbot: QtBot) -> None:
    shown = refuse_left_z(window, qtbot)
    card = mico(window).cards["right.x"]
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
    qtbot.wait(120)
    assert shown.refused_text


def test_the_next_move_of_the_axis_takes_the_ghost_away(
    window: OperatorWindow, qtbot: QtBot
) -> None:
    shown = refuse_left_z(window, qtbot)
    card = mico(window).cards["left.z"]
    enter(qtbot, field(card, "target"), "100")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: not shown.refused_text and not shown.content.ghosts, timeout=20_000)


def test_a_click_on_its_words_takes_the_ghost_away(window: OperatorWindow, qtbot: QtBot) -> None:
    shown = refuse_left_z(window, qtbot)
    words = part(shown, "sceneRefused", ElidedLabel)
    qtbot.mouseClick(words, Qt.MouseButton.LeftButton)
    assert not shown.refused_text
    assert not shown.content.ghosts


def test_what_a_script_is_refused_shows_too(window: OperatorWindow, qtbot: QtBot) -> None:
    shown = scene(window, qtbot)
    mico(window).mico["left.z"].move_to(-5000.0, wait=False)
    qtbot.waitUntil(lambda: "left_jaw" in shown.refused_text)


def test_bodies_of_an_axis_taken_out_are_marked(window: OperatorWindow, qtbot: QtBot) -> None:
    shown = scene(window, qtbot)
    model(window).take_out("left.z")
    qtbot.waitUntil(lambda: "left_jaw_a" in shown.content.unwatched)
    assert "right_jaw_a" not in shown.content.unwatched
    chips = [each.text() for each in window.top_bar.findChildren(QLabel) if each.isVisible()]
    assert any("CD OFF: left.z" in text for text in chips)
    model(window).take_in("left.z")
    qtbot.waitUntil(lambda: not shown.content.unwatched)


def test_a_contact_allowed_stands_in_the_bar(window: OperatorWindow, qtbot: QtBot) -> None:
    def said() -> str:
        labels = window.top_bar.findChildren(QLabel)
        return " | ".join(label.text() for label in labels if label.isVisible())

    with model(window).contact("grasp"):
        qtbot.waitUntil(lambda: "contact: grasp" in said())
    qtbot.waitUntil(lambda: "contact" not in said())


def test_an_axis_carries_all_that_is_mounted_on_it(window: OperatorWindow) -> None:
    scene_model = model(window).model
    lifted = bodies_moved_by(scene_model, ["left.z"])
    assert {"left_arm", "left_gripper", "left_jaw_a", "left_jaw_b"} <= lifted
    assert not any(body.startswith("right") for body in lifted)
    assert bodies_moved_by(scene_model, ["left.gripper"]) == {"left_jaw_a", "left_jaw_b"}


def test_before_the_reference_nobody_claims_to_know(make: Make, qtbot: QtBot) -> None:
    window = make(cold=True)
    scene(window, qtbot)
    qtbot.waitUntil(lambda: "not referenced" in window.top_bar.clearance_text, timeout=8000)
    note = part(scene_panel(window), "sceneUnknown", ElidedLabel)
    qtbot.waitUntil(note.isVisible)
    assert "left.x" in note.text()
    assert "nearest pair not known" in scene(window, qtbot).nearest_text


def test_place_to_look_from_and_visibility_outlive_the_window(
    make: Make, qtbot: QtBot, stored: QSettings
) -> None:
    first = make()
    scene(first, qtbot).restore_state({"preset": "top", "hidden": ["frame"]})
    first.dock(SCENE).close()
    first.close()
    again = make()
    assert not again.dock(SCENE).isVisible()
    again.raise_panel(SCENE)
    state = scene(again, qtbot).save_state()
    assert state["preset"] == "top"
    assert state["hidden"] == ["frame"]
    again.close()
    stored.setValue("scene/view", "{damaged")
    again = make()
    again.raise_panel(SCENE)
    assert scene(again, qtbot).save_state()["preset"] == "home"
