"""Uneven light is divided out of the image."""

import numpy as np
import pytest

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.background import Background
from cosmic.vico.hw.interface import Frame, FrameStatus, PixelFormat


def light() -> np.ndarray:
    y, x = np.mgrid[:120, :160]
    return 1.0 - 0.3 * ((x - 50) ** 2 + (y - 30) ** 2) / 20000.0


def frame(
    level: float = 150.0,
    *,
    pixel_format: PixelFormat = PixelFormat.MONO8,
    seed: int = 0,
    status: FrameStatus = FrameStatus.COMPLETE,
    rows: int = 120,
) -> Frame:
    full = pixel_format.full_scale
    values = light() * level * full / 255.0
    values += np.random.default_rng(seed).normal(0, 2.0 * full / 255.0, values.shape)
    kind = np.uint8 if full == 255 else np.uint16
    data = np.clip(np.rint(values), 0, full).astype(kind)[:rows]
    if pixel_format is PixelFormat.RGB8:
        data = np.stack([data, data // 2, data], axis=2)
    return Frame(data, seed, 0.0, 0.0, status=status, pixel_format=pixel_format)


def filled(pixel_format: PixelFormat = PixelFormat.MONO8) -> Background:
    background = Background()
    background.collect(8)
    for number in range(8):
        background.add(frame(pixel_format=pixel_format, seed=number))
    return background


@pytest.mark.parametrize("pixel_format", list(PixelFormat))
def test_the_ground_is_even_afterwards_in_the_same_format(pixel_format: PixelFormat) -> None:
    shown = frame(100.0, pixel_format=pixel_format, seed=99)
    corrected = filled(pixel_format).correct(shown)
    assert corrected.dtype == shown.data.dtype
    assert corrected.shape == shown.data.shape
    layer = corrected if corrected.ndim == 2 else corrected[:, :, 1]
    corners = [layer[:30, :30].mean(), layer[:30, -30:].mean(), layer[-30:, -30:].mean()]
    assert max(corners) / min(corners) < 1.02
    assert shown.data[:30, :30].mean() / shown.data[-30:, -30:].mean() > 1.2
    assert not corrected.flags.writeable


@pytest.mark.parametrize("pixel_format", [PixelFormat.MONO10, PixelFormat.MONO12])
def test_no_pixel_exceeds_what_its_format_can_hold(pixel_format: PixelFormat) -> None:
    bright = frame(300.0, pixel_format=pixel_format)
    assert filled(pixel_format).correct(bright).max() == pixel_format.full_scale


def test_without_a_background_the_image_passes_as_it_is() -> None:
    background = Background()
    shown = frame()
    assert background.correct(shown) is shown.data
    background.collect(3)  # before any frame came
    assert background.missing == 3
    assert background.correct(shown) is shown.data
    background.add(shown)
    assert background.correct(shown) is shown.data
    assert background.missing == 2


def test_it_can_be_reset_and_taken_again() -> None:
    background = filled()
    assert background.frames == 8
    background.collect(2)
    background.reset()
    background.add(frame())
    assert background.frames == background.missing == 0
    background.collect(1)
    background.add(frame())
    assert background.frames == 1


def test_the_old_one_stays_in_force_until_the_new_one_is_whole() -> None:
    background = filled()
    background.collect(2)
    background.add(frame())
    assert background.frames == 8
    background.add(frame())
    assert background.frames == 2


def test_incomplete_frames_are_not_taken() -> None:
    background = Background()
    background.collect(1)
    background.add(frame(status=FrameStatus.INCOMPLETE))
    assert background.missing == 1


def test_an_image_changed_meanwhile_begins_the_collection_anew() -> None:
    background = Background()
    background.collect(3)
    background.add(frame())
    background.add(frame())
    background.add(frame(rows=100))
    assert background.missing == 2


@pytest.mark.parametrize(
    ("other", "binning", "text"),
    [
        (frame(rows=100), 1, "the image is 160 x 100 px"),
        (frame(pixel_format=PixelFormat.MONO12), 1, "Mono12"),
        (frame(), 2, "binning 2"),
    ],
)
def test_another_size_format_or_binning_is_refused(other: Frame, binning: int, text: str) -> None:
    background = filled()
    assert text in background.misfit(other, binning)
    with pytest.raises(ConfigError, match="take it again or reset it"):
        background.correct(other, binning)
    assert background.misfit(frame()) == ""


def test_black_frames_make_no_background_and_the_old_one_stays() -> None:
    background = filled()
    background.collect(1)
    dark = Frame(np.zeros((120, 160), np.uint8), 1, 0.0, 0.0)
    with pytest.raises(ConfigError, match="the frames are black"):
        background.add(dark)
    assert background.frames == 8
    assert background.missing == 0


@pytest.mark.parametrize("frames", [0, -1, 1001])
def test_a_number_of_frames_that_makes_no_sense_is_refused(frames: int) -> None:
    with pytest.raises(ConfigError, match="give 1 to 1000"):
        Background().collect(frames)
