"""A network of fibres is certain as statistics; noise, bubbles and a few pieces are not."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from cosmic.vico.api.measure import find_network
from cosmic.vico.core.vision.network import CLOSED, NOTHING, TURNING

SHAPE = (480, 640)
Image = npt.NDArray[np.uint8]


def taken(layer: npt.NDArray[np.float32], seed: int) -> Image:
    """Return what a camera shows of a layer, 0 to 1, that is darker than the ground."""
    grain = np.random.default_rng([seed, 1]).normal(0.0, 3.0, SHAPE)
    shown = 160.0 - 60.0 * cv2.GaussianBlur(layer, (0, 0), 1.0) + grain
    return np.asarray(np.clip(shown, 0.0, 255.0), dtype=np.uint8)


def fibres(seed: int, count: int, direction_deg: float | None = None) -> Image:
    """Return slightly curled fibres across each other, all about in one direction if given."""
    rng = np.random.default_rng(seed)
    layer = np.zeros(SHAPE, np.float32)
    for _ in range(count):
        angle = rng.uniform(0.0, np.pi)
        if direction_deg is not None:
            angle = np.radians(direction_deg) + rng.normal(0.0, 0.1)
        bends = angle + np.cumsum(rng.normal(0.0, 0.02, 80))
        steps = 5.0 * np.column_stack([np.cos(bends), np.sin(bends)])
        line = rng.uniform((0.0, 0.0), SHAPE[::-1]) + np.cumsum(steps, axis=0) - steps.sum(0) / 2
        points = [np.round(16.0 * line).astype(np.int32)]
        cv2.polylines(layer, points, False, 1.0, int(rng.integers(3, 6)), cv2.LINE_AA, 4)
    return taken(layer, seed)


def rings(seed: int, count: int, thickness: int) -> Image:
    """Return rims of bubbles, or filled ones where the thickness is -1."""
    rng = np.random.default_rng(seed)
    layer = np.zeros(SHAPE, np.float32)
    for _ in range(count):
        x, y = (8.0 * rng.uniform((0.0, 0.0), SHAPE[::-1])).astype(int).tolist()
        radius = int(8.0 * rng.uniform(8.0, 40.0))
        cv2.circle(layer, (x, y), radius, 1.0, thickness, cv2.LINE_AA, 3)
    return taken(layer, seed)


@pytest.mark.parametrize("seed", [1, 2])
def test_curled_fibres_across_each_other_are_a_network_with_their_direction(seed: int) -> None:
    found = find_network(fibres(seed, 40, direction_deg=30.0))

    assert found.certain, found.doubts
    assert found.direction_deg == pytest.approx(30.0, abs=5.0)
    assert found.alignment > 0.6
    assert find_network(fibres(seed, 50)).certain


@pytest.mark.parametrize("blur_px", [3.0, 5.0])
def test_what_noise_makes_on_a_soft_image_is_no_certain_network(blur_px: float) -> None:
    noise = cv2.GaussianBlur(np.random.default_rng(3).normal(0.0, 1.0, SHAPE), (0, 0), blur_px)

    shown = np.clip(128.0 + 30.0 * noise / noise.std(), 0.0, 255.0)
    found = find_network(np.asarray(shown, dtype=np.uint8))

    assert not found.certain
    assert TURNING in found.doubts


@pytest.mark.parametrize(("count", "thickness"), [(60, 2), (200, 2), (60, -1), (200, -1)])
def test_bubbles_and_drops_are_no_certain_network(count: int, thickness: int) -> None:
    found = find_network(rings(4, count, thickness))

    assert not found.certain
    assert TURNING in found.doubts


def test_rings_that_nothing_joins_are_called_so() -> None:
    assert CLOSED in find_network(rings(5, 12, 2)).doubts


def test_a_few_fibres_are_no_network_to_take_statistics_of() -> None:
    found = find_network(fibres(6, 3))

    assert not found.certain
    assert NOTHING in found.doubts
