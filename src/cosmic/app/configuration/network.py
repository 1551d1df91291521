"""Section ``[network]`` of platform.toml: what a process offers to others, and to whom."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from cosmic.app.configuration.gateways import EpicsSettings, HttpSettings
from cosmic.frame.config import StrictModel
from cosmic.frame.errors import ConfigError, NotAvailable, needs_extra
from cosmic.frame.network.caller import Access
from cosmic.frame.network.station import checked_name

if TYPE_CHECKING:
    from cosmic.frame.network.line_settings import Certificates, Line

DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"

Names = Annotated[tuple[str, ...], Field(strict=False)]


class NetworkSettings(StrictModel):
    """Section ``[network]`` of platform.toml."""

    serve: bool = False
    name: str = ""
    listen: str = DEFAULT_ENDPOINT
    certificates: str = ""
    view: Names = ()
    call: Names = ()
    move: Names = ()
    http: HttpSettings = HttpSettings()
    epics: EpicsSettings = EpicsSettings()

    @property
    def access(self) -> dict[str, Access]:
        """What each client that is named may do; of one named twice, the most."""
        lists = ((self.view, Access.VIEW), (self.call, Access.CALL), (self.move, Access.MOVE))
        return {name: access for names, access in lists for name in names}


@dataclass(frozen=True, slots=True)
class Serving:
    """Under which name and where a station listens, and to whom.

    Attributes
    ----------
    line : Line
        Where it listens.
    access : mapping of str to Access
        What clients may do; empty: on this computer, everybody may do everything.
    """

    line: "Line"
    access: Mapping[str, Access]

    @property
    def name(self) -> str:
        """How others call the station."""
        return self.line.station

    def allowed(self, client: str) -> Access | None:
        """Return what the client of that name may do; None: it is not let in."""
        return self.access.get(client) if self.access else Access.MOVE


def require_network() -> None:
    """Check that what stations need is installed.

    Raises
    ------
    NotAvailable
        It is not; the text says what to do.
    """
    missing = [name for name in ("cryptography", "msgpack", "zenoh") if find_spec(name) is None]
    if missing:
        raise NotAvailable(f"{needs_extra('A station', 'net')} (missing: {', '.join(missing)})")


def serving(
    settings: NetworkSettings,
    platform: str,
    folder: Path,
    *,
    listen: str | None = None,
    name: str | None = None,
    certificates: Path | None = None,
) -> Serving:
    """Return how a process serves; what the command line says goes before the file.

    Parameters
    ----------
    platform : str
        Name of the platform; the station's, where none is given.
    folder : Path
        Where the platform file lies.

    Raises
    ------
    ConfigError
        The endpoint reaches beyond this computer without certificates, or a name is none.
    NotAvailable
        What stations need is not installed.
    """
    require_network()
    from cosmic.frame.network.line_settings import Line

    found = own_certificates(settings, folder, certificates)
    called = name or settings.name or _proven_name(found) or _as_name(platform)
    access = settings.access
    try:
        checked_name(called)
        for client in access:
            checked_name(client)
    except ValueError as exc:
        raise ConfigError(str(exc)) from exc
    endpoint = listen or settings.listen
    try:
        line = Line(endpoint, True, called, found, tuple(access))
    except ConfigError as exc:
        known = endpoint.startswith(("tcp/", "tls/"))
        raise ConfigError(f"{exc}\n{_WHAT_TO_DO}" if known else str(exc)) from exc
    return Serving(line, access)


_WHAT_TO_DO: Final = (
    "to serve other computers: cosmic certificates FOLDER --stations STATION,CLIENT; in section "
    '[network] of the platform file name the station\'s folder (certificates = "FOLDER/STATION") '
    'and its clients (move = ["CLIENT"]); then listen at tls/ADDRESS:PORT'
)


def own_certificates(
    settings: NetworkSettings, folder: Path, given: Path | None = None
) -> "Certificates | None":
    """Return the certificates of this side, where there are any.

    Raises
    ------
    ConfigError
        A file is missing.
    """
    where = given or (folder / settings.certificates if settings.certificates else None)
    if where is None:
        return None
    require_network()
    from cosmic.frame.network.certificates import station_certificates

    return station_certificates(where)


def _proven_name(certificates: "Certificates | None") -> str:
    if certificates is None:
        return ""
    from cosmic.frame.network.certificates import name_in

    return name_in(certificates)


def _as_name(title: str) -> str:
    """Return the name of a platform as it can stand in an address."""
    return re.sub(r"[^a-z0-9_-]+", "-", title.lower()).strip("-") or "station"
