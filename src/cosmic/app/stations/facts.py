"""What a station tells of itself to whoever connects."""

from dataclasses import dataclass
from typing import Final

from cosmic.frame.network.lease import LeaseState, StationLease
from cosmic.frame.network.remote import remote
from cosmic.frame.network.transfer import transferable

ITSELF: Final = "station"
"""Name under which a station tells of itself."""


@transferable
@dataclass(frozen=True, slots=True)
class StationFacts:
    """What a station says of itself.

    Attributes
    ----------
    platform : str
        Name of its platform.
    simulated : bool
        No hardware moves there.
    rate : float
        How many times faster than the wall its clock runs at most.
    applications : tuple of str
        What it hosts.
    software : str
        Name and version of its program.
    """

    platform: str
    simulated: bool
    rate: float
    applications: tuple[str, ...]
    software: str


class StationSide:
    """What a station tells of itself, to everybody."""

    def __init__(self, facts: StationFacts, lease: StationLease) -> None:
        self._facts = facts
        self._lease = lease

    @property
    @remote(reads=True)
    def facts(self) -> StationFacts:
        """What the station says of itself."""
        return self._facts

    @property
    @remote(reads=True)
    def lease(self) -> LeaseState:
        """Who may move now."""
        return self._lease.state
