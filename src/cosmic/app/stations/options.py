"""What is said of stations on the command line; loads nothing."""

from dataclasses import dataclass
from pathlib import Path

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


@dataclass(frozen=True)
class ServeOptions:
    """What the command line says about a station.

    Attributes
    ----------
    applications : tuple of str
        Which to host; empty: all of the platform file.
    listen, name, certificates
        In place of what the platform file says in ``[network]``.
    stations : tuple of StationAddress
        Others that this one uses, so that a force limit here stops the motion there.
    """

    applications: tuple[str, ...] = ()
    config: Path | None = None
    listen: str | None = None
    name: str | None = None
    certificates: Path | None = None
    stations: tuple[StationAddress, ...] = ()
    rate: float = 1.0
    seed: int = 0
    cold: bool = False
    sample: str | None = None
    truth: Path | None = None
