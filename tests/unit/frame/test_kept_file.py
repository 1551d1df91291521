"""What the program writes as TOML is what a reader of TOML finds."""

import math
import tomllib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.kept_file import toml_lines, write_whole


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


def test_the_old_file_stays_whole_where_the_new_one_cannot_be_made(tmp_path: Path) -> None:
    file = tmp_path / "kept.toml"
    write_whole(file, "old = 1\n")
    (tmp_path / "kept.toml.part").mkdir()
    with pytest.raises(OSError, match="kept"):
        write_whole(file, "new = 2\n")
    assert file.read_text(encoding="utf-8") == "old = 1\n"


def test_a_text_that_no_file_can_have_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    write_whole(path, "old")
    with pytest.raises(OSError, match="UTF-8"):
        write_whole(path, "title \udc80")
    assert [each.name for each in tmp_path.iterdir()] == ["a.toml"]
    assert path.read_text(encoding="utf-8") == "old"
