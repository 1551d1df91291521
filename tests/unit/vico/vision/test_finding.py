import subprocess
import sys
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.api import Fibre, fibre_mask, find_fibres
from cosmic.vico.core.vision import refine
from cosmic.vico.core.vision.smoothing import UndeterminedError, smooth
from unit.vico.vision.drawn_fibres import arc, drawn_image, loop

BOW = arc((120.0, 180.0), 0.2, 400.0, 0.9)
LOOP = loop((180.0, 150.0), 0.3, 800.0)


def only(image: np.ndarray) -> Fibre:
    fibres = find_fibres(image)
    assert len(fibres) == 1
    return fibres[0]


def certain(image: np.ndarray) -> list[Fibre]:
    return [fibre for fibre in find_fibres(image) if fibre.certain]


def ends_error_px(fibre: Fibre, line: np.ndarray) -> float:
    ends = line[[0, -1]]
    return min(float(np.abs(fibre.ends_px - each).max()) for each in (ends, ends[::-1]))


@pytest.mark.parametrize("width", [3.0, 9.0, 24.0])
def test_a_fibre_is_measured_whatever_its_width(width: float) -> None:
    fibre = only(drawn_image([BOW], [width]))
    assert fibre.certain, fibre.doubts
    assert fibre.length_px == pytest.approx(400.0, rel=0.003)
    assert fibre.width_px == pytest.approx(width, abs=0.6)
    assert ends_error_px(fibre, BOW) < 1.5
    assert fibre.area_px2 == pytest.approx(fibre.length_px * fibre.width_px)


def test_a_fibre_lighter_than_the_ground_is_measured_alike() -> None:
    fibre = only(drawn_image([BOW], [9.0], contrast=60.0, ground=70.0))
    assert fibre.lighter
    assert fibre.certain
    assert fibre.length_px == pytest.approx(400.0, rel=0.003)


def test_sixteen_bits_give_what_eight_give() -> None:
    image = drawn_image([BOW], [9.0])
    deep = only(image.astype(np.uint16) * 16)
    assert deep.certain
    assert deep.length_px == pytest.approx(only(image).length_px, abs=0.05)


def test_a_coloured_image_is_turned_to_grey() -> None:
    image = drawn_image([BOW], [9.0])
    assert only(cv2.merge([image, image, image])).length_px == pytest.approx(400.0, rel=0.003)


@pytest.mark.parametrize("lumen", [0.5, 0.8])
def test_a_hollow_fibre_is_one_fibre_and_not_its_two_walls(lumen: float) -> None:
    fibre = only(drawn_image([BOW], [22.0], lumen=lumen))
    assert fibre.certain, fibre.doubts
    assert fibre.width_px == pytest.approx(22.0, abs=0.8)
    assert fibre.length_px == pytest.approx(400.0, rel=0.003)


def test_two_dark_lines_with_ground_between_them_are_doubted() -> None:
    beside = arc((117.0, 193.0), 0.2, 400.0, 0.9)
    assert not certain(drawn_image([BOW, beside], [7.0, 7.0]))


@pytest.mark.parametrize("apart", [10.0, 12.0])
def test_ground_between_two_fibres_is_no_hollow(apart: float) -> None:
    beside = [arc((80.0, y), 0.0, 400.0, 0.0) for y in (200.0, 200.0 + apart)]
    assert not certain(drawn_image(beside, [7.0, 7.0]))


@pytest.mark.parametrize("lighter", [False, True], ids=["darker", "lighter"])
@pytest.mark.parametrize(
    ("apart", "count"), [(25.0, 12), (30.0, 12), (40.0, 8), (50.0, 4), (60.0, 12)]
)
def test_fibres_side_by_side_are_found_and_not_the_ground_between_them(
    apart: float, count: int, lighter: bool
) -> None:
    lines = [arc((250.0 + apart * each, 200.0), 1.57, 300.0, 0.2) for each in range(count)]
    image = drawn_image(lines, [7.0] * count, shape=(700, 1200), noise=1.0)
    fibres = certain(255 - image if lighter else image)
    assert len(fibres) == count
    assert [each.width_px for each in fibres] == pytest.approx([7.0] * count, abs=0.4)


