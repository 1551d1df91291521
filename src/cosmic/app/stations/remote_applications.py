"""The applications that run in other processes, as this one uses them."""

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from cosmic.app.configuration.platform_file import KNOWN_APPLICATIONS
from cosmic.app.stations.address import StationAddress, remember_stations
from cosmic.app.stations.remote_station import RemoteStation
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.application import GuiFactory
from cosmic.frame.declaration import Declared
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.application import RemoteApplication
from cosmic.mico.api.client import MicoClient
from cosmic.vico.api.vico import Vico

if TYPE_CHECKING:
    from cosmic.frame.network.line_settings import Certificates

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

    def close(self) -> None:
        """End every line; any state."""
        with ExitStack() as at_end:
            for station in self.stations:
                at_end.callback(station.close)


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
