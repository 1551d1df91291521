"""Where things lie in the image, and how sharp they are there."""

import math

import numpy as np
import pytest

from unit.twin.optics.image_bench import ImageBench


def scale_um_px(bench: ImageBench, height_um: float = 0.0) -> float:
    here, there = bench.px(0.0, 0.0, height_um), bench.px(100.0, 0.0, height_um)
    return 100.0 / math.hypot(*(there - here))


@pytest.mark.parametrize(("magnification", "um_px"), [(0.58, 7.586), (2.0, 2.2), (7.0, 0.6286)])
def test_the_scale_is_that_of_pixel_and_magnification(magnification: float, um_px: float) -> None:
    assert scale_um_px(ImageBench().zoom(magnification)) == pytest.approx(um_px, rel=1e-3)


def test_zoom_grows_by_equal_factors_over_its_counts() -> None:
    bench = ImageBench()
    scales = []
    for part in (0.0, 0.5, 1.0):
        bench._turn("zoom", part)
        scales.append(scale_um_px(bench))
    assert scales[0] / scales[1] == pytest.approx(scales[1] / scales[2])


def test_x_runs_to_the_right_and_y_upwards_turned_by_the_mounting() -> None:
    bench = ImageBench().zoom(2.0)
    x_way = bench.px(100.0, 0.0, 0.0) - bench.px(0.0, 0.0, 0.0)
    y_way = bench.px(0.0, 100.0, 0.0) - bench.px(0.0, 0.0, 0.0)
    assert x_way[0] > 40.0
    assert y_way[1] < -40.0
    assert math.degrees(math.atan2(x_way[1], x_way[0])) == pytest.approx(0.7)
    assert x_way @ y_way == pytest.approx(0.0, abs=1e-9)


def test_the_middle_of_the_image_is_beside_the_origin_and_wanders_with_the_zoom() -> None:
    bench = ImageBench()
    wide = bench.px(60.0, -45.0, 0.0)
    assert np.allclose(wide, [799.5, 599.5])
    assert np.allclose(bench.zoom(7.0).px(60.0, -45.0, 0.0) - wide, [14.0, -9.0])


def test_what_lies_higher_looks_larger() -> None:
    bench = ImageBench()
    ratio = scale_um_px(bench, 0.0) / scale_um_px(bench, 1500.0)
    assert ratio == pytest.approx(86.0 / 84.5)


def test_a_part_of_the_sensor_and_binning_shift_and_shrink_the_image() -> None:
    class Roi:
        x_px, y_px, width_px, height_px = 96, 40, 400, 300

    bench = ImageBench()
    whole = bench.px(500.0, 700.0, 0.0)
    part = bench.optics.world_to_image_px((500.0, 700.0, 0.0), bench.now_s, Roi(), 1)
    binned = bench.optics.world_to_image_px((500.0, 700.0, 0.0), bench.now_s, Roi(), 2)
    assert np.allclose(part, whole - [96, 40])
    assert np.allclose(binned, (whole + 0.5) / 2 - 0.5 - [96, 40])


def test_sharpness_falls_off_around_the_focus_and_faster_at_high_zoom() -> None:
    bench = ImageBench().focus(200.0)
    widths = []
    for magnification in (0.58, 5.0):
        bench.zoom(magnification)
        view = bench.optics.projection(bench.now_s)
        assert view.sigma_px(200.0) < view.sigma_px(0.0)
        assert view.sigma_px(0.0) == pytest.approx(view.sigma_px(400.0), rel=0.01)
        widths.append(view.sigma_px(0.0) / view.sigma_px(200.0))
    assert widths[0] < 1.1
    assert widths[1] > 3.0


def test_several_points_are_reported_at_once() -> None:
    bench = ImageBench()
    points = np.array([[0.0, 0.0, 0.0], [10.0, 20.0, 30.0]])
    found = bench.optics.world_to_image_px(points, bench.now_s)
    assert np.allclose(found, [bench.px(*points[0]), bench.px(*points[1])])
