"""What others want of a run: to rest, to go on, to end; and a bell for its thread."""

import math
from collections.abc import Generator
from contextlib import contextmanager
from threading import Condition
from typing import Final

from cosmic.autonomy.procedures.operation import SafePoint
from cosmic.frame.clock import Clock
from cosmic.frame.pace import Worker

POLL_WALL_S: Final = 0.05
"""How often at least whoever waits looks whether it was ended."""
LOOK_WALL_S: Final = 0.002
"""How often something is looked at that cannot tell of its end."""
LOOK_S: Final = 0.01
"""The same where a test moves the time."""


class OperationEnd(SafePoint):
    """Yielded after each unit operation: one who goes step by step rests there."""


OPERATION_END: Final = OperationEnd()


class Reins:
    """What others want of a run, and a bell for its thread; any thread."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.bell = Condition()
        self.abort_reason: str | None = None
        self.aborts = 0
        self.pausing = False
        self.stepping = False
        self.turn = 0
        self._rung = False
        self._worker = Worker()

    @property
    def poll_s(self) -> float:
        """The longest wait between two looks, in the platform's time."""
        return POLL_WALL_S * self.clock.rate or math.inf

    @property
    def look_s(self) -> float:
        """The wait between two looks at something that cannot tell of its end."""
        return LOOK_WALL_S * self.clock.rate or LOOK_S

    def rests_at(self, place: SafePoint) -> bool:
        """Tell whether the run is to rest at `place`."""
        return self.stepping if isinstance(place, OperationEnd) else self.pausing

    @contextmanager
    def held(self) -> Generator[None]:
        """Run a procedure inside: what its thread does between its waits takes wall time."""
        self._worker = self.clock.worker(leads=True)
        self._worker.busy()
        try:
            yield
        finally:
            self._worker.close()

    def ring(self, *_who: object) -> None:
        """Have the thread of the run look again at once."""
        with self.bell:
            self._rung = True
            self._worker.busy()
            self.bell.notify_all()

    def wait(self, until_s: float) -> None:
        """Wait until the bell rings, or until `until_s`."""
        with self.bell:
            if not self._rung:
                self._worker.idle()
                self.clock.wait(self.bell, until_s)
                self._worker.busy()
            self._rung = False
