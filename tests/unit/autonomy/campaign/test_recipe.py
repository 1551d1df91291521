"""Recipes are read strictly, and every fault is named with its file, key and reason."""

from pathlib import Path

import pytest

from cosmic.autonomy.bending.plan import FARTHER, SpanLimits
from cosmic.autonomy.campaign.recipe import asks_the_same, load_recipe, shipped_recipes
from cosmic.autonomy.handling.settings import StandardSettings
from cosmic.autonomy.shipped.registry import PARAMETERS
from cosmic.frame.config import StrictModel
from cosmic.frame.errors import ConfigError


class Push(StrictModel):
    spans: SpanLimits = SpanLimits()


class Parameters(StrictModel):
    push: Push = Push()
    standard: StandardSettings = StandardSettings()


PROCEDURES: dict[str, type[StrictModel]] = {
    "bend test": Parameters,
    "transport": Parameters,
}


@pytest.mark.parametrize("name", ["bend-test", "quick", "transport"])
def test_a_shipped_recipe_is_found_by_its_name_and_is_right(name: str) -> None:
    assert name in shipped_recipes()
    recipe = load_recipe(Path(name), procedures=PROCEDURES)
    assert recipe.name == name
    assert recipe.file.sample.name
    assert recipe.text.startswith("#")
    assert isinstance(recipe.parameters, Parameters)


def test_the_shipped_bend_test_pushes_as_far_out_as_sealed_sessions_do() -> None:
    found = load_recipe(Path("bend-test"), procedures=PROCEDURES).parameters
    assert isinstance(found, Parameters)
    assert found.push.spans == FARTHER


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('procedure = "bend test"', ("stop: key is missing",)),
        ('procedure = "bend test"\n[stop]\n', ("stop: give at least one of count",)),
        ('procedure = "bend test"\n[stop]\ncount = 0', ("stop.count: ", "has 0")),
        ('procedure = "bend test"\n[stop]\ncuont = 3', ("stop.cuont: unknown key",)),
        ('procedure = "fly"\n[stop]\ncount = 3', ("procedure: ", "'fly'", "bend test, transport")),
        (
            'procedure = "bend test"\n[stop]\ncount = 3\n[parameters.push.spans]\ncount = 99',
            ("parameters.push.spans.count: ", "has 99"),
        ),
        (
            'procedure = "bend test"\n[stop]\ncount = 3\n[parameters.push]\nforce = 1',
            ("parameters.push.force: unknown key",),
        ),
        ('procedure = "bend test"\n[stop]\ncount = 3\n[twin]\nrate = nan', ("twin.rate: ",)),
        ("procedure = ", ("not valid TOML",)),
    ],
)
def test_a_wrong_recipe_is_refused_with_file_key_and_reason(
    text: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_recipe(path, procedures=PROCEDURES)
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_a_shipped_recipe_is_found_beside_a_folder_of_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bend-test").mkdir()  # where its campaign is kept
    monkeypatch.chdir(tmp_path)
    assert load_recipe(Path("bend-test")).path == shipped_recipes()["bend-test"]


def test_a_procedure_under_the_name_that_it_had_before_is_found(tmp_path: Path) -> None:
    path = written(tmp_path, 'procedure = "bend test with two hands"\n[stop]\ncount = 1\n')
    recipe = load_recipe(path, procedures=PARAMETERS)
    assert recipe.file.procedure == "bend test with two grippers"
    assert recipe.file.procedure in PARAMETERS


OLD = """
procedure = "bend test with two hands"
[stop]
count = 3  # three will do
[twin]
seed = 0
"""


@pytest.mark.parametrize(
    ("text", "same"),
    [
        (OLD, True),
        ('procedure = "bend test with two grippers"\n[stop]\ncount = 3\n', True),
        (OLD.replace("[stop]", 'description = "again"\n[stop]'), True),
        (OLD.replace("count = 3", "count = 4"), False),
        (OLD.replace("seed = 0", "seed = 1"), False),
        ("procedure = ", False),
    ],
)
def test_recipes_are_compared_by_what_they_ask_for(text: str, same: bool, tmp_path: Path) -> None:
    recipe = load_recipe(written(tmp_path, OLD), procedures=PARAMETERS)
    assert asks_the_same(text, recipe, PARAMETERS) is same


def test_a_recipe_that_is_not_there_says_which_ones_ship() -> None:
    with pytest.raises(ConfigError, match="no shipped recipe of this name; shipped: bend-test"):
        load_recipe(Path("bent-test"))
    with pytest.raises(ConfigError, match="there is no such file"):
        load_recipe(Path("nowhere/mine.toml"))
