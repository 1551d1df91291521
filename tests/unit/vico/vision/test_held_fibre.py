"""A held fibre is measured from the jaws' front on."""

import cv2
import numpy as np
import pytest

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


def test_a_fibre_far_off_is_not_taken_for_the_held_one() -> None:
    image = jaws_and(arc((300.0, 60.0), 0.0, 260.0, 0.0))
    with pytest.raises(NotAvailable, match="between the jaws"):
        held_shape(find_fibres(image)[0], gripper_on(image))
