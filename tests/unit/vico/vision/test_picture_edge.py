"""Pictures that end before their image does, and what is drawn into them."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from cosmic.vico.core.vision.finding import find_fibres
from cosmic.vico.core.vision.picture_edge import CUT
from unit.vico.vision.drawn_fibres import arc, drawn_image

WIDE = arc((80.0, 300.0), -0.2, 460.0, 0.35)
ROWS, COLUMNS = np.mgrid[0:480, 0:640]
BEYOND = {
    "round": (COLUMNS - 250) ** 2 + (ROWS - 240) ** 2 > 230**2,
    "frame": (COLUMNS > 440) | (ROWS < 40),
    "aslant": COLUMNS + 0.7 * ROWS > 600,
}


def cut_image(
    beyond: np.ndarray, fill: float, *, bright: bool = False, soft_px: float = 0.0
) -> np.ndarray:
    """Return a fibre that runs out of the picture, which ends inside the image."""
    contrast, ground = (60.0, 60.0) if bright else (-60.0, 150.0)
    image = drawn_image([WIDE], [10.0], contrast=contrast, ground=ground).astype(np.float32)
    share = beyond.astype(np.float32)
    if soft_px:
        share = cv2.GaussianBlur(share, (0, 0), soft_px)
    return np.round(image * (1.0 - share) + fill * share).astype(np.uint8)


def test_fibres_are_looked_for_on_a_round_picture_whose_rim_is_large_and_dark() -> None:
    line = arc((60.0, 100.0), 0.6, 520.0, 0.0)
    image = drawn_image([line], [14.0], shape=(480, 560), contrast=-70.0, noise=1.0)
    away = np.hypot(ROWS - 240, COLUMNS - 280)[:, :560]
    light = 1.0 - 0.15 * (away / 182.0) ** 2
    assert CUT in doubts(np.where(away < 182.0, image * light, 255.0).astype(np.uint8))


def doubts(image: np.ndarray) -> set[str]:
    """Return what is doubtful of the longest fibre on an image, where nothing is certain."""
    found = find_fibres(image)
    assert not [each for each in found if each.certain]
    return set(found[0].doubts)


@pytest.mark.parametrize("soft_px", [0.0, 2.0])
@pytest.mark.parametrize("shape", sorted(BEYOND))
def test_a_fibre_that_leaves_the_picture_inside_the_image_is_doubted(
    shape: str, soft_px: float
) -> None:
    assert CUT in doubts(cut_image(BEYOND[shape], 0.0, bright=True, soft_px=soft_px))
    assert not [
        f for f in find_fibres(cut_image(BEYOND[shape], 255.0, soft_px=soft_px)) if f.certain
    ]


def test_so_it_is_at_the_rim_of_what_was_filled_in_at_the_level_of_the_ground() -> None:
    assert CUT in doubts(cut_image(BEYOND["frame"], 150.0))


@pytest.mark.parametrize(
    "hide",
    [
        lambda image, away: np.where(away, np.nan, image.astype(np.float32)),
        lambda image, away: np.ma.masked_array(image, away),
    ],
    ids=["NaN", "masked"],
)
def test_so_it_is_beside_pixels_without_a_value(
    hide: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> None:
    image = drawn_image([WIDE], [10.0])
    assert CUT in doubts(hide(image, BEYOND["frame"]))


@pytest.mark.parametrize("shape", sorted(BEYOND))
def test_one_that_ends_before_the_rim_is_certain(shape: str) -> None:
    line = arc((150.0, 270.0), -0.2, 180.0, 0.35)
    image = drawn_image([line], [10.0])
    image[BEYOND[shape]] = 230
    assert [round(each.length_px) for each in find_fibres(image) if each.certain] == [180]


def test_uneven_light_is_no_rim() -> None:
    fall = 1.0 - 0.5 * (COLUMNS / 640.0) ** 2
    image = np.round(drawn_image([WIDE], [10.0]) * fall).astype(np.uint8)
    (found,) = find_fibres(image)
    assert CUT not in found.doubts


@pytest.mark.parametrize("thick", [3, 6, 10])
@pytest.mark.parametrize("quality", [0, 90])
def test_a_scale_bar_is_no_fibre_to_be_sure_of(thick: int, quality: int) -> None:
    image = drawn_image([WIDE], [10.0])
    image[440 : 440 + thick, 400:600] = 0
    if quality:
        written = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        image = np.asarray(cv2.imdecode(written, cv2.IMREAD_UNCHANGED))
    bars = [each for each in find_fibres(image) if abs(each.length_px - 200.0) < 5.0]
    assert bars
    assert not [each for each in bars if each.certain]
    assert all(any("scale bar" in reason for reason in each.doubts) for each in bars)


def test_a_fibre_that_lies_along_the_rows_is_a_fibre() -> None:
    line = np.column_stack([np.linspace(100.0, 400.0, 1200), np.full(1200, 240.0)])
    (found,) = find_fibres(drawn_image([line], [10.0]))
    assert found.certain


def test_ground_that_falls_below_what_a_camera_sees_is_no_rim() -> None:
    line = arc((120.0, 240.0), 0.0, 300.0, 0.1)
    end = line[-1, 0]
    fall = np.interp(COLUMNS, [end - 30.0, end + 10.0], [8.0, -15.0])
    image = drawn_image([line], [10.0], contrast=80.0, ground=100.0, noise=2.0) - 100.0
    seen = np.clip(np.round(image + fall), 0, 255).astype(np.uint8)
    (found,) = find_fibres(seen)
    assert CUT not in found.doubts
