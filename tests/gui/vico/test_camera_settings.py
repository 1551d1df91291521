"""Settings of the camera: entered, dragged, refused."""

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt

from cosmic.frame.errors import ConfigError
from cosmic.frame.operation import Task
from cosmic.vico.hw.interface import PixelFormat, Roi, Trigger
from gui.vico.fake_vico import INFO, RANGES, SETTINGS


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def enter(qtbot, field, text):
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, text)
    qtbot.keyClick(field, Qt.Key.Key_Return)


def pick(box, text):
    box.setCurrentText(text)
    box.activated.emit(box.currentIndex())


@pytest.fixture
def form(qtbot, shown):
    click(qtbot, shown.row.more)
    return shown.form


def test_exposure_and_gain_stand_beside_the_image_in_their_units(shown):
    form = shown.form
    assert form.exposure.isVisible()
    assert form.exposure.field.text() == "10"
    assert "ms" in form.exposure.field.toolTip()
    assert form.gain.field.text() == "0"


def test_an_exposure_that_is_typed_is_put_in_force(qtbot, form, camera):
    enter(qtbot, form.exposure.field, "25")
    assert camera.settings.exposure_s == pytest.approx(0.025)
    qtbot.keyClick(form.exposure.field, Qt.Key.Key_Up)
    assert camera.settings.exposure_s > 0.025


def test_a_slider_that_is_dragged_changes_the_camera_while_it_goes(qtbot, form, camera):
    slider = form.gain.slider
    slider.setSliderDown(True)
    slider.setSliderPosition(500)
    qtbot.waitUntil(lambda: camera.settings.gain_db == pytest.approx(12.0))
    slider.setSliderDown(False)
    assert form.gain.field.text() == "12"


@pytest.mark.parametrize(("text", "reason"), [("1001", "highest"), ("0.001", "lowest")])
def test_an_exposure_outside_the_range_is_refused_here(qtbot, form, camera, text, reason):
    enter(qtbot, form.exposure.field, text)
    assert reason in form.exposure.field.reason
    assert form.exposure.field.text() == text
    assert camera.calls == []
    qtbot.keyClick(form.exposure.field, Qt.Key.Key_Escape)
    assert form.exposure.field.text() == "10"


def test_what_the_camera_refuses_keeps_its_text_with_the_reason(qtbot, form, camera):
    camera.refuse_later = "100 ms are longer than the frame period of 33 ms"
    enter(qtbot, form.exposure.field, "100")
    qtbot.waitUntil(lambda: "longer than the frame period" in form.exposure.field.reason)
    assert form.exposure.field.text() == "100"
    qtbot.keyClick(form.exposure.field, Qt.Key.Key_Escape)
    assert form.exposure.field.text() == "10"


def test_wishes_that_come_while_the_camera_is_busy_are_asked_together(qtbot, form, camera):
    asked, tasks = [], []

    def configure(settings):
        asked.append(settings)
        tasks.append(Task("Settings"))
        return tasks[-1]

    camera.configure = configure
    enter(qtbot, form.exposure.field, "20")
    enter(qtbot, form.exposure.field, "30")
    enter(qtbot, form.gain.field, "6")
    assert len(asked) == 1
    camera.settings = asked[0]
    tasks[0].finish()
    qtbot.waitUntil(lambda: len(asked) == 2)
    assert (asked[1].exposure_s, asked[1].gain_db) == pytest.approx((0.03, 6.0))
    tasks[1].finish()


def test_binning_format_and_trigger_are_chosen_from_what_the_camera_has(qtbot, form, camera):
    pick(form.binning, "2 × 2")
    assert (camera.settings.binning, camera.settings.roi) == (2, Roi(0, 0, 800, 600))
    pick(form.pixel_format, "Mono12")
    assert camera.settings.pixel_format is PixelFormat.MONO12
    assert not form.shoot.isEnabled()
    pick(form.trigger, "software")
    qtbot.waitUntil(form.shoot.isEnabled)
    click(qtbot, form.shoot)
    assert camera.settings.trigger is Trigger.SOFTWARE
    assert camera.calls[-1] == ("trigger",)


def test_a_refused_choice_goes_back_and_says_why(qtbot, form, camera):
    camera.refuse_later = "not while it runs"
    pick(form.pixel_format, "RGB8")
    qtbot.waitUntil(lambda: "not while it runs" in form.reason.text())
    assert form.pixel_format.currentText() == "Mono8"
    assert form.reason.isVisible()


def test_what_a_camera_lacks_says_so(qtbot, form, camera):
    camera.change(ranges=replace(RANGES, gain_db=None))
    qtbot.waitUntil(lambda: not form.gain.field.isEnabled())
    assert "Not available on this camera" in form.gain.field.toolTip()
    camera.change(ranges=None, settings=None, info=None, problem="unplugged")
    qtbot.waitUntil(lambda: not form.exposure.field.isEnabled())
    assert form.exposure.field.toolTip() == "unplugged"


def test_settings_changed_by_others_are_shown(qtbot, form, camera):
    camera.change(settings=replace(SETTINGS, exposure_s=0.5))
    qtbot.waitUntil(lambda: form.exposure.field.text() == "500")


def test_a_camera_is_chosen_among_those_found_and_they_are_looked_for_again(
    qtbot, shown, port, camera
):
    click(qtbot, shown.row.more)
    box = shown.chooser.box
    assert [box.itemText(n) for n in range(box.count())] == [
        "CoSMic Twin (simulated)",
        "CoSMic Manta (simulated)",
    ]
    pick(box, "CoSMic Manta (simulated)")
    assert port.calls == [("use", "top", "gev-2")]
    port.task.fail(ConfigError("another program has it"))
    qtbot.waitUntil(lambda: "another program has it" in shown.chooser.tasks.text.text())
    assert box.currentText() == "CoSMic Twin (simulated)"
    click(qtbot, shown.chooser.rescan)
    port.found = ()
    port.task.finish()
    qtbot.waitUntil(lambda: box.count() == 1)  # the one in use
    camera.info = None
    port.publish()
    qtbot.waitUntil(lambda: box.placeholderText() == "none found")
    assert INFO.key not in [box.itemData(n) for n in range(box.count())]


def test_algorithms_are_switched_one_by_one(qtbot, shown, camera):
    click(qtbot, shown.row.more)
    tick = shown.chain.ticks["track tips"]
    shown.drawer.ensureWidgetVisible(tick)
    tick.click()
    assert camera.calls == [("switch", "track tips", True)]
    assert not camera.algorithms[0].on
    camera.refuse = "it needs a calibration"
    shown.chain.ticks["find fibres"].click()
    assert "it needs a calibration" in shown.chain.reason.text()
    assert not shown.chain.ticks["find fibres"].isChecked()


def test_a_background_is_taken_and_cleared(qtbot, shown, camera):
    assert not shown.chain.clear.isEnabled()
    shown.chain.take.click()
    qtbot.waitUntil(shown.chain.clear.isEnabled)
    shown.chain.clear.click()
    assert camera.calls == [("set background",), ("clear background",)]


def test_a_step_of_machine_vision_that_fails_is_reported_on_the_image_until_it_works(shown, camera):
    well = camera.algorithms
    camera.change(algorithms=(replace(well[0], on=True, failing=True, problem="finds: broken"),))
    shown.read_out()
    assert "finds: broken" in shown.message.text
    camera.change(algorithms=well)
    shown.read_out()
    assert shown.message.text == ""
