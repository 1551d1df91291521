"""Tools over the image: distance, angle, region, click to move."""

from math import dist

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication

from cosmic.vico.gui.ink import GREEN, ORANGE
from cosmic.vico.hw.interface import Roi


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def choose_target(qtbot, view, name):
    click(qtbot, view.row.go)
    menu = view.row.menu
    action = next(each for each in menu.actions() if each.text() == name)
    qtbot.mouseClick(menu, Qt.MouseButton.LeftButton, pos=menu.actionGeometry(action).center())


def measured(view):
    return [each.text for each in view.tools.measures.measures]


def test_a_distance_is_given_in_micrometres(qtbot, shown, mouse):
    click(qtbot, shown.row.tools["distance"])
    mouse.drag((400, 300), (800, 600))
    (text,) = measured(shown)
    value, unit = text.split()
    assert unit == "µm"
    assert float(value) == pytest.approx(1.25 * dist((400, 300), (800, 600)), rel=0.01)


def test_several_measurements_stand_side_by_side_and_can_be_deleted(qtbot, shown, mouse):
    click(qtbot, shown.row.tools["distance"])
    mouse.drag((400, 300), (800, 300))
    mouse.drag((400, 500), (600, 500))
    assert len(measured(shown)) == 2
    longer = measured(shown)[0]
    qtbot.keyClick(shown.view, Qt.Key.Key_Delete)
    assert measured(shown) == [longer]
    qtbot.keyClick(shown.view, Qt.Key.Key_Delete)
    assert measured(shown) == []


def test_the_menu_deletes_the_measurement_below_the_mouse(qtbot, shown, mouse):
    click(qtbot, shown.row.tools["distance"])
    mouse.drag((400, 300), (800, 300))
    mouse.drag((400, 500), (600, 500))
    shown.view.menu_requested.emit(mouse.screen((500, 301)))
    menu = next(
        x
        for x in QApplication.topLevelWidgets()
        if x.metaObject().className() == "QMenu" and x.isVisible()
    )
    first = menu.actions()[0]
    qtbot.mouseClick(menu, Qt.MouseButton.LeftButton, pos=menu.actionGeometry(first).center())
    (left,) = measured(shown)
    assert float(left.split()[0]) == pytest.approx(250, rel=0.02)


def test_a_click_without_a_drag_measures_nothing(qtbot, shown, mouse):
    click(qtbot, shown.row.tools["distance"])
    mouse.click((400, 300))
    assert measured(shown) == []


def test_an_angle_takes_three_clicks(qtbot, shown, mouse):
    click(qtbot, shown.row.tools["angle"])
    for place in ((800, 300), (400, 300), (400, 700)):
        mouse.move(place)
        mouse.click(place)
    (text,) = measured(shown)
    assert float(text.removesuffix("°")) == pytest.approx(90.0, abs=0.5)


def test_escape_forgets_what_is_half_measured_and_puts_the_tool_away(qtbot, shown, mouse):
    click(qtbot, shown.row.tools["angle"])
    mouse.click((800, 300))
    qtbot.keyClick(shown.view, Qt.Key.Key_Escape)
    assert measured(shown) == []
    assert not shown.row.tools["angle"].isChecked()
    assert shown.view.tool is None


def test_without_a_scale_distances_are_in_pixels(qtbot, shown, mouse, camera):
    camera.scale_um_px = None
    image = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is image)
    click(qtbot, shown.row.tools["distance"])
    mouse.drag((400, 300), (800, 300))
    (text,) = measured(shown)
    assert text.endswith(" px")


def test_a_measurement_keeps_the_scale_it_was_made_at(qtbot, shown, mouse, camera):
    click(qtbot, shown.row.tools["distance"])
    mouse.drag((400, 300), (800, 300))
    before = measured(shown)
    camera.scale_um_px = 0.5
    image = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is image)
    shown.grab()
    assert measured(shown) == before


def test_a_region_that_is_dragged_becomes_that_of_the_camera(qtbot, shown, mouse, camera):
    click(qtbot, shown.row.tools["region"])
    mouse.drag((403, 300), (797, 597))
    assert camera.settings.roi == Roi(400, 296, 400, 304)  # in steps of 8
    assert shown.view.tool is None
    click(qtbot, shown.row.tools["region"])
    mouse.drag((100, 100), (197, 180))
    assert camera.settings.roi == Roi(496, 392, 104, 88)  # a part of the part
    click(qtbot, shown.row.more)
    click(qtbot, shown.form.full_sensor)
    assert camera.settings.roi == Roi(0, 0, 1600, 1200)


def test_a_region_too_small_to_be_meant_is_none(qtbot, shown, mouse, camera):
    click(qtbot, shown.row.tools["region"])
    mouse.drag((400, 300), (403, 302))
    assert camera.calls == []


def test_click_to_move_is_off_with_its_reason_until_calibrated(qtbot, shown, camera):
    assert not shown.row.go.isEnabled()
    assert "not calibrated" in shown.row.go.toolTip()
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)


def test_a_click_moves_what_was_chosen_and_says_so(qtbot, shown, mouse, camera):
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)
    choose_target(qtbot, shown, "right gripper")
    assert shown.view.viewport().cursor().shape() is Qt.CursorShape.PointingHandCursor
    mouse.click((700, 400))
    ((call, place, what),) = camera.calls
    assert (call, what) == ("move", "right gripper")
    assert place == pytest.approx((700, 400), abs=1.0)
    assert shown.message.text == "right gripper goes there"


