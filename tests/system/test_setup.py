"""`cosmic setup` finds axes that nobody configured, moves them with consent, and writes entries."""

import io
import shutil
from pathlib import Path

import pytest

import cosmic
from cosmic.app.cli import main
from cosmic.frame.config import shipped_config_dir

PLATFORM = """\
# Our platform; this comment is ours.
[platform]
name = "New"
applications = ["mico"]
scene = "scene.toml"

[mico]
backend = "simulated"   # four SCUs

[[mico.positioner]]
name = "left.x"         # the only one that somebody wrote down
device = 0
channel = 0
kind = "linear"
limits_um = [-5500.0, 5500.0]
"""
SCENE = """\
# Our scene.
urdf = "scene.urdf"
srdf = "scene.srdf"
margin_um = 20.0

[[drive]]
axis = "left.x"
joint = "x"
overshoot_um = 2.0      # measured
"""
URDF = """\
<robot name="ours">
  <!-- our bodies -->
  <link name="base"><collision><geometry><box size="0.02 0.02 0.004"/></geometry></collision></link>
  <link name="tip"><collision><geometry><box size="0.01 0.01 0.004"/></geometry></collision></link>
  <joint name="x" type="prismatic">
    <parent link="base"/><child link="tip"/><origin xyz="0 0 0.01"/><axis xyz="1 0 0"/>
    <limit lower="-0.006" upper="0.006" effort="1" velocity="1"/>
  </joint>
</robot>
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(shipped_config_dir(), tmp_path, dirs_exist_ok=True)
    for name, text in (
        ("platform.toml", PLATFORM),
        ("scene.toml", SCENE),
        ("scene.urdf", URDF),
        ("scene.srdf", '<robot name="ours"/>\n'),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_what_is_found_is_shown_and_nothing_is_written_unasked(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["setup", "--config", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "device 0 channel 1: linear, position" in said
    assert "device 3 channel 0: rotary" in said
    assert 'name = "device0.channel1"' in said
    assert "No sensor answers at device 2 channel 2, device 3 channel 1" in said
    assert 'device = 2\nchannel = 2\nkind = "open-loop"' in said
    assert (folder / "platform.toml").read_text(encoding="utf-8") == PLATFORM


def test_an_axis_moves_only_where_the_operator_agrees(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("y\nn\n"))
    assert main(["setup", "--config", str(folder), "--move"]) == 0
    said = capsys.readouterr().out
    assert said.count("Move it by 10 um there and back?") >= 2
    assert said.count("  moved\n") == 1


def test_entries_are_written_and_comments_kept(folder: Path) -> None:
    assert main(["setup", "--config", str(folder), "--write"]) == 0
    written = (folder / "platform.toml").read_text(encoding="utf-8")
    for comment in ("this comment is ours", "# four SCUs", "only one that somebody wrote down"):
        assert comment in written
    assert "overshoot_um = 2.0      # measured" in (folder / "scene.toml").read_text("utf-8")
    assert "<!-- our bodies -->" in (folder / "scene.urdf").read_text(encoding="utf-8")
    assert main(["check", str(folder)]) == 0
    with cosmic.connect(folder, applications=("mico",), rate=20) as rig:
        assert len(rig.mico.names) == 9
        axis = rig.mico["device0.channel1"]
        here = axis.position_um
        assert axis.move_by(5.0) == pytest.approx(here + 5.0, abs=1.0)
        with pytest.raises(cosmic.LimitError):
            axis.move_by(500.0)
    assert main(["setup", "--config", str(folder)]) == 0


LINE = """\
[platform]
name = "New"
applications = ["mico"]
"""


LEFT_X = (
    'name = "left.x"',
    "device = 0",
    "channel = 0",
    'kind = "linear"',
    "limits_um = [-55.0, 55.0]",
)


@pytest.mark.parametrize(
    "mico",
    [
        'mico = { backend = "simulated", positioner = [] }\n',
        '[mico]\nbackend = "simulated"\npositioner = []\n',
        f'[mico]\nbackend = "simulated"\npositioner = [{{ {", ".join(LEFT_X)} }}]\n',
        '[mico]\nbackend = "simulated"\n[vico]\n[[mico.positioner]]\n' + "\n".join(LEFT_X),
    ],
)
def test_a_platform_file_is_added_to_however_it_is_written(folder: Path, mico: str) -> None:
    text = mico + LINE if mico.startswith("mico =") else LINE + mico
    (folder / "platform.toml").write_text(text, encoding="utf-8")
    (folder / ".#platform.toml").symlink_to("operator@here.1234")
    assert main(["setup", "--config", str(folder), "--write"]) == 0
    with cosmic.connect(folder, applications=("mico",), rate=20) as rig:
        assert len(rig.mico.names) == 9
    assert main(["setup", "--config", str(folder)]) == 0


def test_the_drives_of_a_scene_may_be_written_in_a_line(folder: Path) -> None:
    line = 'urdf = "scene.urdf"\nsrdf = "scene.srdf"\nmargin_um = 20.0\n'
    drive = 'drive = [{ axis = "left.x", joint = "x", overshoot_um = 2.0 }]\n'
    (folder / "scene.toml").write_text(line + drive, encoding="utf-8")
    assert main(["setup", "--config", str(folder), "--write"]) == 0
    assert main(["check", str(folder)]) == 0
    assert "overshoot_um = 2.0" in (folder / "scene.toml").read_text(encoding="utf-8")


def test_the_configuration_that_ships_is_not_changed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["setup", "--write"]) == 1
    assert "cosmic init" in capsys.readouterr().err
