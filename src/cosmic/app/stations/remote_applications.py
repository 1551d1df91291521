"""The applications that run in other processes, as this one uses them."""

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from threading import Lock
from typing import TYPE_CHECKING, Any, Final, TypeVar

from cosmic.app.configuration.platform_file import KNOWN_APPLICATIONS
from cosmic.app.stations.address import StationAddress, remember_stations
from cosmic.app.stations.remote_station import RemoteStation
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.application import GuiFactory
from cosmic.frame.declaration import Declared
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.application import RemoteApplication, remote_api
from cosmic.mico.api.client import MicoClient
from cosmic.vico.api.vico import Vico

if TYPE_CHECKING:
    from cosmic.frame.network.line_settings import Certificates

D = TypeVar("D", bound=Declared)

_DECLARED: Final[Mapping[str, tuple[str, type[Declared]]]] = {
    "daqco": ("DAQCo", Daqco),
    "vico": ("ViCo", Vico),
}
"""The applications of which a declaration suffices: what the operator reads, and the class."""


@dataclass(frozen=True)
class RemoteApplications:
    """What other stations host for this process.

    Attributes
    ----------
    stations : tuple of RemoteStation
        To which there is a line.
    host_of : mapping of str to RemoteStation
        By application, the station that hosts it.
    """

    stations: tuple[RemoteStation, ...] = ()
    host_of: Mapping[str, RemoteStation] = field(default_factory=dict)
    _brought: dict[str, RemoteApplication[Any]] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    def application(self, name: str, policy: FailurePolicy, gui: GuiFactory | None) -> Any:
        """Return the application of that name as it is used from here; None if it is not there."""
        station = self.host_of.get(name)
        if station is None:
            return None
        if name in _DECLARED:
            title, kind = _DECLARED[name]
            return RemoteApplication(
                title, kind, station.transport, policy, name=name, gui_factory=gui
            )
        return MicoClient(station.transport, policy, gui_factory=gui)

    def brought(self, name: str, kind: type[D], policy: FailurePolicy) -> D | None:
        """Return what an application of another package offers at a station; None if none hosts it.

        Raises
        ------
        TypeError
            Something that `kind` declares cannot be checked.
        """
        hosts = (each for each in self.stations if name in each.facts.applications)
        station = next(hosts, None)
        if station is None or name in KNOWN_APPLICATIONS:
            return None
        with self._lock:
            made = self._brought.get(name)
            if made is None:
                made = RemoteApplication(name, kind, station.transport, policy, name=name)
                self._brought[name] = made
                made.initialize()
        return remote_api(made, kind)

    def close(self) -> None:
        """End every line; any state."""
        with ExitStack() as at_end:
            for station in self.stations:
                at_end.callback(station.close)
            for application in self._brought.values():
                at_end.callback(application.shut_down)


def open_stations(
    addresses: Sequence[StationAddress],
    policy: FailurePolicy,
    *,
    program: str,
    certificates: "Certificates | None" = None,
    wanted: Sequence[str] = KNOWN_APPLICATIONS,
) -> RemoteApplications:
    """Connect to stations; whoever gets them closes them.

    Parameters
    ----------
    program : str
        What kind of program this is, such as "window"; with the number of its process it is how
        stations know it, unless it has certificates with a name.
    wanted : sequence of str
        Which of their applications are used.

    Raises
    ------
    ConfigError
        Two of them host the same application, or an address is wrong.
    StationAway
        One does not answer.
    """
    names = [each.name for each in addresses]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"{name}: this station is named twice")
    client = _client_name(program, certificates)
    with ExitStack() as undo:
        stations = []
        host_of: dict[str, RemoteStation] = {}
        for address in addresses:
            station = RemoteStation(address, client, policy, certificates)
            undo.callback(station.close)
            station.open()
            stations.append(station)
            for name in station.facts.applications:
                if name not in wanted:
                    continue
                if name in host_of:
                    raise ConfigError(f"both {host_of[name].name} and {station.name} host {name}")
                host_of[name] = station
        undo.pop_all()
    remember_stations(addresses)
    return RemoteApplications(tuple(stations), host_of)


def _client_name(program: str, certificates: "Certificates | None") -> str:
    if certificates is None:
        return f"{program}-{os.getpid()}"
    from cosmic.frame.network.certificates import name_in

    return name_in(certificates)
