"""Where one fibre ends and another begins, a network sees on the strip along them."""

import cv2
import numpy as np
import pytest

from cosmic.vico.api import find_fibres
from cosmic.vico.core.vision.certainty import NAMES
from unit.vico.vision.drawn_fibres import arc, drawn_image

WHERE = NAMES.index("joint")
LINE = arc((100.0, 200.0), 0.1, 330.0, 0.4)


def sign(image: np.ndarray) -> float:
    """Return how clear a joint is on the longest fibre of an image."""
    return find_fibres(image)[0].signs[WHERE]


def touching(width: float) -> np.ndarray:
    """Return two fibres end to end, the second one turned a little and aside."""
    first, second = arc((100.0, 200.0), 0.0, 200.0, 0.2), arc((300.0, 222.0), 0.35, 180.0, 0.2)
    return drawn_image([first, second], [width, width], noise=2.0)


def compressed(image: np.ndarray, quality: int) -> np.ndarray:
    """Return an image as JPEG keeps it."""
    coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))


@pytest.mark.parametrize("width", [8.0, 14.0, 24.0])
def test_two_that_touch_are_a_joint_and_one_fibre_is_none(width: float) -> None:
    assert sign(touching(width)) > 1.0
    assert sign(drawn_image([LINE], [width], noise=2.0)) < 0.5


def test_a_fibre_below_four_pixels_has_no_such_sign() -> None:
    assert sign(drawn_image([LINE], [3.0], noise=1.0)) == 0.0


@pytest.mark.parametrize("quality", [40, 75, 85])
def test_on_a_compressed_image_a_joint_is_seen_as_well(quality: int) -> None:
    assert sign(compressed(touching(14.0), quality)) > 1.0
    assert sign(compressed(drawn_image([LINE], [14.0], noise=2.0), quality)) < 0.5


def test_what_is_mostly_blocks_is_not_looked_at() -> None:
    assert sign(compressed(touching(14.0), 30)) == 0.0


def test_the_sign_depends_on_neither_depth_nor_side_nor_polarity() -> None:
    image = touching(12.0)
    known = sign(image)
    assert sign(image) == known
    assert sign(image.astype(np.uint16) * 200) == pytest.approx(known, abs=0.05)
    for turned in (cv2.flip(image, 0), cv2.flip(image, 1), cv2.flip(image, -1), 255 - image):
        assert sign(turned) == pytest.approx(known, abs=0.2)
