"""The page on recipes lists every key as the program has it, and its recipe is one."""

from pathlib import Path
from typing import Final

import pytest
from pydantic import BaseModel

from cosmic.autonomy.bending.plan import SpanLimits
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.calibrating.settings import CalibrationSettings
from cosmic.autonomy.campaign.opening import read_recipe
from cosmic.autonomy.campaign.recipe import (
    ClimateSettings,
    OutputSettings,
    PlateSettings,
    RecipeFile,
    SampleSettings,
    SensorSettings,
    TwinChoice,
    load_recipe,
    shipped_recipes,
)
from cosmic.autonomy.campaign.report_table import COLUMNS
from cosmic.autonomy.campaign.stop_rule import StopSettings
from cosmic.autonomy.handling.settings import StandardSettings
from system.config_tables import rows
from system.docs_blocks import ROOT, blocks
from system.test_docs_reference import section

PAGE: Final = ROOT / "docs" / "reference" / "recipes.md"
TABLES: Final[dict[str, type[BaseModel]]] = {
    "[sample]": SampleSettings,
    "[stop]": StopSettings,
    "[plates]": PlateSettings,
    "[output]": OutputSettings,
    "[climate]": ClimateSettings,
    "[sensor]": SensorSettings,
    "[twin]": TwinChoice,
    "[parameters.standard]": StandardSettings,
    "[parameters.push.spans]": SpanLimits,
    "[parameters.push.fit]": FitSettings,
    "[parameters.calibration]": CalibrationSettings,
}


@pytest.mark.parametrize("heading", TABLES)
def test_the_table_lists_every_key(heading: str, tmp_path: Path) -> None:
    head, *listed = section(PAGE, heading, tmp_path)
    assert head == ["key", "type", "unit", "default", "meaning"]
    assert [tuple(row[:4]) for row in listed] == list(rows(TABLES[heading]))
    assert all(row[4] for row in listed), "a key without a meaning"


def test_every_table_of_a_recipe_has_a_section() -> None:
    described = {model.__name__ for model in TABLES.values()}
    assert set(RecipeFile.model_json_schema()["$defs"]) <= described


def test_the_recipe_on_the_page_is_one(tmp_path: Path) -> None:
    (text,) = [block.text for block in blocks(PAGE) if block.language == "toml"]
    path = tmp_path / "page.toml"
    path.write_text(text, encoding="utf-8")
    assert load_recipe(path).file.stop.count == 40


def test_every_shipped_recipe_names_a_procedure_and_parameters_that_there_are() -> None:
    for path in shipped_recipes().values():
        assert read_recipe(path).parameters is not None


def test_every_shipped_recipe_is_listed() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in shipped_recipes():
        assert f"| `{name}` |" in text


def test_every_column_of_the_table_is_listed() -> None:
    text = (PAGE.parent / "campaign-folder.md").read_text(encoding="utf-8")
    for name in COLUMNS:
        assert f"`{name}`" in text
