"""The live image: what is shown, which part of it, and what is never shown."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QWheelEvent
from PySide6.QtWidgets import QApplication

from cosmic.frame.gui.theme import State
from cosmic.vico.core.vision.tool_tips import HeldSeen
from cosmic.vico.gui.camera_view import CameraView
from cosmic.vico.gui.levels import OVER_RGB, UNDER_RGB
from cosmic.vico.gui.seen_layer import fibre_text
from cosmic.vico.hw.interface import FrameStatus, PixelFormat, Trigger
from cosmic.vico.hw.sim_camera import DrawnFrame
from gui.vico.fake_vico import HEIGHT, SETTINGS, WIDTH, Found, Seen, SeenTip


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def colour_at(view, point_px):
    """Return the colour on the screen in the middle of a pixel of the image."""
    view.row.scale.setChecked(False)
    QApplication.processEvents()
    there = view.view.to_screen.map(QPointF(*point_px)).toPoint()
    return view.view.grab().toImage().pixelColor(there).getRgb()[:3]


def half(value, dtype=np.uint8, full=255):
    """Return an image that is `value` but for a quite black and an over-exposed quarter."""
    data = np.full((HEIGHT, WIDTH), value, dtype)
    data[:600, :800] = 0
    data[600:, :800] = full
    return data


def test_only_the_newest_image_is_shown(qtbot, shown, camera):
    paints = shown.view.paints
    newest = [camera.push() for _ in range(20)][-1]
    qtbot.waitUntil(lambda: shown.view.image is newest)
    QApplication.processEvents()
    assert shown.view.paints <= paints + 2


def test_the_window_waits_for_no_image_that_is_still_drawn(qtbot, shown, camera):
    before = shown.view.image
    asked, drawn = [], threading.Event()

    class Slow:
        ready = property(lambda _: drawn.is_set())

        def pixels(self):
            assert drawn.is_set(), "the window waited"
            return half(90)

    frame = DrawnFrame(lambda: asked.append(1) or Slow(), 99, 5.0, 5.0, size_px=(WIDTH, HEIGHT))
    coming = camera.show_frame(frame)
    qtbot.waitUntil(lambda: bool(asked))
    shown.look()
    assert shown.view.image is before
    drawn.set()
    qtbot.waitUntil(lambda: shown.view.image is coming)
    assert asked == [1]


def test_an_incomplete_image_is_not_shown_as_good(qtbot, shown, camera):
    whole = shown.view.image
    camera.push(status=FrameStatus.INCOMPLETE)
    camera.counters = replace(camera.counters, failed=1)
    qtbot.waitUntil(lambda: shown.status.failed.text() == "failed 1")
    assert shown.view.image is whole


def test_nothing_is_drawn_while_nobody_looks(qtbot, own, port, shown, camera):
    other = CameraView(port, "top")
    own(other)
    other.show()
    before = shown.view.image
    shown.hide()
    for _ in range(3):
        newest = camera.push()
        qtbot.waitUntil(lambda newest=newest: other.view.image is newest)
    assert shown.view.image is before
    shown.show()
    qtbot.waitUntil(lambda: shown.view.image is newest)


def test_the_whole_image_is_shown_and_follows_the_window(shown):
    def corners_inside():
        to, room = shown.view.to_screen, shown.view.rect().adjusted(-1, -1, 2, 2)
        ends = [QPointF(-0.5, -0.5), QPointF(WIDTH - 0.5, HEIGHT - 0.5)]
        return all(room.contains(to.map(each).toPoint()) for each in ends)

    assert corners_inside()
    before = shown.view.zoom
    shown.resize(700, 500)
    QApplication.processEvents()
    assert corners_inside()
    assert shown.view.zoom < before


def test_one_to_one_is_kept_when_images_and_window_change(qtbot, shown, camera):
    click(qtbot, shown.row.one_to_one)
    assert shown.view.zoom == pytest.approx(1.0, abs=0.01)
    newest = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is newest)
    assert shown.view.zoom == pytest.approx(1.0, abs=0.01)
    click(qtbot, shown.row.fit)
    assert shown.view.zoom < 0.7


def test_dragging_pans_and_the_part_stays_for_the_next_image(qtbot, shown, mouse, camera):
    click(qtbot, shown.row.one_to_one)
    before = shown.view.pixel_at(QPointF(100, 100))
    mouse.drag((800, 600), (900, 650))
    after = shown.view.pixel_at(QPointF(100, 100))
    assert after[0] == pytest.approx(before[0] - 100, abs=8)
    newest = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is newest)
    assert shown.view.pixel_at(QPointF(100, 100)) == pytest.approx(after)


def test_dragging_pans_also_after_a_menu_has_swallowed_the_right_button_coming_up(
    qtbot, shown, mouse
):
    click(qtbot, shown.row.one_to_one)
    view = shown.view
    scale, before = view.zoom, view.pixel_at(QPointF(100, 100))
    qtbot.mousePress(view.viewport(), Qt.MouseButton.RightButton, pos=QPoint(200, 200))
    mouse.drag((800, 600), (1000, 700))
    assert view.zoom == pytest.approx(scale)
    assert view.pixel_at(QPointF(100, 100))[0] == pytest.approx(before[0] - 200, abs=16)


def test_the_wheel_zooms_about_the_point_below_the_mouse(qtbot, shown, camera):
    place = QPointF(300.0, 200.0)
    before, zoom = shown.view.pixel_at(place), shown.view.zoom
    turn = QWheelEvent(
        place,
        shown.view.viewport().mapToGlobal(place),
        QPoint(),
        QPoint(0, 240),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(shown.view.viewport(), turn)
    assert shown.view.zoom > 1.2 * zoom
    assert shown.view.pixel_at(place) == pytest.approx(before, abs=2.0)
    zoom = shown.view.zoom
    newest = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is newest)
    shown.resize(800, 600)
    QApplication.processEvents()
    assert shown.view.zoom == pytest.approx(zoom, rel=0.01)


@pytest.mark.parametrize(
    ("pixel_format", "dtype", "full"),
    [
        (PixelFormat.MONO8, np.uint8, 255),
        (PixelFormat.MONO10, np.uint16, 1023),
        (PixelFormat.MONO12, np.uint16, 4095),
        (PixelFormat.MONO16, np.uint16, 65535),
    ],
)
def test_every_depth_is_shown_over_its_range_and_lost_pixels_are_marked(
    qtbot, view, camera, pixel_format, dtype, full
):
    image = camera.push(half(full // 2, dtype, full), pixel_format=pixel_format)
    qtbot.waitUntil(lambda: view.view.image is image)
    assert colour_at(view, (1200, 300)) == pytest.approx((127, 127, 127), abs=2)
    assert colour_at(view, (100, 300)) == (0, 0, 0)
    assert colour_at(view, (100, 900)) == (255, 255, 255)
    view.contrast.marks.click()
    assert colour_at(view, (100, 300)) == UNDER_RGB
    assert colour_at(view, (100, 900)) == OVER_RGB
    assert colour_at(view, (1200, 300)) == pytest.approx((127, 127, 127), abs=2)


def test_a_pixel_is_where_its_number_says(qtbot, view, camera):
    data = np.zeros((30, 40), np.uint8)
    data[10, 20] = 200
    image = camera.push(data)
    qtbot.waitUntil(lambda: view.view.image is image)
    bright = {
        (x, y) for x in (19, 20, 21) for y in (9, 10, 11) if colour_at(view, (x, y))[0] == 200
    }
    assert bright == {(20, 10)}
    assert colour_at(view, (19.6, 9.6))[0] == colour_at(view, (20.4, 10.4))[0] == 200


def test_colours_are_shown_as_they_are(qtbot, view, camera):
    data = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    data[:] = (200, 100, 50)
    data[:600, :800] = (255, 10, 10)
    image = camera.push(data, pixel_format=PixelFormat.RGB8)
    qtbot.waitUntil(lambda: view.view.image is image)
    assert colour_at(view, (1200, 300)) == (200, 100, 50)
    view.contrast.marks.click()
    assert colour_at(view, (100, 300)) == OVER_RGB
    assert colour_at(view, (1200, 300)) == (200, 100, 50)


def test_a_lost_camera_leaves_its_last_image_greyed_and_says_since_when(qtbot, shown, camera):
    bright = colour_at(shown, (1400, 300))
    camera.change(problem="the camera does not answer")
    qtbot.waitUntil(lambda: shown.status.badge.state is State.ERROR)
    assert "the camera does not answer" in shown.note.text
    assert "no image since 12:16:40" in shown.note.text
    assert colour_at(shown, (1400, 300)) != bright
    camera.change(problem="")
    newest = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is newest)
    assert shown.note.text == ""
    assert colour_at(shown, (1400, 300)) == bright


def test_an_image_that_is_not_live_is_greyed_with_its_age(qtbot, shown, camera):
    bright = colour_at(shown, (1400, 300))
    camera.change(running=False)
    qtbot.waitUntil(lambda: "not live: image of 12:16:40, " in shown.note.text)
    assert shown.note.text.endswith("s ago")
    assert colour_at(shown, (1400, 300)) != bright
    camera.change(running=True)
    newest = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is newest)
    qtbot.waitUntil(lambda: shown.note.text == "")
    assert colour_at(shown, (1400, 300)) == bright


def test_a_camera_that_says_nothing_is_reported_after_a_while(qtbot, shown, monkeypatch):
    monkeypatch.setattr("cosmic.vico.gui.camera_view.STALE_S", -1.0)
    monkeypatch.setattr(
        shown._camera,
        "settings",
        replace(SETTINGS, rate_hz=1e6),
    )
    qtbot.waitUntil(lambda: "no image since" in shown.note.text)
    assert shown.status.badge.state is State.ERROR


def test_a_camera_that_waits_for_its_trigger_is_no_fault(qtbot, shown, camera):
    camera.change(settings=replace(SETTINGS, trigger=Trigger.SOFTWARE))
    qtbot.waitUntil(lambda: "trigger" in shown.status.badge.toolTip())
    assert shown.status.badge.state is State.OK
    assert shown.note.text == ""


def test_the_live_button_starts_and_stops(qtbot, shown, camera):
    assert shown.row.live.isChecked()
    click(qtbot, shown.row.live)
    assert camera.calls == [("stop",)]
    qtbot.waitUntil(lambda: not shown.row.live.isChecked())
    click(qtbot, shown.row.live)
    assert camera.calls[-1] == ("start",)
    camera.refuse = "another program has the camera"
    click(qtbot, shown.row.live)
    assert "another program has the camera" in shown.message.text
    assert shown.row.live.isChecked()


def test_counters_are_shown_without_moving_anything(qtbot, shown, camera):
    places = [each.geometry() for each in shown.status.readings]
    camera.counters = replace(camera.counters, completed=9_999_999, failed=99, lost=1234)
    qtbot.waitUntil(lambda: shown.status.lost.text() == "lost 1234")
    assert shown.status.completed.text() == "9999999 whole"
    assert [each.geometry() for each in shown.status.readings] == places


def test_the_pixel_below_the_mouse_is_shown_with_its_position_on_the_platform(shown, mouse, camera):
    mouse.move((400, 200))
    assert shown.pointer.text == "400, 200 px = 100"
    camera.calibration_problem = ""
    mouse.move((800, 600))
    assert shown.pointer.text.startswith("800, 600 px = 100  at ")
    mouse.move((-50, 20))
    assert shown.pointer.text == ""


def test_a_message_and_the_pointer_leave_the_scale_bar_to_be_read(shown, mouse):
    mouse.move((400, 200))
    shown.say("a long refusal, which says what, where and what to do; " * 6)
    shown.grab()
    assert not shown.scale_bar.box.isEmpty()
    assert not shown.message.box.isEmpty()
    assert not shown.message.box.intersects(shown.scale_bar.box)
    assert not shown.pointer.box.isEmpty()
    assert not shown.pointer.box.intersects(shown.scale_bar.box)
    assert not shown.pointer.box.intersects(shown.message.box)
    assert QRectF(shown.view.rect()).contains(shown.message.box)
    shown.scale_bar.shown = False
    shown.grab()
    assert shown.message.box.left() < 20.0


def test_the_scale_bar_goes_by_the_scale_when_the_image_was_taken(qtbot, shown, camera):
    shown.grab()
    bar, pixel = shown.scale_bar, abs(shown.view.to_screen.m11())
    number, unit = bar.text.split()
    assert unit == "µm"
    assert bar.length_px == pytest.approx(float(number) / 1.25 * pixel)
    camera.scale_um_px = 0.5  # the lens has zoomed, yet no image shows it
    shown.grab()
    assert bar.text == f"{number} µm"
    image = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is image)
    shown.grab()
    number, unit = bar.text.split()
    assert bar.length_px == pytest.approx(float(number) / 0.5 * pixel)
    camera.scale_um_px = None
    image = camera.push()
    qtbot.waitUntil(lambda: shown.view.image is image)
    shown.grab()
    assert bar.text.endswith("px")


def test_the_crosshair_can_be_toggled_and_takes_no_click(qtbot, shown, mouse):
    middle = ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    plain = colour_at(shown, middle)
    click(qtbot, shown.row.cross)
    assert colour_at(shown, middle) != plain
    click(qtbot, shown.row.tools["distance"])
    mouse.drag(middle, (1000, 700))
    assert len(shown.tools.measures.measures) == 1


def test_fibres_found_are_drawn_with_their_measures_and_doubts(qtbot, shown, camera):
    image = camera.push()
    crossed = Seen(certain=False, doubts=("it crosses itself at a shallow angle",))
    camera.analysis = Found(image, (Seen(), crossed), (SeenTip(),))
    qtbot.waitUntil(lambda: shown.view.image is image)
    shown.grab()
    sure, doubtful, tip = (text for _, text in shown.seen.labels)
    assert sure == "Fibre, certain"
    assert doubtful == "Fibre, not sure: it crosses itself at a shallow angle"
    assert tip == "Tip of left"
    box = shown.seen.labels[1][0]
    assert "shallow angle" in shown.seen.tip(box.bottomRight() - QPointF(2, 2), shown.view)
    line = Seen().centre_line_px[40]
    assert QColor(*colour_at(shown, line)).saturation() > 100
    click(qtbot, shown.row.found)
    assert QColor(*colour_at(shown, line)).saturation() == 0


@pytest.mark.parametrize(
    ("doubt", "words"),
    [
        ("the image's border cuts it off", "goes on out of the image"),
        ("it runs into something wider", "runs into something wider"),
    ],
)
def test_what_is_seen_in_part_is_given_no_length_of_its_own(qtbot, shown, camera, doubt, words):
    image = camera.push()
    cut = Seen(certain=False, doubts=(doubt,))
    camera.analysis = Found(image, (cut,))
    qtbot.waitUntil(lambda: shown.view.image is image)
    text = fibre_text(cut, None)
    assert text.startswith("over 1034.2 px")
    assert text.endswith(words)
    shown.grab()
    assert [text for _, text in shown.seen.labels] == [f"Fibre, not sure: {doubt}"]


def test_a_held_fibre_is_as_long_as_at_the_height_of_its_gripper(qtbot, shown, camera):
    image = camera.push()  # on the plate, 1.25 um a pixel
    line = np.column_stack([np.linspace(300.0, 400.0, 50), np.full(50, 250.0)])
    camera.analysis = Found(image, held=(HeldSeen("left", line, 100.0, 2.0, True, 1.18),))
    qtbot.waitUntil(lambda: shown.view.image is image)
    shown.grab()
    assert [text for _, text in shown.seen.labels] == [
        "Fibre held by left: 118.0 µm free, +2.0° at the jaws"
    ]


def test_findings_in_an_image_of_another_size_are_not_drawn(qtbot, shown, camera):
    camera.analysis = Found(camera.push(), (Seen(),))
    small = camera.push(np.full((600, 800), 100, np.uint8))
    qtbot.waitUntil(lambda: shown.view.image is small)
    shown.grab()
    assert shown.seen.labels == []


def test_the_focus_measure_is_a_number_and_a_history(qtbot, shown, camera):
    camera.focus = 12.5
    qtbot.waitUntil(lambda: shown.status.focus.text() == "focus 12.50")
    camera.focus = 25.0
    qtbot.waitUntil(lambda: shown.status.bars.best == 25.0)
    click(qtbot, shown.status.bars)
    assert shown.status.bars.best == 0.0
