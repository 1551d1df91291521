"""Where a station listens."""

import argparse
from dataclasses import dataclass

from cosmic.frame.errors import ConfigError


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
        """Read ``fibervision=tcp/127.0.0.1:7448``.

        Raises
        ------
        ConfigError
            It does not read so.
        """
        name, _, endpoint = text.partition("=")
        if not (name and endpoint):
            raise ConfigError(
                f"{text!r} is no station; it reads NAME=tcp/127.0.0.1:PORT or NAME=tls/HOST:PORT"
            )
        return cls(name, endpoint)


def stations_of(chosen: argparse.Namespace) -> tuple[StationAddress, ...]:
    """Return the stations that ``--connect`` names; raises `ConfigError`."""
    return tuple(StationAddress.read(each) for each in chosen.connect or ())
