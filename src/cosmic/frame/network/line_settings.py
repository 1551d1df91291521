"""Where a line goes, who may use it, and how the engine is set for that."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cosmic.frame.errors import ConfigError
from cosmic.frame.network.addresses import (
    asks,
    client_liveliness,
    greetings,
    session_events,
)
from cosmic.frame.network.codec import MESSAGE_LIMIT_BYTES
from cosmic.frame.network.messages import PUBLISH_LIMIT_BYTES

LINE_LEASE_MS: Final = 1000
_COMMON: Final[dict[str, Any]] = {
    "mode": "peer",
    "connect/exit_on_failure": False,
    "connect/timeout_ms": -1,
    "connect/retry": {"period_init_ms": 200, "period_max_ms": 500, "period_increase_factor": 1.5},
    "listen/exit_on_failure": True,
    "scouting/delay": 0,
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "adminspace/enabled": False,
    "plugins_loading/enabled": False,
    "transport/link/tx/lease": LINE_LEASE_MS,
    "transport/link/tx/queue/congestion_control/block/wait_before_close": 1_000_000,  # us
    "transport/unicast/max_sessions": 64,
    "transport/unicast/open_timeout": 2000,
    "transport/unicast/accept_timeout": 2000,
}
_LOOPBACK: Final = ("127.0.0.1", "localhost", "[::1]")


@dataclass(frozen=True, slots=True)
class Certificates:
    """Files that prove who a station is, as `make_certificates` writes them.

    Attributes
    ----------
    authority : Path
        Certificate of the authority that both sides trust.
    certificate, key : Path
        This side's own.
    """

    authority: Path
    certificate: Path
    key: Path


@dataclass(frozen=True, slots=True)
class Line:
    """One end of a line.

    Attributes
    ----------
    endpoint : str
        Such as ``tcp/127.0.0.1:7450`` or, with certificates, ``tls/192.168.1.5:7450``.
    listens : bool
        True for a station, False for its client.
    station : str
        Name of the station.
    certificates : Certificates or None
        Needed for ``tls/``, without which nothing beyond this computer is reached.
    clients : tuple of str
        For a station with certificates: the names that it lets in.
    shared_memory : bool
        Large messages between processes of one computer go through shared memory.

    Raises
    ------
    ConfigError
        The endpoint is none, or reaches beyond this computer without certificates, or a station
        with certificates lets nobody in.
    """

    endpoint: str
    listens: bool
    station: str
    certificates: Certificates | None = None
    clients: tuple[str, ...] = ()
    shared_memory: bool = True

    def __post_init__(self) -> None:
        _check_endpoint(self.endpoint, self.certificates)
        if self.listens and self.encrypted and not self.clients:
            raise ConfigError(f"{self.endpoint}: list the clients whose certificates are let in")

    @property
    def encrypted(self) -> bool:
        """True for TLS with certificates on both sides."""
        return self.endpoint.startswith("tls/")

    @property
    def host(self) -> str:
        """Name or address of the station's computer, without the brackets of IPv6."""
        return self.endpoint.partition("/")[2].rpartition(":")[0].strip("[]")

    def settings(self) -> dict[str, Any]:
        """Return what differs from the engine's own settings, which listen everywhere."""
        limit_bytes = PUBLISH_LIMIT_BYTES if self.listens else MESSAGE_LIMIT_BYTES
        wanted = _COMMON | {
            "listen/endpoints": [self.endpoint] if self.listens else [],
            "connect/endpoints": [] if self.listens else [self.endpoint],
            "transport/link/protocols": [self.endpoint.partition("/")[0]],
            "transport/link/rx/max_message_size": limit_bytes + 65536,
            # Between computers it cannot be used, and it would be a second way in.
            "transport/shared_memory/enabled": self.shared_memory and not self.encrypted,
        }
        if self.encrypted and self.certificates is not None:
            wanted |= _tls(self.certificates)
            if self.listens:
                wanted["access_control"] = _access_control(self.station, self.clients)
        return wanted


def _check_endpoint(endpoint: str, certificates: Certificates | None) -> None:
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if protocol not in ("tcp", "tls") or not host or not port.isdecimal():
        raise ConfigError(
            f"{endpoint!r} is not an endpoint; it reads tcp/127.0.0.1:PORT or tls/HOST:PORT"
        )
    if protocol == "tls":
        if certificates is None:
            raise ConfigError(f"{endpoint}: tls needs certificates")
    elif host not in _LOOPBACK:
        raise ConfigError(
            f"{endpoint}: beyond this computer only tls with certificates is allowed; "
            "make them and write tls/ in place of tcp/"
        )


def _tls(certificates: Certificates) -> dict[str, Any]:
    own, key = str(certificates.certificate), str(certificates.key)
    return {
        "transport/link/tls": {
            "root_ca_certificate": str(certificates.authority),
            "enable_mtls": True,
            "verify_name_on_connect": True,
            "listen_certificate": own,
            "listen_private_key": key,
            "connect_certificate": own,
            "connect_private_key": key,
        }
    }


def _access_control(station: str, clients: tuple[str, ...]) -> dict[str, Any]:
    """Each client reaches only the keys of its own name; whatever is not listed is denied."""
    rules = []
    for name in clients:
        its_own = f"{name}/*"
        topics = (greetings(station, its_own), asks(station, its_own))
        rules += [
            _rule(f"{name} asks", ["query"], "ingress", *topics),
            _rule(f"{name} is answered", ["reply"], "egress", *topics),
            _rule(
                f"{name} finds where to ask",
                ["declare_queryable"],
                "egress",
                greetings(station),
                asks(station, its_own),
            ),
            _rule(
                f"{name} shows itself",
                ["liveliness_token"],
                "ingress",
                client_liveliness(station, its_own),
            ),
            _rule(
                f"{name} is looked for",
                ["declare_liveliness_subscriber", "liveliness_query"],
                "egress",
                client_liveliness(station),
            ),
            _rule(
                f"{name} subscribes",
                ["declare_subscriber"],
                "ingress",
                session_events(station, its_own),
                f"cosmic/{station}/topic/**",
            ),
            _rule(
                f"{name} receives",
                ["put"],
                "egress",
                session_events(station, its_own),
                f"cosmic/{station}/topic/**",
            ),
        ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in clients],
        "policies": [
            {
                "rules": [each["id"] for each in rules if each["id"].startswith(f"{name} ")],
                "subjects": [name],
            }
            for name in clients
        ],
    }


def _rule(title: str, messages: list[str], flow: str, *keys: str) -> dict[str, Any]:
    return {
        "id": title,
        "messages": messages,
        "flows": [flow],
        "permission": "allow",
        "key_exprs": list(keys),
    }
