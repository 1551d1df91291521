"""What a file names and nothing has is told when the file is read, and never first by silence."""

import logging
from pathlib import Path

import pytest

import cosmic
from cosmic.app.cli import main
from cosmic.app.platform import build_platform
from cosmic.frame.errors import ConfigError, NotAvailable

FORCE = 'force_channel = "force"        # what'
PAIR = '["left.gripper", "right.gripper"],'
TABLE = 'table_axis = "table.rotation"  # turns'

IN_THE_PLATFORM_FILE = [
    (
        FORCE,
        'force_channel = "forse" # what',
        "mico.teleoperation.force_channel: ",
        "'forse'",
        "force, spare, aux",
    ),
    (PAIR, '["left.q", "right.q"],', "mirror.pairs[3]: ", "'left.q'", "left.x, left.y"),
    (TABLE, 'table_axis = "table.turn" #', "vico.table_axis: ", "'table.turn'", "table.rotation"),
    (TABLE, 'table_axis = "left.x" #', "vico.table_axis: ", "left.x is linear", ""),
    (
        'gap_axis = "right.gripper"',
        'gap_axis = "right.jaw"',
        "vico.tool[1]: right: ",
        "'right.jaw'",
        "left.x, ",
    ),
    ('channel = "force"\nlow', 'channel = "forse"\nlow', "limit: ", "'forse'", "force, spare, aux"),
    (
        'axes = ["probe.x", "probe.y"]',
        'axes = ["probe.q"]',
        "initialisation.step[1]: ",
        "'probe.q'",
        "left.x, ",
    ),
    (
        'input = "left_x", positioner = "left.x"',
        'input = "left_x", positioner = "left.q"',
        "profile 'left assembly'",
        "'left.q'",
        "left.x, ",
    ),
    (
        'positioners = ["left.x", ',
        'positioners = ["left.q", ',
        "group 'Left assembly'",
        "'left.q'",
        "left.x, ",
    ),
    (
        "[[mico.group]]",
        '[[mico.link]]\nfirst = "left.q"\nsecond = "left.x"\n[[mico.group]]',
        "link[0]: ",
        "'left.q'",
        "left.x, ",
    ),
]


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A copy of the shipped configuration."""
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    capsys.readouterr()
    return folder


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


def checked(folder: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    assert main(["check", str(folder)]) == 1
    return capsys.readouterr().err.splitlines()


@pytest.mark.parametrize(("old", "new", "key", "name", "known"), IN_THE_PLATFORM_FILE)
def test_check_and_start_name_file_key_name_and_what_there_is(
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    old: str,
    new: str,
    key: str,
    name: str,
    known: str,
) -> None:
    edit(folder / "platform.toml", old, new)
    with pytest.raises(ConfigError) as refused:
        build_platform(folder)
    for said in (checked(folder, capsys), str(refused.value).splitlines()):
        found = [line for line in said if key in line and name in line and known in line]
        assert found, said
        assert str(folder / "platform.toml") in found[0]


def test_what_another_station_has_is_not_missed_here(folder: Path) -> None:
    edit(folder / "platform.toml", TABLE, 'table_axis = "table.turn" #')
    edit(folder / "platform.toml", FORCE, 'force_channel = "forse" # what')
    for alone in ("mico", "vico", "daqco"):
        build_platform(folder, applications=(alone,)).shut_down()


def test_check_finds_poses_and_kept_profiles_of_axes_that_are_gone(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    poses, profiles = folder / "poses.toml", folder / "profiles.toml"
    poses.write_text('[home]\n"left.x" = 1.0\n"left.q" = 2.0\n', encoding="utf-8")
    profiles.write_text(
        '[[profile]]\nname = "mine"\n[[profile.axis]]\ninput = "x"\npositioner = "left.q"\n',
        encoding="utf-8",
    )
    said = checked(folder, capsys)
    assert len(said) == 2
    for line, file, key in ((said[0], poses, "home.left.q"), (said[1], profiles, "'mine'")):
        assert str(file) in line
        assert key in line
        assert "there is no positioner 'left.q'; there are left.x, left.y" in line


def test_poses_and_kept_profiles_of_axes_that_are_gone_are_reported_at_the_start(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (folder / "poses.toml").write_text('[home]\n"left.q" = 2.0\n', encoding="utf-8")
    (folder / "profiles.toml").write_text(
        '[[profile]]\nname = "mine"\n[[profile.axis]]\ninput = "x"\npositioner = "left.q"\n',
        encoding="utf-8",
    )
    with (
        caplog.at_level(logging.WARNING, "cosmic"),
        cosmic.connect(folder, applications=("mico",)) as rig,
    ):
        messages = "\n".join(record.getMessage() for record in caplog.records)
        for file, key in (("poses.toml", "home.left.q"), ("profiles.toml", "'mine'")):
            assert f"{folder / file}: " in messages
            assert key in messages
        assert "there is no positioner 'left.q'; there are left.x" in messages
        with pytest.raises(NotAvailable, match=r"pose home\.left\.q: there is no positioner"):
            rig.mico.poses.go("home")


RECIPE = """
procedure = "bend test"
[stop]
count = 1
[parameters]
gripper = "left"
other = "rihgt"
camera = "telescope"
[parameters.push]
channel = "forse"
"""
WANTED = (
    "parameters.other: there is no tool 'rihgt'; there are left, right, probe",
    "parameters.camera: there is no camera 'telescope'; there are microscope, overview",
    "parameters.push.channel: there is no channel 'forse'; there are force, spare, aux",
)


def test_check_finds_recipes_beside_it_that_the_platform_cannot_run(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe = folder / "recipes" / "mine.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    assert checked(folder, capsys) == [f"cosmic: {recipe}: {line}" for line in WANTED]


def test_a_recipe_is_refused_with_all_names_that_the_platform_has_not(tmp_path: Path) -> None:
    recipe = tmp_path / "mine.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    with cosmic.connect() as rig:
        with pytest.raises(ConfigError) as refused:
            rig.campaign(recipe, tmp_path / "out")
        assert str(refused.value).splitlines() == [f"{recipe}: {line}" for line in WANTED]
    assert not (tmp_path / "out").exists()
