"""Who may command motion: one holder at a time."""

import secrets
from abc import abstractmethod
from dataclasses import dataclass
from typing import Protocol

from typing_extensions import override

from cosmic.frame.errors import MoveRefused
from cosmic.frame.network.caller import current_call
from cosmic.frame.network.lease import StationLease


@dataclass(frozen=True, slots=True)
class LeaseHolder:
    """Who holds the lease.

    Attributes
    ----------
    name : str
        What windows show, such as "this program".
    token : str
        Proof that a command comes from the holder; empty when another process is it.
    """

    name: str
    token: str


class Guard(Protocol):
    """What lets a motion go on that another process commanded: a `DeadMan`; any thread."""

    @property
    @abstractmethod
    def expired(self) -> bool:
        """True when the motion has to end; it stays so."""

    @property
    @abstractmethod
    def why(self) -> str:
        """Why it has expired."""


class _NoRight(Guard):
    """Of a caller who has no right to move."""

    def __init__(self, why: str) -> None:
        self._why = why

    @property
    @override
    def expired(self) -> bool:
        return True

    @property
    @override
    def why(self) -> str:
        return self._why


class Lease:
    """The right to move: this process' own, unless a station gave it to another (`join`).

    The window, keys and scripts of this process share its token; `stop` never needs it. A
    command that another process sent has a `Guard` instead. Any thread.
    """

    def __init__(self, name: str = "this program") -> None:
        self._local = LeaseHolder(name, secrets.token_hex(8))
        self._station: StationLease | None = None

    def join(self, station: StationLease) -> None:
        """Let the lease of a station decide whether this process may move."""
        if not isinstance(station, StationLease):
            raise TypeError(f"lease must be that of a station, not {str(station)[:60]}")
        self._station = station

    @property
    def local_token(self) -> str:
        """Token of this process' own commands, whoever holds the lease."""
        return self._local.token

    @property
    def holder(self) -> LeaseHolder:
        """Who holds it now."""
        station = self._station
        state = station.state if station is not None else None
        if state is None or state.local:
            return self._local
        return LeaseHolder(state.holder, "")

    def guard(self) -> Guard | None:
        """Return what watches over a motion begun now in this thread; None: it is our own."""
        call, station = current_call(), self._station
        own = station.local_token if station is not None else ""
        if call is None or call.caller.token == own:
            return None
        if call.dead_man is not None:
            return call.dead_man
        if station is None:
            return _NoRight(f"{call.caller.name} has no right to move")
        try:
            return station.dead_man(call.caller.token)
        except MoveRefused as exc:
            return _NoRight(str(exc))
