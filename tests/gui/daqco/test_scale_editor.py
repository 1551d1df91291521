"""The custom scale editor as its operator sees it."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialogButtonBox

from cosmic.daqco.core.settings import ScaleSettings
from cosmic.daqco.gui.scale_editor import ScaleEditor, formula

Button = QDialogButtonBox.StandardButton
SCALES = (
    ScaleSettings(name="Probe", unit="uN", coefficients=(0.5, 20.0)),
    ScaleSettings(name="Bent", unit="mN", coefficients=(0.0, 1.0, -0.25)),
)


@pytest.fixture
def editor(qtbot):
    made = ScaleEditor(SCALES, {"Probe": "force"}, chosen="Probe")
    qtbot.addWidget(made)
    made.show()
    made.accepted_scales = []
    made.scales_accepted.connect(lambda *given: made.accepted_scales.append(given))
    return made


def ok(qtbot, editor):
    qtbot.mouseClick(editor.buttons.button(Button.Ok), Qt.MouseButton.LeftButton)


def names(editor):
    return [editor.list.item(row).text() for row in range(editor.list.count())]


def test_scales_are_listed_and_the_one_chosen_is_shown(editor):
    assert names(editor) == ["Probe", "Bent"]
    assert editor.name.text() == "Probe"
    assert editor.unit.text() == "uN"
    assert [field.text() for field in editor.coefficients[:3]] == ["0.5", "20", ""]


def test_a_scale_is_plotted_over_all_voltages(editor):
    volts, values = editor.plot.curve.getData()
    assert (volts[0], volts[-1]) == (-10.0, 10.0)
    assert (values[0], values[-1]) == (-199.5, 200.5)


def test_a_scale_is_tried_on_a_voltage(qtbot, editor):
    editor.plot.volts.selectAll()
    qtbot.keyClicks(editor.plot.volts, "2.5")
    qtbot.keyClick(editor.plot.volts, Qt.Key.Key_Return)
    assert editor.plot.result.text() == "50.5 µN"
    assert editor.isVisible()


def test_coefficients_are_changed_and_handed_over(qtbot, editor):
    editor.coefficients[2].setText("-1e-3")
    ok(qtbot, editor)
    ((scales, renamed),) = editor.accepted_scales
    assert scales[0].coefficients == (0.5, 20.0, -0.001)
    assert renamed == {}
    assert not editor.isVisible()


def test_a_missing_power_is_zero(qtbot, editor):
    editor.coefficients[3].setText("2")
    ok(qtbot, editor)
    assert editor.accepted_scales[0][0][0].coefficients == (0.5, 20.0, 0.0, 2.0)


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e13", "1,5", "two", "1e400"])
def test_a_coefficient_that_is_none_or_huge_is_refused_at_its_field(qtbot, editor, text):
    editor.coefficients[1].setText(text)
    ok(qtbot, editor)
    assert editor.coefficients[1].reason
    assert editor.coefficients[1].text() == text
    assert editor.accepted_scales == []
    assert editor.isVisible()


def test_a_scale_without_coefficients_is_refused(qtbot, editor):
    for field in editor.coefficients:
        field.setText("")
    ok(qtbot, editor)
    assert "0 coefficients" in editor.message.text()
    assert editor.accepted_scales == []


@pytest.mark.parametrize(
    ("name", "unit", "refusal"),
    [("", "uN", "needs a name"), ("Bent", "uN", "already"), ("Volts", "V", "already"),
     ("Probe", "", "unit")],
)  # fmt: skip
def test_name_and_unit_are_needed_and_the_name_is_its_own(qtbot, editor, name, unit, refusal):
    editor.name.setText(name)
    editor.unit.setText(unit)
    ok(qtbot, editor)
    assert refusal in editor.message.text()
    assert editor.accepted_scales == []


def test_a_refused_scale_stays_selected(editor):
    editor.coefficients[0].setText("nan")
    editor.list.setCurrentRow(1)
    assert editor.list.currentRow() == 0
    assert editor.name.text() == "Probe"


def test_a_scale_is_added_edited_and_renamed(qtbot, editor):
    editor.name.setText("Tip")
    qtbot.mouseClick(editor.add, Qt.MouseButton.LeftButton)
    assert names(editor) == ["Tip", "Bent", "Scale 1"]
    editor.name.setText("Lamp")
    ok(qtbot, editor)
    ((scales, renamed),) = editor.accepted_scales
    assert [each.name for each in scales] == ["Tip", "Bent", "Lamp"]
    assert renamed == {"Probe": "Tip"}


def test_a_scale_in_use_cannot_be_removed_and_it_says_by_whom(qtbot, editor):
    assert not editor.remove.isEnabled()
    assert editor.remove.toolTip() == "Used by force"
    editor.list.setCurrentRow(1)
    qtbot.mouseClick(editor.remove, Qt.MouseButton.LeftButton)
    ok(qtbot, editor)
    assert [each.name for each in editor.accepted_scales[0][0]] == ["Probe"]


def test_a_scale_that_turns_back_is_reported(editor):
    editor.list.setCurrentRow(1)
    assert "two voltages give the same value" in editor.plot.hint.text()


def test_without_scales_only_adding_is_possible(qtbot):
    editor = ScaleEditor((), {})
    qtbot.addWidget(editor)
    editor.show()
    assert not editor.name.isEnabled()
    assert not editor.remove.isEnabled()
    qtbot.mouseClick(editor.add, Qt.MouseButton.LeftButton)
    assert editor.name.isEnabled()
    qtbot.mouseClick(editor.remove, Qt.MouseButton.LeftButton)
    assert names(editor) == []


def test_cancel_hands_nothing_over(qtbot, editor):
    editor.coefficients[0].setText("nan")
    qtbot.mouseClick(editor.buttons.button(Button.Cancel), Qt.MouseButton.LeftButton)
    assert not editor.isVisible()
    assert editor.accepted_scales == []


def test_a_formula_reads_like_one():
    assert formula((0.5, -20.0, 0.0, 1e-3), "uN") == "value in µN = 0.5 − 20 V + 0.001 V³"
    assert formula((0.0,), "V") == "value in V = 0"
