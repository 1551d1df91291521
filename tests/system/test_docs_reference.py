"""The pages of docs/reference list what the program has: nothing is missing, nothing invented."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import BaseModel

import cosmic
from cosmic.app.configuration.platform_file import load_platform
from cosmic.daqco.hw.sim_faults import NAMES as BOARD_FAULTS
from cosmic.mico.core.motion.positioner import Confidence
from cosmic.mico.hw.sim_faults import NAMES as FAULTS
from system.api_names import CLASSES, ENUMS, exceptions, names, signature
from system.config_tables import SECTIONS, WHOLE_FILES, rows
from system.docs_blocks import ROOT, table_rows

REFERENCE = ROOT / "docs" / "reference"


def section(page: Path, heading: str, tmp_path: Path) -> list[list[str]]:
    """Return the rows of the tables under `heading`, up to the next one of any level."""
    text = page.read_text(encoding="utf-8")
    parts = re.split(r"^#+ (.*)$", text, flags=re.MULTILINE)
    headings = [each.strip().strip("`") for each in parts[1::2]]
    assert heading in headings, f"{page.name} has no section {heading}"
    only = tmp_path / "section.md"
    only.write_text(parts[2 * headings.index(heading) + 2], encoding="utf-8")
    return table_rows(only)


@pytest.mark.parametrize("heading", SECTIONS)
def test_the_table_of_a_section_lists_every_key_as_the_program_has_it(
    heading: str, tmp_path: Path
) -> None:
    model: type[BaseModel] = SECTIONS[heading]
    head, *listed = section(REFERENCE / "configuration.md", heading, tmp_path)
    assert head == ["key", "type", "unit", "default", "meaning"]
    assert [tuple(row[:4]) for row in listed] == list(rows(model))
    assert all(row[4] for row in listed), "a key without a meaning"


def test_every_table_of_both_files_has_a_section() -> None:
    described = {model.__name__ for model in SECTIONS.values()}
    for whole in WHOLE_FILES:
        for name in whole.model_json_schema()["$defs"]:
            assert name in described, f"configuration.md has no section for {name}"


@pytest.mark.parametrize("title", CLASSES)
def test_every_public_name_of_a_class_is_listed_with_its_parameters(
    title: str, tmp_path: Path
) -> None:
    listed = section(REFERENCE / "api.md", title, tmp_path)
    cells = {row[0] for row in listed if row[0] != "name"}
    assert cells == set(names(title).values())
    assert all(row[1] for row in listed)


@pytest.mark.parametrize("title", ENUMS)
def test_every_word_of_an_enumeration_is_listed(title: str, tmp_path: Path) -> None:
    listed = {row[0]: row[1] for row in section(REFERENCE / "api.md", "Words", tmp_path)}
    assert listed[f"`{title}`"] == ", ".join(f"`{each.value}`" for each in ENUMS[title])


def test_every_exception_is_listed_with_what_it_is(tmp_path: Path) -> None:
    _, *listed = section(REFERENCE / "api.md", "Exceptions", tmp_path)
    said = {row[0].strip("`"): row[1].strip("`") for row in listed}
    assert said == {name: cls.__mro__[1].__name__ for name, cls in exceptions().items()}


def test_every_name_that_cosmic_exports_is_in_the_page(tmp_path: Path) -> None:
    text = (REFERENCE / "api.md").read_text(encoding="utf-8")
    assert not [name for name in cosmic.__all__ if f"`{name}" not in text]
    assert f"`connect{signature(cosmic.connect)}`" in text


def test_attributes_made_later_are_there() -> None:
    with cosmic.connect(rate=20.0) as rig:
        axis = rig.mico["left.x"]
        group = rig.mico.move({"left.x": 0.0}, wait=False)
        assert {"commander"} == {name for name in vars(axis) if not name.startswith("_")}
        assert {"movements"} == {name for name in vars(group) if not name.startswith("_")}
        group.wait()


def test_the_keys_of_the_shipped_platform_are_listed(tmp_path: Path) -> None:
    file, _ = load_platform(None)
    listed = {tuple(row[:2]) for row in section(REFERENCE / "keys.md", "Jogging", tmp_path)}
    expected = {("key", "axis")}
    for each in file.mico.positioner:
        for key in (each.backward_key, each.forward_key):
            expected.add((f"`{key}`", f"`{each.name}`"))
    assert listed == expected
    assert f"`{file.platform.stop_key}`" in (REFERENCE / "keys.md").read_text(encoding="utf-8")


def help_of(*command: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "cosmic", *command, "--help"],
        check=False,
        capture_output=True,
        text=True,
    )
    return done.stdout


def test_every_option_of_a_window_is_listed_and_none_besides(tmp_path: Path) -> None:
    listed = section(REFERENCE / "commands.md", "Commands", tmp_path)
    said = {re.findall(r"--\w+", row[0])[0] for row in listed if row[0].startswith("`--")}
    for command in ((), ("mico",), ("daqco",), ("vico",)):
        assert set(re.findall(r"--\w+", help_of(*command))) == said


def test_every_command_is_listed(tmp_path: Path) -> None:
    text = (REFERENCE / "commands.md").read_text(encoding="utf-8")
    commands = re.findall(r"^    (\w+) {2,}\w", help_of(), flags=re.MULTILINE)
    assert len(commands) > 3
    assert not [each for each in commands if f"`cosmic {each}" not in text]


def test_every_thesis_name_leads_to_a_file_that_has_the_name_given(tmp_path: Path) -> None:
    rows_ = table_rows(REFERENCE / "thesis-names.md")
    pairs = [row for row in rows_ if len(row) == 3 and row[0] != "thesis"]
    assert len(pairs) > 40
    for thesis, name, file in pairs:
        path = ROOT / "src" / "cosmic" / file.strip("`")
        assert path.is_file(), f"{thesis}: there is no {file}"
        last = name.strip("`").split("(")[0].split(".")[-1].split()[-1]
        text = path.read_text(encoding="utf-8")
        assert re.search(rf"\b{re.escape(last)}\b", text), f"{thesis}: {file} has no {name}"


def first_cells(rows_of_page: list[list[str]], head: str) -> list[str]:
    """Return the first column of the rows below the one that begins with `head`."""
    start = next(index for index, row in enumerate(rows_of_page) if row[0] == head)
    return [row[0].strip("`") for row in rows_of_page[start + 1 :]]


def test_every_fault_of_the_simulated_controller_is_explained() -> None:
    listed = table_rows(ROOT / "docs" / "explanation" / "simulated-controller.md")
    assert first_cells(listed, "fault") == list(FAULTS)


def test_every_fault_of_the_simulated_boards_is_explained() -> None:
    listed = table_rows(ROOT / "docs" / "explanation" / "acquisition.md")
    assert first_cells(listed, "fault") == list(BOARD_FAULTS)


def test_every_reason_of_a_refusal_and_every_confidence_is_explained(tmp_path: Path) -> None:
    page = ROOT / "docs" / "explanation" / "gate.md"
    checks = section(page, "The checks, in their order", tmp_path)
    said = {row[1].strip("`") for row in checks if len(row) == 3 and row[1] != "reason"}
    assert said == {each.value for each in cosmic.Reason} - {"ALLOWED"}
    assert first_cells(table_rows(page), "confidence") == [each.value for each in Confidence]
