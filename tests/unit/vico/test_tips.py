"""Tips of grippers and probe: half a pixel, or a doubt, or a reason; on two renderers."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from cosmic.frame.errors import ConfigError
from cosmic.twin.settings import shipped_settings
from cosmic.vico.core.vision.tips import find_gripper, find_probe
from cosmic.vico.core.vision.tool_tips import find_tool
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips, NotSeen, ToolEnd
from unit.twin.optics.image_bench import ImageBench
from unit.vico.tool_images import ToolImage, tool_image

Found = ToolEnd | GripperTips


def gripper(image: ToolImage) -> GripperTips:
    found = find_gripper(image.image, image.expected)
    assert isinstance(found, GripperTips), found
    return found


def probe(image: ToolImage) -> ToolEnd:
    found = find_probe(image.image, image.expected)
    assert isinstance(found, ToolEnd), found
    return found


@pytest.mark.parametrize(
    "changes", [{}, {"noise": 12.0}, {"blur": 4.0}, {"width": 23.0, "blur": 3.0}, {"width": 10.0}]
)
def test_a_probe_s_tip_is_found_to_a_part_of_a_pixel(changes: dict[str, float]) -> None:
    images = [tool_image(seed, **changes) for seed in range(4)]
    found = [probe(image) for image in images]
    errors = [math.dist(f.tip_px, p.hold) for f, p in zip(found, images, strict=True)]
    assert np.median(errors) < 0.2
    assert max(errors) < 0.6
    assert all(each.certain for each in found)
    for each, image in zip(found, images, strict=True):
        assert each.width_px == pytest.approx(image.expected.width_px, abs=0.5)
        assert np.dot(each.forward, image.forward) > math.cos(math.radians(1.5))


@pytest.mark.parametrize(
    "changes", [{"gap": 90.0}, {"gap": 60.0, "noise": 12.0}, {"gap": 70.0, "blur": 3.0}]
)
def test_a_gripper_s_middle_and_gap_are_found(changes: dict[str, float]) -> None:
    images = [tool_image(seed, **changes) for seed in range(4)]
    found = [gripper(image) for image in images]
    errors = [math.dist(f.hold_px, p.hold) for f, p in zip(found, images, strict=True)]
    assert np.median(errors) < 0.25
    assert max(errors) < 0.6
    assert all(each.certain for each in found)
    for each in found:
        assert each.gap_px == pytest.approx(changes["gap"], abs=0.4)
        assert math.dist(each.jaws[0].corners_px[0], each.jaws[1].corners_px[0]) == pytest.approx(
            each.gap_px, abs=0.6
        )


def test_the_first_jaw_is_the_one_to_the_left_of_where_the_gripper_points() -> None:
    image = tool_image(2, gap=80.0)
    x, y = image.forward
    first, second = (np.array(jaw.tip_px) for jaw in gripper(image).jaws)
    assert np.dot(second - first, (-y, x)) > 0.0


def test_the_uncertainty_reported_is_about_the_error_made() -> None:
    images = [tool_image(seed, blur=2.0, noise=8.0) for seed in range(12)]
    found = [probe(image) for image in images]
    errors = np.array([np.array(f.tip_px) - p.hold for f, p in zip(found, images, strict=True)])
    mean_std_px = float(np.mean([each.std_px for each in found]))
    assert 0.4 * mean_std_px < errors.std() < 1.6 * mean_std_px


def test_a_fibre_between_the_jaws_shifts_nothing() -> None:
    for seed in range(5):
        image = tool_image(seed, gap=90.0, fibre=True)
        found = gripper(image)
        assert math.dist(found.hold_px, image.hold) < 0.4
        assert found.gap_px == pytest.approx(90.0, abs=0.5)


def test_a_fibre_held_between_the_jaws_is_noticed() -> None:
    doubts = []
    for seed in range(5):
        image = tool_image(seed, gap=14.0, fibre=True)
        found = gripper(image)
        assert math.dist(found.hold_px, image.hold) < 0.4
        doubts += found.doubts
        reckoned = any("something lies against a jaw" in doubt for doubt in found.doubts)
        assert not reckoned or found.std_px > 0.15  # its inner corner was not seen
    assert any("something lies against a jaw" in doubt for doubt in doubts)


# --- what cannot be told ----------------------------------------------------------------------


def test_an_empty_image_and_a_fibre_alone_are_no_tool() -> None:
    rng = np.random.default_rng(0)
    empty = rng.normal(150.0, 4.0, (400, 480)).clip(0, 255).astype(np.uint8)
    image = tool_image(1, gap=90.0, fibre=True)
    line = empty.copy()
    line[190:203] = 70
    expected = ExpectedTool((240.0, 200.0), (1.0, 0.0), 45.0)
    for pixels in (empty, line):
        found = find_probe(pixels, expected)
        assert isinstance(found, NotSeen)
        assert "no large dark body" in found.reason
    assert isinstance(find_gripper(empty, image.expected), NotSeen)


def test_closed_jaws_and_a_single_jaw_are_reported() -> None:
    closed = find_gripper(tool_image(3, width=90.0).image, tool_image(3, gap=1.0).expected)
    assert closed == NotSeen("its jaws cannot be told apart: they are closed, or not in focus")
    single = find_gripper(tool_image(3).image, tool_image(3, gap=40.0).expected)
    assert single == NotSeen("only one of its jaws is seen")


@pytest.mark.parametrize("gap", [0.0, 1.0])
@pytest.mark.parametrize("apart", [0.0, 3.0, 8.0])
def test_a_gripper_that_is_shut_is_one_body_and_may_hold_something(
    apart: float, gap: float
) -> None:
    drawn = tool_image(3, width=40.0 + apart)
    shut = replace(tool_image(3, width=20.0).expected, gap_px=gap).with_jaws_shut()
    found = find_tool(drawn.image, shut)
    assert isinstance(found, GripperTips)
    assert found.certain
    assert found.hold_px == pytest.approx(tuple(drawn.hold), abs=1.0)
    narrow = find_tool(tool_image(3, width=30.0).image, shut)
    assert isinstance(narrow, GripperTips)
    assert any("and should be 4" in each for each in narrow.doubts)


def test_a_tip_off_the_image_or_far_from_where_it_should_be_is_not_seen() -> None:
    image = tool_image(5)
    off = find_probe(image.image, replace(image.expected, tip_px=(500.0, 200.0)))
    assert isinstance(off, NotSeen)
    assert "off the image" in off.reason
    behind = np.array(image.hold) - 130.0 * image.forward
    far = find_probe(image.image, replace(image.expected, tip_px=tuple(behind.tolist())))
    assert isinstance(far, NotSeen)
    assert "reaches more than 40 px beyond" in far.reason


def test_another_width_or_direction_than_expected_is_doubted() -> None:
    image = tool_image(4, off_px=2.0)
    broad = find_probe(image.image, replace(image.expected, width_px=35.0))
    assert isinstance(broad, ToolEnd)
    assert broad.doubts == ("it is 45 px wide, and should be 35 px",)
    x, y = image.forward
    turn = math.radians(12.0)
    turned = (x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn))
    leaning = find_probe(image.image, replace(image.expected, forward=turned))
    assert isinstance(leaning, ToolEnd)
    assert any("points 12 degrees away" in doubt for doubt in leaning.doubts)


def test_a_probe_is_doubted_that_a_thin_fibre_lies_against() -> None:
    for seed in range(4):
        image = tool_image(seed, width=12.0, specks=0)
        assert probe(image).certain
        x, y = image.forward
        side, lean = np.array([-y, x]), math.radians(5.0)
        start = image.hold + 6.0 * side - 12.0 * image.forward
        end = start + 60.0 * (math.sin(lean) * side - math.cos(lean) * image.forward)
        ends = [tuple(np.rint(each * 16).astype(int).tolist()) for each in (start, end)]
        cv2.line(image.image, *ends, 90, 2, cv2.LINE_AA, shift=4)
        found = probe(image)
        assert math.dist(found.tip_px, image.hold) > 0.4, "more than it says"
        assert found.doubts == ("something lies against a side of it",)


@pytest.mark.parametrize("specks", [0, 25, 60])
@pytest.mark.parametrize("blur", [1.5, 3.0, 6.0])
@pytest.mark.parametrize("width", [10.0, 23.0, 45.0])
def test_nothing_is_said_to_lie_against_a_clean_probe(
    width: float, blur: float, specks: int
) -> None:
    for seed in range(20):
        found = probe(tool_image(seed, width=width, blur=blur, specks=specks))
        assert not [each for each in found.doubts if "lies against" in each], seed


def test_a_jaw_whose_front_is_hidden_is_doubted() -> None:
    image = tool_image(6, gap=80.0, off_px=0.0)
    x, y = image.forward
    jaw = image.hold + 62.5 * np.array([-y, x])
    rows, columns = np.mgrid[:400, :480]
    ahead = (columns - jaw[0]) * x + (rows - jaw[1]) * y
    aside = -(columns - jaw[0]) * y + (rows - jaw[1]) * x
    hidden = image.image.copy()
    hidden[(np.abs(ahead) < 8.0) & (np.abs(aside) < 60.0)] = 45
    found = find_gripper(hidden, image.expected)
    assert isinstance(found, NotSeen) or any("front lies" in doubt for doubt in found.doubts)


def test_a_front_that_a_fibre_crosses_is_doubted() -> None:
    image = tool_image(7, noise=2.0, specks=0)
    x, y = image.forward
    rows, columns = np.mgrid[:400, :480]
    ahead = (columns - image.hold[0]) * x + (rows - image.hold[1]) * y
    aside = -(columns - image.hold[0]) * y + (rows - image.hold[1]) * x
    crossed = image.image.copy()
    crossed[(ahead > -1.0) & (ahead < 0.25 * (aside + 5.0)) & (np.abs(aside) < 60.0)] = 50
    found = find_probe(crossed, image.expected)
    assert isinstance(found, ToolEnd)
    assert any("askew" in doubt or "hidden" in doubt for doubt in found.doubts)


@pytest.mark.parametrize(
    "change",
    [
        {"width_px": 3.0},
        {"gap_px": -1.0},
        {"reach_px": 0.0},
        {"forward": (0.0, 0.0)},
        {"forward": (math.nan, 1.0)},
        {"tip_px": (math.inf, 0.0)},
    ],
)
def test_what_cannot_be_looked_for_is_refused(change: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="tool tips"):
        replace(tool_image(1).expected, **change)


# --- the twin ---------------------------------------------------------------------------------


def test_the_twin_s_tools_are_found_where_they_truly_are() -> None:
    bench = ImageBench(shipped_settings()).zoom(2.0).focus(60.0)
    lifted = {"left_z": -1440.0, "right_z": -1440.0, "left_gripper": 180.0, "right_gripper": 220.0}
    bench.go(left_x=3700.0, right_x=-3500.0, probe_y=-4600.0, probe_x=-100.0, **lifted)
    image = bench.optics.render(bench.now_s)
    tips = bench.scene.tips(bench.now_s)
    px_um = bench.optics.projection(bench.now_s).px_um

    def place(point: object) -> np.ndarray:
        return bench.px(*np.asarray(point, dtype=float))

    for side, forward in (("left", (1.0, 0.0)), ("right", (-1.0, 0.0))):
        inner = np.array([tips[f"{side}.jaw_{which}"] for which in "ab"])
        truth, gap = place(inner.mean(axis=0)), px_um * math.dist(*inner)
        expected = ExpectedTool(
            tuple((truth + np.array([14.0, -9.0])).tolist()), forward, 100.0 * px_um, gap
        )
        found = find_gripper(image, expected)
        assert isinstance(found, GripperTips)
        assert math.dist(found.hold_px, truth) < 0.5
        # The jaws are 150 um high: their upper edges are a little nearer to the camera.
        assert found.gap_px == pytest.approx(gap, abs=0.8)
    truth = place(tips["probe"])
    expected = ExpectedTool(
        tuple((truth - np.array([8.0, 12.0])).tolist()), (0.0, 1.0), 50.0 * px_um
    )
    tip = find_probe(image, expected)
    assert isinstance(tip, ToolEnd)
    # The probe is out of focus here.
    assert math.dist(tip.tip_px, truth) < 0.6
