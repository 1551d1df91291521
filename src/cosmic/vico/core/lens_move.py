"""A movement of the lens under way: how far it is, and whether it ended where it should."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, DeviceTimeout
from cosmic.frame.network.dead_man import DeadMan
from cosmic.frame.operation import Task
from cosmic.vico.hw.peripherals import LensAxis, LensState

START_S: Final = 0.7
"""Wall time within which a motor that was told to move has begun."""

REPORT_S: Final = 0.05
"""Wall time between two reports of how far it is, however often a fast twin is looked at."""

NEAR_COUNTS: Final = 2
"""So near to its target a motor has reached it."""


@dataclass(slots=True)
class Move:
    """One task of the lens; used by the thread of the line alone.

    Attributes
    ----------
    targets : mapping of LensAxis to int or None
        Where to; None: home.
    timeout_s : float
        Platform time after which it has failed.
    dead_man : DeadMan or None
        Ends it when whoever commanded it from another process falls silent.
    over : bool
        It has ended, with `error` or well; the task is told by `publish_end`.
    """

    task: Task
    targets: Mapping[LensAxis, int | None]
    clock: Clock
    timeout_s: float
    dead_man: DeadMan | None = None
    begun_s: float = 0.0
    begun_wall_s: float = 0.0
    reported_wall_s: float = -math.inf
    first: dict[LensAxis, int] = field(default_factory=dict)
    left: set[LensAxis] = field(default_factory=set)
    over: bool = False
    error: CosmicError | None = None

    @property
    def abandoned(self) -> str:
        """Why nobody watches over it any more; empty while somebody does."""
        return self.dead_man.why if self.dead_man is not None else ""

    def begin(self) -> None:
        """Count from now; the commands have been sent."""
        self.begun_s, self.begun_wall_s = self.clock.now_s(), WALL.now_s()
        self.left = set(self.targets)

    def end(self, error: CosmicError | None = None) -> None:
        """End it, with `error` or well; what ended stays as it was."""
        if not self.over:
            self.over, self.error = True, error

    def publish_end(self) -> None:
        """Tell whoever waits that it is over."""
        if self.error is None:
            self.task.finish()
        else:
            self.task.fail(self.error)

    def look(self, axis: LensAxis, state: LensState) -> None:
        """Take in where a motor is; it ends when this was the last, or it went wrong."""
        if axis not in self.left or self.over:
            return
        start = self.first.setdefault(axis, state.position_counts)
        if not state.moving and self._arrived(axis, state):
            self.left.discard(axis)
            if not self.left:
                self.end()
                return
        elif not state.moving and WALL.now_s() - self.begun_wall_s >= START_S:
            self.end(self._stranded(axis, state))
            return
        if self.clock.now_s() - self.begun_s > self.timeout_s:
            self.end(self._late(axis, state))
            return
        self._report(axis, start, state)

    def _arrived(self, axis: LensAxis, state: LensState) -> bool:
        target = self.targets[axis]
        if target is None:
            return state.homed
        return state.homed and abs(state.position_counts - target) <= NEAR_COUNTS

    def _report(self, axis: LensAxis, start: int, state: LensState) -> None:
        now_wall_s = WALL.now_s()
        if self.clock.rate > 1.0 and now_wall_s - self.reported_wall_s < REPORT_S:
            return
        self.reported_wall_s = now_wall_s
        target = self.targets[axis]
        travel = (target if target is not None else -state.limit_counts) - start
        part = (state.position_counts - start) / travel if travel else 0.0
        done = len(self.targets) - len(self.left)
        text = f"{axis} at {state.position_counts}" if target is not None else f"{axis} goes home"
        self.task.report((done + min(max(part, 0.0), 1.0)) / len(self.targets), text)

    def _stranded(self, axis: LensAxis, state: LensState) -> CosmicError:
        target = self.targets[axis]
        if target is None:
            return DeviceError(
                f"{axis} stopped at {state.position_counts} counts before it reached its home "
                "position; check that it turns freely, then home it again",
                fault=DeviceFault.REFERENCE,
            )
        again = "" if state.homed else "; the controller lost its position, home it"
        return DeviceError(
            f"{axis} stopped at {state.position_counts} counts instead of {target}{again}",
            fault=DeviceFault.OTHER,
        )

    def _late(self, axis: LensAxis, state: LensState) -> CosmicError:
        target = self.targets[axis]
        where = "home" if target is None else f"at {target}"
        return DeviceTimeout(
            f"{axis} was not {where} after {self.timeout_s:g} s, it is at "
            f"{state.position_counts} counts; it was stopped",
            fault=DeviceFault.TIMEOUT,
        )
