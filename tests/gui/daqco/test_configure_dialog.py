"""`UDaqConfigureDialog` as its operator sees it (thesis, Table F.3)."""

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialogButtonBox

from cosmic.daqco.core.settings import LimitSettings
from cosmic.daqco.gui.configure_dialog import UDaqConfigureDialog
from cosmic.daqco.gui.scale_editor import ScaleEditor, ScaleView
from cosmic.frame.errors import ConfigError
from gui.daqco.fake_port import FakePort, Recorded, many, settings

Button = QDialogButtonBox.StandardButton


@pytest.fixture
def dialog(qtbot, port):
    return shown(qtbot, port)


def shown(qtbot, port):
    made = UDaqConfigureDialog(port)
    qtbot.addWidget(made)
    made.show()
    return made


def press(qtbot, dialog, which):
    qtbot.mouseClick(dialog.button(which), Qt.MouseButton.LeftButton)


def write(qtbot, field, text):
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, text)


def rows(dialog):
    """Return the table: a list of texts for each channel, by board."""
    tree, found = dialog.tree, []
    for top in range(tree.topLevelItemCount()):
        item = tree.topLevelItem(top)
        for number in range(item.childCount()):
            found.append([item.child(number).text(column) for column in range(7)])
    return found


def select(dialog, row):
    item = dialog.tree.topLevelItem(0).child(row)
    dialog.tree.setCurrentItem(item)


def test_the_table_lists_each_channel_with_what_the_operator_set(dialog):
    assert rows(dialog) == [
        ["Dev1/ai0", "force", "-10 V", "10 V", "yes", "Probe", "orange"],
        ["Dev1/ai1", "light", "-10 V", "10 V", "yes", "Volts", "sky blue"],
        ["Dev1/ai2", "spare", "-10 V", "10 V", "no", "Volts", "bluish green"],
    ]
    headings = [dialog.tree.topLevelItem(i).text(0) for i in range(2)]
    assert headings[0] == "Dev1, simulated PCI-6229: 2 of 32 inputs active"


def test_selecting_a_row_shows_its_channel(dialog):
    select(dialog, 1)
    form = dialog.form
    assert form.address.text() == "Dev1/ai1"
    assert form.address.isReadOnly()
    assert form.name.text() == "light"
    assert form.colour_shown.text() == "sky blue"
    assert (form.low.value(), form.high.value()) == (-10.0, 10.0)
    assert form.scale_shown.text() == "Volts"
    assert form.active.isChecked()


def test_apply_puts_every_field_in_force(qtbot, dialog, port):
    form = dialog.form
    write(qtbot, dialog.rate, "2500")
    write(qtbot, dialog.refresh, "60")
    write(qtbot, form.name, "probe.force")
    write(qtbot, form.low, "-5")
    write(qtbot, form.high, "7.5")
    form.colour.setCurrentText("yellow")
    form.colour.activated.emit(form.colour.currentIndex())
    form.scale.setCurrentText("Volts")
    form.scale.activated.emit(form.scale.currentIndex())
    form.mode.setCurrentIndex(2)
    press(qtbot, dialog, Button.Apply)
    assert dialog.isVisible()
    now = port.settings
    assert (now.rate_hz, now.refresh_hz) == (2500.0, 60.0)
    changed = now.channel[0]
    assert (changed.name, changed.low_v, changed.high_v) == ("probe.force", -5.0, 7.5)
    assert (changed.colour, changed.scale, changed.mode) == ("#F0E442", "Volts", "differential")
    assert rows(dialog)[0][1:] == ["probe.force", "-5 V", "7.5 V", "yes", "Volts", "yellow"]


def test_ok_applies_and_closes(qtbot, dialog, port):
    write(qtbot, dialog.form.name, "other")
    press(qtbot, dialog, Button.Ok)
    assert port.settings.channel[0].name == "other"
    assert not dialog.isVisible()


def test_cancel_keeps_what_was_in_force(qtbot, dialog, port):
    before = port.settings
    write(qtbot, dialog.form.name, "other")
    write(qtbot, dialog.rate, "20")
    press(qtbot, dialog, Button.Cancel)
    assert port.settings is before
    assert port.calls == []
    assert not dialog.isVisible()