@pytest.mark.parametrize("contrast", [-30.0, -60.0])
def test_fibres_side_by_side_are_found_where_light_falls_off_to_a_third(contrast: float) -> None:
    shape = (900, 1200)
    lines = [arc((425.0 + 50.0 * each, 300.0), 1.5, 300.0, 0.15) for each in range(8)]
    even = drawn_image(lines, [7.0] * 8, shape=shape, noise=0.0, contrast=contrast, ground=200.0)
    y, x = np.mgrid[: shape[0], : shape[1]] / 1200.0
    light = 0.25 + 0.75 * np.exp(-((x - 0.5) ** 2 + (y - 0.375) ** 2) / (2.0 * 0.4**2))
    seen = even * light + np.random.default_rng(1).normal(0.0, 1.5, shape)
    assert len(certain(np.clip(np.round(seen), 0, 255).astype(np.uint8))) == 8


def test_a_course_that_runs_away_costs_no_other_fibre(monkeypatch: pytest.MonkeyPatch) -> None:
    def badly(line: np.ndarray, *others: Any) -> np.ndarray:
        # As in the middle of ground that is cut into blocks.
        return 1e4 * line if line[:, 1].max() < 240.0 else smooth(line, *others)

    monkeypatch.setattr(refine, "smooth", badly)
    lines = [arc((80.0, y), 0.0, 400.0, 0.1) for y in (150.0, 330.0)]
    assert len(certain(drawn_image(lines, [7.0, 7.0]))) == 1


def test_a_fibre_that_crosses_itself_is_followed_through() -> None:
    fibre = only(drawn_image([LOOP], [9.0]))
    assert fibre.certain, fibre.doubts
    assert fibre.length_px == pytest.approx(800.0, rel=0.005)
    assert ends_error_px(fibre, LOOP) < 1.5


def test_two_fibres_that_cross_are_distinguished() -> None:
    down = arc((150.0, 80.0), 0.7, 420.0, 0.2)
    up = arc((150.0, 400.0), -0.7, 420.0, -0.2)
    fibres = find_fibres(drawn_image([down, up], [8.0, 11.0]))
    assert [fibre.certain for fibre in fibres] == [True, True]
    assert sorted(fibre.width_px for fibre in fibres) == pytest.approx([8.0, 11.0], abs=0.6)
    assert [fibre.length_px for fibre in fibres] == pytest.approx([420.0, 420.0], rel=0.005)


def test_several_fibres_come_longest_first() -> None:
    lines = [arc((60.0, y), 0.1, length, 0.3) for y, length in ((80.0, 200.0), (220.0, 480.0))]
    lengths = [fibre.length_px for fibre in find_fibres(drawn_image(lines, [8.0, 8.0]))]
    assert lengths == pytest.approx([480.0, 200.0], rel=0.005)


def test_a_fibre_cut_off_by_the_border_says_so() -> None:
    fibre = only(drawn_image([arc((-60.0, 200.0), 0.1, 400.0, 0.4)], [9.0]))
    assert not fibre.certain
    assert any("border" in doubt for doubt in fibre.doubts)


def test_a_gap_in_a_fibre_is_doubted() -> None:
    image = drawn_image([BOW], [9.0])
    image[:, 280:296] = np.random.default_rng(1).normal(150.0, 3.0, (480, 16))
    assert not certain(image)


def test_an_end_that_lies_on_another_fibre_is_doubted() -> None:
    along = arc((80.0, 240.0), 0.0, 480.0, 0.0)
    onto = arc((330.0, 243.0), 1.2, 180.0, 0.1)
    shorter = find_fibres(drawn_image([along, onto], [9.0, 9.0]))[-1]
    assert not shorter.certain


