"""What looks like a fibre and is none: a scratch, the marks of a frame."""

import cv2
import numpy as np
import pytest

from cosmic.vico.core.vision.checks import DRAWN, EMBOSSED
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


def test_several_lines_along_rows_and_columns_are_drawn() -> None:
    down = np.column_stack([np.full(400, 120.0), np.linspace(100.0, 200.0, 400)])
    along = np.column_stack([np.linspace(300.0, 420.0, 400), np.full(400, 380.0)])
    fibre = arc((250.0, 120.0), 0.4, 200.0, 0.5)
    found = find_fibres(drawn_image([down, along, fibre], [7.0, 7.0, 9.0]))
    assert [round(each.length_px) for each in found if each.certain] == [200]
    assert sum(DRAWN in each.doubts for each in found) == 2
