"""What the program writes as TOML is what a reader of TOML finds."""

import errno
import math
import os
import stat
import subprocess
import sys
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame import kept_file
from cosmic.frame.kept_file import changing, toml_lines, write_whole


@given(st.text(st.characters(codec="utf-8")))
def test_any_text_is_read_as_it_was(text: str) -> None:
    assert tomllib.loads(toml_lines({"text": text})) == {"text": text}


def test_every_kind_of_value_is_read_as_it_was() -> None:
    values = {
        "whole": 3,
        "part": 0.1,
        "measured": np.float64(1e-12),
        "yes": True,
        "no": False,
        "when": datetime(2026, 11, 21, 12, 0, 5, tzinfo=UTC),
        "matrix": ((1.0, -2.5), (0.0, 1e300)),
        "by_name": {"left.x": 1.5, 'a "quoted" one': 2},
        "empty": (),
    }
    read = tomllib.loads(toml_lines(values))
    assert read == values | {"matrix": [[1.0, -2.5], [0.0, 1e300]], "empty": []}
    assert isinstance(read["whole"], int)
    assert read["yes"] is True


def test_what_is_none_is_left_out() -> None:
    assert toml_lines({"zoom": None, "tool": "probe"}) == 'tool = "probe"\n'


@pytest.mark.parametrize("value", [math.nan, math.inf, (1.0, -math.inf)])
def test_a_number_that_is_not_finite_is_not_kept(value: object) -> None:
    with pytest.raises(ValueError, match="not a number"):
        toml_lines({"value": value})


def test_the_old_file_stays_whole_where_the_new_one_cannot_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "kept.toml"
    write_whole(file, "old = 1\n")

    def full(_handle: int) -> None:
        raise OSError(errno.ENOSPC, "no space left", "kept")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="kept"):
        write_whole(file, "new = 2\n")
    assert file.read_text(encoding="utf-8") == "old = 1\n"
    assert [each.name for each in tmp_path.iterdir()] == ["kept.toml"]


def test_of_two_that_write_a_file_at_once_one_is_kept_as_a_whole(tmp_path: Path) -> None:
    file = tmp_path / "kept.toml"
    texts = ["a" * 20_000, "b" * 20_000]
    write_whole(file, texts[0])

    def write(text: str) -> None:
        for _ in range(50):
            write_whole(file, text)

    with ThreadPoolExecutor(2) as pool:
        writing = [pool.submit(write, text) for text in texts]
        seen = set()
        while not all(each.done() for each in writing):
            seen.add(file.read_text(encoding="utf-8"))
    for each in writing:
        each.result()
    assert seen <= set(texts)
    assert file.read_text(encoding="utf-8") in texts
    assert [each.name for each in tmp_path.iterdir()] == ["kept.toml"]


def _ended_pid() -> int:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    return ended.pid


def test_what_a_killed_process_left_half_written_is_removed_at_the_next_start(
    tmp_path: Path,
) -> None:
    gone, minutes_ago_s = _ended_pid(), time.time() - 300.0
    left = tmp_path / f"kept.toml.{gone}-1.part"
    ours = tmp_path / f"other.toml.{os.getpid()}-1.part"
    users = tmp_path / "holiday.part"
    fresh = tmp_path / f"kept.toml.{gone}-2.part"
    for each in (left, ours, users, fresh):
        each.write_text("half = ", encoding="utf-8")
    for each in (left, ours, users):
        os.utime(each, (minutes_ago_s, minutes_ago_s))
    write_whole(tmp_path / "kept.toml", "new = 1\n")
    names = {each.name for each in tmp_path.iterdir()}
    assert names == {"kept.toml", ours.name, users.name, fresh.name}


def test_one_that_changes_a_file_waits_for_another_but_not_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "kept.toml"
    monkeypatch.setattr(kept_file, "WAIT_S", 0.1)
    with changing(file), changing(file):
        write_whole(file, "new = 1\n")
    assert file.read_text(encoding="utf-8") == "new = 1\n"


def test_a_text_that_no_file_can_have_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    write_whole(path, "old")
    with pytest.raises(OSError, match="UTF-8"):
        write_whole(path, "title \udc80")
    assert [each.name for each in tmp_path.iterdir()] == ["a.toml"]
    assert path.read_text(encoding="utf-8") == "old"


@pytest.mark.skipif(sys.platform == "win32", reason="links and modes are those of POSIX")
def test_a_link_stays_and_so_does_who_may_read_what_it_leads_to(tmp_path: Path) -> None:
    kept, link = tmp_path / "kept.toml", tmp_path / "link.toml"
    kept.write_text("token = 1", encoding="utf-8")
    kept.chmod(0o600)
    link.symlink_to(kept.name)
    write_whole(link, "token = 2")
    assert link.is_symlink()
    assert kept.read_text(encoding="utf-8") == "token = 2"
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600


def test_a_file_that_is_read_only_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "kept.toml"
    kept.write_text("a = 1", encoding="utf-8")
    kept.chmod(0o444)
    whoever = os.access  # root may write all
    monkeypatch.setattr(os, "access", lambda path, mode: whoever(path, mode) and not mode & os.W_OK)
    with pytest.raises(PermissionError, match="read-only"):
        write_whole(kept, "a = 2")
    assert kept.read_text(encoding="utf-8") == "a = 1"
    assert list(tmp_path.iterdir()) == [kept]
