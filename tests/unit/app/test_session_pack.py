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
from cosmic.frame.network.certificates import make_certificates


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


def test_names_are_addresses_as_ro_crate_wants_them(session: Path) -> None:
    (session / "push #1 50 %.csv").write_text("a,b")
    pack_session([session / "push #1 50 %.csv"], session / "x.zip")
    with zipfile.ZipFile(session / "x.zip") as file:
        assert "push #1 50 %.csv" in file.namelist()
        known = {each["@id"]: each for each in json.loads(file.read(METADATA))["@graph"]}
    assert known["./"]["hasPart"] == [{"@id": "push%20%231%2050%20%25.csv"}]
    assert known["push%20%231%2050%20%25.csv"]["name"] == "push #1 50 %.csv"


def test_what_is_given_away_has_neither_tokens_nor_private_keys(
    session: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = session / "config"
    make_certificates(config / "keys", "fibres")
    text = '[[network.http.client]]\nname = "desk"\ntoken = "correct horse battery"  # of May\n'
    (config / "platform.toml").write_text(text)
    target = session / "x.zip"
    assert main(["session", "pack", str(config), "--output", str(target)]) == 0
    assert "private key" in capsys.readouterr().err
    with zipfile.ZipFile(target) as file:
        packed = {name: file.read(name) for name in file.namelist()}
    assert not [name for name, content in packed.items() if b"PRIVATE KEY" in content]
    assert [name for name in packed if name.endswith((".pem", ".crt"))]
    kept = packed["config/platform.toml"]
    assert kept == text.replace("correct horse battery", "").encode()
    known = {each["@id"]: each for each in json.loads(packed[METADATA])["@graph"]}
    assert known["config/platform.toml"]["sha256"] == hashlib.sha256(kept).hexdigest()


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
