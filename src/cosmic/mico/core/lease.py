"""Who may command motion: one holder at a time."""

import secrets
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LeaseHolder:
    """Who holds the lease.

    Attributes
    ----------
    name : str
        What windows show, such as "this program".
    token : str
        Proof that a command comes from the holder.
    """

    name: str
    token: str


class Lease:
    """The right to move, held by this process: its window, keys and scripts share it.

    Stations will make it pass between processes; `stop` never needs it.
    """

    def __init__(self, name: str = "this program") -> None:
        self._holder = LeaseHolder(name, secrets.token_hex(8))

    @property
    def holder(self) -> LeaseHolder:
        """Who holds it now."""
        return self._holder
