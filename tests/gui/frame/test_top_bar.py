from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QToolButton
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.chip import Chip, Tone
from cosmic.frame.gui.clearance_meter import Clearance
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.palette import ThemeName, contrast_ratio
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.stop_button import StopButton
from cosmic.frame.gui.theme import State, apply_theme
from cosmic.frame.gui.top_bar import TopBar

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def bar(qtbot: QtBot) -> TopBar:
    bar = TopBar()
    bar.resize(1366, 70)
    qtbot.addWidget(bar)
    bar.show()
    return bar


def stop_button(bar: TopBar) -> StopButton:
    return bar.findChildren(StopButton)[0]


def reset_button(bar: TopBar) -> QPushButton:
    return next(each for each in bar.findChildren(QPushButton) if each.text() == "Reset")


def texts(bar: TopBar) -> str:
    return " | ".join(each.text() for each in bar.findChildren(QLabel) if each.isVisible())


def test_stop_is_at_the_right_high_and_names_its_key(bar: TopBar) -> None:
    stop = stop_button(bar)
    assert stop.height() >= 48
    assert stop.text() == "STOP  F12"
    assert bar.width() - stop.geometry().right() < 16


def test_stop_acts_when_the_mouse_button_goes_down(qtbot: QtBot, bar: TopBar) -> None:
    with qtbot.waitSignal(bar.stop_requested):
        qtbot.mousePress(stop_button(bar), LEFT)


def test_the_latched_bar_says_why_and_offers_reset(qtbot: QtBot, bar: TopBar) -> None:
    height = bar.sizeHint().height()
    assert not reset_button(bar).isVisible()
    bar.set_latched("force above 400 µN")
    assert bar.property("latched") is True
    assert "STOPPED: force above 400 µN" in texts(bar)
    assert "SIMULATED" in texts(bar)
    assert bar.sizeHint().height() == height
    with qtbot.waitSignal(bar.reset_requested):
        qtbot.mouseClick(reset_button(bar), LEFT)
    assert bar.latched  # only the owner resets
    bar.set_latched(None)
    assert "STOPPED" not in texts(bar)
    assert not reset_button(bar).isVisible()


