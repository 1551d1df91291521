"""Strict configuration whose every error names file, key and reason."""

import tomllib
from pathlib import Path

import pytest
from pydantic import Field, ValidationError, field_validator

from cosmic.frame.config import (
    StrictModel,
    load_model,
    read_toml,
    shipped_config_dir,
    without_tokens,
)
from cosmic.frame.errors import ConfigError


class Axis(StrictModel):
    name: str
    speed_um_s: float = Field(gt=0)

    @field_validator("name")
    @classmethod
    def _plain(cls, name: str) -> str:
        if " " in name:
            raise ValueError("a name has no spaces")
        return name


class Platform(StrictModel):
    title: str
    channels: int = 3
    axis: list[Axis] = Field(default_factory=list)


GOOD = """
title = "rig"
[[axis]]
name = "left.x"
speed_um_s = 100
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "platform.toml"


def test_a_good_file_becomes_a_frozen_model(file: Path) -> None:
    file.write_text(GOOD, encoding="utf-8")
    platform = load_model(file, Platform)
    assert (platform.title, platform.channels, platform.axis[0].speed_um_s) == ("rig", 3, 100.0)
    with pytest.raises(ValidationError):
        platform.title = "another"


def test_all_errors_are_reported_at_once_with_file_key_and_reason(file: Path) -> None:
    file.write_text(
        'titel = "rig"\nchannels = "3"\n[[axis]]\nname = "left x"\nspeed_um_s = nan\n'
        '[[axis]]\nspeed_um_s = 0.0\nname = "b"\n',
        encoding="utf-8",
    )
    with pytest.raises(ConfigError) as caught:
        load_model(file, Platform)
    lines = sorted(str(caught.value).splitlines())
    assert all(line.startswith(f"{file}: ") for line in lines)
    reasons = [line.removeprefix(f"{file}: ") for line in lines]
    assert reasons[0] == "axis[0].name: a name has no spaces"
    assert reasons[1].startswith("axis[0].speed_um_s: Input should be a finite number")
    assert reasons[2].startswith("axis[1].speed_um_s: Input should be greater than 0")
    assert reasons[3].startswith("channels: Input should be a valid integer")
    assert reasons[4] == "titel: unknown key; is it misspelt?"
    assert reasons[5] == "title: key is missing"
    assert len(reasons) == 6


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"title = \n", r"not valid TOML: .*line 1"),
        (b'title = "a"\ntitle = "b"\n', r"not valid TOML: .*line 2"),
        (b'# \xb5m\ntitle = "rig"\n', r"not UTF-8 text \(.*at byte 2\)"),
    ],
)
def test_what_is_not_toml_is_refused_with_file_and_place(
    file: Path, content: bytes, reason: str
) -> None:
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=reason) as caught:
        read_toml(file)
    assert str(caught.value).startswith(f"{file}: ")


def test_a_missing_file_is_said_to_be_missing(file: Path) -> None:
    with pytest.raises(ConfigError, match="there is no such file"):
        load_model(file, Platform)


def test_a_folder_in_place_of_a_file_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_toml(tmp_path)


def test_the_shipped_configuration_is_there_and_is_toml() -> None:
    files = sorted(shipped_config_dir().glob("*.toml"))
    assert files
    assert all(read_toml(each) for each in files)


@pytest.mark.parametrize(
    "token",
    ['"s3cret word"', "'s3cret word'", '"""\ns3cret\nword"""', '"s3cret \\" word"', "'''s3cret'''"],
)
def test_a_token_is_not_kept_and_all_else_is(token: str) -> None:
    for text in (
        f'# of the lab\n[[client]]\nname = "desk"\ntoken={token}  # new in May\naccess = "move"\n',
        f'client = [{{name = "desk", token = {token}, access = "move"}}]\n',
        f'[[client]]\n"token"  = {token}\nname = "desk"\naccess = "move"\n',
    ):
        kept = without_tokens(text)
        assert "s3cret" not in kept
        assert kept == text.replace(token, '""')
        assert tomllib.loads(kept)["client"] == [{"name": "desk", "token": "", "access": "move"}]
