"""The twin and the collision gate read one URDF with code of their own; they must agree."""

import random

import numpy as np
import pytest

from cosmic.frame.clock import ManualClock
from cosmic.frame.config import shipped_config_dir
from cosmic.mico.core.collision.kinematics import body_poses
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings

NANOMETRE = 1e-3
TIPS = {
    "probe": "probe_tip",
    "left.jaw_a": "left_jaw_a",
    "left.jaw_b": "left_jaw_b",
    "right.jaw_a": "right_jaw_a",
    "right.jaw_b": "right_jaw_b",
}


@pytest.fixture(scope="module")
def model() -> SceneModel:
    return load_scene(shipped_config_dir() / "scenes" / "fiberstation.toml")


def places(model: SceneModel, count: int) -> list[dict[str, float]]:
    chance = random.Random(20)
    spans = {axis: model.travel(axis) for axis in model.axes}
    return [{axis: chance.uniform(*span) for axis, span in spans.items()} for _ in range(count)]


def scene_at(place: dict[str, float]) -> Scene:
    shipped = shipped_settings()
    stages = {
        name: each.model_copy(update={"start": place[name]})
        for name, each in shipped.stages.items()
    }
    return Scene.from_settings(shipped.model_copy(update={"stages": stages}), ManualClock())


def test_tips_of_jaws_and_probe_are_where_the_gate_has_them(model: SceneModel) -> None:
    for place in places(model, 50):
        force_side = scene_at(place).force_side
        assert force_side is not None
        poses = body_poses(model, model.joint_values(place))
        tips = force_side.tips(0.0)
        for tip, body in TIPS.items():
            gate = poses[model.body_number[body]][:3, 3]
            assert tips[tip] == pytest.approx(gate, abs=NANOMETRE), (tip, place)


def test_every_body_stands_and_points_as_the_gate_has_it(model: SceneModel) -> None:
    force_side = scene_at(places(model, 1)[0]).force_side
    assert force_side is not None
    for place in places(model, 50):
        poses = body_poses(model, model.joint_values(place))
        for body, number in model.body_number.items():
            if number == 0:
                continue
            twin = force_side.skeleton.pose(body, place)
            assert twin[:3, 3] == pytest.approx(poses[number][:3, 3], abs=NANOMETRE), body
            assert np.allclose(twin[:3, :3], poses[number][:3, :3], atol=1e-12), body
