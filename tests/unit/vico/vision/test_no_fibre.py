"""What looks like a fibre and is none: a scratch, the marks of a frame."""

import cv2
import numpy as np
import pytest

from cosmic.vico.core.vision.checks import COPY, DRAWN, EMBOSSED, UNEVEN
from cosmic.vico.core.vision.finding import find_fibres
from unit.vico.vision.drawn_fibres import arc, drawn_image, strip

SHAPE = (480, 640)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_scratch_dark_on_one_side_and_light_on_the_other_is_not_certain(side: float) -> None:
    line = arc((100.0, 150.0), 0.3, 300.0, 0.02)
    tangent = np.gradient(line, axis=0)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    normal *= side / np.linalg.norm(normal, axis=1, keepdims=True)
    dark, light = (strip(SHAPE, line + away * normal, 4.0) for away in (-2.0, 2.0))
    image = cv2.GaussianBlur(150.0 - 50.0 * dark + 50.0 * light, (0, 0), 1.0)
    image += np.random.default_rng(2).normal(0.0, 3.0, SHAPE)
    for fibre in find_fibres(np.clip(np.round(image), 0, 255).astype(np.uint8)):
        assert not fibre.certain
        assert EMBOSSED in fibre.doubts


def test_a_fibre_on_a_sharpened_image_is_certain() -> None:
    line = arc((120.0, 120.0), 0.5, 320.0, 0.5)
    image = drawn_image([line], [9.0]).astype(np.float32)
    seam = image + 1.0 * (image - cv2.GaussianBlur(image, (0, 0), 2.0))
    (found,) = find_fibres(np.clip(np.round(seam), 0, 255).astype(np.uint8))
    assert found.certain


@pytest.mark.parametrize("level", [0, 40, 255])
@pytest.mark.parametrize("kind", [cv2.LINE_8, cv2.LINE_AA])
def test_a_line_that_is_drawn_aslant_is_not_certain(level: int, kind: int) -> None:
    image = drawn_image([], [])
    curve = np.round(arc((120.0, 120.0), 0.5, 320.0, 0.5)).astype(np.int32)
    cv2.polylines(image, [curve], isClosed=False, color=level, thickness=8, lineType=kind)
    (found,) = find_fibres(image)
    assert DRAWN in found.doubts


@pytest.mark.parametrize("contrast", [-250.0, 250.0])
def test_a_fibre_at_an_end_of_the_range_of_grey_is_certain(contrast: float) -> None:
    lines = [arc((120.0, 120.0), 0.5, 320.0, 0.5)]
    image = drawn_image(lines, [9.0], contrast=contrast, blur_px=0.75)
    (found,) = find_fibres(image)
    assert found.certain


def test_a_row_of_drops_that_touch_is_not_certain() -> None:
    along = np.arange(90.0, 290.0, 16.2)
    rows, columns = np.mgrid[0:300, 0:400]
    drops = np.min([np.hypot(columns - each, rows - 150) for each in along], axis=0) < 9.0
    image = cv2.GaussianBlur(170.0 - 80.0 * drops, (0, 0), 1.0)
    image += np.random.default_rng(1).normal(0.0, 1.5, image.shape)
    (found,) = find_fibres(image.astype(np.uint8))
    assert UNEVEN in found.doubts


def test_a_word_is_not_certain() -> None:
    ink = np.zeros((300, 400), np.uint8)
    cv2.putText(ink, "abcdefgh", (150, 160), cv2.FONT_HERSHEY_DUPLEX, 0.7, 255, 3, cv2.LINE_AA)
    image = cv2.GaussianBlur(170.0 - 80.0 * (ink / 255.0), (0, 0), 1.5)
    image += np.random.default_rng(1).normal(0.0, 1.5, image.shape)
    assert all(UNEVEN in each.doubts for each in find_fibres(image.astype(np.uint8)))


def test_several_lines_along_rows_and_columns_are_drawn() -> None:
    down = np.column_stack([np.full(400, 120.0), np.linspace(100.0, 200.0, 400)])
    along = np.column_stack([np.linspace(300.0, 420.0, 400), np.full(400, 380.0)])
    other = np.column_stack([np.linspace(300.0, 480.0, 400), np.full(400, 430.0)])
    fibre = arc((250.0, 120.0), 0.4, 200.0, 0.5)
    found = find_fibres(drawn_image([down, along, other, fibre], [7.0, 7.0, 7.0, 9.0]))
    assert [round(each.length_px) for each in found if each.certain] == [200]
    assert sum(DRAWN in each.doubts for each in found) == 3
    two = find_fibres(drawn_image([down, along, fibre], [7.0, 7.0, 9.0]))
    assert [each.certain for each in two] == [True, True, True]


def test_the_weaker_of_two_that_are_alike_is_a_reflection() -> None:
    line = arc((120.0, 120.0), 0.5, 320.0, 0.5)
    image = drawn_image([line], [9.0], noise=2.0).astype(np.float32)
    ghost = 0.75 * image + 0.25 * np.roll(image, (-70, 40), axis=(0, 1))
    found = find_fibres(np.round(ghost).astype(np.uint8))
    assert [each.certain for each in sorted(found, key=lambda each: -each.contrast)] == [
        True,
        False,
    ]
    assert COPY in min(found, key=lambda each: each.contrast).doubts


def test_marks_of_a_frame_that_is_turned_are_copies() -> None:
    centre, half = np.array([320.0, 240.0]), 45.0
    lines = []
    for number in range(4):
        angle = 0.12 + 0.5 * np.pi * number
        out = np.array([np.cos(angle), np.sin(angle)])
        along = np.array([-out[1], out[0]])
        lines.append(centre + 180.0 * out + np.linspace(-half, half, 400)[:, None] * along)
    found = find_fibres(drawn_image(lines, [7.0] * 4))
    assert len(found) == 4
    assert all(COPY in each.doubts for each in found)


@pytest.mark.parametrize("aside", [0.0, 60.0, 260.0])
def test_two_fibres_as_long_as_each_other_may_lie_at_right_angles(aside: float) -> None:
    way = np.linspace(-100.0, 100.0, 400)[:, None]
    along, across = np.array([np.cos(0.5), np.sin(0.5)]), np.array([-np.sin(0.5), np.cos(0.5)])
    centre = np.array([220.0, 180.0])
    lines = [centre + way * along, centre + aside * along + way * across]
    found = find_fibres(drawn_image(lines, [9.0, 9.0]))
    assert [each.certain for each in found] == [True, True]
