"""Moving axes within a procedure: through the gate, and back where they were."""

import logging
from collections.abc import Mapping

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, MoveCancelled, StoppedError
from cosmic.frame.operation import Task
from cosmic.frame.units import AxisUnit
from cosmic.mico.api.group import move_together
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.ports import ManagerPort

logger = logging.getLogger(__name__)


class Mover:
    """Moves some axes for one task, and remembers where they stood."""

    def __init__(self, manager: ManagerPort, axes: Mapping[str, AxisUnit], clock: Clock) -> None:
        self._manager = manager
        self._axes = dict(axes)
        self._clock = clock
        self._before: dict[str, float] = {}

    def positions(self) -> dict[str, float]:
        """Return where all axes are that are known, in gate coordinates."""
        states = self._manager.states().values()
        return {each.name: each.position for each in states if each.position is not None}

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
        motions = {name: MoveTo(target, self._axes[name]) for name, target in targets.items()}
        move_together(self._manager, motions, task, source=source)
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
