"""No image of 8 or 16 bits ends in an exception; what else there is, is converted or refused."""

import cv2
import numpy as np
import pytest
from benchmarks.fibre_pairs import Kind, draw

from cosmic.frame.errors import ConfigError
from cosmic.vico.api import find_fibres
from unit.vico.vision.drawn_fibres import arc, drawn_image
from unit.vico.vision.odd_images import compressed, odd_image

BOW = arc((120.0, 180.0), 0.2, 400.0, 0.9)


@pytest.mark.parametrize("quality", [10, 15, 20])
def test_what_jpeg_makes_of_a_fibre_is_measured_or_doubted(quality: int) -> None:
    wrong = 0
    for seed in range(6):
        length = 200.0 + 60.0 * seed
        line = arc((60.0 + 20 * seed, 120.0 + 20 * seed), 0.1, length, 0.3 * seed - 0.6)
        image = compressed(drawn_image([line], [6.0 + seed], seed=seed), quality)
        for fibre in find_fibres(image):
            wrong += fibre.certain and abs(fibre.length_px / length - 1.0) > 0.02
    assert not wrong


@pytest.mark.parametrize("quality", [10, 20])
def test_large_images_with_blocks_of_jpeg_are_looked_at(quality: int) -> None:
    lines = [arc((200.0, 150.0 + 300 * n), 0.1, 700.0, 0.5 * n - 0.5) for n in range(3)]
    widths = [8.0, 14.0, 20.0]
    image = drawn_image(lines, widths, shape=(900, 1200), noise=4.0, seed=quality)
    assert find_fibres(compressed(image, quality))


def test_what_jpeg_leaves_that_is_thinner_than_a_pixel_is_looked_at() -> None:
    assert find_fibres(draw(Kind.TOUCHING, 3_400_074, jpeg=True, compare=False).image)


def test_no_odd_image_ends_in_an_exception() -> None:
    for seed in range(200):
        find_fibres(odd_image(seed))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(200, 10_200, 1_000))
def test_no_odd_image_of_ten_thousand_ends_in_an_exception(first: int) -> None:
    for seed in range(first, first + 1_000):
        find_fibres(odd_image(seed))


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.int16, np.int32, ">u2"])
def test_other_numbers_give_what_eight_bits_give(dtype: str) -> None:
    image = drawn_image([BOW], [9.0])
    (found,) = find_fibres(image.astype(dtype))
    assert found.length_px == pytest.approx(find_fibres(image)[0].length_px, abs=0.1)


def test_pixels_that_are_no_numbers_count_as_ground() -> None:
    image = drawn_image([BOW], [9.0]).astype(np.float32)
    image[20:24, 500:504] = np.nan
    image[400, 100] = np.inf
    (found,) = find_fibres(image)
    assert found.length_px == pytest.approx(400.0, rel=0.003)


def test_opacity_is_left_out() -> None:
    image = drawn_image([BOW], [9.0])
    opaque = cv2.merge([image, image, image, np.zeros_like(image)])
    assert find_fibres(opaque)[0].length_px == pytest.approx(400.0, rel=0.003)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((32, 32), np.complex128),
        np.full((32, 32), "a"),
        np.zeros((32, 32), object),
        np.full((32, 32), np.nan),
        np.zeros((32, 32, 2), np.uint8),
        np.zeros((4, 32, 32, 3), np.uint8),
        np.zeros(32, np.uint16),
        np.zeros((15, 40), np.uint8),
        np.zeros((16, 40_000), np.uint8),
    ],
    ids=lambda image: f"{image.dtype}-{image.shape}",
)
def test_what_is_no_image_is_refused_by_type_and_shape(image: np.ndarray) -> None:
    with pytest.raises(ConfigError) as refused:
        find_fibres(image)
    assert str(image.dtype) in str(refused.value)
    assert str(image.shape) in str(refused.value)
