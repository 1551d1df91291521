"""Which plate of a campaign is on the table, and whether another is to be put there."""

import logging
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from cosmic.autonomy.campaign.records import CampaignError, FibreRecord
from cosmic.autonomy.campaign.store import CampaignStore, is_written, write_whole
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate_change import PlateByPerson, PlateHandler
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotAvailable
from cosmic.frame.operation import Task

logger = logging.getLogger(__name__)

MOST_EMPTY: Final = 2
"""Plates in a row without any fibre that was begun with: then a person is to look."""

CONFIRMED: Final = "plate.confirmed"
"""File in a campaign's folder by which another program says that a plate is there."""

LOOK_WALL_S: Final = 0.2
"""How often it is looked for."""

PlateChangeProcedure = Callable[[PlateHandler, int], Procedure[HandlingContext]]
"""`build(handler, plate)` returns the procedure that has a plate put on the table."""


def confirm(folder: Path) -> int:
    """Say to the program that carries a campaign out that its plate is there; returns the number.

    Raises
    ------
    CampaignError
        No plate was asked for, no program carries the campaign out, or it cannot be written.
    """
    changes = CampaignReader(folder).plate_changes()
    if not changes or changes[-1].over:
        raise CampaignError(f"{folder}: no plate is waited for")
    if not is_written(folder):
        raise CampaignError(
            f"{folder}: no program carries this campaign out now. Start it again in this folder: "
            f"it asks for plate {changes[-1].plate} anew"
        )
    write_whole(folder / CONFIRMED, b"")
    return changes[-1].plate


def confirmed(folder: Path) -> bool:
    """Return whether another program said so, once."""
    try:
        (folder / CONFIRMED).unlink()
    except FileNotFoundError:
        return False
    return True


class _ConfirmedAnywhere:
    """Asks a person for a plate, who confirms it to this program or to another one.

    Parameters
    ----------
    by : PlateByPerson
        Who asks.
    folder : Path
        Of the campaign, where another program leaves word.
    """

    def __init__(self, by: PlateByPerson, folder: Path) -> None:
        self.name = by.name
        self.put, self.restore = by.put, by.restore
        self._by, self._folder = by, folder

    def change(self, plate: int) -> "_PlateAwaited":
        """Ask for a plate; what is returned ends once somebody says that it is there."""
        return _PlateAwaited(self._by.change(plate), self._taken(plate))

    def _taken(self, plate: int) -> Callable[[], None]:
        def take() -> None:
            if confirmed(self._folder):
                try:
                    self._by.put(plate)
                except NotAvailable as exc:
                    logger.warning("plate %d was confirmed, and is not there: %s", plate, exc)

        return take


class _PlateAwaited:
    """What ends when the plate is there that was asked for."""

    def __init__(self, asked: Task, take: Callable[[], None]) -> None:
        self._asked, self._take = asked, take
        self._next_wall_s = -math.inf
        self.add_callback = asked.add_callback

    @property
    def done(self) -> bool:
        """It is there, or is wanted no longer."""
        if not self._asked.done and WALL.now_s() >= self._next_wall_s:
            self._next_wall_s = WALL.now_s() + LOOK_WALL_S
            self._take()
        return self._asked.done

    def wait(self, timeout_s: float | None = None) -> object:
        """Wait for it, and raise what it failed with."""
        return self._asked.wait(timeout_s)

    def cancel(self) -> None:
        """Want it no longer."""
        self._asked.cancel()


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
        confirmed(store.folder)  # of an earlier plate: nobody has put this one there yet
        store.begin_plate(self._next, time_s=time_s, by=self._handler.name)
        self._pending = True
        handler: PlateHandler = self._handler
        if isinstance(handler, PlateByPerson):
            handler = _ConfirmedAnywhere(handler, store.folder)
        return self._build(handler, self._next)

    def there(self, store: CampaignStore, time_s: float) -> None:
        """Note that it is there."""
        store.finish_plate(self._next, time_s=time_s)
        self._pending = False
        self._next += 1
