"""Names of recordings, directories and room."""

import os
import shutil
import sys
from collections import namedtuple
from datetime import datetime
from functools import partial

import pytest

from cosmic.frame.errors import RecordingError
from cosmic.frame.file_names import (
    RESERVE_BYTES,
    NameOption,
    check_base_name,
    check_directory,
    check_space,
    space_left,
)
from cosmic.frame.file_names import (
    file_name as named,
)

Usage = namedtuple("Usage", "total used free")
file_name = partial(named, suffix=".h5")
WHEN = datetime(2026, 5, 4, 9, 8, 7)


def test_a_name_stays_as_it_is_or_takes_a_time_or_a_number(tmp_path):
    assert file_name("fibre 12") == "fibre 12.h5"
    assert file_name("fibre.h5") == "fibre.h5"
    assert file_name("fibre", NameOption.TIME, when=WHEN) == "fibre_2026-05-04_09-08-07.h5"
    assert file_name("fibre", NameOption.NUMBER, directory=tmp_path) == "fibre_001.h5"


def test_the_number_follows_the_highest_in_use(tmp_path):
    for name in ("fibre_002.h5", "Fibre_010.H5", "fibre_x.h5", "other_050.h5", "fibre_99.csv"):
        (tmp_path / name).touch()
    assert file_name("fibre", NameOption.NUMBER, directory=tmp_path) == "fibre_011.h5"
    assert file_name("f(1)", NameOption.NUMBER, directory=tmp_path) == "f(1)_001.h5"


def test_numbering_in_a_missing_directory_begins_at_one(tmp_path):
    name = file_name("fibre", NameOption.NUMBER, directory=tmp_path / "none")
    assert name == "fibre_001.h5"


@pytest.mark.parametrize(
    ("base", "said"),
    [
        ("", "no name"),
        ("  ", "no name"),
        ("a/b", "/ cannot be part"),
        ("..\\b", "directory belongs"),
        ("..", "full stop"),
        (".hidden", "full stop"),
        ("end.", "full stop"),
        ("C:run", ": cannot be"),
        ("what?", "? cannot be"),
        ("a\nb", "cannot be printed"),
        ("a\0b", "cannot be printed"),
        ("NUL", "device"),
        ("com1.h5", "device"),
        (".h5", "full stop"),
        ("ä" * 101, "longer than 200"),
    ],
)
def test_a_name_that_some_system_does_not_take_is_refused(base, said):
    with pytest.raises(RecordingError, match=said.replace("?", r"\?")):
        file_name(base)


def test_a_usual_name_passes():
    assert check_base_name(" Fichte (µm) #3, 20 °C ") == "Fichte (µm) #3, 20 °C"


def test_a_directory_must_exist_and_be_one(tmp_path):
    (tmp_path / "file").touch()
    assert check_directory(tmp_path) == tmp_path
    with pytest.raises(RecordingError, match="does not exist; create it"):
        check_directory(tmp_path / "none")
    with pytest.raises(RecordingError, match="is a file; choose a directory"):
        check_directory(tmp_path / "file")


def test_a_directory_that_is_read_only_is_refused(tmp_path, monkeypatch):
    if sys.platform != "win32" and os.geteuid() != 0:
        tmp_path.chmod(0o500)
    else:
        monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(RecordingError, match="cannot be written to"):
        check_directory(tmp_path)
    tmp_path.chmod(0o700)


def test_the_time_left_follows_from_the_room(tmp_path, monkeypatch):
    free = RESERVE_BYTES + 7_680_000
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**12, 0, free))
    space = check_space(tmp_path, 3_840_000.0)
    assert (space.free_bytes, space.left_s) == (7_680_000, 2.0)
    with pytest.raises(RecordingError, match="the disk is full"):
        check_space(tmp_path, 7_680_001.0)
    assert space_left(tmp_path, 0.0).left_s == float("inf")


def test_a_disk_that_is_gone_is_reported(tmp_path):
    with pytest.raises(RecordingError, match="is the disk still there"):
        space_left(tmp_path / "gone", 1.0)


def test_a_long_name_leaves_room_for_the_reason() -> None:
    with pytest.raises(RecordingError) as refused:
        check_base_name("a/" + "long " * 30)
    assert str(refused.value).index("cannot be part of") < 40
    with pytest.raises(RecordingError, match="the name is longer than 200 bytes"):
        check_base_name("a/" + "long" * 100)
