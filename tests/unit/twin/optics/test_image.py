"""What the twin's microscope sees."""

import math
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from cosmic.twin.settings import shipped_settings
from unit.twin.optics.image_bench import Grey, ImageBench, along, crossing

LEFT_LOWERED = -810.0
"""Of left.z: the held fibre lies at the height of the probe's middle."""


@dataclass(frozen=True)
class Part:
    x_px: int
    y_px: int
    width_px: int
    height_px: int


def lying_near_the_middle(bench: ImageBench) -> Grey:
    """Return the centre line of the fibre to be found at once, shape (n, 2), in the image."""
    lines = bench.optics.centre_lines_um(bench.now_s)
    (line,) = (each for each in lines if abs(each[:, 0].mean() - 200.0) < 20.0)
    return bench.optics.world_to_image_px(line, bench.now_s)


def offset_px(bench: ImageBench, image: Grey, line: Grey, at: int, reach_px: float) -> float:
    """Return how far the dark of a fibre lies beside its true line."""
    way = line[at + 1] - line[at - 1]
    normal = np.array([-way[1], way[0]]) / math.hypot(*way) * reach_px
    distances, values = along(image, line[at] - normal, line[at] + normal)
    dark = np.median(values[:20]) - values
    return float((dark * distances).sum() / dark.sum() - reach_px)


# --- truth ------------------------------------------------------------------------------------


@pytest.mark.parametrize("magnification", [0.58, 2.0, 5.0])
def test_a_fibre_is_seen_where_it_lies(magnification: float) -> None:
    bench = ImageBench().zoom(magnification)
    image, line = bench.image(), lying_near_the_middle(bench)
    reach = 20.0 * bench.optics.projection(bench.now_s).px_um + 8.0
    offsets = [offset_px(bench, image, line, at, reach) for at in range(5, 30, 5)]
    assert np.abs(offsets).max() < 0.05
    outwards = (line[0] - line[1]) / math.hypot(*(line[0] - line[1])) * 15.0
    end_px = crossing(*along(image, line[0] - outwards, line[0] + outwards)) - 15.0
    assert abs(end_px) < 0.1


@pytest.mark.parametrize("opening_um", [600.0, 200.0])
def test_jaws_are_seen_where_they_are_and_as_far_open(opening_um: float) -> None:
    bench = ImageBench().go(right_x=-3500.0, right_gripper=opening_um).focus(1500.0).zoom(2.0)
    image = bench.image()
    for jaw, side in (("right.jaw_a", 1.0), ("right.jaw_b", -1.0)):
        x, y, z = bench.scene.tips(bench.now_s)[jaw]
        inside, edge = bench.px(x + 300, y - side * 60, z), bench.px(x + 300, y, z)
        seen = crossing(*along(image, inside, bench.px(x + 300, y + side * 50, z)))
        assert seen == pytest.approx(math.hypot(*(edge - inside)), abs=0.2)
        before, tip = bench.px(x - 100, y + side * 50, z), bench.px(x, y + side * 50, z)
        seen = crossing(*along(image, before, bench.px(x + 200, y + side * 50, z)))
        assert seen == pytest.approx(math.hypot(*(tip - before)), abs=0.2)


def test_the_table_turns_what_lies_on_it() -> None:
    bench = ImageBench()
    before = lying_near_the_middle(bench)
    bench.image()
    bench.go(table_rotation=30.0)
    lines = bench.optics.centre_lines_um(bench.now_s)
    radius = math.hypot(200.0, 150.0)
    (line,) = (each for each in lines if abs(math.hypot(*each[:, :2].mean(axis=0)) - radius) < 20)
    turned = math.degrees(math.atan2(line[:, 1].mean(), line[:, 0].mean()))
    assert turned == pytest.approx(math.degrees(math.atan2(-150.0, 200.0)) + 30.0, abs=0.5)
    line_px, image = bench.optics.world_to_image_px(line, bench.now_s), bench.image()
    assert abs(offset_px(bench, image, line_px, 20, 12.0)) < 0.05
    x, y = np.round(before[20]).astype(int)
    assert image[y, x] > image.max() - 3.0


def test_a_fibre_far_out_of_focus_is_a_wide_shade_at_the_same_place() -> None:
    bench = ImageBench().zoom(5.0).focus(700.0)
    image, line = bench.image(), lying_near_the_middle(bench)
    reach = 3.5 * bench.optics.projection(bench.now_s).sigma_px(0.0)
    assert reach > 80.0  # drawn on a coarser grid
    offsets = [offset_px(bench, image, line, at, reach) for at in (16, 20, 24)]
    assert np.abs(offsets).max() < 1.0


