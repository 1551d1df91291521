import numpy as np
import pytest

from cosmic.vico.api import find_fibres
from cosmic.vico.core.vision.measures import kink_angles_deg, kink_index, longest_extent
from unit.vico.vision.drawn_fibres import arc, drawn_image


def bent(angle_deg: float, length: float = 200.0) -> np.ndarray:
    first = arc((0.0, 0.0), 0.0, length, 0.0)[::8]
    last = arc(tuple(first[-1]), np.radians(angle_deg), length, 0.0)[::8]
    return np.concatenate([first, last[1:]])


def test_a_straight_fibre_has_no_curl_and_no_kink() -> None:
    fibre = find_fibres(drawn_image([arc((100.0, 200.0), 0.3, 400.0, 0.0)], [9.0]))[0]
    assert fibre.curl == pytest.approx(0.0, abs=0.001)
    assert fibre.kinks == 0
    assert fibre.kink == 0.0
    assert fibre.orientation_deg == pytest.approx(np.degrees(0.3), abs=0.2)
    assert fibre.projected_length_px == pytest.approx(400.0, rel=0.003)


def test_half_a_circle_has_the_curl_of_geometry() -> None:
    fibre = find_fibres(drawn_image([arc((320.0, 100.0), 0.0, 400.0, np.pi)], [9.0]))[0]
    assert fibre.curl == pytest.approx(np.pi / 2.0 - 1.0, rel=0.005)
    assert fibre.kinks == 0


@pytest.mark.parametrize(("angle_deg", "weight"), [(15.0, 0), (33.0, 2), (70.0, 3), (110.0, 4)])
def test_a_kink_counts_by_its_angle(angle_deg: float, weight: int) -> None:
    line = bent(angle_deg)
    angles = kink_angles_deg(line, 8.0)
    assert angles == [pytest.approx(angle_deg, abs=4.0)]
    assert kink_index(angles, 400.0) == weight / 400.0


def test_the_projected_length_is_the_largest_distance_and_not_that_of_the_ends() -> None:
    line = arc((0.0, 0.0), 0.0, 2.0 * np.pi * 100.0, 1.8 * np.pi)[::8]
    extent, _ = longest_extent(line)
    assert extent == pytest.approx(2.0 * 100.0 / 0.9, rel=0.002)


def test_grasp_points_lie_on_the_fibre_near_its_two_ends() -> None:
    fibre = find_fibres(drawn_image([arc((120.0, 200.0), 0.2, 400.0, 0.5)], [9.0]))[0]
    assert fibre.grasp_points_px.shape == (2, 2)
    for point in fibre.grasp_points_px:
        assert np.linalg.norm(fibre.centre_line_px - point, axis=1).min() < 0.1
        assert 10.0 < np.linalg.norm(fibre.ends_px - point, axis=1).min() < 120.0


def test_no_grasp_point_lies_beside_another_fibre() -> None:
    long = arc((100.0, 200.0), 0.0, 440.0, 0.0)
    near = arc((100.0, 216.0), 0.0, 150.0, 0.0)
    fibres = find_fibres(drawn_image([long, near], [8.0, 8.0]))
    assert all(point[0] > 250.0 for point in fibres[0].grasp_points_px)
