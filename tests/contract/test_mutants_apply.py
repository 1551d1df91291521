"""The edits that break the safety path on purpose still fit the code that they break."""

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MUTANTS = tomllib.loads((ROOT / "tests" / "mutants" / "safety.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("mutant", MUTANTS["mutant"], ids=lambda each: each["name"])
def test_an_edit_is_found_once_and_its_tests_are_there(mutant: dict[str, str]) -> None:
    text = (ROOT / "src" / "cosmic" / mutant["file"]).read_text(encoding="utf-8")

    assert text.count(mutant["before"]) == 1
    assert mutant["after"] != mutant["before"]
    for file in mutant["tests"]:
        assert (ROOT / file).is_file()
