"""Which plate of a campaign is on the table, and whether another is to be put there."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from cosmic.autonomy.campaign.records import CampaignError, FibreRecord
from cosmic.autonomy.campaign.store import CampaignStore, write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate_change import PlateByPerson, PlateHandler
from cosmic.autonomy.procedures.procedure import Procedure

MOST_EMPTY: Final = 2
"""Plates in a row without any fibre that was begun with: then a person is to look."""

CONFIRMED: Final = "plate.confirmed"
"""File in a campaign's folder by which another program says that a plate is there."""

PlateChangeProcedure = Callable[[PlateHandler, int], Procedure[HandlingContext]]
"""`build(handler, plate)` returns the procedure that has a plate put on the table."""


def confirm(folder: Path) -> int:
    """Say to the program that carries a campaign out that its plate is there; returns the number.

    Raises
    ------
    CampaignError
        No plate was asked for, or it cannot be written.
    """
    changes = CampaignReader(folder).plate_changes()
    if not changes or changes[-1].over:
        raise CampaignError(f"{folder}: no plate is waited for")
    write_whole(folder / CONFIRMED, b"")
    return changes[-1].plate


def confirmed(folder: Path) -> bool:
    """Return whether another program said so, once."""
    try:
        (folder / CONFIRMED).unlink()
    except FileNotFoundError:
        return False
    return True


class CampaignPlates:
    """The plates of one campaign; belongs to its thread.

    Parameters
    ----------
    most : int
        How many are to be worked off.
    handler : PlateHandler
        Who puts them there.
    build : callable
        Makes the procedure for it.
    number : int
        The one that is there.
    pending : bool
        It was asked for, and nobody knows whether it is there.
    """

    def __init__(
        self,
        most: int,
        handler: PlateHandler,
        build: PlateChangeProcedure,
        *,
        number: int = 1,
        pending: bool = False,
    ) -> None:
        self._most = most
        self._handler = handler
        self._build = build
        self._next = number if pending else number + 1
        self._pending = pending

    @property
    def number(self) -> int:
        """The one that is there, from 1 on; while one is waited for, the one before."""
        return self._next - 1

    @property
    def pending(self) -> bool:
        """Whether a plate was asked for, and nobody knows whether it is there."""
        return self._pending

    @property
    def request(self) -> str:
        """What a person is asked for; empty for nothing."""
        return self._handler.request if isinstance(self._handler, PlateByPerson) else ""

    def confirm(self) -> None:
        """Say that the plate is there which was asked for; any thread.

        Raises
        ------
        NotAvailable
            None was asked for, or it cannot be there.
        """
        self._handler.put(self._next)

    def restore(self) -> None:
        """Have the plate there with which the campaign goes on."""
        self._handler.restore(self.number)

    def why_no_other(self, fibres: Sequence[FibreRecord]) -> str:
        """Return why no further plate is put there; empty: one is."""
        if self.number >= self._most:
            return "no further plate"
        begun = {each.plate for each in fibres}
        last = range(self._next - MOST_EMPTY, self._next)
        if last.start >= 1 and not begun.intersection(last):
            return f"no fibre was found on plates {last.start} to {last.stop - 1}: look at them"
        return ""

    def change(self, store: CampaignStore, time_s: float) -> Procedure[HandlingContext]:
        """Note that the next plate is asked for, and return the procedure that has it put there."""
        store.begin_plate(self._next, time_s=time_s, by=self._handler.name)
        self._pending = True
        return self._build(self._handler, self._next)

    def there(self, store: CampaignStore, time_s: float) -> None:
        """Note that it is there."""
        store.finish_plate(self._next, time_s=time_s)
        self._pending = False
        self._next += 1
