"""The focus is found from two images that are both out of it."""

import cv2
import numpy as np
import pytest

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.defocus import DefocusModel, calibrate, in_focus
from unit.vico.vision.drawn_fibres import arc, strip

SHAPE = (320, 400)
SHARP_AT, PX_PER_UM = 130.0, 0.012
THINGS = sum(
    strip(SHAPE, arc((60.0 + 40.0 * n, 60.0), 0.3 + 0.35 * n, 230.0, 0.4), 8.0) for n in range(4)
)


def seen(
    position: float, seed: int, *, sharp_at: float = SHARP_AT, light: float = 1.0
) -> np.ndarray:
    """Return an image with the disc of a defocused lens."""
    radius = 2.0 * PX_PER_UM * abs(position - sharp_at)
    image = cv2.GaussianBlur(150.0 - 60.0 * np.minimum(THINGS, 1.0), (0, 0), 1.0)
    if radius > 0.3:
        side = 2 * int(np.ceil(radius)) + 1
        y, x = np.mgrid[:side, :side] - side // 2
        disc = np.clip(radius + 0.5 - np.hypot(x, y), 0.0, 1.0)
        image = cv2.filter2D(image, -1, disc / disc.sum(), borderType=cv2.BORDER_REFLECT)
    image = light * image + np.random.default_rng(seed).normal(0.0, 2.0, SHAPE)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def model() -> DefocusModel:
    return calibrate([(at, seen(at, n)) for n, at in enumerate(np.linspace(0.0, 260.0, 9))])


def test_the_growth_of_blur_is_that_of_the_lens(model: DefocusModel) -> None:
    assert model.growth == pytest.approx(PX_PER_UM**2, rel=0.15)


@pytest.mark.parametrize("sharp_at", [-40.0, 60.0, 130.0, 200.0])
@pytest.mark.parametrize("light", [1.0, 0.8])
def test_two_images_give_the_position(model: DefocusModel, sharp_at: float, light: float) -> None:
    one = (40.0, seen(40.0, 20, sharp_at=sharp_at))
    other = (140.0, seen(140.0, 21, sharp_at=sharp_at, light=light))
    found = in_focus(one, other, model)
    assert found.position == pytest.approx(sharp_at, abs=25.0)


def test_images_without_detail_are_refused(model: DefocusModel) -> None:
    empty = np.full(SHAPE, 120, np.uint8) + np.random.default_rng(0).integers(0, 3, SHAPE, np.uint8)
    with pytest.raises(NotAvailable, match="detail"):
        in_focus((0.0, empty), (50.0, empty), model)
    with pytest.raises(ConfigError, match="one position"):
        in_focus((0.0, empty), (0.0, empty), model)
    with pytest.raises(ConfigError, match="cannot be compared"):
        in_focus((0.0, empty), (5.0, empty[:100]), model)
    with pytest.raises(ConfigError, match="positions"):
        calibrate([(0.0, empty), (1.0, empty)])
