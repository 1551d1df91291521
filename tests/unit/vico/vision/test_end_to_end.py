"""Two fibres end to end are never told as one that is certain."""

import cv2
import numpy as np
import pytest

from cosmic.vico.api import find_fibres

SHAPE = (400, 760)


def stretch(start: float, end: float, width: float, *, kink: float = 0.0) -> np.ndarray:
    """Return the cover of a straight fibre, ends in x; it turns about (380, 200)."""
    scale = 4
    x, y = np.array([start, end, end, start]), np.array([-1.0, -1.0, 1.0, 1.0]) * width / 2
    cos, sin = np.cos(0.1 + kink), np.sin(0.1 + kink)
    corners = np.column_stack([380 + cos * x - sin * y, 200 + sin * x + cos * y])
    big = np.zeros((SHAPE[0] * scale, SHAPE[1] * scale), np.uint8)
    cv2.fillConvexPoly(big, np.round((corners + 0.5) * scale * 16).astype(np.int32), 255, shift=4)
    return cv2.resize(big, SHAPE[::-1], interpolation=cv2.INTER_AREA).astype(np.float64) / 255.0


def seen(dark: np.ndarray, seed: int, noise: float = 3.0) -> np.ndarray:
    image = cv2.GaussianBlur(150.0 - 60.0 * dark, (0, 0), 1.2)
    image += np.random.default_rng(seed).normal(0.0, noise, SHAPE)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def certain(image: np.ndarray) -> int:
    return sum(fibre.certain for fibre in find_fibres(image))


@pytest.mark.parametrize("gap_px", [3.0, 4.0, 6.0, 9.0, 18.0])
@pytest.mark.parametrize("width", [8.0, 12.0, 18.0])
def test_a_gap_between_two_fibres_is_never_one_certain_fibre(gap_px: float, width: float) -> None:
    dark = stretch(-260, -gap_px / 2, width) + stretch(gap_px / 2, 220, width)
    assert not certain(seen(dark, seed=int(gap_px)))


@pytest.mark.parametrize("width", [8.0, 12.0, 24.0])
def test_two_fibres_that_overlap_and_let_light_through_are_doubted(width: float) -> None:
    dark = stretch(-260, width / 2, width) + stretch(-width / 2, 220, width)
    assert not certain(seen(dark, seed=1))


@pytest.mark.parametrize("other", [0.7, 0.8, 1.25])
def test_a_step_of_width_is_doubted(other: float) -> None:
    assert not certain(seen(np.maximum(stretch(-260, 0, 12), stretch(0, 220, 12 * other)), seed=2))


@pytest.mark.parametrize("other", [0.7, 0.8, 1.25])
def test_a_step_of_contrast_is_doubted(other: float) -> None:
    assert not certain(seen(stretch(-260, 0, 12) + other * stretch(0, 220, 12), seed=3))


def test_ends_that_touch_at_an_angle_leave_a_notch() -> None:
    dark = np.maximum(stretch(-260, 0, 14), stretch(0, 220, 14, kink=0.4))
    assert not certain(seen(dark, seed=4))


@pytest.mark.parametrize("width", [10.0, 14.0])
def test_a_kink_where_two_touch_is_doubted_even_where_a_blur_fills_the_notch(width: float) -> None:
    dark = np.maximum(stretch(-260, 0.3 * width, width), stretch(0, 220, width, kink=0.3))
    assert not certain(cv2.GaussianBlur(seen(dark, seed=6, noise=1.5), (0, 0), 1.2))


def test_a_fibre_too_short_to_check_is_not_certain() -> None:
    (found,) = find_fibres(seen(stretch(-40, 40, 14), seed=8))
    assert not found.certain
    assert "too short" in found.doubts[0]


def test_a_bow_is_no_kink() -> None:
    line = np.array([(380 + 240 * np.sin(a), 420 - 240 * np.cos(a)) for a in np.linspace(-1, 1)])
    big = np.zeros((SHAPE[0] * 4, SHAPE[1] * 4), np.uint8)
    cv2.polylines(big, [np.round(line * 64).astype(np.int32)], False, 255, 40, shift=4)
    dark = cv2.resize(big, SHAPE[::-1], interpolation=cv2.INTER_AREA) / 255.0
    assert certain(seen(dark, seed=7)) == 1


def test_a_root_that_thins_and_goes_on_is_not_certain() -> None:
    dark = np.maximum(stretch(-260, 0, 14), 0.5 * stretch(0, 260, 5))
    assert not certain(seen(dark, seed=5))


def test_plain_fibres_stay_certain() -> None:
    found = [
        certain(seen(stretch(-250, 200 + seed, 7.0 + seed), seed, noise=2.0 + seed / 6.0))
        for seed in range(20)
    ]
    assert sum(found) >= 19
