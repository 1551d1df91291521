"""Names of recordings of pictures, and what forbids one before anything is written."""

import os
import sys
from datetime import datetime

import pytest

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.file_names import NameOption
from cosmic.vico.core.recording.formats import (
    PictureFormat,
    picture_file_name,
    recording_suffix,
    traits,
)
from cosmic.vico.core.recording.picture_file import PictureFile
from cosmic.vico.core.recording.side_row import row_of
from unit.vico.recording.picture_helpers import noise, picture


def test_a_name_takes_the_ending_of_its_format_a_time_or_a_number(tmp_path):
    when = datetime(2026, 5, 4, 9, 8, 7)
    assert picture_file_name("fibre", PictureFormat.FFV1) == "fibre.mkv"
    assert picture_file_name("fibre 1.5", PictureFormat.TIFF) == "fibre 1.5"
    stamped = picture_file_name("fibre", PictureFormat.FAST, NameOption.TIME, when=when)
    assert stamped == "fibre_2026-05-04_09-08-07.nut"
    (tmp_path / "fibre_004").mkdir()
    (tmp_path / "fibre_002.csv").touch()
    for wanted, name in ((PictureFormat.FFV1, "fibre_005.mkv"), (PictureFormat.PNG, "fibre_005")):
        assert picture_file_name("fibre", wanted, NameOption.NUMBER, directory=tmp_path) == name


@pytest.mark.parametrize(
    ("name", "picture_format", "kept"),
    [
        ("run", PictureFormat.FFV1, "run.mkv"),
        ("run.MKV", PictureFormat.FFV1, "run.mkv"),
        ("step 1.5", PictureFormat.FAST, "step 1.5.nut"),
        ("step 1.5", PictureFormat.TIFF, "step 1.5"),
    ],
)
def test_the_ending_may_be_left_out(tmp_path, name, picture_format, kept):
    file = PictureFile(tmp_path / name, picture_format)
    file.append(noise(), row_of(picture(), None))
    file.close(complete=True)
    assert file.path == tmp_path / kept
    assert file.path.exists()
    side_name = kept if picture_format is PictureFormat.TIFF else kept.rpartition(".")[0]
    assert file.side_path == tmp_path / f"{side_name}.csv"
    assert file.side_path.exists()


@pytest.mark.parametrize(
    ("name", "picture_format", "said"),
    [
        ("run.mp4", PictureFormat.FFV1, ".mp4 is not the ending of format ffv1"),
        ("run.tif", PictureFormat.TIFF, "names a directory"),
        ("a?b", PictureFormat.FFV1, "cannot be part"),
        ("NUL", PictureFormat.FFV1, "device"),
        (".mkv", PictureFormat.FFV1, "full stop"),
    ],
)
def test_a_name_that_cannot_be_is_refused(tmp_path, name, picture_format, said):
    with pytest.raises(RecordingError, match=said):
        PictureFile(tmp_path / name, picture_format)
    assert list(tmp_path.iterdir()) == []


def test_a_directory_that_is_missing_or_read_only_is_told(tmp_path, monkeypatch):
    with pytest.raises(RecordingError, match="does not exist; create it"):
        PictureFile(tmp_path / "none" / "run", PictureFormat.FFV1)
    if sys.platform == "win32" or os.geteuid() == 0:
        monkeypatch.setattr(os, "access", lambda *_: False)
    tmp_path.chmod(0o500)
    with pytest.raises(RecordingError, match="cannot be written to"):
        PictureFile(tmp_path / "run", PictureFormat.FFV1)
    tmp_path.chmod(0o700)


@pytest.mark.parametrize("there", ["run.mkv", "run.csv", "run"])
def test_what_is_there_is_replaced_only_when_asked_to(tmp_path, there):
    picture_format = PictureFormat.FFV1 if there.endswith("mkv") else PictureFormat.TIFF
    if there == "run":
        (tmp_path / there).mkdir()
        (tmp_path / there / "run_000007.tif").write_bytes(b"before")
        (tmp_path / there / "notes_000001.tif").write_bytes(b"another's")
    else:
        (tmp_path / there).write_bytes(b"before")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(RecordingExistsError, match="may be replaced"):
        PictureFile(tmp_path / "run", picture_format)
    assert sorted(tmp_path.rglob("*")) == before
    PictureFile(tmp_path / "run", picture_format, overwrite=True).close(complete=True)
    left = [each.name for each in (tmp_path / "run").glob("*")]
    assert left == (["notes_000001.tif"] if there == "run" else [])


@pytest.mark.parametrize("first", PictureFormat)
@pytest.mark.parametrize("second", PictureFormat)
def test_a_recording_in_another_format_keeps_its_side_file(tmp_path, first, second):
    (tmp_path / "step 1.5").mkdir()  # of somebody else, and in nobody's way
    file = PictureFile(tmp_path / "run", first)
    file.append(noise(), row_of(picture(), None))
    file.close(complete=True)
    if recording_suffix(first) == recording_suffix(second):
        PictureFile(tmp_path / "run", second, overwrite=True).close(complete=True)
        return
    before = file.side_path.read_bytes()
    with pytest.raises(RecordingError, match="is a recording in another format"):
        PictureFile(tmp_path / "run", second, overwrite=True)
    assert file.side_path.read_bytes() == before
    file = PictureFile(tmp_path / "step 1.5", PictureFormat.FFV1)
    file.close(complete=True)


def test_a_missing_codec_is_told_before_anything_is_written(tmp_path, monkeypatch):
    import av

    def unknown(name, mode):
        raise av.codec.codec.UnknownCodecError(name)

    monkeypatch.setattr(av, "Codec", unknown)
    with pytest.raises(RecordingError, match="no codec 'ffv1'; choose format tiff or png"):
        PictureFile(tmp_path / "run", PictureFormat.FFV1)
    assert list(tmp_path.iterdir()) == []
    PictureFile(tmp_path / "run", PictureFormat.TIFF).close(complete=True)


def test_a_missing_library_is_told_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(RecordingError, match="PyAV cannot be loaded"):
        PictureFile(tmp_path / "run", PictureFormat.FAST)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_format_lists_those_there_are():
    with pytest.raises(RecordingError, match="ffv1, fast, small, tiff, png"):
        traits("mp4")
