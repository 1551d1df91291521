"""Tracking: found again to a small part of a pixel, or lost, and never something else instead."""

import math
from types import MappingProxyType

import cv2
import numpy as np
import pytest

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.fibre_tracking import FibreTracker
from cosmic.vico.core.vision.matching import Template, displacement
from cosmic.vico.core.vision.tracking import TemplateTracker, TrackState
from cosmic.vico.hw.interface import Roi

SIZE = (300, 400)


def scene(
    shift: tuple[float, float] = (0.0, 0.0), *, noise: float = 2.5, gain: float = 1.0, seed: int = 0
) -> np.ndarray:
    """Return dark spots on a bright ground, each drawn anew where it is: nothing interpolates."""
    rng = np.random.default_rng(42)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float64)
    image = np.full(SIZE, 150.0)
    for _ in range(14):
        at = rng.uniform((100.0, 80.0), (300.0, 220.0)) + shift
        radius = rng.uniform(4.0, 11.0)
        distance = np.hypot(x - at[0], y - at[1])
        image -= 70.0 / (1.0 + np.exp((distance - radius) / 0.8))
    image = image * gain + np.random.default_rng(seed + 1).normal(0.0, noise, SIZE)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def test_a_shift_is_found_to_a_small_part_of_a_pixel_and_its_uncertainty_is_true() -> None:
    rng = np.random.default_rng(3)
    before = scene()
    errors, stds_px = [], []
    for number in range(25):
        shift = tuple(rng.uniform(-15.0, 15.0, 2).tolist())
        match = displacement(before, scene(shift, seed=number), Roi(140, 90, 100, 90), 20.0)
        assert match is not None
        assert match.score > 0.9
        errors.append(np.array(match.centre_px) - (189.5, 134.5) - shift)
        stds_px.append(match.std_px)
    assert np.abs(errors).max() < 0.08
    assert np.std(errors) < 1.3 * np.mean(stds_px)
    assert np.mean(stds_px) < 0.05


def test_brightness_contrast_and_sixteen_bits_change_nothing() -> None:
    before = scene()
    bright = scene((5.3, -2.7), gain=1.5)
    for after in (bright, bright.astype(np.uint16) * 16):
        match = displacement(before, after, Roi(140, 90, 100, 90), 20.0)
        assert match is not None
        assert match.centre_px == pytest.approx((194.8, 131.8), abs=0.06)


def test_a_straight_edge_is_not_sure_along_itself() -> None:
    image = np.full(SIZE, 150, np.uint8)
    image[:, 200:] = 80
    noisy = [
        np.clip(image + np.random.default_rng(n).normal(0, 2, SIZE), 0, 255).astype(np.uint8)
        for n in (0, 1)
    ]
    match = displacement(noisy[0], noisy[1], Roi(170, 100, 60, 60), 10.0)
    assert match is not None
    assert match.std_px > 0.5


