"""Focus: sharper images measure more, and a sweep finds the peak or says why there is none."""

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import cv2
import numpy as np
import pytest

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.focus import (
    FocusAnswer,
    FocusFault,
    FocusMeasure,
    FocusSearch,
    fresh,
    sharpness,
)
from cosmic.vico.hw.interface import Frame, FrameStatus, Roi


def scene(seed: int = 0, size: int = 256) -> np.ndarray:
    """Return a bright ground with a few dark bars and specks, as floats."""
    rng = np.random.default_rng(seed)
    image = np.full((size, size), 150.0, np.float32)
    for _ in range(6):
        start, end = (tuple(rng.integers(0, size, 2).tolist()) for _ in range(2))
        cv2.line(image, start, end, 70.0, 9, cv2.LINE_AA)
    for _ in range(20):
        cv2.circle(image, tuple(rng.integers(0, size, 2).tolist()), 2, 90.0, -1)
    return image


def seen(blur_px: float, noise: float = 2.5, gain: float = 1.0, seed: int = 0) -> np.ndarray:
    image = cv2.GaussianBlur(scene(), (0, 0), max(blur_px, 0.3)) * gain
    image = image + np.random.default_rng(seed).normal(0.0, noise, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("measure", list(FocusMeasure))
def test_the_sharper_of_two_images_measures_more(measure: FocusMeasure) -> None:
    values = [sharpness(seen(blur), None, measure) for blur in (1.0, 2.0, 4.0, 8.0)]
    assert values == sorted(values, reverse=True)


@pytest.mark.parametrize("measure", list(FocusMeasure))
def test_a_brighter_lamp_makes_nothing_sharper(measure: FocusMeasure) -> None:
    dim, bright = (sharpness(seen(2.0, 0.0, gain), None, measure) for gain in (0.7, 1.4))
    assert bright == pytest.approx(dim, rel=0.05)


@pytest.mark.parametrize("measure", list(FocusMeasure))
def test_sixteen_bits_and_colours_measure_as_eight_bits(measure: FocusMeasure) -> None:
    image = seen(2.0)
    expected = sharpness(image, None, measure)
    assert sharpness(image.astype(np.uint16) * 16, None, measure) == pytest.approx(
        expected, rel=0.05
    )
    coloured = np.ascontiguousarray(np.stack([image] * 3, axis=2))
    assert sharpness(coloured, None, measure) == pytest.approx(expected, rel=0.05)


def test_only_the_region_counts() -> None:
    image = seen(1.0)
    image[:, 128:] = 140
    assert sharpness(image, Roi(140, 20, 100, 100)) == 0.0
    assert sharpness(image, Roi(0, 0, 128, 256)) > sharpness(image)


def test_a_black_image_is_not_sharp() -> None:
    assert sharpness(np.zeros((64, 64), np.uint8)) == 0.0


@pytest.mark.parametrize("region", [Roi(200, 0, 100, 100), Roi(-1, 0, 50, 50), Roi(0, 0, 8, 50)])
def test_a_region_that_is_not_in_the_image_is_refused(region: Roi) -> None:
    with pytest.raises(ConfigError, match="must lie within the image of 256 x 256"):
        sharpness(seen(1.0), region)


def test_only_a_whole_frame_exposed_after_the_movement_is_fresh() -> None:
    def frame(exposed_s: float, status: FrameStatus = FrameStatus.COMPLETE) -> Frame:
        return Frame(np.zeros((4, 4), np.uint8), 1, exposed_s + 0.05, exposed_s, status=status)

    assert fresh(frame(2.0), 2.0)
    assert not fresh(frame(1.99), 2.0)  # complete at 2.04, yet begun before
    assert not fresh(frame(3.0, FrameStatus.INCOMPLETE), 2.0)
    assert not fresh(frame(math.nan), 2.0)


# --- the search ------------------------------------------------------------------------------


def drive(search: FocusSearch, measure: Callable[[float], float]) -> FocusAnswer:
    for _ in range(2000):
        if search.target is None:
            break
        search.add(search.target, measure(search.target))
    assert search.answer is not None
    return search.answer


def peak(at: float, *, width: float = 12.0, noise: float = 0.0, floor: float = 0.02) -> Callable:
    rng = np.random.default_rng(3)

    def measure(position: float) -> float:
        height = 0.05 / (1.0 + ((position - at) / width) ** 2) + floor
        return float(height * (1.0 + noise * rng.normal()))

    return measure


def searching(**changes: float) -> FocusSearch:
    frames = int(changes.pop("frames", 1))
    steps: dict[str, float] = {"coarse_step": 20.0, "fine_step": 5.0} | changes
    return FocusSearch(-100.0, 100.0, frames=frames, **steps)


@pytest.mark.parametrize("at", [-91.0, -37.3, 0.0, 12.2, 58.0, 92.0])
def test_the_peak_is_found_between_the_positions_measured(at: float) -> None:
    answer = drive(searching(), peak(at))
    assert answer.fault is None
    assert answer.position == pytest.approx(at, abs=0.5)


def test_the_uncertainty_reported_is_the_error_made() -> None:
    rng = np.random.default_rng(5)
    errors, stds = [], []
    for _ in range(150):
        at = float(rng.uniform(-60.0, 60.0))
        measure = peak(at, width=20.0)
        answer = drive(searching(), lambda p, m=measure: m(p) * (1.0 + 0.02 * rng.normal()))
        assert answer.position is not None
        assert answer.std is not None
        errors.append(answer.position - at)
        stds.append(answer.std)
    assert np.std(errors) == pytest.approx(np.sqrt(np.mean(np.square(stds))), rel=0.35)


def test_every_sweep_goes_upwards_and_stays_within_the_range() -> None:
    answer = drive(searching(), peak(95.0))
    positions = [position for position, _ in answer.curve]
    assert min(positions) == -100.0
    assert max(positions) == 100.0
    assert sum(later < earlier for earlier, later in pairwise(positions)) == 1


@pytest.mark.parametrize(
    ("measure", "fault", "advice"),
    [
        (lambda _: 0.05, FocusFault.FLAT, "light it"),
        (lambda _: 0.0, FocusFault.FLAT, "light it"),
        (lambda position: 0.05 + 1e-6 * position, FocusFault.FLAT, "light it"),
        (lambda position: 0.5 + 0.004 * position, FocusFault.AT_END, "beyond 100"),
        (lambda position: 0.5 - 0.004 * position, FocusFault.AT_END, "beyond -100"),
        (lambda position: math.nan if position > 0 else 0.1, FocusFault.NO_MEASURE, "nan"),
    ],
)
def test_what_has_no_focus_says_why(
    measure: Callable[[float], float], fault: FocusFault, advice: str
) -> None:
    answer = drive(searching(), measure)
    assert answer.position is None
    assert answer.std is None
    assert answer.fault is fault
    assert advice in answer.text


def test_pure_noise_is_never_taken_for_a_focus_when_frames_are_compared() -> None:
    rng = np.random.default_rng(7)
    answers = [
        drive(searching(frames=3), lambda _: float(0.05 + 0.004 * rng.normal())) for _ in range(40)
    ]
    assert [answer.position for answer in answers if answer.position is not None] == []


def test_a_curve_that_jumps_is_hardly_ever_taken_for_a_peak() -> None:
    rng = np.random.default_rng(11)
    answers = [drive(searching(), lambda _: float(rng.uniform(0.01, 0.05))) for _ in range(200)]
    assert sum(answer.position is not None for answer in answers) <= 4


@pytest.mark.parametrize(
    ("low", "high", "coarse", "fine"),
    [
        (5.0, 5.0, 1.0, 0.5),
        (0.0, math.nan, 1.0, 0.5),
        (0.0, 10.0, 5.0, 1.0),
        (0.0, 10.0, 1.0, 2.0),
        (0.0, 10.0, 1.0, 0.0),
        (0.0, 1e6, 1.0, 0.5),
        (0.0, 10.0, math.nan, 0.5),
    ],
)
def test_a_range_that_makes_no_sweep_is_refused(
    low: float, high: float, coarse: float, fine: float
) -> None:
    with pytest.raises(ConfigError, match="focus"):
        FocusSearch(low, high, coarse_step=coarse, fine_step=fine)


def camera(lens: list[tuple[float, float]]) -> Iterator[Frame]:
    """Yield frames at 15/s of a lens whose way is known; each is exposed before it arrives."""
    for number in range(100_000):
        exposed_s = number / 15.0
        position = [where for since_s, where in lens if since_s <= exposed_s][-1]
        image = seen(abs(position - 13.0) / 8.0 + 0.6, seed=number)
        yield Frame(image, number, exposed_s + 0.12, exposed_s)


def test_old_frames_that_still_wait_do_not_mislead_the_search() -> None:
    """The image before the move arrives after it: taken, it would shift the peak by a step."""
    lens = [(-1.0, -60.0)]
    frames = camera(lens)
    now_s = 0.0
    search = FocusSearch(-60.0, 60.0, coarse_step=15.0, fine_step=5.0)
    while (target := search.target) is not None:
        arrived_s = now_s + 0.02
        lens.append((arrived_s, target))
        frame = next(each for each in frames if fresh(each, arrived_s))
        now_s = frame.time_s
        search.add(target, sharpness(frame.data))
    assert search.answer is not None
    assert search.answer.position == pytest.approx(13.0, abs=0.7)
