"""The journal: what is about to be done is written down before it is done."""

from collections.abc import Callable
from typing import Final

from cosmic.autonomy.campaign.records import Value
from cosmic.autonomy.campaign.store import CampaignStore

FELL: Final = "fell"
"""Phase of a line about a measured fibre that lies on the plate again, nobody knows where."""


class Journal:
    """Lines of the journal with the time and the fibre in hand; any thread.

    Attributes
    ----------
    fibre : int or None
        The fibre in treatment.
    """

    def __init__(self, store: CampaignStore, now_s: Callable[[], float]) -> None:
        self.fibre: int | None = None
        self._store = store
        self._now_s = now_s

    def note(self, operation: str, phase: str, **payload: Value) -> None:
        """Write what is about to happen, such as `note("descend", "move", left_z_um=-850.0)`.

        Raises
        ------
        CampaignError
            It cannot be written: then it must not be done.
        """
        self._store.note(operation, phase, payload, time_s=self._now_s(), fibre=self.fibre)
