"""Worlds: how far a laboratory may be from what twin.toml says, drawn anew for each seed.

A world is a file in the folder `worlds` beside twin.toml. It says of any constant of twin.toml by
which spread it differs from session to session, and of any property of a fibre how it differs from
fibre to fibre. Each number is drawn from the seed and its own name, so that a world with one effect
more leaves all others as they were.
"""

import math
import random
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, check_model, load_model, shipped_config_dir
from cosmic.frame.errors import ConfigError
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.settings import TwinSettings

PLAIN: Final = "plain"
"""The world of twin.toml as it stands; it needs no file."""

FOLDER: Final = "worlds"
TRIES: Final = 1000

CURL_INDEX: Final = "curl_index"
"""A key of a fibre that stands for `curl_deg`: length over the distance of the ends, less one."""

WHOLE_FIBRE_UM: Final = 2300.0
"""Fibres of the literature whose curl index is published are so long; shorter ones turn by less."""

MOST_CURL_DEG: Final = 120.0


class Spread(StrictModel):
    """A number to be drawn.

    Attributes
    ----------
    normal : (float, float) or None
        Mean and standard deviation.
    lognormal : (float, float) or None
        Median, and standard deviation of the logarithm.
    uniform : (float, float) or None
        Lowest and highest.
    low, high : float or None
        What lies outside is drawn again.
    absolute : bool
        Without its sign.
    """

    normal: tuple[float, float] | None = Field(default=None, strict=False)
    lognormal: tuple[float, float] | None = Field(default=None, strict=False)
    uniform: tuple[float, float] | None = Field(default=None, strict=False)
    low: float | None = None
    high: float | None = None
    absolute: bool = False

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        if sum(each is not None for each in (self.normal, self.lognormal, self.uniform)) != 1:
            raise ValueError("a spread is one of normal, lognormal and uniform")
        return self

    def drawn(self, chance: random.Random) -> float:
        """Return one number.

        Raises
        ------
        ValueError
            Hardly any lies between `low` and `high`.
        """
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        for _ in range(TRIES):
            value = self._once(chance)
            if low <= value <= high:
                return value
        raise ValueError(f"hardly any number lies between {low:g} and {high:g}")

    def _once(self, chance: random.Random) -> float:
        value = 0.0
        if self.normal is not None:
            value = chance.gauss(*self.normal)
        elif self.lognormal is not None:
            median, sigma = self.lognormal
            value = median * math.exp(chance.gauss(0.0, sigma))
        elif self.uniform is not None:
            value = chance.uniform(*self.uniform)
        return abs(value) if self.absolute else value


Constant = Spread | float | bool


class World(StrictModel):
    """A whole file of a world.

    Attributes
    ----------
    about : str
        One sentence for people.
    standard : str
        Which of the standards of twin.toml lies on each plate; "" none.
    session : dict
        By key of twin.toml, such as "contact.jaw_side_un_um", what it is for a whole session;
        a part "*" stands for all tables of that kind.
    fibre : dict
        By key of `[[fibres]]`, or `curl_index`, what it is for each fibre; standards have none of
        it.
    """

    about: str = ""
    standard: str = ""
    session: dict[str, Constant] = Field(default_factory=dict)
    fibre: dict[str, Constant] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _fibres_have_it(self) -> Self:
        known = set(FibreSettings.model_fields) | {CURL_INDEX}
        for key in self.fibre:
            if key not in known:
                raise ValueError(f"fibre.{key}: a fibre has no such key")
        return self

    def applied(self, settings: TwinSettings, seed: int) -> TwinSettings:
        """Return the constants of one session.

        Raises
        ------
        ConfigError
            twin.toml has no such key, or the number drawn is none for it.
        """
        if self.standard and self.standard not in settings.standards:
            raise ConfigError(f"world: standard: there is no standard {self.standard!r}")
        if not self.session:
            return settings
        data = settings.model_dump()
        for key, constant in self.session.items():
            places = list(_places(data, key))
            if not places:
                raise ConfigError(f"world: session.{key}: twin.toml has no such key")
            value = _value(constant, f"world {key} {seed}", f"session.{key}")
            for table, name in places:
                table[name] = value
        return check_model("world: session", data, TwinSettings)

    def fibre_of(self, fibre: FibreSettings, key: str) -> FibreSettings:
        """Return a fibre with what this world has of it; `key` names seed, plate and fibre.

        Raises
        ------
        ConfigError
            A number drawn is none for a fibre.
        """
        drawn = {
            name: _value(constant, f"fibre {name} {key}", f"fibre.{name}")
            for name, constant in self.fibre.items()
        }
        if CURL_INDEX in drawn:
            turn = arc_deg(drawn.pop(CURL_INDEX)) * fibre.length_um / WHOLE_FIBRE_UM
            side = random.Random(f"curl {key}").choice((-1.0, 1.0))
            drawn["curl_deg"] = side * min(turn, MOST_CURL_DEG)
        if not drawn:
            return fibre
        return check_model("world: fibre", fibre.model_dump() | drawn, FibreSettings)


def arc_deg(curl_index: float) -> float:
    """Return by how much an even arc turns that is so much longer than its ends are apart."""
    low, high = 0.0, math.pi
    for _ in range(50):
        half = 0.5 * (low + high)
        if half > (1.0 + curl_index) * math.sin(half):
            high = half
        else:
            low = half
    return math.degrees(low + high)


def load_world(name: str, folder: Path) -> World:
    """Return a world by its name, from beside a twin.toml or from what ships with CoSMic.

    Raises
    ------
    ConfigError
        There is no such world, or its file is wrong or cannot be read.
    """
    if name == PLAIN:
        return World(about="As twin.toml has it.")
    for each in (folder, shipped_config_dir()):
        path = each / FOLDER / f"{name}.toml"
        try:
            found = path.is_file()
        except OSError as exc:  # such as a name that is too long for a file
            raise ConfigError(f"world: {name[:80]!r} cannot be read: {exc.strerror}") from exc
        if found:
            return load_model(path, World)
    known = ", ".join(world_names(folder))
    raise ConfigError(f"world: there is no world {name!r}; known: {known}")


def world_names(folder: Path) -> tuple[str, ...]:
    """Return the worlds there are for a folder with a twin.toml."""
    folders = folder / FOLDER, shipped_config_dir() / FOLDER
    return (PLAIN, *sorted({path.stem for each in folders for path in each.glob("*.toml")}))


def _value(constant: Constant, key: str, where: str) -> Any:
    if not isinstance(constant, Spread):
        return constant
    try:
        return constant.drawn(random.Random(key))
    except ValueError as exc:
        raise ConfigError(f"world: {where}: {exc}") from None


def _places(table: Mapping[str, Any], key: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the tables, with the name in them, that a dotted key stands for."""
    for name, value in table.items():
        if key == name and isinstance(table, dict):
            yield table, name
        elif isinstance(value, dict):
            for start in (f"{name}.", "*."):
                if key.startswith(start):
                    yield from _places(value, key.removeprefix(start))
                    break
