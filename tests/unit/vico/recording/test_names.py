"""Names of recordings of images, and what forbids one before anything is written."""

import os
import sys

import pytest

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.vico.core.recording.formats import (
    ImageFormat,
    recording_suffix,
    traits,
)
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.side_row import row_of
from unit.vico.recording.image_helpers import image, noise


@pytest.mark.parametrize(
    ("name", "image_format", "kept"),
    [
        ("run", ImageFormat.FFV1, "run.mkv"),
        ("run.MKV", ImageFormat.FFV1, "run.mkv"),
        ("step 1.5", ImageFormat.FAST, "step 1.5.nut"),
        ("step 1.5", ImageFormat.TIFF, "step 1.5"),
    ],
)
def test_the_ending_may_be_left_out(tmp_path, name, image_format, kept):
    file = ImageFile(tmp_path / name, image_format)
    file.append(noise(), row_of(image(), None))
    file.close(complete=True)
    assert file.path == tmp_path / kept
    assert file.path.exists()
    side_name = kept if image_format is ImageFormat.TIFF else kept.rpartition(".")[0]
    assert file.side_path == tmp_path / f"{side_name}.csv"
    assert file.side_path.exists()


@pytest.mark.parametrize(
    ("name", "image_format", "said"),
    [
        ("run.mp4", ImageFormat.FFV1, ".mp4 is not the ending of format ffv1"),
        ("run.tif", ImageFormat.TIFF, "names a directory"),
        ("a?b", ImageFormat.FFV1, "cannot be part"),
        ("NUL", ImageFormat.FFV1, "device"),
        (".mkv", ImageFormat.FFV1, "full stop"),
    ],
)
def test_a_name_that_cannot_be_is_refused(tmp_path, name, image_format, said):
    with pytest.raises(RecordingError, match=said):
        ImageFile(tmp_path / name, image_format)
    assert list(tmp_path.iterdir()) == []


def test_a_directory_that_is_missing_or_read_only_is_reported(tmp_path, monkeypatch):
    with pytest.raises(RecordingError, match="does not exist; create it"):
        ImageFile(tmp_path / "none" / "run", ImageFormat.FFV1)
    if sys.platform == "win32" or os.geteuid() == 0:
        monkeypatch.setattr(os, "access", lambda *_: False)
    tmp_path.chmod(0o500)
    with pytest.raises(RecordingError, match="cannot be written to"):
        ImageFile(tmp_path / "run", ImageFormat.FFV1)
    tmp_path.chmod(0o700)


@pytest.mark.parametrize("there", ["run.mkv", "run.csv", "run"])
def test_what_is_there_is_replaced_only_when_asked_to(tmp_path, there):
    image_format = ImageFormat.FFV1 if there.endswith("mkv") else ImageFormat.TIFF
    if there == "run":
        (tmp_path / there).mkdir()
        (tmp_path / there / "run_000007.tif").write_bytes(b"before")
        (tmp_path / there / "notes_000001.tif").write_bytes(b"another's")
    else:
        (tmp_path / there).write_bytes(b"before")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(RecordingExistsError, match="may be replaced"):
        ImageFile(tmp_path / "run", image_format)
    assert sorted(tmp_path.rglob("*")) == before
    ImageFile(tmp_path / "run", image_format, overwrite=True).close(complete=True)
    left = [each.name for each in (tmp_path / "run").glob("*")]
    assert left == (["notes_000001.tif"] if there == "run" else [])


@pytest.mark.parametrize("first", ImageFormat)
@pytest.mark.parametrize("second", ImageFormat)
def test_a_recording_in_another_format_keeps_its_side_file(tmp_path, first, second):
    (tmp_path / "step 1.5").mkdir()  # of somebody else, and in nobody's way
    file = ImageFile(tmp_path / "run", first)
    file.append(noise(), row_of(image(), None))
    file.close(complete=True)
    if recording_suffix(first) == recording_suffix(second):
        ImageFile(tmp_path / "run", second, overwrite=True).close(complete=True)
        return
    before = file.side_path.read_bytes()
    with pytest.raises(RecordingError, match="is a recording in another format"):
        ImageFile(tmp_path / "run", second, overwrite=True)
    assert file.side_path.read_bytes() == before
    file = ImageFile(tmp_path / "step 1.5", ImageFormat.FFV1)
    file.close(complete=True)


def test_a_missing_codec_is_reported_before_anything_is_written(tmp_path, monkeypatch):
    import av

    def unknown(name, mode):
        raise av.codec.codec.UnknownCodecError(name)

    monkeypatch.setattr(av, "Codec", unknown)
    with pytest.raises(RecordingError, match="no codec 'ffv1'; choose format tiff or png"):
        ImageFile(tmp_path / "run", ImageFormat.FFV1)
    assert list(tmp_path.iterdir()) == []
    ImageFile(tmp_path / "run", ImageFormat.TIFF).close(complete=True)


def test_a_missing_library_is_reported_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(RecordingError, match="PyAV cannot be loaded"):
        ImageFile(tmp_path / "run", ImageFormat.FAST)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_format_lists_those_there_are():
    with pytest.raises(RecordingError, match="ffv1, fast, small, stack, zarr, tiff, png"):
        traits("mp4")