def test_an_image_out_of_focus_is_doubted() -> None:
    fibre = only(drawn_image([BOW], [12.0], blur_px=7.0))
    assert not fibre.certain
    assert any("focus" in doubt for doubt in fibre.doubts)


def test_a_fibre_that_fades_away_is_doubted() -> None:
    image = drawn_image([BOW], [9.0], noise=0.0).astype(float)
    fade = np.linspace(1.4, -0.4, 640).clip(0.0, 1.0)[None, :]
    faded = 150.0 + (image - 150.0) * fade + np.random.default_rng(2).normal(0.0, 3.0, image.shape)
    assert not certain(np.clip(faded, 0, 255).astype(np.uint8))


def test_a_gripper_is_not_a_fibre() -> None:
    image = np.full((480, 640), 150.0, np.float32)
    jaw = np.array([[0, 160], [250, 210], [270, 240], [250, 270], [0, 320]], np.int32)
    cv2.fillPoly(image, [jaw], 60.0)
    noisy = cv2.GaussianBlur(image, (0, 0), 1.0) + np.random.default_rng(3).normal(
        0.0, 3.0, image.shape
    )
    assert not certain(np.clip(noisy, 0, 255).astype(np.uint8))


def test_the_edge_of_something_wide_is_not_a_fibre() -> None:
    image = np.full((480, 640), 150.0, np.float32)
    cv2.circle(image, (320, 240), 150, 60.0, -1)
    noise = np.random.default_rng(6).normal(0.0, 3.0, image.shape)
    noisy = cv2.GaussianBlur(image, (0, 0), 1.0) + noise
    assert find_fibres(np.clip(noisy, 0, 255).astype(np.uint8)) == []


