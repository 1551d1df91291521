"""`Executor`: drives the generator of a whole tree, waits for it, and ends it in order."""

import logging
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from cosmic.autonomy.procedures.failures import (
    ProcedureAborted,
    ProcedureStopped,
)
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.procedures.procedure import (
    Branch,
    ExecutionContext,
    NodeSteps,
    Procedure,
    TreePosition,
    perform,
)
from cosmic.autonomy.procedures.tree import ProcedureTreeState
from cosmic.autonomy.procedures.waits import Pending, RunControl
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError

logger = logging.getLogger(__name__)

W = TypeVar("W")

ENDING_WALL_S = 2.0
"""How long what was cancelled may take to end before things are made safe."""


class OnRest(Protocol):
    """Told when a run begins to rest and when it goes on."""

    def __call__(self, *, resting: bool) -> None:
        """Take it."""


class Executor(Generic[W]):
    """Carries out one procedure in the thread that calls `carry_out`."""

    def __init__(
        self,
        procedure: Procedure[W],
        work: W,
        tree: ProcedureTreeState,
        control: RunControl,
        on_rest: OnRest,
        stopped: Callable[[], str | None] | None,
    ) -> None:
        self._procedure = procedure
        self._work = work
        self._tree = tree
        self._control = control
        self._on_rest = on_rest
        self._stopped = stopped
        self.not_safe = ""
        """Why things could not be made safe at the end."""

    def carry_out(self) -> None:
        """Do all of it.

        Raises
        ------
        OperationFailed
            What it failed with.
        ProcedureAborted
            It was aborted.
        Exception
            A defect of an operation.
        """
        branch = Branch(self._whole(), self._control)
        try:
            self._drive(branch, self._look_for_end)
        except ProcedureStopped:
            self._end(branch)
            raise
        except (OperationFailed, ProcedureAborted, KeyboardInterrupt):
            self._end(branch)
            self._make_safe()
            raise
        except BaseException:
            self._end(branch)
            raise

    def _whole(self) -> NodeSteps:
        context = ExecutionContext(self._work, self._tree, self._control)
        try:
            yield from perform(self._procedure.root, TreePosition(context))
        except ProcedureStopped:
            raise
        except OperationFailed as failure:
            try:
                yield from context.undo_failed()
            except OperationFailed as exc:
                logger.warning("%s", exc)  # what it failed with first is what matters
                if isinstance(exc, ProcedureStopped):
                    raise exc from failure
            raise

    def _drive(self, branch: Branch, look: Callable[[], None]) -> None:
        while not branch.over:
            look()
            self._wait(branch.pending, look)
            branch.go()

    def _wait(self, pending: Pending, look: Callable[[], None]) -> None:
        clock, control = self._control.clock, self._control
        rested = False
        try:
            while not pending.ready():
                if pending.resting and not rested:
                    rested = True
                    self._publish_rest(resting=True)
                now_s = clock.now_s()
                control.wait(min(pending.look_again_s(now_s), now_s + control.poll_s))
                look()
        finally:
            if rested:
                self._publish_rest(resting=False)

    def _publish_rest(self, *, resting: bool) -> None:
        self._tree.rest(resting=resting)
        self._on_rest(resting=resting)

    # Ways to the end

    def _look_for_end(self) -> None:
        reason = self._control.abort_reason
        if reason is not None:
            raise ProcedureAborted(f"{self._procedure.name}: {reason}")
        stop = self._stopped() if self._stopped is not None else None
        if stop is not None:
            raise ProcedureStopped(f"motion was stopped: {stop}")

    def _end(self, branch: Branch) -> None:
        """Cancel what moves, close all that was begun, and wait a moment for it to come to rest."""
        left = branch.end()
        until_s = WALL.now_s() + ENDING_WALL_S
        while left.running() and WALL.now_s() < until_s:
            now_s = self._control.clock.now_s()
            self._control.wait(now_s + self._control.look_s)

    def _make_safe(self) -> None:
        make_safe = self._procedure.make_safe
        if make_safe is None:
            return
        self._control.pausing = self._control.stepping = False
        aborts = self._control.aborts
        until_s = self._control.clock.now_s() + self._procedure.make_safe_s

        def look() -> None:
            if self._control.aborts > max(1, aborts):
                raise ProcedureAborted("aborted a second time")
            if not self._control.clock.now_s() <= until_s:
                raise ProcedureAborted(f"not safe after {self._procedure.make_safe_s:g} s")

        branch: Branch | None = None
        try:
            steps = make_safe(self._work)
            if steps is not None:
                branch = Branch(steps, self._control)
                self._drive(branch, look)
        except CosmicError as exc:
            self.not_safe = str(exc)
            logger.error("%s: could not be made safe: %s", self._procedure.name, exc)
        finally:
            if branch is not None:
                self._end(branch)