def test_task_active_takes_a_channel_in_and_out(qtbot, dialog, port):
    select(dialog, 2)
    dialog.form.active.click()
    assert rows(dialog)[2][4] == "yes"
    press(qtbot, dialog, Button.Apply)
    assert port.settings.channel[2].active


@pytest.mark.parametrize("text", ["9.99", "15000.01", "0", "-1", "nan", "inf", "many", "", "1e9"])
def test_a_sampling_frequency_outside_10_to_15000_hz_is_refused(qtbot, dialog, port, text):
    before = port.settings
    dialog.rate.setText(text)
    press(qtbot, dialog, Button.Apply)
    assert dialog.rate.reason
    assert dialog.rate.text() == text
    assert port.settings is before
    assert dialog.isVisible()


@pytest.mark.parametrize("text", ["0.99", "300.5", "nan", "", "fast"])
def test_a_refresh_rate_outside_1_to_300_hz_is_refused(qtbot, dialog, port, text):
    before = port.settings
    dialog.refresh.setText(text)
    press(qtbot, dialog, Button.Ok)
    assert dialog.refresh.reason
    assert port.settings is before
    assert dialog.isVisible()


@pytest.mark.parametrize(("rate", "refresh"), [("10", "1"), ("15000", "300")])
def test_the_ends_of_both_ranges_are_accepted(qtbot, dialog, port, rate, refresh):
    dialog.rate.setText(rate)
    dialog.refresh.setText(refresh)
    press(qtbot, dialog, Button.Ok)
    assert (port.settings.rate_hz, port.settings.refresh_hz) == (float(rate), float(refresh))


@pytest.mark.parametrize(
    ("low", "high", "wrong"),
    [
        ("-10.01", "10", "low"),
        ("-10", "10.01", "high"),
        ("1", "1", "high"),
        ("2", "-2", "high"),
        ("nan", "1", "low"),
        ("-1", "", "high"),
    ],
)
def test_voltages_that_make_no_sense_are_refused_at_the_field(
    qtbot, dialog, port, low, high, wrong
):
    before = port.settings
    dialog.form.low.setText(low)
    dialog.form.high.setText(high)
    press(qtbot, dialog, Button.Apply)
    assert getattr(dialog.form, wrong).reason
    assert port.settings is before


@pytest.mark.parametrize("name", ["", "Force", "1st", "a b", "light", "a.b.c", "ä", "x" * 90])
def test_a_name_that_is_none_or_taken_is_refused(qtbot, dialog, port, name):
    before = port.settings
    dialog.form.name.setText(name)
    press(qtbot, dialog, Button.Apply)
    assert dialog.form.name.property("refused")
    assert dialog.form.name.text() == name
    assert port.settings is before


def test_another_row_cannot_be_selected_while_an_entry_is_refused(dialog):
    dialog.form.low.setText("20")
    select(dialog, 1)
    assert dialog.form.address.text() == "Dev1/ai0"
    assert dialog.tree.row == 0
    assert dialog.form.low.reason


def test_what_was_changed_in_one_row_is_not_lost_by_selecting_another(qtbot, dialog, port):
    write(qtbot, dialog.form.name, "other")
    select(dialog, 1)
    select(dialog, 0)
    assert dialog.form.name.text() == "other"
    press(qtbot, dialog, Button.Apply)
    assert port.settings.channel[0].name == "other"


def test_the_highest_rate_follows_the_active_channels(qtbot, tmp_path):
    port = FakePort(many(32, rate_hz=7000.0), tmp_path)
    dialog = shown(qtbot, port)
    assert dialog.highest.text() == "highest for 32 active channels: 7812.5 Hz"
    dialog.form.active.click()
    assert "31 active channels: 8064" in dialog.highest.text()


def test_more_than_the_board_can_do_is_refused(qtbot, tmp_path):
    port = FakePort(many(32, rate_hz=7000.0), tmp_path)
    dialog = shown(qtbot, port)
    dialog.rate.setText("7813")
    press(qtbot, dialog, Button.Apply)
    assert "at most 7812.5 Hz" in dialog.rate.reason
    assert port.calls == []
    dialog.rate.setText("7812.5")
    press(qtbot, dialog, Button.Apply)
    assert port.settings.rate_hz == 7812.5


