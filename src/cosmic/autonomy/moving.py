"""Moving axes within a procedure: through the gate, and back where they were."""

import logging
from collections.abc import Mapping

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, MoveCancelled, StoppedError
from cosmic.frame.operation import Task
from cosmic.frame.units import AxisUnit
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.motion.positioner import positions_of

logger = logging.getLogger(__name__)


class Mover:
    """Moves some axes for one task, and remembers where they stood."""

    def __init__(self, mico: Mico, axes: Mapping[str, AxisUnit], clock: Clock) -> None:
        self._mico = mico
        self._axes = dict(axes)
        self._clock = clock
        self._before: dict[str, float] = {}

    def positions(self) -> dict[str, float]:
        """Return where all axes are that are known, in gate coordinates."""
        return positions_of(self._mico.states())

    def remember(self) -> dict[str, float]:
        """Return where its axes stand, which is where they go back to."""
        here = self.positions()
        self._before = {axis: here[axis] for axis in self._axes}
        return dict(self._before)

    def go(self, targets: Mapping[str, float], task: Task, source: str) -> float:
        """Move there and wait; returns the platform time from which images show it.

        Raises
        ------
        MoveCancelled
            The task was cancelled.
        CosmicError
            The gate refused, or the movement failed.
        """
        if task.cancel_requested:
            raise MoveCancelled(f"{task.title} was cancelled")
        together = self._mico.begin_together(
            {name: MoveTo(target, self._axes[name]) for name, target in targets.items()},
            source=source,
        )
        task.on_cancel(together.cancel)
        together.wait()
        return self._clock.now_s()

    def go_back(self, task: Task, source: str) -> None:
        """Move back; where somebody wanted it to stand, it stays."""
        if task.cancel_requested or not self._before:
            return
        try:
            self.go(self._before, task, source)
        except (MoveCancelled, StoppedError):
            return
        except CosmicError as exc:
            logger.warning("%s: not moved back: %s", task.title, exc)
