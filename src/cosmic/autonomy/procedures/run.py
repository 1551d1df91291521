"""`ProcedureRun`: one run of a procedure, with pause, step and abort."""

import logging
import threading
from collections.abc import Callable
from enum import StrEnum
from typing import Generic, TypeVar

from typing_extensions import override

from cosmic.autonomy.procedures.combinators import outline_of
from cosmic.autonomy.procedures.executor import Executor
from cosmic.autonomy.procedures.failures import ProcedureAborted, ProcedureStopped, defect_of
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.times import OperationTimes
from cosmic.autonomy.procedures.tree import NodeEvent, NodeView, ProcedureTreeState
from cosmic.autonomy.procedures.waits import RunControl
from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, NotAvailable, WrongThreadError
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Operation
from cosmic.frame.threads import WorkerThread, forbid_waiting_here

logger = logging.getLogger(__name__)


class RunState(StrEnum):
    """What a run is at; the value is the word."""

    READY = "ready"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    ABORTING = "aborting"
    DONE = "done"
    FAILED = "failed"
    ABORTED = "aborted"


OVER = frozenset({RunState.DONE, RunState.FAILED, RunState.ABORTED})


_kept: list[WorkerThread] = []


def _keep(thread: WorkerThread) -> None:
    """Hold on to it until it has ended: Qt aborts the process over one let go before."""
    _kept[:] = [*(each for each in _kept if not each.isFinished()), thread]


class RunThread(WorkerThread):
    """The thread of one run."""

    def __init__(
        self,
        carry_out: Callable[[], None],
        abort: Callable[[str], None],
        name: str,
        policy: FailurePolicy,
    ) -> None:
        super().__init__(f"procedure {name}", policy)
        self._carry_out: Callable[[], None] | None = carry_out
        self._abort = abort
        _keep(self)

    @override
    def run_body(self) -> None:
        carry_out, self._carry_out = self._carry_out, None
        if carry_out is not None:
            carry_out()

    @override
    def request_end(self) -> None:
        self._abort("the program is closing")
        super().request_end()


W = TypeVar("W")


