"""A movement of one axis that takes those linked to it along."""

from collections.abc import Mapping
from threading import Lock

from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion
from cosmic.mico.core.ports import ManagerPort


class LinkedMovement(Movement):
    """Ends when all axes have: well at the position of the one that was asked, or badly.

    `parts` has the movement of each axis by name; empty where all were refused.
    """

    def __init__(self, axis: str) -> None:
        super().__init__()
        self._axis = axis
        self._lock = Lock()
        self.parts: Mapping[str, Movement] = {}

    def begin(self, group: GroupMovement) -> None:
        """Follow `group`; for whoever makes it."""
        self.parts = group.movements
        self.on_cancel(group.cancel)
        for part in self.parts.values():
            part.add_callback(self._on_part_ended)

    def _on_part_ended(self, _part: Movement) -> None:
        with self._lock:
            if not all(part.done for part in self.parts.values()):
                return
        failures = [error for part in self.parts.values() if (error := part.exception())]
        if failures:
            self.fail(next((each for each in failures if not _cancelled(each)), failures[0]))
        else:
            self.finish(self.parts[self._axis].wait())


def _cancelled(error: Exception) -> bool:
    return isinstance(error, MoveCancelled)


def linked_movement(
    manager: ManagerPort,
    axis: str,
    motion: Motion,
    *,
    source: str,
    consent: bool,
    follows: Movement | None = None,
) -> LinkedMovement:
    """Move `axis` and those linked to it; a refusal fails the movement."""
    whole = LinkedMovement(axis)
    before = follows.parts if isinstance(follows, LinkedMovement) else None
    try:
        orders = manager.order_together(
            {axis: motion}, source=source, consent=consent, follows=before
        )
    except CosmicError as exc:
        whole.fail(exc)
        return whole
    whole.begin(GroupMovement.of(orders))
    return whole
