import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.frame.gui.reason_bubble import ReasonBubble
from cosmic.frame.gui.theme import current_palette


@pytest.fixture
def window(qtbot: QtBot) -> QWidget:
    window = QWidget()
    column = QVBoxLayout(window)
    for low, high in ((-5000.0, 5000.0), (0.0, 10.0)):
        column.addWidget(QuantityField("um", low=low, high=high, name="target"))
    window.resize(400, 300)
    qtbot.addWidget(window)
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()
    return window


def fields(window: QWidget) -> list[QuantityField]:
    return window.findChildren(QuantityField)


@pytest.fixture
def field(window: QWidget) -> QuantityField:
    first = fields(window)[0]
    first.setFocus()
    return first


def enter(qtbot: QtBot, field: QuantityField, text: str) -> None:
    field.selectAll()
    if text:
        qtbot.keyClicks(field, text)
    else:
        qtbot.keyClick(field, Qt.Key.Key_Delete)
    qtbot.keyClick(field, Qt.Key.Key_Return)


def bubble(field: QuantityField) -> ReasonBubble:
    return ReasonBubble.of(field)


@pytest.mark.parametrize(
    ("text", "value"),
    [("120", 120.0), ("-0.25", -0.25), ("0.2 mm", 200.0), ("200 nm", 0.2), ("5000", 5000.0)],
)
def test_a_number_with_or_without_a_unit_is_taken(
    qtbot: QtBot, field: QuantityField, text: str, value: float
) -> None:
    with qtbot.waitSignal(field.value_committed) as signal:
        enter(qtbot, field, text)
    assert signal.args == [pytest.approx(value)]
    assert field.value() == pytest.approx(value)
    assert field.reason == ""
    assert float(field.text()) == pytest.approx(value)


@pytest.mark.parametrize(
    "text", ["nan", "inf", "1e400", "abc", "", "1,5", "5000.1", "-1e9", "3 V", "--1", "1 2"]
)
def test_a_bad_entry_is_refused_keeps_its_text_and_says_why(
    qtbot: QtBot, field: QuantityField, text: str
) -> None:
    with qtbot.assertNotEmitted(field.value_committed), qtbot.waitSignal(field.refused):
        enter(qtbot, field, text)
    assert field.text() == text
    assert field.value() == 0.0
    assert field.reason
    assert field.reason in field.toolTip()
    assert field.accessibleDescription() == field.reason
    assert field.property("refused") is True
    assert bubble(field).isVisible()
    assert field.reason in bubble(field).text()


def test_a_value_beyond_the_range_names_value_and_limit(qtbot: QtBot, field: QuantityField) -> None:
    enter(qtbot, field, "25 mm")
    assert "25000.0 µm" in field.reason
    assert "5000.0 µm" in field.reason


def test_showing_the_reason_moves_nothing(qtbot: QtBot, field: QuantityField) -> None:
    before = [each.geometry() for each in fields(field.window())]
    enter(qtbot, field, "abc")
    assert [each.geometry() for each in fields(field.window())] == before


def test_the_reason_stands_right_below_the_field(qtbot: QtBot, field: QuantityField) -> None:
    enter(qtbot, field, "abc")
    note = bubble(field).geometry()
    assert 0 <= note.top() - field.geometry().bottom() <= 8
    assert note.left() == field.geometry().left()


def test_escape_goes_back_to_the_last_good_value(qtbot: QtBot, field: QuantityField) -> None:
    enter(qtbot, field, "120")
    enter(qtbot, field, "abc")
    assert field.is_editing
    qtbot.keyClick(field, Qt.Key.Key_Escape)
    assert field.text() == "120.0"
    assert field.reason == ""
    assert not field.is_editing
    assert not bubble(field).isVisible()
    assert field.property("refused") is False


def test_typing_on_takes_the_refusal_away(qtbot: QtBot, field: QuantityField) -> None:
    enter(qtbot, field, "abc")
    qtbot.keyClick(field, Qt.Key.Key_Backspace)
    assert field.reason == ""
    assert field.is_editing


def test_leaving_the_field_commits_once(qtbot: QtBot, window: QWidget) -> None:
    first, second = fields(window)
    values: list[float] = []
    first.value_committed.connect(values.append)
    first.setFocus()
    first.selectAll()
    qtbot.keyClicks(first, "7")
    second.setFocus()
    first.setFocus()
    second.setFocus()
    assert values == [7.0]


def test_an_unchanged_value_is_not_committed_but_entered(
    qtbot: QtBot, field: QuantityField
) -> None:
    enter(qtbot, field, "7")
    with qtbot.assertNotEmitted(field.value_committed), qtbot.waitSignal(field.entered) as signal:
        enter(qtbot, field, "7.0 um")
    assert signal.args == [7.0]