def test_a_refused_move_is_reported_over_the_image(qtbot, shown, mouse, camera):
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)
    choose_target(qtbot, shown, "left gripper")
    camera.refuse = "left jaw would come within 12 µm of the plate"
    mouse.click((700, 400))
    assert shown.message.text == "◆ left jaw would come within 12 µm of the plate"
    mouse.click((-30, 400))
    assert "outside the image" in shown.message.text
    assert camera.calls == []


def test_a_calibration_that_is_lost_ends_click_to_move(qtbot, shown, mouse, camera):
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)
    choose_target(qtbot, shown, "left gripper")
    camera.change(calibration_problem="the zoom has changed: calibrate again")
    qtbot.waitUntil(lambda: shown.view.tool is None)
    mouse.click((700, 400))
    assert camera.calls == []
    assert not shown.row.go.isChecked()


def test_nothing_moves_while_the_choice_is_open(qtbot, shown, mouse, camera):
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)
    click(qtbot, shown.row.go)
    qtbot.keyClick(shown.row.menu, Qt.Key.Key_Escape)
    mouse.click((700, 400))
    assert camera.calls == []


def test_a_drag_aims_and_the_tool_moves_to_where_the_button_is_let_go(
    qtbot, shown, mouse, camera
) -> None:
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)
    choose_target(qtbot, shown, "right gripper")
    aimed: list[object] = []
    shown.tools.aimed.connect(lambda point, what: aimed.append((point, what)))
    mouse.drag((100.0, 100.0), (300.0, 200.0))
    points = [point for point, what in aimed if point is not None]
    assert points[0] == pytest.approx((100.0, 100.0), abs=1.0)
    assert points[-1] == pytest.approx((300.0, 200.0), abs=1.0)
    assert aimed[-1][0] is None
    ((_, place, what),) = camera.calls
    assert (place, what) == (pytest.approx((300.0, 200.0), abs=1.0), "right gripper")


@pytest.mark.parametrize("kind", ["move", "region", "distance", "angle"])
def test_a_double_click_is_one_click_for_a_tool(qtbot, shown, mouse, camera, kind) -> None:
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)
    if kind == "move":
        choose_target(qtbot, shown, "right gripper")
    else:
        click(qtbot, shown.row.tools[kind])
    there = shown.view.to_screen.map(QPointF(300.0, 200.0)).toPoint()
    pane = shown.view.viewport()
    qtbot.mouseClick(pane, Qt.MouseButton.LeftButton, pos=there)
    qtbot.mouseDClick(pane, Qt.MouseButton.LeftButton, pos=there)
    assert len(camera.calls) == (1 if kind == "move" else 0)


def colours_around(view, point_px) -> set[str]:
    """Return the colours on the screen within a few pixels of a pixel of the image."""
    there = view.view.to_screen.map(QPointF(*point_px)).toPoint()
    shot = view.view.grab().toImage()
    near = range(-4, 5)
    return {
        shot.pixelColor(there + QPoint(across, down)).name().upper()
        for across in near
        for down in near
    }


def test_a_drag_shows_where_the_tool_would_stand(qtbot, shown, mouse, camera) -> None:
    place = (300.0, 200.0)
    before = colours_around(shown, place)
    shown.ghost.aim(place, width_px=40.0)
    shown.view.redraw()
    assert GREEN.name().upper() in colours_around(shown, place) - before
    shown.ghost.show_answer("the plate is in the way", allowed=False)
    shown.view.redraw()
    assert ORANGE.name().upper() in colours_around(shown, place) - before
    shown.ghost.aim(None)
    shown.view.redraw()
    assert colours_around(shown, place) == before


def test_a_gripper_is_outlined_where_its_jaws_would_stand(qtbot, shown, mouse, camera) -> None:
    tip, jaw = (300.0, 200.0), (280.0, 240.0)  # the inner edge of one jaw of a gap of 80 pixels
    before = colours_around(shown, jaw)
    shown.ghost.aim(tip, width_px=20.0)
    shown.view.redraw()
    assert GREEN.name().upper() not in colours_around(shown, jaw) - before
    shown.ghost.aim(tip, width_px=20.0, gap_px=80.0)
    shown.view.redraw()
    assert GREEN.name().upper() in colours_around(shown, jaw) - before
    between = colours_around(shown, (280.0, 210.0))
    assert GREEN.name().upper() not in between, "nothing of it stands between its jaws"


def test_the_wheel_with_ctrl_changes_the_height_and_not_the_zoom(qtbot, shown, camera) -> None:
    camera.change(calibration_problem="")
    qtbot.waitUntil(shown.row.go.isEnabled)
    notches: list[int] = []
    shown.view.height_wheeled.connect(notches.append)

    def wheel(modifier: Qt.KeyboardModifier) -> None:
        middle = QPointF(shown.view.rect().center())
        event = QWheelEvent(
            middle,
            QPointF(shown.view.mapToGlobal(middle.toPoint())),
            QPoint(),
            QPoint(0, 120),
            Qt.MouseButton.NoButton,
            modifier,
            Qt.ScrollPhase.NoScrollPhase,
            False,
        )
        QApplication.sendEvent(shown.view.viewport(), event)

    wheel(Qt.KeyboardModifier.ControlModifier)
    assert notches == [], "no tool is chosen: the wheel zooms"
    zoom = shown.view.zoom
    choose_target(qtbot, shown, "right gripper")
    wheel(Qt.KeyboardModifier.ControlModifier)
    assert notches == [1]
    assert shown.view.zoom == zoom
