"""The scene where there is no OpenGL: projections with the same content."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QLabel, QToolButton, QWidget

from cosmic.frame.gui.palette import contrast_ratio
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import apply_theme
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.poses import Pose
from cosmic.mico.gui.scene.pose_picture import PosePictures
from cosmic.mico.gui.scene.projection_view import ProjectionView
from cosmic.mico.gui.scene.scene_widget import SceneWidget
from gui.mico.scene_models import two_arms

NEAR = Approach(
    bodies=("left_jaw", "plate"),
    distance_um=182.4,
    places_um=((-4e3, 0.0, 2e3), (-4e3, 0.0, 0.0)),
    margin_um=20.0,
)
TOUCH = Approach(
    bodies=("left_jaw", "plate"),
    distance_um=0.0,
    places_um=((-3e3, 0.0, 0.0), (-3e3, 0.0, 0.0)),
    margin_um=20.0,
    pose={"left.z": -2000.0, "left.x": 1000.0},
)


@pytest.fixture
def scene(qtbot, qapp):
    apply_theme(qapp, "dark")
    widget = SceneWidget()
    qtbot.addWidget(widget)
    widget.set_model(two_arms())
    widget.resize(700, 500)
    widget.show()
    qtbot.waitExposed(widget)
    yield widget
    qapp.setStyleSheet("")


def picture(scene):
    """The pixels of the view, shape (height, width, 3)."""
    image = (
        scene.view.grab().toImage().convertToFormat(scene.grab().toImage().Format.Format_RGBX8888)
    )
    data = np.frombuffer(image.constBits(), np.uint8)
    return data.reshape(image.height(), image.bytesPerLine() // 4, 4)[:, : image.width(), :3].copy()


def share_like(scene, colour, reach=60):
    """How many pixels look like a colour."""
    wanted = np.array(QColor(colour).getRgb()[:3])
    return int((np.abs(picture(scene).astype(int) - wanted).sum(axis=2) < reach).sum())


def settled_frames(scene):
    QApplication.processEvents()
    return scene.view.frames


def test_without_opengl_it_shows_projections_and_says_why(scene):
    assert isinstance(scene.view, ProjectionView)
    assert "no OpenGL" in scene.view.reason
    assert picture(scene).std() > 5.0


def test_without_a_model_it_says_so(qtbot):
    widget = SceneWidget()
    qtbot.addWidget(widget)
    widget.show()
    words = widget.findChild(QLabel, "sceneNone")
    assert words.isVisible()
    assert "no collision model" in words.text()
    widget.set_model(None, "the file is missing")
    assert "the file is missing" in words.text()
    widget.set_positions({"left.x": 1.0})
    widget.set_planned([{"left.x": 1.0}])
    widget.look("home")


def test_bodies_follow_the_positions(scene):
    before = picture(scene)
    scene.set_positions({"left.x": 3000.0, "table.rotation": 45.0})
    assert np.allclose(scene.content.poses["left_jaw"][:3, 3], (-27.0, 0.0, 0.0))
    assert (picture(scene) != before).any()


def test_it_paints_only_when_a_body_moved(scene):
    scene.set_positions({"left.x": 10.0})
    painted = settled_frames(scene)
    scene.set_positions({"left.x": 10.0})
    scene.set_positions({"stranger.x": 10.0})
    scene.set_nearest(None)
    assert settled_frames(scene) == painted
    scene.set_positions({"left.x": 11.0})
    assert settled_frames(scene) == painted + 1


def test_a_repaint_draws_no_body_anew(scene):
    scene.set_positions({"left.x": 10.0})
    drawn, before = settled_frames(scene), picture(scene)
    scene.view.repaint()
    scene.set_nearest(NEAR)
    scene.set_nearest(None)
    assert settled_frames(scene) == drawn
    assert (picture(scene) == before).all()
    scene.resize(600, 420)
    assert settled_frames(scene) == drawn + 1


def test_what_lies_below_the_scene_does_not_have_it_painted(qtbot):
    below = QWidget()
    qtbot.addWidget(below)
    below.resize(760, 560)
    scene = SceneWidget(below)
    scene.set_model(two_arms())
    scene.setGeometry(20, 20, 700, 500)
    below.show()
    qtbot.waitExposed(below)
    QApplication.processEvents()
    painted = []
    scene.view.draw_hovered = lambda *_: painted.append("anew")
    below.update()
    QApplication.processEvents()
    assert painted == []
    scene.view.update()
    QApplication.processEvents()
    assert painted == ["anew"]


def test_an_inset_shows_one_picture_and_no_words_on_each_other(scene):
    assert len(scene.view.panels()) == 2
    scene.view.resize(190, 142)
    (panel,) = scene.view.panels()
    assert panel.box.width() == scene.view.width()
    assert picture(scene).std() > 5.0


def test_a_pose_has_a_picture_of_its_own_drawn_once(qapp):
    pictures = PosePictures(two_arms())
    home, away = Pose("home", {"left.x": 0.0}), Pose("away", {"left.x": 4000.0})
    first, second = pictures.of(home).toImage(), pictures.of(away).toImage()
    assert first != second
    assert pictures.of(Pose("again", {"left.x": 0.0})) is pictures.of(home)
    apply_theme(qapp, "light")
    assert pictures.of(home).toImage() != first
    apply_theme(qapp, "dark")


def test_an_axis_that_is_not_named_or_not_known_stays_where_it_was(scene):
    scene.set_positions({"left.x": 1000.0})
    scene.set_positions({"left.y": 500.0, "left.x": float("nan")})
    assert np.allclose(scene.content.poses["left_jaw"][:3, 3], (-29.0, 0.5, 0.0))


def test_the_nearest_pair_is_named_with_its_distance(scene):
    scene.set_nearest(NEAR)
    assert scene.nearest_text == "182 µm  left_jaw – plate"
    scene.set_nearest(None)
    assert "not known" in scene.nearest_text


def test_a_pair_inside_its_margin_says_so(scene):
    scene.set_nearest(
        Approach(NEAR.bodies, distance_um=4.04, places_um=NEAR.places_um, margin_um=5.0)
    )
    assert "4.0 µm" in scene.nearest_text
    assert "margin 5.0 µm reached" in scene.nearest_text


def test_the_width_of_the_distance_does_not_change_with_it(scene):
    figures = scene.findChild(QLabel, "sceneClearance")
    widths = set()
    for distance_um in (0.0, 9.9, 182.0, 123456.0):
        scene.set_nearest(Approach(NEAR.bodies, distance_um, NEAR.places_um))
        widths.add(figures.width())
    assert len(widths) == 1


def test_nothing_of_a_refusal_is_cut_off_in_an_inset(scene):
    scene.set_compact(True)
    scene.resize(136, 102)
    scene.show_refused(TOUCH)
    QApplication.processEvents()
    words = scene.findChild(QLabel, "sceneRefused")
    line = words.parentWidget()
    assert not any(each.isVisible() for each in line.findChildren(StateBadge))
    for each in (words, line.findChild(QToolButton)):
        assert each.isVisible()
        assert line.rect().contains(each.geometry())


def test_a_refusal_is_taken_away_at_the_left_where_no_inset_lies_over_it(scene):
    scene.show_refused(TOUCH)
    QApplication.processEvents()
    line = scene.findChild(QLabel, "sceneRefused").parentWidget()
    assert line.findChild(QToolButton).geometry().right() < line.width() / 2


def test_a_refused_movement_stands_as_a_ghost_until_it_is_cleared(scene):
    before = share_like(scene, "#FF8A4C")
    scene.show_refused(TOUCH)
    assert set(scene.content.ghosts) == {"left_z", "left_jaw"} & set(scene.content.meshes)
    assert scene.refused_text == "left_jaw would touch plate"
    assert share_like(scene, "#FF8A4C") > before + 100
    scene.clear_refused()
    assert scene.content.ghosts == {}
    assert scene.refused_text == ""
    assert share_like(scene, "#FF8A4C") == before


def test_the_operator_can_take_the_ghost_away(qtbot, scene):
    scene.show_refused(TOUCH)
    button = next(b for b in scene.findChildren(QToolButton) if b.text() == "✕")
    with qtbot.waitSignal(scene.refused_cleared):
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert scene.refused_text == ""


def test_a_refusal_does_not_make_the_image_jump(scene):
    before = scene.view.size()
    scene.show_refused(TOUCH)
    QApplication.processEvents()
    assert scene.view.size() == before


def test_the_ghost_is_gone_where_the_body_has_come_to_stand(scene):
    scene.show_refused(TOUCH)
    scene.set_positions(TOUCH.pose)
    assert scene.content.ghosts == {}


def test_paths_are_those_of_the_tips_that_move(scene):
    scene.set_planned([{"left.z": 0.0}, {"left.z": 4000.0}, {"left.z": 4000.0, "left.x": 2000.0}])
    (way,) = scene.content.planned
    assert np.allclose(way[:, [0, 2]], [(-4.0, 2.25), (-4.0, 6.25), (-2.0, 6.25)])
    assert share_like(scene, "#009E73") > 50
    scene.set_planned(None)
    assert scene.content.planned == ()


def test_the_caller_may_name_whose_path_is_shown(scene):
    scene.set_recorded([{"left.z": 0.0}, {"right.z": 4000.0}], ["right_jaw", "left_jaw"])
    assert len(scene.content.recorded) == 2


def test_a_long_path_is_thinned(scene):
    scene.set_recorded([{"left.x": float(x)} for x in range(5000)])
    (way,) = scene.content.recorded
    assert len(way) <= 400
    assert np.allclose(way[[0, -1], 0], (-4.0, 0.999))


def test_the_body_under_the_cursor_is_named(qtbot, scene):
    top, _ = scene.view.panels()
    x, y = top.project(np.array([[-6.0, 0.0, 0.0]]))[0]
    with qtbot.waitSignal(scene.hovered) as heard:
        qtbot.mouseMove(scene.view, QPoint(round(x), round(y)))
    assert heard.args == ["left_jaw"]
    assert scene.hovered_body == "left_jaw"
    assert scene.view.body_at(QPointF(1.0, 1.0)) == ""


def test_a_hidden_body_is_neither_drawn_nor_named(scene):
    shown = picture(scene)
    scene.restore_state({"hidden": ["left_jaw"], "preset": "home"})
    top, _ = scene.view.panels()
    x, y = top.project(np.array([[-6.0, 0.0, 0.0]]))[0]
    assert scene.view.body_at(QPointF(x, y)) == "plate"
    assert (picture(scene) != shown).any()


def test_what_was_hidden_and_where_one_looked_from_is_kept(qtbot, scene):
    scene.restore_state({"hidden": ["frame"], "preset": "left"})
    other = SceneWidget()
    qtbot.addWidget(other)
    other.restore_state(scene.save_state())
    other.set_model(two_arms())
    assert other.save_state() == {"hidden": ["frame"], "preset": "left"}
    assert "frame" not in other.content.shown


@pytest.mark.parametrize("state", [{}, {"hidden": 3, "preset": None}, {"preset": "nowhere"}])
def test_a_state_that_makes_no_sense_is_left_alone(scene, state):
    scene.restore_state(state)
    assert scene.save_state() == {"hidden": [], "preset": "home"}


def test_a_body_not_watched_is_hatched(scene):
    before = share_like(scene, "#F0E442")
    scene.set_unwatched(["plate"])
    assert share_like(scene, "#F0E442") > before + 50


def test_each_button_looks_from_its_side(qtbot, scene):
    for name in ("top", "front", "side", "home"):
        button = scene.findChild(QToolButton, f"sceneLook {name}")
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
        assert scene.save_state()["preset"] == name


def test_the_theme_can_change_while_it_is_shown(qapp, scene):
    dark = picture(scene).mean()
    apply_theme(qapp, "light")
    assert picture(scene).mean() > dark + 40.0


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_a_jaw_is_seen_over_a_bright_plate(qapp, qtbot, theme):
    apply_theme(qapp, theme)
    model = two_arms()
    bright = [replace(each, colour=(0.86, 0.9, 0.94, 0.9)) for each in model.views]
    widget = SceneWidget()
    qtbot.addWidget(widget)
    widget.set_model(replace(model, views=tuple(bright)))
    widget.resize(700, 500)
    widget.show()
    qtbot.waitExposed(widget)
    top = widget.view.panels()[0]
    x, y = top.project(np.array([[-8.0, 0.0, 2.0]]))[0]
    across = picture(widget)[int(y) - 12 : int(y) + 13, int(x)]
    plate, *others = [QColor(*(int(part) for part in each)).name() for each in across]
    assert max(contrast_ratio(plate, each) for each in others) >= 2.0


def test_another_model_replaces_the_first(scene):
    scene.show_refused(TOUCH)
    scene.set_nearest(NEAR)
    scene.set_model(two_arms())
    assert scene.refused_text == ""
    assert "not known" in scene.nearest_text
    scene.set_model(None)
    assert not scene.view.isVisible()


def test_a_3d_view_that_fails_is_replaced_by_projections(scene, caplog):
    scene.view.failed.emit("ignored: these are projections already")
    with caplog.at_level(logging.WARNING):
        QApplication.processEvents()
    assert isinstance(scene.view, ProjectionView)


def test_keys_are_left_to_what_jogs(scene):
    assert scene.view.focusPolicy() == Qt.FocusPolicy.NoFocus
