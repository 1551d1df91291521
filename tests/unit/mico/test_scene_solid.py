"""Solids that overlap are told from those that do not, whatever their shape and place."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cosmic.mico.core.collision.model import Floats
from cosmic.mico.core.collision.scene_solid import (
    close_pairs,
    overlapping_pairs,
    solid_gap_um,
    solids_overlap,
)
from unit.mico.small_scenes import two_arms


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Floats:
    grid = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), dtype=float)
    return grid.reshape(3, -1).T


UNIT = box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def aside(distance_um: float) -> Floats:
    """The unit box, shifted along x."""
    return np.add(UNIT, (distance_um, 0.0, 0.0))


@pytest.mark.parametrize("gap_um", [0.001, 1.0, 1000.0])
def test_boxes_apart_along_an_axis_have_their_distance_as_gap(gap_um: float) -> None:
    other = aside(1.0 + gap_um)
    assert solid_gap_um(UNIT, other) == pytest.approx(gap_um, rel=1e-6)
    assert not solids_overlap(UNIT, other)


def test_boxes_that_touch_overlap() -> None:
    assert solids_overlap(UNIT, aside(1.0))


def test_a_body_inside_another_overlaps_it() -> None:
    assert solids_overlap(box((-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)), UNIT)
    assert solids_overlap(UNIT, box((-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)))


def test_crossed_bars_overlap_although_no_corner_is_inside() -> None:
    one = box((-10.0, -1.0, -1.0), (10.0, 1.0, 1.0))
    other = box((-1.0, -10.0, -1.0), (1.0, 10.0, 1.0))
    assert solids_overlap(one, other)


def test_bodies_whose_boxes_overlap_can_be_apart() -> None:
    turn = Rotation.from_euler("z", 45.0, degrees=True)
    plate = turn.apply(box((-50.0, -0.5, -50.0), (50.0, 0.5, 50.0)))
    block = box((5.0, -15.0, -1.0), (15.0, -5.0, 1.0))
    distance_um = 10.0 / np.sqrt(2.0) - 0.5
    assert not solids_overlap(plate, block)
    assert 0.57 * distance_um <= solid_gap_um(plate, block) <= distance_um + 1e-9


def test_random_boxes_agree_with_the_separating_axes(seed: int = 5) -> None:
    """15 axes decide for two boxes: three of each, and the nine crosses of their edges."""
    random = np.random.default_rng(seed)
    decided = {True: 0, False: 0}
    for _ in range(300):
        sizes = 10.0 ** random.uniform(1.0, 4.0, size=(2, 3))
        turns = [Rotation.from_quat(random.normal(size=4)) for _ in range(2)]
        shift = random.normal(size=3) * 1500.0
        boxes = [
            turn.apply(box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)) * size)
            for turn, size in zip(turns, sizes, strict=True)
        ]
        boxes[1] = boxes[1] + shift
        axes = [*turns[0].as_matrix().T, *turns[1].as_matrix().T]
        axes += [np.cross(a, b) for a in axes[:3] for b in axes[3:]]
        gaps = []
        for axis in axes:
            one, other = (each @ (axis / np.linalg.norm(axis)) for each in boxes)
            gaps.append(max(other.min() - one.max(), one.min() - other.max()))
        if abs(max(gaps)) < 0.01:
            continue
        overlap = bool(max(gaps) < 0.0)
        decided[overlap] += 1
        assert solids_overlap(*boxes) is overlap
        if not overlap:
            assert solid_gap_um(*boxes) > 0.0
    assert min(decided.values()) > 30


def test_pairs_of_a_scene_that_overlap_are_named() -> None:
    scene = two_arms()
    assert overlapping_pairs(scene, {}) == []
    assert overlapping_pairs(scene, {"left.x": 2500.0}) == [("left_z", "right_z")]
    assert overlapping_pairs(scene, {"left.z": -1020.0}) == [("base", "left_z")]


def test_pairs_of_a_scene_that_come_close_are_named_with_a_gap() -> None:
    scene = two_arms()
    (found,) = close_pairs(scene, {"left.x": 1900.0}, within_um=150.0)
    assert found == (("left_z", "right_z"), pytest.approx(100.0))
