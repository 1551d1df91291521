"""The wheel scrolls; it changes nothing that it only passes over."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QDoubleSpinBox,
    QScrollArea,
    QSlider,
    QSpinBox,
    QTabBar,
    QVBoxLayout,
    QWidget,
)
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.application_events import ApplicationEvents
from cosmic.frame.gui.wheel_guard import WheelGuard
from gui.frame.wheel import turn


@pytest.fixture
def area(qtbot: QtBot, qapp: QApplication) -> Iterator[QScrollArea]:
    """A panel to be scrolled, with one of each that could react."""
    guard = WheelGuard(qapp)
    content = QWidget()
    column = QVBoxLayout(content)
    spin, real, slider, combo, tabs = (
        QSpinBox(),
        QDoubleSpinBox(),
        QSlider(Qt.Orientation.Horizontal),
        QComboBox(),
        QTabBar(),
    )
    combo.addItems(["left", "right", "probe"])
    for each in ("one", "two", "three"):
        tabs.addTab(each)
    for widget in (spin, real, slider, combo, tabs):
        column.addWidget(widget)
    content.setMinimumHeight(2000)
    area = QScrollArea()
    area.setWidget(content)
    area.setWidgetResizable(True)
    qtbot.addWidget(area)
    area.resize(300, 300)
    with qtbot.waitActive(area):
        area.show()
        area.activateWindow()
    area.setFocus()
    yield area
    ApplicationEvents.of(qapp).remove(guard)
    guard.deleteLater()


def value(widget: QWidget) -> float:
    if isinstance(widget, (QComboBox, QTabBar)):
        return widget.currentIndex()
    assert isinstance(widget, (QSpinBox, QDoubleSpinBox, QSlider))
    return widget.value()


@pytest.mark.parametrize("kind", [QSpinBox, QDoubleSpinBox, QSlider, QComboBox, QTabBar])
def test_the_wheel_leaves_the_value_and_is_handed_on_to_what_scrolls(
    area: QScrollArea, kind: type[QWidget]
) -> None:
    widget = area.findChild(kind)
    for notches in (-1, 1, -1):
        assert not turn(widget, notches)
        assert value(widget) == 0
    assert not widget.hasFocus()


@pytest.mark.parametrize("kind", [QSpinBox, QDoubleSpinBox, QSlider, QComboBox, QTabBar])
def test_the_panel_scrolls_with_the_mouse_over_any_of_them(
    area: QScrollArea, kind: type[QWidget]
) -> None:
    widget, bar = area.findChild(kind), area.verticalScrollBar()
    bar.setValue(bar.maximum() // 2)
    area.ensureWidgetVisible(widget)
    before = bar.value()
    place = widget.mapTo(area, widget.rect().center())
    QTest.wheelEvent(area.windowHandle(), QPointF(place), QPoint(0, -120))
    assert bar.value() > before
    assert value(widget) == 0
    assert not widget.hasFocus()


@pytest.mark.parametrize("kind", [QSpinBox, QSlider])
def test_a_field_with_the_focus_takes_the_wheel(area: QScrollArea, kind: type[QWidget]) -> None:
    widget = area.findChild(kind)
    widget.setFocus()
    turn(widget, 1)
    assert value(widget) != 0


@pytest.mark.parametrize("kind", [QComboBox, QTabBar])
def test_a_choice_is_not_made_by_the_wheel_even_with_the_focus(
    area: QScrollArea, kind: type[QWidget]
) -> None:
    widget = area.findChild(kind)
    widget.setFocus()
    turn(widget, -1)
    assert value(widget) == 0


def test_a_scroll_bar_keeps_the_wheel(area: QScrollArea) -> None:
    bar = area.verticalScrollBar()
    before = bar.value()
    turn(bar, -1)
    assert bar.value() > before