@pytest.mark.parametrize(
    ("region", "reason"),
    [
        (Roi(380, 0, 40, 40), "within the image of 400 x 300"),
        (Roi(10, 10, 4, 40), "12 px or more"),
        (Roi(0, 0, 40, 40), "no contrast"),
    ],
)
def test_a_region_that_cannot_be_followed_is_refused(region: Roi, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        Template(scene(noise=0.0), region)


# --- a place ----------------------------------------------------------------------------------

START = (200.3, 150.6)


def test_a_moving_point_is_followed_with_its_prediction() -> None:
    tracker = TemplateTracker(size_px=80, reach_px=12.0)
    tracker.start(scene(), START)
    for step in range(1, 8):
        # Nine pixels a frame: within reach at first, then only because the movement is expected.
        shift = (9.0 * step, -2.2 * step)
        track = tracker.follow(scene(shift, seed=step))
        assert track.state is TrackState.FOUND, track.reason
        assert track.position_px == pytest.approx(
            (START[0] + shift[0], START[1] + shift[1]), abs=0.2
        )
        assert track.std_px is not None
    assert tracker.expected_px == pytest.approx((START[0] + 72.0, START[1] - 17.6), abs=0.3)


def test_a_jump_is_followed_where_the_stages_say_it_goes() -> None:
    tracker = TemplateTracker(size_px=80, reach_px=10.0)
    tracker.start(scene(), START)
    jumped = scene((50.0, 30.0), seed=3)
    assert tracker.follow(jumped).state is not TrackState.FOUND
    track = tracker.follow(jumped, expected_px=(252.0, 178.0))
    assert track.state is TrackState.FOUND
    assert track.position_px == pytest.approx((250.3, 180.6), abs=0.1)


def test_what_is_gone_is_lost_and_found_again_when_it_is_back() -> None:
    tracker = TemplateTracker(size_px=80, reach_px=15.0)
    tracker.start(scene(), START)
    empty = np.clip(np.random.default_rng(9).normal(150, 3, SIZE), 0, 255).astype(np.uint8)
    track = tracker.follow(empty)
    assert track.state is TrackState.LOST
    assert track.position_px is None
    assert "no match was found" in track.reason
    assert tracker.follow(scene((20.0, 0.0))).state is TrackState.FOUND


def test_what_leaves_the_image_is_lost() -> None:
    tracker = TemplateTracker(size_px=80, reach_px=15.0)
    tracker.start(scene(), START)
    assert tracker.follow(scene(), expected_px=(395.0, 150.0)).reason == "it left the image"


def test_two_points_that_look_alike_are_not_distinguished() -> None:
    image = np.full(SIZE, 150, np.uint8)
    for x in range(40, 400, 40):
        cv2.circle(image, (x, 150), 8, 70, -1, cv2.LINE_AA)
    tracker = TemplateTracker(size_px=36, reach_px=60.0)
    tracker.start(image, (200.0, 150.0))
    track = tracker.follow(image)
    assert track.state is TrackState.UNSURE
    assert "another point looks like it" in track.reason


def test_what_changes_slowly_is_learnt_anew_and_the_uncertainty_grows() -> None:
    """One texture fades into another: its first look would be lost, the last one is not."""
    rng = np.random.default_rng(8)
    first, last = (cv2.GaussianBlur(rng.normal(0.0, 150.0, SIZE), (0, 0), 3.0) for _ in range(2))

    def fading(share: float, seed: int) -> np.ndarray:
        noise = np.random.default_rng(seed).normal(0.0, 2.0, SIZE)
        image = 140.0 + (1.0 - share) * first + share * last + noise
        return np.clip(image, 0, 255).astype(np.uint8)

    start = (190.0, 140.0)
    tracker = TemplateTracker(size_px=80, reach_px=15.0)
    tracker.start(fading(0.0, 0), start)
    tracks = [
        tracker.follow(fading(share, number))
        for number, share in enumerate(np.linspace(0.05, 1.0, 20))
    ]
    assert {track.state for track in tracks} == {TrackState.FOUND}
    assert tracks[-1].position_px == pytest.approx(start, abs=0.5)
    assert tracks[-1].std_px > 1.3 * tracks[0].std_px
    other = TemplateTracker(size_px=80, reach_px=15.0)
    other.start(fading(0.0, 0), start)
    assert other.follow(fading(1.0, 1)).state is TrackState.LOST


def test_nothing_is_followed_before_it_is_started() -> None:
    with pytest.raises(NotAvailable, match="start on an image"):
        TemplateTracker().follow(scene())
    with pytest.raises(NotAvailable, match="start with one that was found"):
        FibreTracker().follow([])


# --- a fibre ----------------------------------------------------------------------------------


def fibre(
    x: float = 0.0,
    y: float = 0.0,
    *,
    length: float = 300.0,
    width: float = 12.0,
    turn: float = 0.0,
    doubts: tuple[str, ...] = (),
) -> Fibre:
    along = np.linspace(-0.5 * length, 0.5 * length, 120)
    bow = 20.0 * np.cos(along / 90.0)
    cosine, sine = math.cos(turn), math.sin(turn)
    line = np.column_stack([cosine * along - sine * bow + x, sine * along + cosine * bow + y])
    return Fibre(
        centre_line_px=line,
        widths_px=np.full(120, width),
        length_px=length,
        length_std_px=0.1,
        length_interval_px=(0.0, 1e9),
        projected_length_px=length,
        width_px=width,
        width_std_px=0.1,
        area_px2=length * width,
        ends_px=line[[0, -1]],
        ends_std_px=np.full(2, 0.2),
        curl=0.0,
        kink=0.0,
        kinks=0,
        orientation_deg=0.0,
        grasp_points_px=np.empty((0, 2)),
        contrast=60.0,
        lighter=False,
        certain=not doubts,
        probability=0.5 if doubts else 1.0,
        signs=(),
        doubts=doubts,
        uncertainties=MappingProxyType({}),
    )


def following(one: Fibre) -> FibreTracker:
    tracker = FibreTracker(reach_px=40.0)
    tracker.start(one)
    return tracker


def test_a_fibre_is_followed_among_others_whichever_end_comes_first() -> None:
    tracker = following(fibre())
    for step in range(1, 10):
        mine = fibre(12.0 * step, 3.0 * step, turn=0.05 * step)
        mine.centre_line_px[:] = mine.centre_line_px[:: (-1) ** step].copy()
        others = [fibre(12.0 * step, 3.0 * step + 120.0), fibre(0.0, 200.0, length=200.0)]
        track = tracker.follow([*others, mine])
        assert track.state is TrackState.FOUND, track.reason
        assert track.fibre is mine
        assert track.moved_px == pytest.approx((12.0, 3.0), abs=2.0)


def test_a_movement_that_goes_on_is_expected() -> None:
    tracker = following(fibre())
    for step in range(1, 5):
        track = tracker.follow([fibre(0.0, 35.0 * step)])
        assert track.state is TrackState.FOUND
    assert track.distance_px == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(
    ("others", "reason"),
    [
        ([], "there is no fibre on the image"),
        ([fibre(0.0, 90.0)], "the nearest lies 90 px away"),
        ([fibre(length=230.0)], "the length of the one there differs by -23 %"),
        ([fibre(width=20.0)], "the width of the one there differs by [+]67 %"),
    ],
)
def test_another_fibre_is_not_taken_for_it(others: list[Fibre], reason: str) -> None:
    track = following(fibre()).follow(others)
    assert track.state is TrackState.LOST
    assert track.fibre is None
    assert reason.replace("[+]", "+") in track.reason


def test_it_is_found_again_where_it_was_lost() -> None:
    tracker = following(fibre())
    assert tracker.follow([]).state is TrackState.LOST
    assert tracker.follow([fibre(10.0, 5.0)]).state is TrackState.FOUND


def test_two_that_fit_alike_leave_it_open_and_nothing_is_learnt() -> None:
    tracker = following(fibre())
    track = tracker.follow([fibre(0.0, 6.0), fibre(0.0, -6.5)])
    assert track.state is TrackState.UNSURE
    assert track.reason == "two fibres fit it almost alike"
    assert tracker.follow([fibre(0.0, 1.0)]).moved_px == pytest.approx((0.0, 1.0), abs=1e-9)


def test_the_stages_say_where_a_turned_fibre_is() -> None:
    turned = fibre(60.0, 40.0, turn=1.2)
    tracker = following(fibre())
    assert tracker.follow([turned]).state is TrackState.LOST
    track = tracker.follow([turned], expected_line_px=turned.centre_line_px + 5.0)
    assert track.state is TrackState.FOUND


def test_a_doubtful_fibre_is_followed_and_its_doubts_are_reported() -> None:
    track = following(fibre()).follow([fibre(3.0, 0.0, doubts=("an end is hidden",))])
    assert track.state is TrackState.UNSURE
    assert track.reason == "an end is hidden"
    assert track.fibre is not None


def test_a_length_that_creeps_is_compared_with_the_first() -> None:
    tracker = following(fibre())
    states = [
        tracker.follow([fibre(length=300.0 * (1.0 - 0.04 * step))]).state for step in range(1, 7)
    ]
    assert states[:3] == [TrackState.FOUND] * 3
    assert states[3:] == [TrackState.LOST] * 3
