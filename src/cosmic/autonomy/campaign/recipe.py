"""Recipes: what a campaign does, in one TOML file."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import Field, field_validator

from cosmic.autonomy.campaign.stop_rule import StopSettings
from cosmic.frame.config import StrictModel, check_model, read_toml, shipped_config_dir
from cosmic.frame.errors import ConfigError

RECIPES: Final = "recipes"
RENAMED: Final = {"bend test with two hands": "bend test with two grippers"}
"""Names that procedures had before, still read in recipes."""


class SampleSettings(StrictModel):
    """What lies on the plate.

    Attributes
    ----------
    name : str
        Of the twin's sample; empty on a real platform.
    """

    name: str = ""
    description: str = ""


class ClimateSettings(StrictModel):
    """The air of the room, as it was read when the campaign began; for the record.

    Attributes
    ----------
    temperature_c, rh_percent : float or None
        None where nobody read it.
    """

    temperature_c: float | None = Field(None, gt=-40.0, lt=80.0)
    rh_percent: float | None = Field(None, ge=0.0, le=100.0)


class SensorSettings(StrictModel):
    """Which force sensor it is, for the record.

    Attributes
    ----------
    serial, certificate : str
        Its number, and that of its certificate.
    calibrated : str
        When the certificate was given.
    """

    serial: str = ""
    certificate: str = ""
    calibrated: str = ""


class PlateSettings(StrictModel):
    """How plates are changed, where `stop.plates` asks for several.

    Attributes
    ----------
    by : str
        "handler": by what the platform has for it, and by a person where it has nothing.
        "person": somebody puts each plate there and confirms it.
    """

    by: Literal["handler", "person"] = "handler"


class OutputSettings(StrictModel):
    """What is kept and made besides the records."""

    pictures: bool = True
    html: bool = True
    pdf: bool = True
    table: bool = True


class TwinChoice(StrictModel):
    """How the simulated platform runs; a real one does not look at it.

    Attributes
    ----------
    rate : float
        Platform seconds for one of the wall.
    """

    seed: int = Field(0, ge=0)
    rate: float = Field(20.0, gt=0.0, le=1000.0)


class RecipeFile(StrictModel):
    """A recipe as it stands in its file.

    Attributes
    ----------
    parameters : dict
        Of the procedure, which checks them.
    """

    procedure: str
    description: str = ""
    operator: str = ""
    sample: SampleSettings = SampleSettings()
    climate: ClimateSettings = ClimateSettings()
    sensor: SensorSettings = SensorSettings()
    stop: StopSettings
    plates: PlateSettings = PlateSettings()
    parameters: dict[str, Any] = Field(default_factory=dict)
    output: OutputSettings = OutputSettings()
    twin: TwinChoice = TwinChoice()

    @field_validator("procedure")
    @classmethod
    def _present_name(cls, procedure: str) -> str:
        return RENAMED.get(procedure, procedure)


@dataclass(frozen=True, slots=True)
class Recipe:
    """A recipe that was checked.

    Attributes
    ----------
    name : str
        Of the file, without its ending.
    text : str
        The file as it was read: it goes into the campaign's record.
    parameters : StrictModel
        Of the procedure; None where the recipe was loaded without knowing procedures.
    """

    name: str
    path: Path
    text: str
    file: RecipeFile
    parameters: StrictModel | None = None


def load_recipe(path: Path, *, procedures: Mapping[str, type[StrictModel]] | None = None) -> Recipe:
    """Read a recipe.

    Parameters
    ----------
    path : Path
        A file, or the name of a shipped recipe such as "bend-test".
    procedures : mapping, optional
        Parameters of each procedure that there is, by its name; None: neither the procedure's
        name nor its parameters are looked at.

    Raises
    ------
    ConfigError
        One line per fault, each with file, key and reason.
    """
    path = _found(path)
    return _checked(path, read_toml(path), path.read_text(encoding="utf-8"), procedures)


def asks_the_same(
    text: str, recipe: Recipe, procedures: Mapping[str, type[StrictModel]] | None = None
) -> bool:
    """Return whether the text of an earlier recipe asks for the same as `recipe`.

    Comments, the order of keys, values that are written out although they are the usual ones, the
    description and names that procedures had before make no difference.
    """
    if text == recipe.text:
        return True
    try:
        earlier = _checked(recipe.path, tomllib.loads(text), text, procedures)
    except (ConfigError, ValueError):
        return False
    return _asked(earlier) == _asked(recipe)


def _asked(recipe: Recipe) -> tuple[RecipeFile, StrictModel | None]:
    """Return what of a recipe changes a campaign."""
    parameters = recipe.file.parameters if recipe.parameters is None else {}
    said = {"description": "", "parameters": parameters}
    return recipe.file.model_copy(update=said), recipe.parameters


def _checked(
    path: Path,
    data: object,
    text: str,
    procedures: Mapping[str, type[StrictModel]] | None,
) -> Recipe:
    file = check_model(path, data, RecipeFile)
    parameters = None
    if procedures is not None:
        if file.procedure not in procedures:
            known = ", ".join(sorted(procedures)) or "none"
            raise ConfigError(
                f"{path}: procedure: there is no procedure {file.procedure!r}; known: {known}"
            )
        parameters = check_model(
            path, file.parameters, procedures[file.procedure], under="parameters"
        )
    return Recipe(name=path.stem, path=path, text=text, file=file, parameters=parameters)


def shipped_recipes() -> dict[str, Path]:
    """Return the recipes that ship with CoSMic, by name."""
    folder = shipped_config_dir() / RECIPES
    return {each.stem: each for each in sorted(folder.glob("*.toml"))}


def _found(path: Path) -> Path:
    if path.suffix or path.is_file() or path.parent != Path():
        return path
    shipped = shipped_recipes()
    if path.name not in shipped:
        raise ConfigError(
            f"{path}: there is no such file, and no shipped recipe of this name; "
            f"shipped: {', '.join(shipped) or 'none'}"
        )
    return shipped[path.name]
