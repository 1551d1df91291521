"""Three axes of an MCS2 that carry a gripper of FiberStation over the other one, along a line.

The grippers face each other, and the left one goes from below to above the right one. Whether the
jaws kept clear is read from the twin's true path by an oracle that reads the scene a second time.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
import tomlkit

import cosmic
from cosmic.app.cli import main
from oracles.clearance import PlatformClearance

NAMES = ("left.x", "left.y", "left.z")
BESIDE_UM = -5400.0
"""Of `right.x`: its jaws stand where those of the left gripper go."""
ABOVE = {"left.x": 5000.0, "left.y": 300.0, "left.z": 3000.0}
JUST_ABOVE = {**ABOVE, "left.z": 1200.0}


def with_an_mcs2(folder: Path) -> Path:
    """Write the shipped platform with an MCS2 in place of the SCU of the left gripper's stages."""
    assert main(["init", str(folder)]) == 0
    twin_file, platform_file = folder / "twin.toml", folder / "platform.toml"
    twin = tomlkit.parse(twin_file.read_text("utf-8")).unwrap()
    (first, *others) = twin["devices"]
    assert tuple(first["channels"]) == NAMES
    twin["devices"] = [*others, {"make": "smaractctl", "channels": list(NAMES)}]
    twin_file.write_text(tomlkit.dumps(twin), "utf-8")
    platform = tomlkit.parse(platform_file.read_text("utf-8")).unwrap()
    mico, last = platform["mico"], len(others)
    mico["serials"] = [*mico["serials"][:last], "MCS2-00000415"]
    for each in mico["positioner"]:
        each["device"] = last if each["name"] in NAMES else each["device"] - 1
    platform_file.write_text(tomlkit.dumps(platform), "utf-8")
    return platform_file


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[cosmic.Rig]:
    with cosmic.connect(with_an_mcs2(tmp_path / "c"), applications=("mico",), rate=20.0) as opened:
        opened.mico["right.x"].move_to(BESIDE_UM)
        yield opened


def test_a_line_over_the_other_gripper_passes_where_the_box_is_refused(
    rig: cosmic.Rig, tmp_path: Path
) -> None:
    verdict = rig.mico.check(ABOVE)
    assert verdict.reason is cosmic.Reason.COLLISION
    assert "jaw" in str(verdict)
    with pytest.raises(cosmic.CollisionError):
        rig.mico.move(ABOVE)
    assert rig.mico.move(ABOVE, match_arrival=True) == pytest.approx(ABOVE, abs=1.0)

    scene = rig._platform.scene
    assert scene is not None
    now_s = scene.clock.now_s()
    stand = {name: stage.position(now_s) for name, stage in scene.stages.items()}
    paths = {name: scene.stages[name].path for name in NAMES}
    begin_s = min(path.times_s[0] for path in paths.values())
    end_s = max(path.end_s for path in paths.values())
    clearance = PlatformClearance(tmp_path / "c" / "scenes" / "fiberstation.toml")
    for number in range(101):
        at_s = begin_s + number * (end_s - begin_s) / 100
        gone = {name: path.at(at_s) for name, path in paths.items()}
        assert clearance.nearest(stand | gone).spare_um > 0.0, gone
        shares = [gone[name] / ABOVE[name] for name in NAMES]
        assert max(shares) - min(shares) < 0.02, "they keep to the line"


def test_a_line_that_comes_too_near_is_refused_though_its_ends_are_clear(rig: cosmic.Rig) -> None:
    with pytest.raises(cosmic.CollisionError, match="left_jaw_a would touch right_jaw_a"):
        rig.mico.move(JUST_ABOVE, match_arrival=True)
    for name in NAMES:
        assert rig.mico[name].position_um == pytest.approx(0.0, abs=1.0), "nothing moved"
    for name in reversed(NAMES):
        rig.mico[name].move_to(JUST_ABOVE[name])
    for name in NAMES:
        assert rig.mico[name].position_um == pytest.approx(JUST_ABOVE[name], abs=1.0)


def test_the_same_axes_of_an_scu_are_refused_for_their_box() -> None:
    with cosmic.connect(applications=("mico",), rate=20.0) as shipped:
        shipped.mico["right.x"].move_to(BESIDE_UM)
        with pytest.raises(cosmic.CollisionError, match="jaw"):
            shipped.mico.move(ABOVE, match_arrival=True)
