"""Contrast: levels by hand, once, kept; histogram and share of lost pixels."""

import numpy as np
import pytest
from PySide6.QtCore import Qt

from cosmic.vico.gui.levels import Levels, histogram
from cosmic.vico.hw.interface import PixelFormat
from gui.vico.fake_vico import HEIGHT, WIDTH


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def enter(qtbot, field, text):
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, text)
    qtbot.keyClick(field, Qt.Key.Key_Return)


def dim(low=40, high=90):
    """Return an image of noise between two greys."""
    return np.random.default_rng(0).integers(low, high, (HEIGHT, WIDTH)).astype(np.uint8)


@pytest.fixture
def panel(qtbot, view, camera):
    image = camera.push(dim())
    qtbot.waitUntil(lambda: view.view.image is image)
    click(qtbot, view.row.more)
    qtbot.waitUntil(lambda: view.contrast.plot.histogram is not None)
    return view.contrast


def test_once_stretches_the_contrast_and_the_next_image_does_not(qtbot, panel, view, camera):
    assert view.view.pixels.levels == Levels(0.0, 255.0)
    click(qtbot, panel.once)
    levels = view.view.pixels.levels
    assert levels.low == pytest.approx(40, abs=2)
    assert levels.high == pytest.approx(90, abs=2)
    camera.push(dim(100, 200))
    qtbot.waitUntil(lambda: panel.plot.histogram.percentile(50) > 120)
    assert view.view.pixels.levels == levels


def test_auto_follows_the_images_and_a_typed_level_ends_it(qtbot, panel, view, camera):
    click(qtbot, panel.auto)
    camera.push(dim(100, 200))
    qtbot.waitUntil(lambda: view.view.pixels.levels.low == pytest.approx(100, abs=2))
    enter(qtbot, panel.low, "50")
    assert not panel.auto.isChecked()
    assert view.view.pixels.levels.low == 50.0
    click(qtbot, panel.reset)
    assert view.view.pixels.levels == Levels(0.0, 255.0)
    assert panel.high.text() == "255"


def test_black_above_white_is_refused_and_keeps_its_text(qtbot, panel, view):
    enter(qtbot, panel.high, "100")
    enter(qtbot, panel.low, "120")
    assert "not below 100" in panel.low.reason
    assert panel.low.text() == "120"
    assert view.view.pixels.levels == Levels(0.0, 100.0)
    qtbot.keyClick(panel.low, Qt.Key.Key_Escape)
    assert (panel.low.text(), panel.low.reason) == ("0", "")


def test_a_level_outside_the_range_is_refused(qtbot, panel, view):
    for text in ("256", "-1", "nan", "inf", "a", "", "1,5"):
        panel.high.clear()
        enter(qtbot, panel.high, text)
        assert panel.high.reason, text
        assert panel.high.text() == text
        assert view.view.pixels.levels == Levels(0.0, 255.0)
        qtbot.keyClick(panel.high, Qt.Key.Key_Escape)
        assert panel.high.reason == ""


def test_the_range_is_that_of_the_pixel_format(qtbot, panel, view, camera):
    click(qtbot, panel.once)
    deep = (dim().astype(np.uint16)) * 16
    camera.push(deep, pixel_format=PixelFormat.MONO12)
    qtbot.waitUntil(lambda: panel.plot.histogram.full == 4095)
    assert view.view.pixels.levels.low == pytest.approx(40 * 16, rel=0.05)
    click(qtbot, panel.reset)
    assert view.view.pixels.levels == Levels(0.0, 4095.0)


def test_the_share_of_lost_pixels_is_reported(qtbot, panel, view, camera):
    data = dim()
    data[: HEIGHT // 4] = 255
    data[-HEIGHT // 8 :] = 0
    camera.push(data)
    qtbot.waitUntil(lambda: view.status.over.text() == "over-exposed 25.00 %")
    assert panel.share.text().startswith("over-exposed 25.00 %, black 12.")


def test_an_image_of_one_grey_is_not_stretched_to_noise():
    levels = histogram(np.full((600, 800), 100, np.uint8), 255).levels()
    assert levels.low < 100 < levels.high
    assert levels.high - levels.low >= 4


def test_the_histogram_is_made_from_a_part_of_a_large_image():
    data = np.zeros((1200, 1600), np.uint16)
    data[:, 800:] = 4095
    found = histogram(data, 4095)
    assert found.shares[[0, 255]] == pytest.approx([0.5, 0.5], abs=0.01)
    assert (found.under, found.over) == pytest.approx((0.5, 0.5), abs=0.01)
