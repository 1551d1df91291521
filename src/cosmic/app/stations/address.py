"""Where stations listen, and those that were used before."""

import argparse
import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tomlkit
from pydantic import Field
from PySide6.QtCore import QStandardPaths

from cosmic.frame.config import StrictModel, load_model
from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import changing, write_whole

logger = logging.getLogger(__name__)

_HEAD: Final = """\
# The stations that were used from this account, with where they listen. CoSMic adds to this file
# when a station answers; what you change or remove stays so.

[stations]
"""


class _KnownStations(StrictModel):
    stations: dict[str, str] = Field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class StationAddress:
    """Name of a station, and where it listens.

    Attributes
    ----------
    endpoint : str
        Such as ``tcp/127.0.0.1:7448``.
    """

    name: str
    endpoint: str

    @classmethod
    def read(cls, text: str) -> "StationAddress":
        """Read ``fibervision=tcp/127.0.0.1:7448``, or the name alone of a station used before.

        Raises
        ------
        ConfigError
            It does not read so, or no station of this name was used before.
        """
        name, equals, endpoint = text.partition("=")
        if name and not equals:
            return cls.known(name)
        if not (name and endpoint):
            raise ConfigError(
                f"{text!r} is not a station; it reads NAME=tcp/127.0.0.1:PORT or NAME=tls/HOST:PORT"
            )
        return cls(name, endpoint)

    @classmethod
    def known(cls, name: str) -> "StationAddress":
        """Return the address at which a station was used last.

        Raises
        ------
        ConfigError
            No station of this name was used before, or the file that keeps them is damaged.
        """
        stations = known_stations()
        if name not in stations:
            raise ConfigError(
                f"no station {name!r} was used before; used were: {', '.join(stations) or 'none'}. "
                f"Give its address: {name}=tcp/127.0.0.1:PORT or {name}=tls/HOST:PORT"
            )
        return cls(name, stations[name])


def stations_of(chosen: argparse.Namespace) -> tuple[StationAddress, ...]:
    """Return the stations that ``--connect`` names; raises `ConfigError`."""
    return tuple(StationAddress.read(each) for each in chosen.connect or ())


def endpoints_of(chosen: argparse.Namespace) -> dict[str, str]:
    """Return the same by name, as `cosmic.connect` takes them.

    Raises
    ------
    ConfigError
        A station is named twice, or as `stations_of`.
    """
    found: dict[str, str] = {}
    for each in stations_of(chosen):
        if each.name in found:
            raise ConfigError(f"{each.name}: this station is named twice")
        found[each.name] = each.endpoint
    return found


def stations_file() -> Path:
    """Return where the stations of this account are kept."""
    location = QStandardPaths.StandardLocation.GenericConfigLocation
    return Path(QStandardPaths.writableLocation(location)) / "CoSMic" / "stations.toml"


def known_stations() -> dict[str, str]:
    """Return the endpoints of the stations that were used before, by name.

    Raises
    ------
    ConfigError
        The file that keeps them is damaged.
    """
    path = stations_file()
    return dict(load_model(path, _KnownStations).stations) if path.exists() else {}


def remember_stations(addresses: Iterable[StationAddress]) -> None:
    """Keep stations that answered; where that is not possible a warning is logged."""
    path = stations_file()
    fresh = {each.name: each.endpoint for each in addresses}
    try:
        if fresh.items() <= known_stations().items():
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        with changing(path):
            text = path.read_text(encoding="utf-8") if path.exists() else _HEAD
            document = tomlkit.parse(text)  # which keeps the user's comments
            document.setdefault("stations", tomlkit.table()).update(fresh)
            write_whole(path, document.as_string())
    except (ConfigError, OSError) as exc:
        logger.warning("%s: the stations in use are not remembered: %s", path, exc)
