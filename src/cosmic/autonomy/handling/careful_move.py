"""A movement of the probe that ends where it feels more than it should."""

import math
from collections.abc import Callable
from typing import Final

from cosmic.autonomy.handling.force import ForceWatch
from cosmic.autonomy.handling.retrying_move import RetryingMove
from cosmic.frame.errors import MoveCancelled

LOOK_S: Final = 0.02


class CarefulMove:
    """A movement that is cancelled as soon as the force comes beyond a bound; to be yielded.

    It is looked at with each chunk of samples, and each `LOOK_S` where a hurried simulation has
    longer ones. Nothing is latched: what a limit does when it is crossed, it does besides.

    Parameters
    ----------
    low_un, high_un : float
        What may be felt.

    Attributes
    ----------
    felt_un : float or None
        The force that ended it; None: none did.
    """

    def __init__(
        self, movement: RetryingMove, forces: ForceWatch, low_un: float, high_un: float
    ) -> None:
        self.felt_un: float | None = None
        self._movement = movement
        self._forces = forces
        self._low_un, self._high_un = low_un, high_un
        self._next_s = -math.inf
        self._leave = forces.subscribe(self._look)
        self._expect()

    def _expect(self) -> None:
        clock = self._forces.clock
        now_s = clock.now_s()
        if now_s >= self._next_s:
            self._next_s = now_s + LOOK_S
            clock.expect(self._next_s)

    def _look(self) -> None:
        """Look at the newest samples; in the thread of the acquisition."""
        if not self._movement.done:
            self._expect()
        felt = self._forces.farthest_un(self._low_un, self._high_un)
        if felt is not None and self.felt_un is None and not self._movement.done:
            self.felt_un = felt
            self._movement.cancel()

    @property
    def done(self) -> bool:
        """It has ended, well or not."""
        return self._movement.done

    def add_callback(self, callback: Callable[["CarefulMove"], object]) -> None:
        """Call `callback(self)` whenever it may have ended, in the thread that ends it."""
        self._movement.add_callback(lambda _movement: callback(self))

    def wait(self, timeout_s: float | None = None) -> "CarefulMove":
        """Wait for the end, and return itself; raises what else ended it."""
        try:
            self._movement.wait(timeout_s)
        except MoveCancelled:
            if self.felt_un is None:
                raise
        finally:
            if self._movement.done:
                self._leave()
        return self

    def cancel(self) -> None:
        """End it; what it has set in motion stops."""
        self._leave()
        self._movement.cancel()
