"""A held fibre is measured from the jaws' front on."""

from contextlib import suppress

import cv2
import numpy as np
import pytest
from benchmarks.twin_image import Set

from cosmic.frame.errors import NotAvailable
from cosmic.vico.api import find_fibres
from cosmic.vico.core.vision.held import HeldShape, held_shape
from cosmic.vico.core.vision.tips import find_gripper
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips
from unit.vico.vision.drawn_fibres import arc, drawn_image

FRONT_PX, MIDDLE_PX = 220.0, 240.0


def jaws_and(line: np.ndarray, width: float = 9.0, gap: float = 10.0) -> np.ndarray:
    """Return an image of a fibre between two jaws that reach in from the left."""
    image = drawn_image([line], [width], noise=0.0, blur_px=0.01).astype(np.float32)
    half = int(gap / 2)
    rows = (slice(int(MIDDLE_PX) - half - 50, int(MIDDLE_PX) - half),
            slice(int(MIDDLE_PX) + half, int(MIDDLE_PX) + half + 50))  # fmt: skip
    for each in rows:
        image[each, : int(FRONT_PX)] = 60.0
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    image += np.random.default_rng(1).normal(0.0, 2.0, image.shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def gripper_on(image: np.ndarray, gap: float = 10.0) -> GripperTips:
    found = find_gripper(
        image, ExpectedTool((FRONT_PX, MIDDLE_PX), (1.0, 0.0), 50.0, gap_px=gap, reach_px=30.0)
    )
    assert isinstance(found, GripperTips)
    return found


def held(line: np.ndarray) -> HeldShape:
    image = jaws_and(line)
    fibres = find_fibres(image)
    assert fibres
    return held_shape(fibres[0], gripper_on(image))


@pytest.mark.parametrize("turn", [-0.6, 0.0, 0.6])
def test_the_free_length_begins_at_the_jaws_front(turn: float) -> None:
    line = arc((160.0, MIDDLE_PX - 0.5), 0.0, 60.0 + 0.5, 0.0)
    free = arc((FRONT_PX - 0.5, MIDDLE_PX - 0.5), 0.0, 300.0, turn)
    shape = held(np.concatenate([line, free[1:]]))
    assert shape.length_px == pytest.approx(300.0, abs=1.5)
    assert shape.clamps[0].angle_deg == pytest.approx(0.0, abs=1.0)
    assert np.sign(round(shape.clamps[0].curvature_px, 3)) == np.sign(turn)


def test_the_slope_at_the_clamp_is_that_of_the_fibre() -> None:
    angle = 0.15
    back = np.array([FRONT_PX - 0.5, MIDDLE_PX - 0.5]) - 8.0 * np.array([1.0, 0.15])
    shape = held(arc((float(back[0]), float(back[1])), angle, 320.0, 0.0))
    assert shape.clamps[0].angle_deg == pytest.approx(np.degrees(angle), abs=0.6)


@pytest.mark.parametrize(("magnification", "part"), [(1.0, 0.003), (2.0, 0.002)])
def test_the_held_fibre_of_the_twin_is_free_from_the_jaws_on(
    magnification: float, part: float
) -> None:
    stage = Set()
    stage.look(magnification, 700.0)
    stage.now_s += 1.0
    image = np.asarray(stage.optics.render(stage.now_s))
    view, tips = stage.optics.projection(stage.now_s), stage.scene.tips(stage.now_s)
    at = {
        name: view.image_px(np.array([tips[f"left.{name}"]]))[0]
        for name in ("hold", "jaw_a", "jaw_b")
    }
    (true,) = (
        view.image_px(line)
        for line in stage.optics.centre_lines_um(stage.now_s)
        if line[0, 2] > 300.0
    )
    gap = float(abs(at["jaw_b"] - at["jaw_a"])[1])
    hold = (float(at["hold"][0]), float(at["hold"][1]))
    gripper = find_gripper(
        image, ExpectedTool(hold, (1.0, 0.0), 100.0 * view.px_um, gap_px=gap, reach_px=30.0)
    )
    assert isinstance(gripper, GripperTips)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(true, axis=0), axis=1))])
    free = way[-1] - np.interp(gripper.hold_px[0], true[:, 0], way)
    shapes = []
    for fibre in find_fibres(image):
        with suppress(NotAvailable):
            shapes.append(held_shape(fibre, gripper))
    assert [shape.length_px for shape in shapes] == pytest.approx([free], rel=part)
    slope = np.degrees(np.arctan2(*(true[-1] - true[-2])[::-1]))
    pointing = np.degrees(np.arctan2(*gripper.jaws[0].forward[::-1]))
    assert shapes[0].clamps[0].angle_deg == pytest.approx(slope - pointing, abs=0.5)


def test_a_fibre_far_off_is_not_taken_for_the_held_one() -> None:
    image = jaws_and(arc((300.0, 60.0), 0.0, 260.0, 0.0))
    with pytest.raises(NotAvailable, match="between the jaws"):
        held_shape(find_fibres(image)[0], gripper_on(image))
