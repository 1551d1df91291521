"""What hides a part of a fibre: the rest of it is not certain."""

import numpy as np
import pytest

from cosmic.vico.core.vision.beyond import COVERED
from cosmic.vico.core.vision.checks import CONTINUES
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.finding import find_fibres
from unit.vico.vision.drawn_fibres import arc, drawn_image

LINE = arc((120.0, 120.0), 0.5, 320.0, 0.5)
SHAPE = (480, 640)
ROWS, COLUMNS = np.mgrid[0:480, 0:640].astype(np.float64)


def only(image: np.ndarray) -> Fibre:
    (found,) = find_fibres(image)
    return found


def spotted(
    image: np.ndarray, at: np.ndarray, radius: float, level: float, noise: float = 3.0
) -> np.ndarray:
    """Return an image with a round spot of dirt, its rim a little soft."""
    share = 1.0 / (1.0 + np.exp((np.hypot(COLUMNS - at[0], ROWS - at[1]) - radius) / 0.8))
    rough = np.random.default_rng(11).normal(0.0, noise, SHAPE)
    mixed = image * (1.0 - share) + (level + rough) * share
    return np.clip(np.round(mixed), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("bright", [False, True])
@pytest.mark.parametrize("radius", [9.0, 14.0])
def test_an_end_that_dirt_of_the_other_shade_covers_is_doubted(bright: bool, radius: float) -> None:
    contrast, ground, dirt = (60.0, 90.0, 40.0) if bright else (-60.0, 150.0, 200.0)
    image = drawn_image([LINE], [9.0], contrast=contrast, ground=ground)
    assert only(image).certain
    assert COVERED in only(spotted(image, LINE[-1], radius, dirt)).doubts


@pytest.mark.parametrize("contrast", [-60.0, 60.0])
def test_dirt_nearly_as_light_as_the_ground_over_an_end_is_doubted(contrast: float) -> None:
    image = drawn_image([LINE], [9.0], contrast=contrast, noise=1.0)
    assert only(image).certain
    dirt = 150.0 - 0.07 * contrast
    assert COVERED in only(spotted(image, LINE[-1], 14.0, dirt, noise=1.0)).doubts


@pytest.mark.parametrize("falls_off", [-0.4, 0.4])
def test_light_that_falls_off_along_a_fibre_covers_no_end(falls_off: float) -> None:
    light = 1.0 + falls_off * (COLUMNS / 640.0 - 0.5)
    even = drawn_image([LINE], [14.0], contrast=-30.0, ground=190.0, noise=1.0)
    assert only(np.clip(np.round(even * light), 0, 255).astype(np.uint8)).certain
    covered = spotted(even, LINE[-1], 14.0, 205.0)
    assert COVERED in only(np.clip(np.round(covered * light), 0, 255).astype(np.uint8)).doubts


def test_a_line_thinner_than_a_step_along_it_is_measured() -> None:
    image = np.full((300, 400), 150.0)
    image[150, 60:340] = 60.0
    image += np.random.default_rng(3).normal(0.0, 6.0, image.shape)
    assert only(image.astype(np.uint8)).length_px == pytest.approx(280.0, abs=2.0)


def test_a_fragment_behind_dirt_makes_the_fibre_doubtful() -> None:
    line = arc((120.0, 120.0), 0.5, 170.0, 0.2)
    image = drawn_image([line], [9.0])
    assert only(image).certain
    hidden = spotted(image, line[int(0.75 * len(line))], 13.0, 150.0)
    assert CONTINUES in only(hidden).doubts


def test_a_speck_near_an_end_is_no_fragment() -> None:
    image = drawn_image([LINE], [9.0])
    ahead = LINE[-1] - LINE[-40]
    at = LINE[-1] + 40.0 * ahead / np.linalg.norm(ahead)
    assert only(spotted(image, at, 2.5, 100.0)).certain


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("shift", [18, 45])
def test_a_fibre_torn_with_its_image_is_not_certain(turned: bool, shift: int) -> None:
    image = drawn_image([arc((120.0, 200.0), 0.15, 380.0, 0.2)], [9.0])
    torn = np.hstack([image[:, :310], np.roll(image, shift, axis=0)[:, 310:]])
    found = find_fibres(np.ascontiguousarray(torn.T) if turned else torn)
    assert len(found) == 2
    assert all(CONTINUES in each.doubts for each in found)


@pytest.mark.parametrize("contrast", [-110.0, -150.0])
def test_a_length_on_a_clipped_ground_is_known_as_well_as_its_interval_says(
    contrast: float,
) -> None:
    image = drawn_image([LINE], [9.0], contrast=contrast, ground=300.0, noise=5.0, blur_px=1.5)
    assert np.median(image) == 255
    found = only(image)
    low, high = found.length_interval_px
    assert low <= 320.0 <= high
    short = arc((120.0, 120.0), 0.5, 80.0, 0.5)
    image = drawn_image([short], [9.0], contrast=contrast, ground=300.0, noise=5.0, blur_px=1.5)
    assert not only(image).certain
