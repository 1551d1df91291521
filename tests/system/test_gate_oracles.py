"""The collision gate against independent oracles, shortly; benchmarks/collision_oracles.py is long.

The oracles compute distances, poses and swept volumes with code of their own.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.mico.core.collision.sweep import Sweep
from oracles import convex, poses, retreats, trials
from oracles.scenes import Builder, X, Y, Z, blobs


@pytest.fixture(scope="module")
def platform(repository) -> SceneModel:
    scene = load_scene(repository / "config" / "scenes" / "fiberstation.toml")
    return poses.without_overshoot(scene)


def two_blocks(size: float, travel: float, margin_um: float = 5.0) -> SceneModel:
    build = Builder()
    build.box("base", (0.0, 0.0, 0.0), (size, size, size))
    build.body("block", "base", X, axis="block.x", travel=(-travel, travel))
    build.box("block", (-size, 0.0, 0.0), (0.0, size, size))
    return build.model([("base", "block")], margin_um)


def going(start: float, end: float) -> dict[str, AxisSpan]:
    return {"block.x": AxisSpan(min(start, end), max(start, end), start, moving=True)}


def test_no_jaw_tunnels_through_a_fibre_or_sheet_and_none_is_refused_without_need() -> None:
    found = trials.jaw_trial(seed=11, count=300)
    assert found["collides"] > 80
    assert found["free"] > 100
    assert found["tunnelled"] == 0
    assert found["refused though free"] <= 4


@pytest.mark.parametrize(("turning", "count"), [(0.0, 50), (0.3, 5), (1.0, 6)])
def test_no_pose_in_a_clear_joint_box_is_closer_than_the_margin(turning, count) -> None:
    axes = (1, 4) if turning else (2, 8)
    found = trials.box_trial(12, count, turning=turning, samples=60, axes=axes)
    assert found["clear"] > 0
    assert found["unsound"] == 0
    assert found["too careful"] == 0


@pytest.mark.parametrize("turning", [0.4, 1.0])
def test_boxes_as_wide_as_they_may_be_hold_no_pose_closer_than_the_margin(turning) -> None:
    found = trials.widest_trial(18, 12, turning=turning, samples=50)
    assert found["boxes"] > 2
    assert found["unsound"] == 0


@pytest.mark.parametrize("turning", [0.0, 0.4])
def test_what_begins_inside_the_margin_never_comes_closer(turning) -> None:
    found = trials.retreat_trial(13, 50, turning=turning)
    assert found["allowed"] > 0
    assert found["closer"] == 0


@pytest.mark.parametrize(("turning", "count"), [(False, 6), (True, 4)])
def test_what_is_inside_its_margin_can_always_retreat_and_never_come_closer(turning, count) -> None:
    found = retreats.trial(31, count, turning=turning)
    _check_retreats(found)


@pytest.mark.slow
@pytest.mark.parametrize("turning", [False, True])
def test_hundreds_of_bodies_inside_their_margins_retreat(turning) -> None:
    found = retreats.trial(32, 60, turning=turning)
    assert found["several inside"] > 10
    _check_retreats(found)


def _check_retreats(found) -> None:
    assert found["retreat"] > 10
    assert found["harmful"] > 40
    assert found["retreat refused"] == 0
    assert found["harmful and allowed"] == found["turns harmful and allowed"] == 0
    assert found["turns retreat refused"] == 0


def test_what_overlaps_two_pieces_leaves_outwards_and_not_through_their_seam() -> None:
    build = Builder()
    build.box("base", (-1000.0, -1000.0, -1000.0), (3.0, 1000.0, 0.0))
    build.box("base", (3.0, -1000.0, -1000.0), (1000.0, 1000.0, 0.0))
    build.body("slide", "base", X, axis="x")
    build.body("tip", "slide", Z, axis="z")
    build.box("tip", (-20.0, -20.0, -10.0), (0.0, 20.0, 500.0))
    sweep = Sweep(build.model([("base", "tip")]))

    def clear(axis: str, way: float) -> bool:
        spans = {"x": AxisSpan(0.0, 0.0, 0.0), "z": AxisSpan(0.0, 0.0, 0.0)}
        spans[axis] = AxisSpan(min(0.0, way), max(0.0, way), 0.0, moving=True)
        return sweep.check(spans).clear

    assert clear("z", 2.0)
    assert clear("z", 700.0)
    assert not any(clear("x", way) for way in (-2.0, 2.0, 900.0, -900.0))
    assert not clear("z", -2.0)


def test_a_probe_that_cannot_be_lifted_leaves_a_thin_body_the_way_it_can_move() -> None:
    build = Builder()
    build.box("base", (-500.0, -500.0, 0.0), (500.0, 500.0, 20.0))
    build.body("probe", "base", Y, axis="y")
    build.box("probe", (-20.0, 400.0, -50.0), (20.0, 2000.0, 50.0))
    sweep = Sweep(build.model([("base", "probe")]))
    assert sweep.check({"y": AxisSpan(0.0, 5.0, 0.0, moving=True)}).clear
    assert not sweep.check({"y": AxisSpan(-5.0, 0.0, 0.0, moving=True)}).clear


def test_two_arms_replayed_with_any_speeds_and_delays_keep_their_margin(platform) -> None:
    found = trials.two_arm_trial(platform, 14, 30, replays=2)
    assert found["replays that pass near"] > 0
    assert found["replays that collide"] == 0


def test_plain_conservative_advancement_comes_to_the_same_verdicts(platform) -> None:
    found = trials.advancement_trial(platform, 15, 40)
    assert found["clear though not free"] == 0
    assert found["refused though free"] == 0


def test_a_pair_whose_start_nobody_knows_does_not_count_as_retreating() -> None:
    # A ball that passes beside another: halfway they are closest, and the way is a tangent.
    rng = np.random.default_rng(16)
    points = rng.normal(size=(60, 3))
    points *= 500.0 / np.linalg.norm(points, axis=1, keepdims=True)
    build = Builder()
    build.piece("base", np.vstack((points, [[0.0, 0.0, 500.0]])))
    build.body("ball", "base", X, axis="block.x")
    top = np.vstack((points, [[0.0, 0.0, -500.0]])) + np.array((0.0, 0.0, 1003.0))
    build.piece("ball", top)
    sweep = Sweep(build.model([("ball", "base")]))
    assert not sweep.check({"block.x": AxisSpan(-2000.0, 2000.0, None, moving=True)}).clear


def test_where_an_axis_stands_belongs_to_what_is_looked_at() -> None:
    sweep = Sweep(two_blocks(1000.0, 6000.0))
    # From beyond the other block to this side of it.
    outside = AxisSpan(-2000.0, -1000.0, 2500.0, moving=True)
    assert not sweep.check({"block.x": outside}).clear


def test_half_an_endless_turn_is_a_whole_one() -> None:
    build = Builder()
    build.box("base", (-900.0, -50.0, 0.0), (-500.0, 50.0, 100.0))
    build.body("bar", "base", Z, axis="bar", turns=True, travel=(-math.inf, math.inf))
    build.box("bar", (500.0, -50.0, 0.0), (900.0, 50.0, 100.0))
    sweep = Sweep(build.model([("bar", "base")]))
    assert sweep.check({"bar": AxisSpan(0.0, 100.0, 0.0, moving=True)}).clear
    assert not sweep.check({"bar": AxisSpan(100.0, math.inf, 100.0, moving=True)}).clear


def test_a_turn_away_from_contact_is_allowed_and_one_towards_it_is_not() -> None:
    build = Builder()
    build.box("base", (200.0, 53.0, 0.0), (1000.0, 200.0, 100.0))
    build.body("bar", "base", Z, axis="bar", turns=True, travel=(-math.pi, math.pi))
    build.box("bar", (100.0, -50.0, 0.0), (1000.0, 50.0, 100.0))
    sweep = Sweep(build.model([("bar", "base")]))
    assert sweep.check({"bar": AxisSpan(-20.0, 0.0, 0.0, moving=True)}).clear
    assert not sweep.check({"bar": AxisSpan(0.0, 1.0, 0.0, moving=True)}).clear


def test_a_piece_wholly_inside_another_may_not_move_on() -> None:
    build = Builder()
    build.box("base", (-5000.0, -5000.0, -5000.0), (5000.0, 5000.0, 5000.0))
    build.body("block", "base", X, axis="block.x", travel=(-20e3, 20e3))
    build.box("block", (-5.0, -5.0, -5.0), (5.0, 5.0, 5.0))
    answer = Sweep(build.model([("base", "block")])).check(going(-8000.0, 8000.0))
    assert not answer.clear
    inside = {"block.x": AxisSpan(-50.0, 50.0, None, moving=True)}
    assert not Sweep(build.model([("base", "block")])).check(inside).clear


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_bodies_of_a_micrometre_and_of_a_metre_are_checked_alike(size) -> None:
    sweep = Sweep(two_blocks(size, 3.0 * size + 20.0))
    assert sweep.check(going(-2.0 * size - 10.0, -5.0 - 1e-4)).clear
    assert not sweep.check(going(-2.0 * size - 10.0, -5.0 + 1e-4)).clear
    assert not sweep.check(going(-2.0 * size - 10.0, 2.0 * size + 10.0)).clear


def test_faces_that_lie_flat_on_each_other_slide_at_the_margin() -> None:
    build = Builder()
    build.box("base", (-3000.0, -3000.0, -10.0), (3000.0, 3000.0, 0.0))
    build.body("sheet", "base", X, axis="block.x")
    build.box("sheet", (-3000.0, -3000.0, 5.001), (3000.0, 3000.0, 15.0))
    model = build.model([("base", "sheet")])
    assert Sweep(model).check(going(-4000.0, 4000.0)).clear
    tighter = replace(model, pairs=tuple(replace(p, margin_um=5.002) for p in model.pairs))
    assert not Sweep(tighter).check({"block.x": AxisSpan(-1e3, 1e3, None, moving=True)}).clear


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_position_that_is_no_number_is_never_clear(bad) -> None:
    sweep = Sweep(two_blocks(100.0, 6000.0))
    assert not sweep.check({"block.x": AxisSpan(-200.0, -150.0, bad, moving=True)}).clear
    assert not sweep.check({"block.x": AxisSpan(bad, bad, None, moving=True)}).clear
    with pytest.raises(ValueError, match="finite"):
        sweep.nearest({"block.x": bad})


def test_a_scene_without_pieces_or_pairs_is_clear_and_has_nothing_nearest() -> None:
    for model in (
        replace(two_blocks(100.0, 6000.0), pieces=()),
        replace(two_blocks(100.0, 6000.0), pairs=()),
    ):
        assert Sweep(model).check(going(0.0, 100.0)).clear
        assert Sweep(model).nearest({}) is None


def test_pieces_of_four_vertices_are_checked_by_their_exact_distance() -> None:
    build = Builder()
    build.piece("base", np.array([[0, 0, 0], [1000, 0, 0], [0, 1000, 0], [0, 0, 1000]]))
    build.body("tip", "base", X, axis="block.x")
    build.piece("tip", np.array([[0, 0, 0], [900, 100, 0], [900, -100, 0], [900, 0, 100]]))
    model = build.model([("base", "tip")], margin_um=20.0)
    one, other = (piece.vertices_um for piece in model.pieces)
    for end in (1010.0, 1019.9, 1020.1, 1500.0):
        far = other + np.array((2500.0, 0.0, 0.0))
        way = np.array([[end - 2500.0], [0.0], [0.0]])
        least = convex.distance(one, convex.swept(far, way, np.zeros(1), np.ones(1)))
        assert Sweep(model).check(going(2500.0, end)).clear == (least > 20.0)


def test_hulls_of_bumpy_meshes_are_checked_as_their_exact_distance_says() -> None:
    model = blobs(two_blocks(1000.0, 6000.0))
    one, other = (piece.vertices_um for piece in model.pieces)
    rng = np.random.default_rng(17)
    for end in rng.uniform(-30.0, 300.0, 12).tolist():
        ways = np.array([[end + 3000.0], [0.0], [0.0]])
        far = other + np.array((-3000.0, 0.0, 0.0))
        least = convex.distance(one, convex.swept(far, ways, np.zeros(1), np.ones(1)))
        assert Sweep(model).check(going(-3000.0, end)).clear == (least > 5.0)