def test_the_whole_latched_bar_is_red(bar: TopBar) -> None:
    bar.set_latched("F12")
    image = bar.grab().toImage()
    for x, y in ((2, 2), (2, bar.height() - 6), (bar.width() - 3, 2), (bar.width() // 2, 2)):
        colour = image.pixelColor(x, y)
        assert colour.red() > 120
        assert colour.green() < 40


@pytest.fixture
def light_or_dark(qapp: QApplication, request: pytest.FixtureRequest) -> Iterator[None]:
    """A theme for one test."""
    name: ThemeName = request.param
    apply_theme(qapp, name)
    yield
    apply_theme(qapp, "dark")
    qapp.setStyleSheet("")


@pytest.mark.parametrize("tone", ["quiet", "warning", "alarm", "real"])
@pytest.mark.parametrize("light_or_dark", ["light", "dark"], indirect=True)
@pytest.mark.usefixtures("light_or_dark")
def test_what_a_chip_says_can_be_read_while_stopped(bar: TopBar, tone: Tone) -> None:
    chip = Chip("force 2.2/150 ARMED", tone)
    bar.set_workspaces((("Handle", "Move one tool"),))
    bar.add_indicator(chip)
    bar.set_latched("key F12")
    image = chip.grab().toImage()
    ground = image.pixelColor(4, image.height() // 2).name()
    seen = {image.pixelColor(x, y).name() for x in range(image.width()) for y in (10, 12, 14)}
    assert max(contrast_ratio(each, ground) for each in seen) > 4.5


def test_a_narrow_bar_says_stopped_in_whole(bar: TopBar) -> None:
    bar.set_latched("force above 400 µN")
    label = next(each for each in bar.findChildren(ElidedLabel) if "STOPPED" in each.text())
    for words in ("■ STOPPED: force above 400 µN", "■ STOPPED", "STOPPED"):
        label.resize(label.fontMetrics().horizontalAdvance(words) + 4, label.height())
        assert label.shown_text == words
    assert "force above 400 µN" in label.toolTip()


def test_a_reason_too_long_for_the_large_letters_stands_in_small_ones(bar: TopBar) -> None:
    words = "■ STOPPED: force reached 153.5 µN, its limit is 150"
    bar.set_latched("force reached 153.5 uN, its limit is 150")
    label = next(each for each in bar.findChildren(ElidedLabel) if "STOPPED" in each.text())
    label.resize(int(0.9 * label.fontMetrics().horizontalAdvance(words)), label.height())
    assert label.shown_text == words


def test_missing_collision_model_is_said_loudly(bar: TopBar) -> None:
    assert "no collision model" in texts(bar)
    bar.set_collision_model(present=True)
    assert "no collision model" not in texts(bar)


def test_the_clearance_says_how_near_and_who(bar: TopBar) -> None:
    bar.set_collision_model(present=True)
    bar.set_clearance(Clearance(182.4, ("jaw", "plate"), 5.0))
    assert bar.clearance_text == "clearance 182 µm  jaw – plate"
    assert "182" in texts(bar)
    assert "jaw – plate" in texts(bar)


@pytest.mark.parametrize(
    ("distance_um", "word"),
    [
        (25.0, "● clearance"),
        (24.9, "▲ close"),
        (5.1, "▲ close"),
        (5.0, "◆ at margin"),
        (0.0, "◆ at margin"),
        (float("nan"), "◆ at margin"),
    ],
)
def test_closeness_is_said_by_sign_and_word(bar: TopBar, distance_um: float, word: str) -> None:
    bar.set_collision_model(present=True)
    bar.set_clearance(Clearance(distance_um, ("jaw", "plate"), 5.0))
    assert word in texts(bar)


def test_an_unknown_clearance_says_why_and_shows_no_number(bar: TopBar) -> None:
    bar.set_collision_model(present=True)
    bar.set_clearance(Clearance(182.4, ("jaw", "plate"), 5.0))
    bar.set_clearance(None, "not referenced")
    assert bar.clearance_text == "clearance unknown: not referenced"
    assert "unknown: not referenced" in texts(bar)
    assert "182" not in texts(bar)


def test_the_figures_of_the_clearance_never_move(qtbot: QtBot, bar: TopBar) -> None:
    bar.set_collision_model(present=True)
    places = set()
    figures = bar.findChild(QLabel, "clearance")
    assert figures is not None
    for distance_um in (0.0, 7.2, 182.0, 123456.0):
        bar.set_clearance(Clearance(distance_um, ("a", "right_finger_b_with_a_long_name"), 5.0))
        qtbot.waitUntil(lambda: f"{distance_um:.0f}"[:1] in figures.text())  # noqa: B023
        places.add(figures.geometry().getRect())
    bar.set_clearance(None, "not referenced")
    places.add(figures.geometry().getRect())
    assert len(places) == 1


def test_axes_taken_out_are_named_loudly_while_it_lasts(bar: TopBar) -> None:
    assert "CD OFF" not in texts(bar)
    bar.set_unwatched(("left.x", "left.y", "left.z"))
    assert "CD OFF: left.x, left.y +1" in texts(bar)
    chip = next(each for each in bar.findChildren(QLabel) if "CD OFF" in each.text())
    assert "left.z" in chip.toolTip()
    assert "to watch it again" in chip.toolTip()
    bar.set_latched("F12")
    assert "CD OFF" in texts(bar)
    bar.set_unwatched(())
    assert "CD OFF" not in texts(bar)


def test_contacts_allowed_are_named(bar: TopBar) -> None:
    bar.set_contacts(("grasp",))
    assert "contact: grasp" in texts(bar)
    bar.set_contacts(())
    assert "contact" not in texts(bar)


def test_the_rate_is_shown_where_it_is_not_one(bar: TopBar) -> None:
    assert "time ×" not in texts(bar)
    bar.set_rate(20.0, 18.66)
    assert "time ×20 (reached ×18.7)" in texts(bar)


def test_what_is_clicked_stays_in_place_when_a_warning_comes_and_goes(
    qtbot: QtBot, bar: TopBar
) -> None:
    bar.set_collision_model(present=True)
    bar.set_workspaces((("Set up", "all axes"), ("Look", "the image")))
    names = ("alarmsButton", "modeList")
    clicked = [*(bar.findChild(QToolButton, name) for name in names), bar.controls]
    qtbot.waitUntil(lambda: all(each.isVisible() for each in clicked))
    QApplication.processEvents()
    before = [each.mapTo(bar, each.rect().topLeft()).x() for each in clicked]
    bar.set_rate(1.0, 0.8)
    bar.set_contacts(("grasp",))
    bar.set_unwatched(("left.x",))
    qtbot.waitUntil(lambda: "reached" in texts(bar))
    QApplication.processEvents()
    assert [each.mapTo(bar, each.rect().topLeft()).x() for each in clicked] == before


def test_only_manual_mode_can_be_chosen_and_the_others_say_why(qtbot: QtBot, bar: TopBar) -> None:
    buttons = {each.property("mode"): each for each in bar.findChildren(QToolButton)}
    assert [buttons[each].text() for each in ("MCM", "SCM", "ECM", "ACM")] == [
        "Manual",
        "Replay",
        "Guided",
        "Automatic",
    ]
    assert "ECM" in buttons["ECM"].toolTip()
    assert buttons["MCM"].isChecked()
    for name in ("SCM", "ECM", "ACM"):
        assert not buttons[name].isEnabled()
        assert "Not available" in buttons[name].toolTip()
    bar.set_mode_available("SCM")
    with qtbot.waitSignal(bar.mode_requested) as signal:
        qtbot.mouseClick(buttons["SCM"], LEFT)
    assert signal.args == ["SCM"]
    assert buttons["MCM"].isChecked()  # the owner decides
    bar.set_mode("SCM")
    assert buttons["SCM"].isChecked()


def test_a_long_message_is_elided_has_a_tooltip_and_opens_the_log(
    qtbot: QtBot, bar: TopBar
) -> None:
    story = "device 1 did not answer " * 40
    width = bar.minimumSizeHint().width()
    bar.set_message(story)
    assert bar.minimumSizeHint().width() <= width + StateBadge().sizeHint().width() + 16
    assert bar.message == story.strip()
    line = next(each for each in bar.findChildren(ElidedLabel) if "device 1" in each.text())
    assert story in line.toolTip()
    with qtbot.waitSignal(bar.message_clicked):
        qtbot.mouseClick(line, LEFT)


def test_the_bar_fits_the_smallest_screen(bar: TopBar) -> None:
    bar.set_rate(20.0, 18.66)
    assert bar.minimumSizeHint().width() <= 1280
    bar.set_collision_model(present=True)
    bar.set_contacts(("grasp",))
    bar.set_unwatched(("right.gripper", "table.rotation", "left.x"))
    assert bar.minimumSizeHint().width() <= 1366


def test_a_badge_keeps_its_width_whatever_it_shows(qtbot: QtBot) -> None:
    badge = StateBadge()
    qtbot.addWidget(badge)
    sizes = set()
    for state in State:
        badge.set_state(state, "why")
        sizes.add(badge.sizeHint().toTuple())
        assert badge.toolTip() == f"{state.value}: why"
        assert badge.accessibleName() == f"{state.value}: why"
    assert len(sizes) == 1


def test_badges_of_two_states_look_different(qtbot: QtBot) -> None:
    badge = StateBadge()
    qtbot.addWidget(badge)
    badge.resize(badge.sizeHint())
    images = []
    for state in State:
        badge.set_state(state)
        images.append(badge.grab().toImage())
    assert all(images[i] != images[j] for i in range(len(images)) for j in range(i))


def test_a_badge_in_a_greyed_panel_claims_nothing_by_colour(qtbot: QtBot) -> None:
    badge = StateBadge(State.OK)
    qtbot.addWidget(badge)
    badge.resize(badge.sizeHint())
    badge.setEnabled(False)
    image = badge.grab().toImage()
    colours = {
        image.pixelColor(x, y).hsvSaturation()
        for x in range(image.width())
        for y in range(image.height())
    }
    assert max(colours) < 80