def test_a_network_holds_no_fibre_that_is_certain() -> None:
    rng = np.random.default_rng(4)
    lines = [
        arc((rng.uniform(0, 320), rng.uniform(0, 240)), rng.uniform(0, 6.3), 200.0, 1.0)
        for _ in range(24)
    ]
    assert not certain(drawn_image(lines, [4.0] * 24, shape=(240, 320)))


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 640), np.uint8),
        np.full((480, 640), 255, np.uint8),
        np.full((480, 640), 1000, np.uint16),
        np.random.default_rng(5).normal(120, 20, (480, 640)).clip(0, 255).astype(np.uint8),
        np.tile(np.arange(640) // 3, (480, 1)).astype(np.uint8),
        np.zeros((16, 16), np.uint8),
    ],
    ids=["black", "saturated", "constant", "noise", "ramp", "tiny"],
)
def test_an_image_of_nothing_holds_no_fibre(image: np.ndarray) -> None:
    assert find_fibres(image) == []


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (np.zeros((0, 0), np.uint8), "too small"),
        (np.zeros((1, 1), np.uint8), "too small"),
        (np.full((64, 64), np.nan), "no finite pixel"),
        (np.zeros((64, 64, 2), np.uint8), "shape"),
        (np.zeros((4, 64, 64), np.uint8), "shape"),
        (np.zeros(64, np.uint8), "shape"),
        ([[0, 1], [1, 0]], "numpy array"),
    ],
)
def test_what_is_no_image_is_refused(image: np.ndarray, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        find_fibres(image)


def test_the_image_is_left_as_it_was() -> None:
    image = drawn_image([BOW], [9.0])
    image.flags.writeable = False
    before = image.copy()
    find_fibres(image)
    assert np.array_equal(image, before)


def test_a_painted_fibre_covers_what_was_drawn() -> None:
    image = drawn_image([LOOP], [12.0], noise=0.0)
    painted = fibre_mask(only(image), image.shape) > 0
    drawn = image < 120
    assert 2.0 * (painted & drawn).sum() / (painted.sum() + drawn.sum()) > 0.97


def test_every_value_has_an_uncertainty_or_a_reason() -> None:
    fibre = only(drawn_image([BOW], [9.0]))
    for name in ("length_px", "projected_length_px", "width_px", "curl", "orientation_deg"):
        assert 0.0 < float(fibre.uncertainties[name]) < 0.05 * max(1.0, getattr(fibre, name))
    assert isinstance(fibre.uncertainties["kink"], str)
    assert not fibre.centre_line_px.flags.writeable


@settings(max_examples=8, deadline=None, derandomize=True)
@given(
    angle=st.floats(0.0, 2.0 * np.pi),
    turn=st.floats(-2.5, 2.5),
    width=st.floats(4.0, 14.0),
    length=st.floats(150.0, 330.0),
)
def test_a_certain_length_is_right(angle: float, turn: float, width: float, length: float) -> None:
    line = arc((0.0, 0.0), angle, length, turn)
    line = line - line.mean(axis=0) + (200.3, 199.6)
    if line.min() < 20.0 or line.max() > 380.0:
        return
    for fibre in find_fibres(drawn_image([line], [width], shape=(400, 400))):
        assert not fibre.certain or fibre.length_px == pytest.approx(length, rel=0.01)


def test_importing_the_api_loads_no_vision_library() -> None:
    code = (
        "import sys, cosmic.vico.api; "
        "sys.exit(any(name in sys.modules for name in ('cv2', 'scipy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_dirt_less_dark_than_the_fibre_at_its_end_makes_the_length_doubtful() -> None:
    line = arc((100.0, 100.0), 0.2, 140.0, 0.2)
    image = drawn_image([line], [7.7], shape=(240, 340), noise=0.0, blur_px=0.3).astype(np.float32)
    x, y = line[-1] + (5.0, 2.0)
    dirty = image.copy()
    cv2.ellipse(dirty, (round(x), round(y)), (5, 3), 20.0, 0, 360, 108.0, -1)
    rough = np.random.default_rng(7).normal(0.0, 3.0, image.shape)
    dirty = cv2.GaussianBlur(np.minimum(image, dirty), (0, 0), 1.2) + rough
    clean = cv2.GaussianBlur(image, (0, 0), 1.2) + rough
    assert only(np.clip(clean, 0, 255).astype(np.uint8)).certain
    assert not certain(np.clip(dirty, 0, 255).astype(np.uint8))


def test_points_of_which_too_few_count_determine_no_curve() -> None:
    line = np.column_stack([np.arange(120.0), np.zeros(120)])
    weights = np.zeros(120)
    weights[:2] = 1.0
    with pytest.raises(UndeterminedError, match="2 of 120 points count"):
        smooth(line, weights, 600.0)
    np.testing.assert_allclose(smooth(line, np.ones(120), 60.0), line, atol=1e-3)


def test_what_nobody_foresaw_of_an_image_is_reported_and_no_error_of_numpy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def broken(*_: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("cosmic.vico.core.vision.finding.find_relief", broken)
    with pytest.raises(NotAvailable, match=r"LinAlgError: Singular matrix\); take another"):
        find_fibres(np.full((64, 64), 200, np.uint8))


def test_only_the_line_that_is_wanted_is_measured_and_as_it_is_among_all() -> None:
    other = arc((200.0, 60.0), 0.0, 350.0, 0.2)
    image = drawn_image([BOW, other], [9.0, 9.0])
    among = find_fibres(image)
    asked: list[np.ndarray] = []

    def wanted(line: np.ndarray) -> bool:
        asked.append(line)
        return bool((np.linalg.norm(line - np.array([120.0, 180.0]), axis=1) < 15.0).any())

    (alone,) = find_fibres(image, wanted=wanted)
    assert len(asked) == len(among) == 2
    np.testing.assert_allclose(alone.centre_line_px, among[0].centre_line_px)
    assert alone.certain
