"""The histogram of an image, and the contrast that is taken from it."""

import numpy as np
import pytest

from cosmic.vico.gui.levels import histogram
from cosmic.vico.hw.interface import PixelFormat, Pixels

MONO = [each for each in PixelFormat if each is not PixelFormat.RGB8]


def normal(pixel_format: PixelFormat) -> Pixels:
    full = pixel_format.full_scale
    kind = np.uint8 if full == 255 else np.uint16
    values = np.random.default_rng(0).normal(0.4, 0.08, (600, 800)) * full
    return np.clip(values, 0, full).astype(kind)


@pytest.mark.parametrize("pixel_format", MONO)
def test_percentiles_are_those_of_all_pixels_at_every_depth(pixel_format: PixelFormat) -> None:
    data, full = normal(pixel_format), pixel_format.full_scale
    shown = histogram(data, full)
    for percent in (0.5, 10.0, 50.0, 99.5):
        expected = np.percentile(data, percent)
        assert shown.percentile(percent) == pytest.approx(expected, abs=0.006 * full)
    assert shown.shares.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("pixel_format", MONO)
def test_the_share_of_pixels_at_both_ends_is_reported(pixel_format: PixelFormat) -> None:
    data, full = normal(pixel_format), pixel_format.full_scale
    data[:60] = 0
    data[:, :200] = full
    shown = histogram(data, full)
    assert shown.over == pytest.approx(0.25, abs=0.01)
    assert shown.under == pytest.approx(0.075, abs=0.01)


def test_a_colour_that_is_over_exposed_alone_counts() -> None:
    data = np.full((40, 50, 3), 90, np.uint8)
    data[3, 4, 1] = 255
    shown = histogram(data, 255)
    assert shown.over == pytest.approx(1.0 / 2000.0)
    assert shown.percentile(50.0) == pytest.approx(90.0, abs=1.0)


@pytest.mark.parametrize("value", [0, 117, 255])
def test_an_image_of_one_grey_can_still_be_shown(value: int) -> None:
    levels = histogram(np.full((30, 30), value, np.uint8), 255).levels()
    assert levels.high >= levels.low + 1.0
    assert levels.low <= value + 1.0
