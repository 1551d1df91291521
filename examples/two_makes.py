"""One platform with controllers of two makes: SCUs and an MCS2, moved together.

The shipped platform is copied out, and its last two SCUs are replaced by one MCS2 with six
channels: probe and grippers, and the table.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import tomlkit

import cosmic
from cosmic.frame.config import shipped_config_dir

MCS2 = ["probe.x", "probe.y", "left.gripper", "table.rotation", "right.gripper", ""]


def write_platform(folder: Path) -> Path:
    """Write the files of the platform into `folder` and return the platform file."""
    for each in shipped_config_dir().rglob("*"):
        if each.is_file():
            copy = folder / each.relative_to(shipped_config_dir())
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(each.read_bytes())
    twin_file, platform_file = folder / "twin.toml", folder / "platform.toml"
    twin = tomlkit.parse(twin_file.read_text("utf-8")).unwrap()
    twin["devices"] = [*twin["devices"][:2], {"make": "smaractctl", "channels": MCS2}]
    twin_file.write_text(tomlkit.dumps(twin), "utf-8")
    platform = tomlkit.parse(platform_file.read_text("utf-8")).unwrap()
    mico = platform["mico"]
    mico["serials"] = [*mico["serials"][:2], "MCS2-00000414"]
    for positioner in mico["positioner"]:
        if positioner["name"] in MCS2:
            positioner |= {"device": 2, "channel": MCS2.index(positioner["name"])}
    platform_file.write_text(tomlkit.dumps(platform), "utf-8")
    return platform_file


def main() -> dict[str, float]:
    """Move an axis of each make in one synchronous move and return where they are."""
    with TemporaryDirectory() as folder:
        platform = write_platform(Path(folder))
        with cosmic.connect(platform, applications=("mico",), rate=20.0) as rig:
            left, probe = rig.mico["left.x"], rig.mico["probe.x"]
            targets = {
                "left.x": left.position_um - 40.0,
                "probe.x": probe.position_um - 40.0,
            }
            assert rig.mico.check(targets).allowed
            return dict(rig.mico.move(targets, match_arrival=True))


if __name__ == "__main__":
    for name, position_um in main().items():
        print(f"{name} stands at {position_um:.1f} um")
