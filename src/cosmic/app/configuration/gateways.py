"""Tables ``[network.http]`` and ``[network.epics]`` of platform.toml: doors for other programs."""

import secrets
from dataclasses import dataclass
from ipaddress import ip_address
from socket import getaddrinfo
from typing import Annotated, Final, Literal

from pydantic import Field

from cosmic.frame.config import StrictModel, check_model
from cosmic.frame.errors import ConfigError

DEFAULT_PORT: Final = 8470
SHORTEST_TOKEN: Final = 16

Word = Literal["view", "call", "move"]


class HttpClient(StrictModel):
    """A program that may use HTTP, and how far."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")
    # In no record of a campaign, and in no message.
    token: str = Field(min_length=SHORTEST_TOKEN, exclude=True, repr=False)
    access: Word = "view"


class HttpSettings(StrictModel):
    """Table ``[network.http]``."""

    listen: str = ""
    certificate: str = ""
    key: str = ""
    approve: bool = False
    keep_control_s: float = Field(default=60.0, ge=1.0, le=600.0)
    client: Annotated[tuple[HttpClient, ...], Field(strict=False)] = ()

    @property
    def where(self) -> tuple[str, int]:
        """Address and port.

        Raises
        ------
        ConfigError
            They are none.
        """
        host, colon, port = self.listen.rpartition(":")
        if not colon:
            host, port = self.listen, str(DEFAULT_PORT)
        if not port.isdecimal() or int(port) > 65_535 or not host:
            raise ConfigError(f"HTTP: {self.listen!r} is not ADDRESS:PORT, such as 127.0.0.1:8470")
        return host.strip("[]"), int(port)


class EpicsSettings(StrictModel):
    """Table ``[network.epics]``."""

    prefix: str = Field(default="", pattern=r"^([A-Za-z0-9_:.-]{1,40})?$")
    interface: str = "127.0.0.1"
    port: int = Field(default=0, ge=0, le=65_535)
    write: bool = True
    approve: bool = False
    step_um: float = Field(default=0.5, gt=0.0, allow_inf_nan=False)
    pva: bool = False
    pva_port: int = Field(default=0, ge=0, le=65_535)


@dataclass(frozen=True, slots=True)
class Doors:
    """What a process opens beside its station; None for what it does not.

    Attributes
    ----------
    token : str
        The one that was made for this run, where the platform file names no client; or empty.
    """

    http: HttpSettings | None = None
    epics: EpicsSettings | None = None
    token: str = ""

    @property
    def asks_first(self) -> bool:
        """What moves waits for a person at every door: who asks at one leaves none open."""
        opened = (self.http, self.epics)
        return any(each is not None and each.approve for each in opened)


def doors(
    http: HttpSettings,
    epics: EpicsSettings,
    *,
    listen: str | None = None,
    prefix: str | None = None,
) -> Doors:
    """Return what is opened; what the command line says goes before the file.

    Raises
    ------
    ConfigError
        An address or a prefix is none, or reaches beyond this computer without what guards it.
    """
    token = ""
    chosen = http.model_copy(update={"listen": listen}) if listen else http
    if chosen.listen:
        _check_guarded(chosen)
        if not chosen.client:
            token = secrets.token_urlsafe(24)
            anybody = HttpClient(name="http", token=token, access="move")
            chosen = chosen.model_copy(update={"client": (anybody,)})
    given = {**epics.model_dump(), "prefix": prefix or epics.prefix}
    records = check_model("--epics", given, EpicsSettings)
    return Doors(chosen if chosen.listen else None, records if records.prefix else None, token)


def is_local(host: str) -> bool:
    """Return whether an address is reached from this computer alone."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _check_address(host: str) -> None:
    """Check that `host` is an address, or a name that stands for one."""
    try:
        getaddrinfo(host, None)
    except (OSError, UnicodeError) as exc:
        why = exc.strerror if isinstance(exc, OSError) else exc
        raise ConfigError(
            f"HTTP: {host!r} is not an address ({why}); give ADDRESS:PORT, such as 127.0.0.1:8470"
        ) from exc


def _check_guarded(settings: HttpSettings) -> None:
    names = [each.name for each in settings.client]
    if len(set(names)) != len(names):
        raise ConfigError("[[network.http.client]]: two have the same name")
    if bool(settings.certificate) != bool(settings.key):
        raise ConfigError("[network.http]: certificate and key belong together")
    host = settings.where[0]
    if is_local(host):
        return
    _check_address(host)
    if not settings.certificate or not settings.client:
        raise ConfigError(
            f"HTTP at {settings.listen} reaches beyond this computer: name certificate and key, "
            "and clients with their tokens, in [network.http] of the platform file"
        )
