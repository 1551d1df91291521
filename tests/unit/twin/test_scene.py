"""The scene and the file it is made from."""

import tomllib
from typing import Any

import pytest
from pydantic import ValidationError

from cosmic.frame.clock import ManualClock
from cosmic.frame.config import shipped_config_dir
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.scene import Scene, parse_layout
from cosmic.twin.settings import TwinSettings, shipped_settings


@pytest.fixture
def table() -> dict[str, Any]:
    """The shipped file as plain data."""
    return tomllib.loads((shipped_config_dir() / "twin.toml").read_text(encoding="utf-8"))


def test_the_default_platform_has_eleven_stages_on_four_devices() -> None:
    scene = Scene.from_settings(shipped_settings(), ManualClock())
    assert scene.wiring == (
        ("left.x", "left.y", "left.z"),
        ("right.x", "right.y", "right.z"),
        ("probe.x", "probe.y", "left.gripper"),
        ("table.rotation", "right.gripper", None),
    )
    assert len(scene.stages) == 11
    assert {name for device in scene.wiring for name in device if name} == set(scene.stages)


def test_a_warm_platform_is_referenced_and_stands_at_its_start() -> None:
    scene = Scene.from_settings(shipped_settings(), ManualClock())
    for name, place in shipped_settings().stages.items():
        assert scene.truth()[name] == place.start
        assert scene.at_power_up[name].known is scene.stages[name].kind.sensor


def test_a_cold_platform_stands_anywhere_and_knows_nothing() -> None:
    scenes = [
        Scene.from_settings(shipped_settings(), ManualClock(), seed, cold=True) for seed in range(9)
    ]
    for name, stage in scenes[0].stages.items():
        places = [scene.truth()[name] for scene in scenes]
        assert len(set(places)) == 9
        middle = (stage.kind.power_up_low + stage.kind.power_up_high) / 2
        for place in places:
            assert stage.kind.power_up_low <= place <= stage.kind.power_up_high
            assert place != pytest.approx(middle, abs=1.0)
        assert not any(scene.at_power_up[name].known for scene in scenes)


def test_one_seed_makes_one_scene() -> None:
    def truth(seed: int) -> dict[str, float]:
        return Scene.from_layout("LRN", shipped_settings(), ManualClock(), seed).truth()

    assert truth(3) == truth(3) != truth(4)


def test_a_layout_of_any_number_of_devices_makes_a_scene() -> None:
    scene = Scene.from_layout("LLL," * 16, shipped_settings(), ManualClock(), cold=False)
    assert len(scene.wiring) == 16 and len(scene.stages) == 48
    assert set(scene.truth().values()) == {0.0}
    assert parse_layout("LLL, RNN ,") == ("LLL", "RNN")


def test_a_library_over_a_scene_takes_its_wiring_and_clock() -> None:
    scene = Scene.from_layout("LLL,RNN", shipped_settings(), ManualClock())
    library = load_simulated_library(scene=scene)
    assert library.clock is scene.clock
    assert library.scene is scene


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("controller", "amplitude_dv"), 1001, "amplitude_dv"),
        (("controller", "surprise"), 1, "surprise"),
        (("kinds", "linear", "high"), -7000.0, "must rise"),
        (("kinds", "linear", "step_at_100v"), float("nan"), "step_at_100v"),
        (("kinds", "linear", "drift_per_min_low"), 1.0, "drift_per_min_low"),
        (("stages", "left.x", "start"), 6001.0, "outside its travel"),
        (("stages", "left.x", "kind"), "hexapod", "unknown kind"),
        (("devices", 0, "channels"), ["left.x", "left.x", ""], "wired twice"),
        (("devices", 0, "channels"), ["left.x", "nobody", ""], "not a stage"),
        (("devices", 0, "channels"), ["left.x"], "channels"),
    ],
)
def test_a_broken_file_is_refused_by_name(
    table: dict[str, Any], path: tuple[str | int, ...], value: object, words: str
) -> None:
    place: Any = table
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(ValidationError, match=words):
        TwinSettings.model_validate(table)


def test_every_constant_of_the_shipped_file_names_its_source() -> None:
    text = (shipped_config_dir() / "twin.toml").read_text(encoding="utf-8")
    controller = text.split("[controller]")[1].split("# ------")[0]
    lines = [line for line in controller.splitlines() if " = " in line]
    paired = {"packet_latency_high_s", "call_latency_high_s", "settle_high_s"}
    for line in lines:
        assert "[C]" in line or "[G]" in line or line.split(" = ")[0] in paired, line
