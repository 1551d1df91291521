"""What the reduced image joins is told apart: end to end across a gap, and side by side."""

import cv2
import numpy as np
import pytest

from cosmic.vico.api import Fibre, find_fibres
from unit.vico.vision.drawn_fibres import arc, drawn_image


def lengths(fibres: list[Fibre]) -> list[float]:
    return [fibre.length_px for fibre in fibres]


@pytest.mark.parametrize(("width", "gap"), [(8.0, 4.0), (12.0, 6.0), (14.0, 10.0)])
def test_a_gap_of_half_a_width_parts_two_fibres(width: float, gap: float) -> None:
    first = arc((70.0, 200.0), 0.1, 260.0, 0.3)
    second = arc(tuple(first[-1] + gap * np.array([np.cos(0.4), np.sin(0.4)])), 0.4, 200.0, 0.2)
    found = find_fibres(drawn_image([first, second], [width, width]))
    assert lengths(found) == pytest.approx([260.0, 200.0], abs=2.0)
    assert not any(fibre.certain for fibre in found)


@pytest.mark.parametrize("apart", [15.0, 17.0])
def test_three_fibres_side_by_side_are_separated_and_called_a_bundle(apart: float) -> None:
    lines = [
        arc((100.0 + 15.0 * n, 180.0 + apart * n), 0.0, 300.0 + 20.0 * n, 0.0) for n in range(3)
    ]
    found = find_fibres(drawn_image(lines, [9.0] * 3, shape=(480, 1280)))
    assert lengths(found) == pytest.approx([340.0, 320.0, 300.0], rel=0.01)
    assert all(any("bundle" in doubt for doubt in fibre.doubts) for fibre in found)


def test_a_bundle_of_which_no_ground_is_seen_is_not_certain() -> None:
    lines = [arc((100.0, 180.0 + 8.5 * n), 0.0, 300.0, 0.2) for n in range(3)]
    found = find_fibres(drawn_image(lines, [9.0] * 3, shape=(480, 1280)))
    assert not any(fibre.certain and fibre.length_px < 310.0 and n for n, fibre in enumerate(found))


def test_the_shade_of_what_crosses_a_fibre_is_no_sign_of_two() -> None:
    below, above = arc((60.0, 150.0), 0.2, 480.0, 0.2), arc((320.0, 60.0), 1.5, 330.0, 0.1)
    image = drawn_image([below, above], [10.0, 10.0], noise=2.0).astype(np.float32)
    near = np.zeros(image.shape, np.float32)
    cv2.polylines(near, [np.round(above).astype(np.int32)], False, 1.0, 22)
    fibre = drawn_image([below], [10.0], noise=0.0) < 120
    shaded = image + 14.0 * cv2.GaussianBlur(near * fibre, (0, 0), 1.0) * (image < 125)
    found = find_fibres(np.clip(shaded, 0, 255).astype(np.uint8))
    assert [fibre.certain for fibre in found] == [True, True]


@pytest.mark.parametrize(
    ("lines", "true"),
    [
        # They touch on the right, and no ground is seen between them there.
        (
            [
                arc((100.0, 150.0), 0.055, 360.0, 0.0),
                arc((80.0, 172.0), 0.02, 440.0, 0.0),
                arc((120.0, 190.0), 0.02, 330.0, 0.0),
            ],
            [440.0, 360.0, 330.0],
        ),
        # Two cross at four degrees, and come out of each other's shade.
        ([arc((90.0, 170.0), 0.09, 400.0, 0.0), arc((90.0, 190.0), 0.02, 460.0, 0.0)], [460, 400]),
    ],
)
def test_fibres_of_a_bundle_that_touch_or_cross_are_separated(
    lines: list[np.ndarray], true: list[float]
) -> None:
    found = find_fibres(drawn_image(lines, [9.0] * len(lines), shape=(480, 1280)))
    assert lengths(found) == pytest.approx(true, rel=0.005)
    assert [fibre.width_px for fibre in found] == pytest.approx([9.0] * len(lines), abs=0.9)
    assert all(any("bundle" in doubt for doubt in fibre.doubts) for fibre in found)


def test_an_end_that_lies_on_another_fibre_of_a_bundle_is_not_made_up() -> None:
    lines = [arc((100.0, 180.0), 0.0, 420.0, 0.0), arc((120.0, 194.0), -0.0466, 300.0, 0.0)]
    found = find_fibres(drawn_image(lines, [9.0, 9.0], shape=(480, 1280)))
    apart = [each for each in found if any("bundle" in doubt for doubt in each.doubts)]
    assert not any(fibre.certain for fibre in found)
    assert len(apart) != 2 or lengths(apart) == pytest.approx([420.0, 300.0], rel=0.01)


def test_a_hollow_fibre_is_not_taken_for_two_that_touch() -> None:
    line = arc((80.0, 150.0), 0.1, 460.0, 0.3)
    found = find_fibres(drawn_image([line], [24.0], lumen=0.8))
    assert [fibre.certain for fibre in found] == [True]
    assert lengths(found) == pytest.approx([460.0], rel=0.001)