def test_a_refusal_by_the_gate_undoes_what_was_committed(
    qtbot: QtBot, field: QuantityField
) -> None:
    def refuse(value: float) -> None:
        field.refuse("left.gripper would touch the table")

    enter(qtbot, field, "10")
    field.value_committed.connect(refuse)
    with qtbot.assertNotEmitted(field.entered):
        enter(qtbot, field, "20")
    assert field.text() == "20.0"
    assert "touch the table" in field.reason
    assert field.value() == 10.0
    qtbot.keyClick(field, Qt.Key.Key_Escape)
    assert field.text() == "10.0"


def test_a_value_from_the_model_leaves_an_entry_alone(qtbot: QtBot, field: QuantityField) -> None:
    field.selectAll()
    qtbot.keyClicks(field, "12")
    field.set_value(99.5)
    assert field.text() == "12"
    qtbot.keyClick(field, Qt.Key.Key_Escape)
    assert field.text() == "99.5"


def test_the_text_always_says_the_value_exactly(qtbot: QtBot, field: QuantityField) -> None:
    enter(qtbot, field, "12.3456")
    assert field.text() == "12.3456"


@pytest.mark.parametrize("text", ["1.5", "0", "30000"])
def test_a_field_for_whole_numbers_refuses_others(qtbot: QtBot, text: str) -> None:
    steps = QuantityField("steps", low=1, high=29999, value=10, integers=True)
    qtbot.addWidget(steps)
    steps.show()
    enter(qtbot, steps, text)
    assert steps.reason
    enter(qtbot, steps, "100")
    assert (steps.value(), steps.text()) == (100.0, "100")


def test_one_window_spells_out_one_refusal(qtbot: QtBot, window: QWidget) -> None:
    for each in fields(window):
        enter(qtbot, each, "abc")
    assert len(window.findChildren(ReasonBubble)) == 1
    assert all(each.reason for each in fields(window))


def test_a_deleted_field_takes_its_note_along(qtbot: QtBot, window: QWidget) -> None:
    first = fields(window)[0]
    enter(qtbot, first, "abc")
    note = bubble(first)
    with qtbot.waitSignal(first.destroyed):
        first.deleteLater()
    assert not note.isVisible()


def test_a_click_takes_the_note_away_and_leaves_the_refusal(
    qtbot: QtBot, field: QuantityField
) -> None:
    enter(qtbot, field, "abc")
    qtbot.mouseClick(bubble(field), Qt.MouseButton.LeftButton)
    assert not bubble(field).isVisible()
    assert field.reason


def test_what_is_typed_after_the_click_into_a_field_replaces_its_number(
    qtbot: QtBot, window: QWidget
) -> None:
    fields(window)[1].setFocus()
    field = fields(window)[0]
    qtbot.mouseClick(field, Qt.MouseButton.LeftButton)
    qtbot.keyClicks(field, "0.2 mm")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert field.value() == 200.0


def test_a_click_into_a_field_that_is_typed_into_puts_the_cursor(
    qtbot: QtBot, field: QuantityField
) -> None:
    field.setText("120")
    qtbot.mouseClick(field, Qt.MouseButton.LeftButton)
    assert not field.hasSelectedText()


def test_a_double_click_marks_the_whole_number(qtbot: QtBot, field: QuantityField) -> None:
    field.set_value(-12.5)
    room = field.cursorRect().center()
    qtbot.mouseDClick(field, Qt.MouseButton.LeftButton, pos=room)
    qtbot.keyClicks(field, "90")
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert field.value() == 90.0


def test_the_mark_of_a_refusal_covers_no_digit(qtbot: QtBot, field: QuantityField) -> None:
    field.setText("-9000.0")
    field.setFixedWidth(80)  # as in the table of axes
    before = field.grab().toImage()
    field.refuse("too far")
    field.deselect()
    after = field.grab().toImage()
    mark = QColor(current_palette().refused)
    marked = [
        x
        for x in range(4, after.width() - 4)
        for y in range(8, after.height() - 8)
        if _near(after.pixelColor(x, y), mark) and not _near(before.pixelColor(x, y), mark)
    ]
    assert marked
    assert min(marked) > field.cursorRect().left()


def _near(one: QColor, other: QColor) -> bool:
    pairs = zip(one.getRgb(), other.getRgb(), strict=True)
    return all(abs(a - b) < 40 for a, b in pairs)


def test_a_refusal_has_the_units_that_the_field_shows(field: QuantityField) -> None:
    field.refuse("target 6000 um is outside its limit 5500 um")
    assert field.reason == "target 6000 µm is outside its limit 5500 µm"