def test_a_fibre_that_is_let_go_is_seen_on_the_plate() -> None:
    bench = ImageBench()
    bench.image()
    (held,) = (
        each for each in bench.optics.centre_lines_um(bench.now_s) if each[:, 2].min() > 1000.0
    )
    bench.go(left_gripper=400.0)
    (fallen,) = (
        each
        for each in bench.optics.centre_lines_um(bench.now_s)
        if abs(each[:, 0].mean() - held[[0, -1], 0].mean()) < 20.0
    )
    assert fallen[:, 2].max() < 10.0
    x, y = np.round(bench.px(*fallen[-1] - [300.0, 0.0, 0.0])).astype(int)
    assert np.ptp(bench.image()[y - 8 : y + 9, x]) > 20.0


def test_an_image_shows_its_own_time_though_the_force_side_was_asked_later() -> None:
    ends = []
    for ahead_s in (0.0, 0.08):
        bench = ImageBench().go(left_z=LEFT_LOWERED, left_x=3000.0, probe_x=-500.0)
        bench.go(probe_y=-5000.0)
        stage = bench.scene.stages["probe.y"]
        route = stage.route(bench.now_s)
        route.go(-5200.0, 500.0)
        stage.follow(route, held_until_s=1e9)
        assert bench.scene.force_side is not None
        bench.scene.force_side.timeline.moment(bench.now_s + 0.2 + ahead_s)
        (line,) = (
            each
            for each in bench.optics.centre_lines_um(bench.now_s + 0.2)
            if each[:, 2].min() > 500.0
        )
        ends.append(line[-1, 1])
    assert ends[0] < -100.0
    assert ends[1] == pytest.approx(ends[0], abs=2.0)


def test_the_probe_is_seen_bending_the_fibre() -> None:
    bench = ImageBench().go(left_z=LEFT_LOWERED, left_x=3000.0, probe_x=-500.0)
    bench.zoom(2.0).focus(700.0).go(probe_y=-4940.0)
    free_px = bench.px(-450.0, 0.0, 700.0)
    assert abs(_seen_below(bench, free_px)) < 0.2
    bench.go(probe_y=-5080.0)
    assert bench.scene.force_side is not None
    (push,) = bench.scene.force_side.timeline.moment(bench.now_s).pushes
    beside_um = push.deflection_um + 50.0 * 1.5 * push.deflection_um / push.abscissa_um
    seen_um = _seen_below(bench, free_px) / bench.optics.projection(bench.now_s).px_um
    assert seen_um == pytest.approx(beside_um, rel=0.05)


def _seen_below(bench: ImageBench, point_px: Grey) -> float:
    """Return how far below a place in the image a dark fibre crosses its column."""
    column = bench.image()[:, round(float(point_px[0]))]
    rows = np.arange(len(column))
    near = np.abs(rows - point_px[1]) < 90
    dark = np.where(near, np.median(column) - column, 0.0).clip(min=5.0) - 5.0
    return float((dark * rows).sum() / dark.sum() - point_px[1])


