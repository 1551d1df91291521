"""A station elsewhere: the line to it, who may move there, and what it hosts."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING, Final

from cosmic.app.configuration.network import require_network
from cosmic.app.stations.address import StationAddress
from cosmic.app.stations.facts import ITSELF, StationFacts
from cosmic.frame.errors import ConfigError, CosmicError, ProtocolError
from cosmic.frame.events import Event, Unsubscribe, notify
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.lease import LeaseState
from cosmic.frame.network.station import LEASE_TOPIC, checked_name
from cosmic.frame.network.transport import Presence, Rule

if TYPE_CHECKING:
    from cosmic.frame.network.client_side_connection import ClientSideConnection
    from cosmic.frame.network.line_settings import Certificates

logger = logging.getLogger(__name__)

CONNECT_LIMIT_S: Final = 5.0
"""How long a station may take to answer at the start."""

ControlListener = Callable[["StationControl"], object]


@dataclass(frozen=True, slots=True)
class StationControl:
    """Who may move things at a station, as seen from here.

    Attributes
    ----------
    station : str
        Its name.
    holder : str
        Who may move; empty while it is not known.
    here : bool
        It is this program.
    offered : bool
        This program may take it.
    away : str
        Why the station cannot be reached; empty while it can.
    """

    station: str
    holder: str = ""
    here: bool = False
    offered: bool = False
    away: str = ""


class RemoteStation:
    """One station elsewhere, as this process uses it; any thread.

    Parameters
    ----------
    client : str
        How the station knows this program.

    Raises
    ------
    ConfigError
        The endpoint reaches beyond this computer without certificates.
    NotAvailable
        What stations need is not installed.
    """

    def __init__(
        self,
        address: StationAddress,
        client: str,
        policy: FailurePolicy,
        certificates: "Certificates | None" = None,
    ) -> None:
        require_network()
        try:
            checked_name(address.name)
        except ValueError as exc:
            raise ConfigError(f"{address.name}={address.endpoint}: {exc}") from exc
        from cosmic.frame.network.client_side_connection import ClientSideConnection
        from cosmic.frame.network.line_settings import Line
        from cosmic.frame.network.zenoh_wire import ZenohWire

        self._address = address
        self._client = client
        line = Line(address.endpoint, False, address.name, certificates)
        self._connection = ClientSideConnection(
            address.name, client, lambda: ZenohWire(line), policy
        )
        self._background = JobQueue(f"calls to {address.name}", policy)
        self._lock = Lock()
        self._facts: StationFacts | None = None
        self._lease: LeaseState | None = None
        self._away = "not connected yet"
        self._control_changed: Event[StationControl] = Event()
        self._undo: list[Callable[[], object]] = []

    @property
    def name(self) -> str:
        """Its name."""
        return self._address.name

    @property
    def endpoint(self) -> str:
        """Where it listens."""
        return self._address.endpoint

    @property
    def transport(self) -> "ClientSideConnection":
        """The line to it."""
        return self._connection

    @property
    def facts(self) -> StationFacts:
        """What it said of itself when it was first reached."""
        if self._facts is None:
            raise StationAway(f"{self.name} was not reached yet")
        return self._facts

    def open(self) -> None:
        """Connect and learn what it hosts; afterwards the line mends itself.

        Raises
        ------
        StationAway
            It does not answer.
        """
        self._connection.start()
        if not self._connection.wait_until_here(CONNECT_LIMIT_S):
            raise StationAway(
                f"{self.name} at {self.endpoint} does not answer: {self._connection.state.why}. "
                "Is it running, under this name?"
            )
        facts = self._connection.call(ITSELF, "facts")
        if not isinstance(facts, StationFacts):
            raise ProtocolError(f"{self.name} at {self.endpoint} is not a station of CoSMic")
        self._facts = facts
        subscription = self._connection.subscribe(LEASE_TOPIC, Rule.ALL, self._on_lease)
        self._undo = [subscription.close, self._connection.presence(self._on_presence)]

    # Who may move there

    @property
    def control(self) -> StationControl:
        """Who may move things there."""
        with self._lock:
            lease, away = self._lease, self._away
        if away or lease is None:
            return StationControl(self.name, away=away)
        here = self._connection.holds_lease and lease.holder == self._client
        offered = lease.offered and lease.local
        return StationControl(self.name, lease.holder, here=here, offered=offered)

    def on_control(self, listener: ControlListener) -> Unsubscribe:
        """Call `listener` now and at each change; returns the function that ends it."""
        unsubscribe = self._control_changed.subscribe(listener)
        notify(listener, self.control)
        return unsubscribe

    def take_control(self) -> None:
        """Take the right to move things there, or keep it.

        Raises
        ------
        MoveRefused
            Another holds it, or the operator there keeps it (`NO_LEASE`).
        StationAway
            It cannot be reached.
        """
        self._connection.take_lease()
        self._ask_lease()

    def release_control(self) -> None:
        """Give the right to move back; what moves by it stops.

        Raises
        ------
        StationAway
            It cannot be reached, and takes it back by itself.
        """
        self._connection.release_lease()
        self._ask_lease()

    def later(self, what: Callable[[], object], failed: Callable[[CosmicError], object]) -> None:
        """Do `what` in a thread of the station's own, for windows, which must not wait."""
        self._background.submit(what, f"a call to {self.name}").when_failed(failed)

    def close(self) -> None:
        """Give control back and end the line; any state."""
        for undo in self._undo:
            undo()
        self._undo = []
        self._background.request_end()
        self._background.join()
        self._connection.close()

    # What comes from there

    def _on_lease(self, state: object) -> None:
        if isinstance(state, LeaseState):
            with self._lock:
                self._lease = state
            self._publish()

    def _on_presence(self, presence: Presence) -> None:
        with self._lock:
            self._away = "" if presence.here else presence.why or "it cannot be reached"
            self._lease = self._lease if presence.here else None
        if presence.here:
            self.later(self._ask_lease, _say_later)
        self._publish()

    def _ask_lease(self) -> None:
        self._on_lease(self._connection.call(ITSELF, "lease"))

    def _publish(self) -> None:
        self._control_changed.emit(self.control)


def _say_later(error: CosmicError) -> None:
    logger.info("the holder of the control is unknown: %s", error)
