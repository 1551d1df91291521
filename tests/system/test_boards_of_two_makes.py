"""Boards of two makes in one acquisition: a second driver beside the first."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import cosmic
from cosmic.app.cli import main

SECOND = """
[[daqco.driver]]
backend = "simulated"
options = { product = "T7", name = "T7_", boards = 1, clock_ppm = 400.0 }

[[daqco.channel]]
name = "strain"
board = "T7_1"
input = "ai2"

[[daqco.channel]]
name = "aux"
"""


@pytest.fixture
def platform(tmp_path: Path) -> Path:
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    path = folder / "platform.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('\n[[daqco.channel]]\nname = "aux"\n', SECOND), encoding="utf-8")
    return path


@pytest.fixture
def rig(platform: Path) -> Iterator[cosmic.Rig]:
    with cosmic.connect(platform, applications=("daqco",), rate=10.0) as opened:
        yield opened


def test_channels_of_both_makes_come_in_one_chunk(rig: cosmic.Rig) -> None:
    assert list(rig.daqco.latest()) == ["force", "spare", "strain", "aux"]
    assert {each.product for each in rig.daqco.boards()} == {"PCI-6229", "T7"}


def test_how_well_their_clocks_agree_is_reported_and_recorded(
    rig: cosmic.Rig, tmp_path: Path
) -> None:
    (told,) = [each for each in rig.daqco.clock_agreement if each.board == "T7_1"]
    assert told.drift_ppm == 100.0, "each may be off by clock_ppm"
    with rig.daqco.record(tmp_path / "run.h5"):
        rig.daqco.mark("here")
    with cosmic.open_recording(tmp_path / "run.h5") as recording:
        assert [each.text for each in recording.events if each.kind == "clocks"] == [told.text]


def test_two_boards_of_one_name_are_refused(platform: Path) -> None:
    text = platform.read_text(encoding="utf-8")
    platform.write_text(text.replace('name = "T7_"', 'name = "Dev"'), encoding="utf-8")
    with cosmic.connect(platform, applications=("daqco",)) as rig:
        assert "two boards are called Dev1" in rig.daqco.problem


def test_a_driver_that_is_not_there_is_named_by_the_check(
    platform: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = platform.read_text(encoding="utf-8")
    platform.write_text(text.replace('product = "T7"', 'product = "T9"'), encoding="utf-8")
    assert main(["check", str(platform)]) == 1
    assert "daqco" in (said := capsys.readouterr().err) and "T9" in said
