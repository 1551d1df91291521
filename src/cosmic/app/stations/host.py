"""Offers the applications of this process to others."""

import logging
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import fields
from typing import TYPE_CHECKING, Final, Protocol, runtime_checkable

from cosmic.app.audit import PlatformAudit
from cosmic.app.configuration.gateways import Doors
from cosmic.app.configuration.network import Serving
from cosmic.app.gateways.approvals import Approvals
from cosmic.app.gateways.campaigns import CAMPAIGNS, Campaigns
from cosmic.app.gateways.opened import Gateways
from cosmic.app.platform import Platform
from cosmic.app.stations.facts import ITSELF, StationFacts, StationSide
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.declaration import Declared, declaration_of
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.host import Host
from cosmic.frame.network.lease import StationLease
from cosmic.frame.network.station import Station
from cosmic.frame.version import __version__
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.vico import Vico

if TYPE_CHECKING:
    from cosmic.app.rig import Rig
    from cosmic.frame.network.wire import Wire

logger = logging.getLogger(__name__)

APPROVALS: Final = "approvals"


@runtime_checkable
class _Closing(Protocol):
    def close(self) -> None: ...


class StationHost:
    """A platform as a station that others reach; `close` it in every case.

    Only what this process hosts is offered: what it reaches elsewhere is not passed on.

    Parameters
    ----------
    doors : Doors
        What is opened for programs that are not CoSMic.
    audit : PlatformAudit or None
        Writes what clients command.

    Raises
    ------
    ConfigError
        There is nothing to offer.
    StationAway
        It cannot listen there.
    NotAvailable
        What a door needs is not installed, or it cannot listen there.
    """

    def __init__(
        self,
        platform: Platform,
        how: Serving,
        doors: Doors | None = None,
        audit: PlatformAudit | None = None,
    ) -> None:
        # Imported here: they need the extra `net`.
        from cosmic.frame.network.server_listener import ServerListener

        sides = _sides(platform)
        if not sides:
            raise ConfigError(f"{how.name}: no application runs here that could be served")
        self._how = how
        self._asks_first = doors is not None and doors.asks_first
        lease = StationLease(f"the operator at {how.name}")
        self._station = Station(how.name, platform.policy, lease)
        self._applications = tuple(sides)
        with ExitStack() as undo:
            for name, side in sides.items():
                if isinstance(side, _Closing):
                    undo.callback(side.close)
                self._station.host(name, side)
            facts = _facts(platform, self._applications)
            self._station.host(ITSELF, StationSide(facts, lease))
            listener = ServerListener(self._station, _opened(how), how.allowed)
            undo.callback(listener.shut_down)
            listener.start()
            hosts = {name: side for name, side in sides.items() if isinstance(side, Host)}
            self._approvals = Approvals(platform.policy)
            undo.callback(self._approvals.close)
            approvals = Host(APPROVALS, self._approvals)
            undo.callback(approvals.close)
            self._station.host(APPROVALS, approvals)
            self._campaigns = self._offered_campaigns(sides, platform.policy, undo)
            if self._campaigns is not None:
                hosts[CAMPAIGNS] = Host(CAMPAIGNS, self._campaigns)
                undo.callback(hosts[CAMPAIGNS].close)
                self._station.host(CAMPAIGNS, hosts[CAMPAIGNS])
            if audit is not None:  # when all is hosted that can be called
                undo.callback(audit.join(self._station, self._approvals))
            said = {each.name: getattr(facts, each.name) for each in fields(facts)}
            self._gateways = Gateways(
                self._station, hosts, said, doors or Doors(), self._approvals.ask
            )
            undo.callback(self._gateways.close)
            self._undo = undo.pop_all()
        logger.info("%s", self.address)

    @staticmethod
    def _offered_campaigns(
        sides: Mapping[str, object], policy: FailurePolicy, undo: ExitStack
    ) -> Campaigns | None:
        """Return campaigns where all that they need runs here."""
        daqco = sides.get("daqco")
        if not sides.keys() >= {"mico", "daqco", "vico"} or not isinstance(daqco, Host):
            return None
        served = daqco.served
        if not isinstance(served, Daqco):
            return None
        made = Campaigns(lambda: served.directory / CAMPAIGNS, policy)
        undo.callback(made.close)
        return made

    def use_rig(self, rig: "Rig") -> None:
        """Have campaigns that others start run on `rig`, beside what else it runs."""
        if self._campaigns is not None:
            self._campaigns.use(rig.campaign)

    @property
    def address(self) -> str:
        """Its name, what it serves, and where: one line."""
        served = ", ".join(self._applications)
        return f"{self._how.name} serves {served} at {self._how.line.endpoint}"

    @property
    def approvals(self) -> Approvals:
        """What programs want to move, where that waits for a person."""
        return self._approvals

    @property
    def asks_first(self) -> bool:
        """What a program moves over HTTP or EPICS waits for a person."""
        return self._asks_first

    @property
    def gateways(self) -> tuple[str, ...]:
        """Where programs that are not CoSMic reach it, a line each."""
        return self._gateways.lines

    @property
    def name(self) -> str:
        """How others call it."""
        return self._how.name

    @property
    def lease(self) -> StationLease:
        """Who may move."""
        return self._station.lease

    def close(self) -> None:
        """Stop what clients have set in motion, send them away and answer no more; any state."""
        self._undo.close()


def _opened(how: Serving) -> "Wire":
    from cosmic.frame.network.zenoh_wire import ZenohWire

    try:
        return ZenohWire(how.line)
    except StationAway as exc:
        logger.debug("%s", exc)
        raise StationAway(
            f"{how.name} cannot listen at {how.line.endpoint}: the address is not one of this "
            "computer, or another program listens there already; choose another with --listen"
        ) from exc


def _sides(platform: Platform) -> dict[str, object]:
    """Return what answers for each application that runs in this process."""
    sides: dict[str, object] = {}
    for name, application in platform.own.items():
        if isinstance(application, MicoApplication):
            sides[name] = Host(name, Mico(application, "station"))
        elif isinstance(application, DaqcoApplication):
            sides[name] = Host(name, Daqco(application))
        elif isinstance(application, VicoApplication):
            sides[name] = Host(name, Vico(application))
        else:
            offered = application.interface
            if isinstance(offered, Declared) and _can_be_served(name, offered):
                sides[name] = Host(name, offered)
    return sides


def _can_be_served(name: str, offered: Declared) -> bool:
    """Return whether what an application of another package declares can travel."""
    try:
        declaration_of(type(offered))
    except TypeError as exc:  # the others are served without it
        logger.error("application %s is not served: %s", name, exc)
        return False
    return True


def _facts(platform: Platform, applications: tuple[str, ...]) -> StationFacts:
    return StationFacts(
        platform=platform.file.platform.name,
        simulated=platform.simulated,
        rate=platform.clock.rate,
        applications=applications,
        software=f"CoSMic {__version__}",
    )