def test_an_input_can_be_added_and_removed(qtbot, dialog, port):
    boards = {each.text(): each.menu() for each in dialog.add.menu().actions()}
    inputs = {each.text(): each for each in boards["Dev1, PCI-6229"].actions()}
    assert "ai1" not in inputs
    inputs["ai7"].trigger()
    assert dialog.form.address.text() == "Dev1/ai7"
    press(qtbot, dialog, Button.Apply)
    assert port.settings.channel[-1].input == "ai7"
    qtbot.mouseClick(dialog.remove, Qt.MouseButton.LeftButton)
    press(qtbot, dialog, Button.Apply)
    assert len(port.settings.channel) == 3


def test_without_an_active_channel_it_is_refused(qtbot, dialog, port):
    before = port.settings
    for _ in range(2):
        qtbot.mouseClick(dialog.remove, Qt.MouseButton.LeftButton)
    press(qtbot, dialog, Button.Apply)
    assert "activate at least one" in dialog.message.text()
    assert port.settings is before


def test_all_channels_can_be_removed_from_the_draft_and_one_added(qtbot, dialog, port):
    for _ in range(3):
        qtbot.mouseClick(dialog.remove, Qt.MouseButton.LeftButton)
    assert not dialog.form.isEnabled()
    dialog.add_input("Dev2", "ai31")
    press(qtbot, dialog, Button.Ok)
    assert [f"{x.board}/{x.input}" for x in port.settings.channel] == ["Dev2/ai31"]


def test_a_limit_goes_with_its_channel(qtbot, tmp_path):
    port = FakePort(settings(limit=(LimitSettings(channel="force", high=1.0),)), tmp_path)
    dialog = shown(qtbot, port)
    write(qtbot, dialog.form.name, "probe")
    press(qtbot, dialog, Button.Apply)
    assert port.settings.limit[0].channel == "probe"
    qtbot.mouseClick(dialog.remove, Qt.MouseButton.LeftButton)
    press(qtbot, dialog, Button.Apply)
    assert port.settings.limit == ()


def test_what_the_application_refuses_is_reported_and_the_dialog_stays(qtbot, dialog, port):
    port.refuse = "Dev1 is taken by another program"
    write(qtbot, dialog.rate, "500")
    press(qtbot, dialog, Button.Ok)
    assert "taken by another program" in dialog.message.text()
    assert dialog.isVisible()
    assert dialog.rate.value() == 500.0


def test_rate_and_channels_are_locked_while_recording_and_it_says_why(qtbot, dialog, port):
    port.change(recording=Recorded(active=True, path=port.directory / "x.h5"))
    qtbot.waitUntil(lambda: not dialog.rate.isEnabled())
    assert not dialog.form.active.isEnabled()
    assert not dialog.add.isEnabled()
    assert dialog.form.colour.isEnabled()
    assert "recording is running" in dialog.message.text()
    port.change(recording=Recorded())
    qtbot.waitUntil(dialog.rate.isEnabled)
    assert dialog.form.active.isEnabled()
    assert dialog.message.text() == ""


def test_a_board_that_is_gone_is_reported(qtbot, port):
    port.known = ()
    dialog = shown(qtbot, port)
    assert "not connected" in dialog.tree.topLevelItem(0).text(0)
    assert rows(dialog)[0][1] == "force"


def test_view_shows_the_structure_of_the_scale(qtbot, dialog):
    qtbot.mouseClick(dialog.form.view, Qt.MouseButton.LeftButton)
    view = dialog.findChild(ScaleView)
    assert view.plot.formula.text() == "value in µN = 20 V"
    view.close()


def test_an_edited_scale_is_in_force_after_apply(qtbot, dialog, port):
    qtbot.mouseClick(dialog.form.edit, Qt.MouseButton.LeftButton)
    editor = dialog.findChild(ScaleEditor)
    editor.name.setText("Probe 2")
    editor.coefficients[1].setText("25")
    qtbot.mouseClick(editor.buttons.button(Button.Ok), Qt.MouseButton.LeftButton)
    assert port.settings.scale[0].name == "Probe"
    assert rows(dialog)[0][5] == "Probe 2"
    press(qtbot, dialog, Button.Apply)
    assert port.settings.scale[0].coefficients == (0.0, 25.0)
    assert port.settings.channel[0].scale == "Probe 2"


def test_an_exception_of_the_draft_is_fit_for_the_operator(dialog):
    dialog._draft.channels[0] = dialog._draft.channels[1]
    with pytest.raises(ConfigError, match="channel 'light' is used 2 times"):
        dialog._draft.settings()
