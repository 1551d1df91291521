"""`ClearanceWatch`: keeps an eye on the nearest pair of bodies, for meters and views."""

from collections.abc import Callable
from threading import Event
from typing import Final

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread
from cosmic.mico.core.collision.answer import Approach

PERIOD_S: Final = 0.05


class ClearanceWatch(WorkerThread):
    """Asks for the nearest pair at most 20 times a second, and only when something has moved.

    Parameters
    ----------
    nearest : callable
        Returns the nearest pair with the axes at some positions; raises `CosmicError`.
    positions : callable
        Returns the position of every axis in gate coordinates; None while one is not known.

    Signals
    -------
    changed(Approach or None)
        The nearest pair; None while it is not known, or nothing can meet.
    """

    changed = Signal(object)

    def __init__(
        self,
        nearest: Callable[[dict[str, float]], Approach | None],
        positions: Callable[[], dict[str, float] | None],
        policy: FailurePolicy,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("clearance", policy, parent)
        self._nearest = nearest
        self._positions = positions
        self._wake = Event()
        self._latest: Approach | None = None

    @property
    def latest(self) -> Approach | None:
        """The nearest pair as it was last seen; any thread."""
        return self._latest

    @override
    def request_end(self) -> None:
        super().request_end()
        self._wake.set()

    @override
    def run_body(self) -> None:
        seen: dict[str, float] | None = {}
        while not self.end_requested:
            positions = self._positions()
            if positions != seen and self._look(positions):
                seen = positions
            self._wake.wait(PERIOD_S)

    def _look(self, positions: dict[str, float] | None) -> bool:
        """Tell what is nearest; return False where nobody could say, to ask again."""
        answered = True
        nearest: Approach | None = None
        if positions is not None:
            try:
                nearest = self._nearest(positions)
            except CosmicError:
                answered = False  # the gate says it too, and louder
        if nearest != self._latest:
            self._latest = nearest
            self.changed.emit(nearest)
        return answered
