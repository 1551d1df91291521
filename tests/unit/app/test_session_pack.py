"""A session in one file: everything is in it as it was, and described."""

import hashlib
import json
import os
import zipfile
from pathlib import Path

import h5py
import pytest

from cosmic.app.cli import main
from cosmic.app.session_pack import METADATA, pack_session
from cosmic.frame.errors import RecordingError, RecordingExistsError


@pytest.fixture
def session(tmp_path: Path) -> Path:
    folder = tmp_path / "campaign"
    (folder / "fibres").mkdir(parents=True)
    (folder / "fibres" / "0001.h5").write_bytes(b"\x89HDF" + bytes(1000))
    (folder / "report.html").write_text("<p>good</p>")
    (tmp_path / "platform.toml").write_text("[platform]\n")
    return tmp_path


def test_everything_is_in_it_and_described(session: Path) -> None:
    target = session / "monday.zip"
    packed = pack_session([session / "campaign", session / "platform.toml"], target)
    assert packed.files == 3
    with zipfile.ZipFile(target) as file:
        assert file.testzip() is None
        described = json.loads(file.read(METADATA))
        known = {each["@id"]: each for each in described["@graph"]}
        parts = {each["@id"] for each in known["./"]["hasPart"]}
        assert parts == set(file.namelist()) - {METADATA}
        for name in parts:
            content = file.read(name)
            assert known[name]["sha256"] == hashlib.sha256(content).hexdigest()
            assert int(known[name]["contentSize"]) == len(content)
    assert known["campaign/fibres/0001.h5"]["encodingFormat"] == "application/x-hdf5"
    assert known[METADATA]["conformsTo"]["@id"].startswith("https://w3id.org/ro/crate/1.1")
    assert known["./"]["name"] == "monday"


def test_what_cannot_be_packed_is_said_and_nothing_is_left(session: Path) -> None:
    target = session / "x.zip"
    with pytest.raises(RecordingError, match="no such"):
        pack_session([session / "none"], target)
    twice = session / "other" / "platform.toml"
    twice.parent.mkdir()
    twice.write_text("")
    with pytest.raises(RecordingError, match="as well"):
        pack_session([session / "platform.toml", twice], target)
    assert not target.exists()
    target.write_text("mine")
    with pytest.raises(RecordingExistsError):
        pack_session([session / "campaign"], target)
    assert target.read_text() == "mine"


def test_recordings_that_were_not_closed_are_named(
    session: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = session / "campaign" / "fibres" / "0002.h5"
    with h5py.File(path, "w", libver="latest") as file:
        file["data"] = list(range(5000))
    os.truncate(path, path.stat().st_size - 100)
    target = session / "tuesday.zip"
    assert main(["session", "pack", str(session / "campaign"), "--output", str(target)]) == 0
    said = capsys.readouterr().err
    assert f"cosmic repair {path}" in said
    assert "0001.h5" not in said
    with zipfile.ZipFile(target) as file:
        described = json.loads(file.read(METADATA))
    known = {each["@id"]: each for each in described["@graph"]}
    assert "cut off" in known["campaign/fibres/0002.h5"]["description"]


def test_the_command_packs(session: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["session", "pack", str(session / "campaign"), "--output", str(session / "s.zip")]
    assert main([*command, "--title", "Monday"]) == 0
    assert "2 files" in capsys.readouterr().out
    assert main(command) == 1