def test_a_tool_hides_the_fibre_below_it() -> None:
    bench = ImageBench().zoom(2.0)
    line = lying_near_the_middle(bench)
    x, y = np.round(line[len(line) // 2]).astype(int)
    around = slice(y - 12, y + 13)
    assert np.ptp(bench.image()[around, x]) > 40.0
    bench.go(right_x=-4200.0, right_y=1000.0)
    assert np.ptp(bench.image()[around, x]) > 40.0  # beside it
    place = bench.optics.centre_lines_um(bench.now_s)
    (fibre,) = (each for each in place if abs(each[:, 0].mean() - 200.0) < 20.0)
    bench.go(right_y=float(fibre[len(fibre) // 2, 1]) - 350.0)
    assert np.ptp(bench.image()[y - 5 : y + 6, x]) < 12.0


def test_the_first_look_shows_both_grippers_and_a_fibre() -> None:
    bench = ImageBench(shipped_settings())
    image = bench.image()
    ground = np.median(image)
    for jaw, side in (("left.jaw_a", -1.0), ("right.jaw_a", 1.0)):
        x, y, z = bench.scene.tips(bench.now_s)[jaw]
        column, row = np.round(bench.px(x + side * 400.0, y + 50.0, z)).astype(int)
        assert 0 < column < 1600
        assert image[row - 3 : row + 4, column].min() < 0.5 * ground
    for magnification in (2.0, 5.0):
        middle = lying_near_the_middle(bench.zoom(magnification))[20]
        assert np.abs(middle - [800, 600]).max() < 300


# --- light, focus, noise ----------------------------------------------------------------------


def test_light_exposure_and_gain_make_it_brighter_until_it_is_white() -> None:
    bench = ImageBench()
    black = bench.optics.settings.camera.black_grey

    def bright(**how: float) -> float:
        return float(np.median(bench.image(**how))) - black

    usual = bright()
    assert 120.0 < usual < 210.0
    assert bright(exposure_s=0.01) == pytest.approx(usual / 2, abs=1.0)
    assert bright(exposure_s=0.005, gain_db=6.0206) == pytest.approx(usual / 2, abs=1.0)
    assert bright(exposure_s=0.1) == 255.0 - black
    bench.light.set_percent(20.0, bench.now_s)
    assert bright() == pytest.approx(0.4 * usual, abs=1.5)
    bench.light.set_percent(0.0, bench.now_s)
    assert bright() < 2.0


def test_sixteen_bits_show_the_same_image_more_finely() -> None:
    bench = ImageBench()
    fine, coarse = bench.optics.render(1.0, bits=16), bench.optics.render(1.0)
    assert fine.dtype == np.uint16
    assert coarse.dtype == np.uint8
    assert np.abs(fine / 257.0 - coarse).max() < 0.6
    assert len(np.unique(fine)) > 256


@pytest.mark.parametrize("height_um", [0.0, 1500.0])
def test_things_are_sharpest_when_the_focus_is_at_their_height(height_um: float) -> None:
    bench = ImageBench().go(right_x=-3800.0).zoom(2.0)
    x, y, z = bench.scene.tips(bench.now_s)["right.jaw_a"]
    near = lying_near_the_middle(bench)[0] if height_um == 0.0 else bench.px(x, y + 50.0, z)
    rows, columns = (slice(int(each) - 40, int(each) + 40) for each in near[::-1])
    steepest = {}
    for focus_um in (-1000.0, 0.0, 750.0, 1500.0):
        image = bench.focus(focus_um).image()[rows, columns]
        steepest[focus_um] = np.abs(np.diff(image, axis=0)).max()
    sharp = steepest.pop(height_um)
    assert sharp > 1.5 * max(steepest.values())


def test_far_out_of_focus_drawing_on_a_coarser_grid_changes_no_brightness() -> None:
    bench = ImageBench().go(right_x=-3900.0).zoom(5.0)
    sums = []
    for focus_um in (1500.0, 1100.0, 300.0):
        sums.append(bench.focus(focus_um).image().mean())
    assert sums[1] == pytest.approx(sums[0], rel=0.02)
    assert sums[2] == pytest.approx(sums[0], rel=0.05)


def test_the_same_seed_and_time_give_the_same_image_and_others_other_noise() -> None:
    first, again = ImageBench(shipped_settings()), ImageBench(shipped_settings())
    image = first.optics.render(1.0)
    assert np.array_equal(image, again.optics.render(1.0))
    assert np.array_equal(image, first.optics.render(1.0))
    difference = first.optics.render(1.0).astype(float) - first.optics.render(1.05)
    assert 1.0 < difference[:400, :400].std() / math.sqrt(2.0) < 4.0
    other = ImageBench(shipped_settings(), seed=1)
    assert not np.array_equal(image, other.optics.render(1.0))


def test_noise_grows_with_the_gain() -> None:
    bench = ImageBench(shipped_settings())

    def noise(**how: float) -> float:
        part = bench.image(**how)[100:400, 500:900]
        return float(np.diff(part, axis=1).std())

    assert noise(exposure_s=0.005, gain_db=12.0) > 1.4 * noise()


# --- what the camera may ask for --------------------------------------------------------------


def test_an_image_is_fresh_and_may_be_written_to() -> None:
    bench = ImageBench()
    first = bench.optics.render(1.0)
    kept = first.copy()
    first[:] = 0
    assert np.array_equal(bench.optics.render(1.0), kept)


def test_a_part_of_the_sensor_shows_that_part_of_the_image() -> None:
    bench = ImageBench(shipped_settings()).zoom(2.0)
    whole = bench.image()
    part = bench.optics.render(bench.now_s, roi=Part(600, 500, 320, 240))
    assert part.shape == (240, 320)
    difference = part - whole[500:740, 600:920]
    assert abs(difference.mean()) < 0.2
    assert np.abs(difference).max() < 20.0


def test_binned_pixels_are_means_of_four() -> None:
    bench = ImageBench(shipped_settings()).zoom(2.0)
    whole = bench.image()
    binned = bench.optics.render(bench.now_s, binning=2)
    assert binned.shape == (600, 800)
    means = whole.reshape(600, 2, 800, 2).mean(axis=(1, 3))
    assert abs((binned - means).mean()) < 0.2
    assert np.diff(binned[:200].astype(float)).std() < 0.7 * np.diff(whole[:400]).std()
    assert np.abs(binned - means).max() < 20.0


def test_a_second_camera_sees_more_at_a_fixed_zoom() -> None:
    bench = ImageBench().zoom(7.0)
    tips = bench.scene.tips(bench.now_s)
    assert bench.optics.views == ("microscope", "overview")
    seen = bench.optics.render(bench.now_s, view="overview")
    x, y = bench.optics.world_to_image_px(tips["probe"], bench.now_s, view="overview")
    assert seen[round(y) - 8, round(x)] < 0.5 * np.median(seen)


def test_nothing_is_loaded_or_drawn_before_somebody_looks() -> None:
    code = (
        "import sys\n"
        "from cosmic.frame.clock import ManualClock\n"
        "from cosmic.twin.scene import Scene\n"
        "from cosmic.twin.settings import shipped_settings\n"
        "Scene.from_settings(shipped_settings(), ManualClock())\n"
        "sys.exit('cv2' in sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