class ProcedureRun(Generic[W]):
    """Carries out a procedure once, in a thread of its own or in the caller's; any thread.

    Parameters
    ----------
    procedure : Procedure
        What to do.
    work : W
        What its operations share.
    clock : Clock
        The platform's; all waiting goes by it.
    policy : FailurePolicy
        Told of a defect in an operation, which stops all motion.
    stopped : callable or None
        Returns why motion is stopped, or None; a run ends when it is, even where it only waits.
    busy : callable or None
        Returns what runs that this must not run beside, in words; empty for nothing.
    """

    def __init__(
        self,
        procedure: Procedure[W],
        work: W,
        clock: Clock,
        policy: FailurePolicy,
        *,
        stopped: Callable[[], str | None] | None = None,
        busy: Callable[[], str] | None = None,
    ) -> None:
        self.procedure = procedure
        self.work = work
        self.times = OperationTimes()
        self._policy = policy
        self._busy = busy
        self._tree = ProcedureTreeState(outline_of(procedure.root), clock)
        self._tree.subscribe(self._on_event)
        self._control = RunControl(clock)
        self._executor = Executor(
            procedure, work, self._tree, self._control, self._on_rest, stopped
        )
        self._lock = threading.RLock()
        self._state = RunState.READY
        self._ended = Operation[None](procedure.name)
        self._change: Event[[]] = Event()
        self._thread: RunThread | None = None
        self._ident: int | None = None

    @override
    def __repr__(self) -> str:
        return f"<ProcedureRun {self.procedure.name!r}, {self.state}>"

    # What is known of it

    @property
    def name(self) -> str:
        """Name of the procedure."""
        return self.procedure.name

    @property
    def state(self) -> RunState:
        """What it is at."""
        return self._state

    @property
    def over(self) -> bool:
        """True when it has ended, well or not."""
        return self._ended.done

    @property
    def failure(self) -> Exception | None:
        """What it failed with; None while it runs, and when it ended well."""
        return self._ended.failure

    @property
    def not_safe(self) -> str:
        """Why things could not be made safe at the end; empty when they were, or need not be."""
        return self._executor.not_safe

    @property
    def tree(self) -> NodeView:
        """What each part is at now."""
        return self._tree.snapshot()

    def subscribe(self, listener: Callable[[NodeEvent], object]) -> Callable[[], None]:
        """Call `listener(event)` at each change of a part, in order, in the run's thread."""
        return self._tree.subscribe(listener)

    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()` when anything changed, in any thread; returns what ends it."""
        return self._change.subscribe(listener)

    # What can be asked of it

    def start(self) -> None:
        """Begin, in a thread of its own; returns at once.

        Raises
        ------
        NotAvailable
            It was begun before, or something runs that it must not run beside.
        """
        self._begin()
        self._thread = RunThread(self._carry_out, self.abort, self.name, self._policy)
        self._thread.start()

    def run_here(self) -> None:
        """Carry it out in the calling thread, to its end.

        Raises
        ------
        OperationFailed
            What it failed with.
        ProcedureAborted
            It was aborted.
        NotAvailable
            It was begun before, or something runs that it must not run beside.
        """
        forbid_waiting_here(f"running {self.name!r}")
        self._begin()
        self._carry_out()
        self._ended.wait()

    def pause(self) -> None:
        """Rest at the next safe point; harmless when it does not run."""
        with self._lock:
            if self._state not in (RunState.RUNNING, RunState.PAUSING):
                return
            self._control.pausing = True
            self._state = RunState.PAUSING
        self._changed()

    def resume(self) -> None:
        """Go on after a pause or a step; harmless when it does not pause."""
        with self._lock:
            if self._state not in (RunState.PAUSED, RunState.PAUSING):
                return
            self._control.pausing = self._control.stepping = False
            self._control.turn += 1
            self._state = RunState.RUNNING
        self._changed()

    def step(self) -> None:
        """Carry out one operation, then rest: the first, the next, or the one that runs.

        Raises
        ------
        NotAvailable
            It is over.
        """
        with self._lock:
            if self._state in OVER or self._state is RunState.ABORTING:
                raise NotAvailable(f"{self.name} has ended: make a new run")
            begin = self._state is RunState.READY
            self._control.pausing, self._control.stepping = False, True
            self._control.turn += 1
            if not begin:
                self._state = RunState.PAUSING
        if begin:
            self.start()
        else:
            self._changed()

    def abort(self, reason: str = "aborted") -> None:
        """End it at once: what moves is cancelled, nothing is undone, then it is made safe.

        Returns at once; harmless when it is over. The second time ends the making safe too.
        """
        with self._lock:
            if self._state in OVER:
                return
            self._control.aborts += 1
            if self._control.abort_reason is None:
                self._control.abort_reason = reason
            begun = self._state is not RunState.READY
            self._state = RunState.ABORTING if begun else RunState.ABORTED
        if begun:
            self._changed()
        else:
            self._end(RunState.ABORTED, ProcedureAborted(f"{self.name}: {reason}"))

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the end; raises what it failed with.

        Raises
        ------
        OperationFailed, ProcedureAborted
            How it ended.
        DeviceTimeout
            It had not ended after `timeout_s` of wall time; it goes on.
        WrongThreadError
            Called in the GUI thread, or in the run's own.
        """
        if not self.over and threading.get_ident() == self._ident:
            raise WrongThreadError(f"{self.name} cannot wait for itself")
        self._ended.exception(timeout_s)
        self.join()
        self._ended.wait()

    def join(self) -> None:
        """Wait until its thread is gone; for whoever closes the platform, after `abort`."""
        if self._thread is not None and threading.get_ident() != self._ident:
            self._thread.join()

    # The run's own thread

    def _begin(self) -> None:
        with self._lock:
            if self._state is not RunState.READY:
                raise NotAvailable(f"{self.name} has already started: make a new run")
            if self._busy is not None and (other := self._busy()):
                raise NotAvailable(f"{self.name}: {other} is running; end it first")
            self._state = RunState.PAUSING if self._control.stepping else RunState.RUNNING
        logger.info("%s begins", self.name)
        self._changed()

    def _carry_out(self) -> None:
        self._ident = threading.get_ident()
        try:
            with self._control.carrying_out():
                self._executor.carry_out()
        except ProcedureAborted as exc:
            self._end(RunState.ABORTED, exc)
        except CosmicError as exc:
            self._end(RunState.FAILED, exc)
        except Exception as exc:  # noqa: BLE001 - whoever waits for the end is told
            self._policy.report(exc, f"procedure {self.name!r}")
            self._end(RunState.FAILED, defect_of(exc))
        except BaseException as exc:
            self._end(RunState.ABORTED, ProcedureAborted(f"{self.name}: {type(exc).__name__}"))
            raise
        else:
            self._end(RunState.DONE, None)

    def _end(self, state: RunState, failure: Exception | None) -> None:
        if failure is None:
            logger.info("%s finished", self.name)
        else:
            meant = state is RunState.ABORTED or isinstance(failure, ProcedureStopped)
            log = logger.warning if meant else logger.error
            log("%s %s: %s", self.name, state, failure)
        with self._lock:
            self._state = state
            if failure is None:
                self._ended.finish(None)
            else:
                self._ended.fail(failure)
        self._changed()

    def _on_event(self, event: NodeEvent) -> None:
        self.times.note(event)
        self._change.emit()

    def _on_rest(self, *, resting: bool) -> None:
        with self._lock:
            if self._state is RunState.ABORTING:
                return
            control = self._control
            if not (control.pausing or control.stepping):
                self._state = RunState.RUNNING
            else:
                self._state = RunState.PAUSED if resting else RunState.PAUSING
        self._change.emit()

    def _changed(self) -> None:
        self._control.wake()
        self._change.emit()
