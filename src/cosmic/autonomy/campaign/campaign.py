"""`Campaign`: fibre after fibre by one recipe, recorded so that it can be resumed."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from threading import Condition
from typing import Final

from cosmic.autonomy.campaign.analysis import finish
from cosmic.autonomy.campaign.plates import CampaignPlates
from cosmic.autonomy.campaign.recipe import Recipe
from cosmic.autonomy.campaign.recorder import FibreRecorder, skip_known
from cosmic.autonomy.campaign.records import FibreRecord
from cosmic.autonomy.campaign.resume import ResumePlan
from cosmic.autonomy.campaign.statistics import CampaignProgress
from cosmic.autonomy.campaign.stop_rule import StandardSchedule, StopRule
from cosmic.autonomy.campaign.store import CampaignStore, NotWrittenError
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.force_limit import armed_beyond_parking
from cosmic.autonomy.handling.survey import NONE_LEFT
from cosmic.autonomy.procedures.failures import STOPPED, ProcedureAborted
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.run import ProcedureRun, RunState, RunThread
from cosmic.autonomy.procedures.times import OperationTimes
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.events import Event, Unsubscribe
from cosmic.frame.failure import FailurePolicy

logger = logging.getLogger(__name__)

MOST_STUCK: Final = 3
"""Fibres in a row that cannot be put away before a person is asked for."""
_POLL_S: Final = 0.2
RETRY_INTERVAL_WALL_S: Final = 2.0
"""How often it is tried to write what could not be written."""
RETRY_TIMEOUT_WALL_S: Final = 600.0
"""How long that is tried."""
WAITING: Final = "waiting for disk space"


class CampaignPhase(StrEnum):
    """What a campaign is at; the value is the word.

    `ENDED`: what the recipe asks for is done. `STOPPED`: it ended before that, in order: by
    somebody's wish, by a stop, or because no fibre could be taken. `FAILED`: by a fault.
    """

    READY = "ready"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    ENDING = "ending"
    ENDED = "ended"
    STOPPED = "stopped"
    FAILED = "failed"


OVER: Final = frozenset({CampaignPhase.ENDED, CampaignPhase.STOPPED, CampaignPhase.FAILED})


@dataclass(frozen=True, slots=True)
class Treatment:
    """What a campaign does with each fibre.

    Attributes
    ----------
    procedure : Procedure
        Treats one fibre; run once for each.
    measures : bool
        A fibre without a result is no good one.
    standard : Procedure or None
        Measures the standard and puts it back; None: there is none.
    plates : CampaignPlates or None
        Has further plates put there; None: the campaign ends with the fibres of the first.
    """

    procedure: Procedure[HandlingContext]
    measures: bool = True
    standard: Procedure[HandlingContext] | None = None
    plates: CampaignPlates | None = None


class Campaign:
    """Runs a procedure again and again on one platform, and keeps what comes of it; any thread.

    Parameters
    ----------
    work : HandlingContext
        The platform with the settings of the recipe; the campaign closes it.
    treatment : Treatment
        What is done with a fibre.
    recipe : Recipe
        When to end, and what to keep.
    store : CampaignStore
        Where it is kept; closed at the end.
    policy : FailurePolicy
        Told of defects.
    stopped : callable
        Returns why motion is stopped, or None.
    known : ResumePlan or None
        What was done before the program ended.
    """

    def __init__(
        self,
        work: HandlingContext,
        treatment: Treatment,
        recipe: Recipe,
        store: CampaignStore,
        *,
        policy: FailurePolicy,
        stopped: Callable[[], str | None],
        known: ResumePlan | None = None,
        busy: Callable[[], str] = str,
    ) -> None:
        self.recipe = recipe
        self.store = store
        self.work = work
        self._treatment = treatment
        self._recorder = FibreRecorder(
            work, store, measures=treatment.measures, images=recipe.file.output.pictures
        )
        self._rule = StopRule(recipe.file.stop)
        self._policy = policy
        self._stopped, self._busy = stopped, busy
        self._known = known
        self._changed = Condition()
        self._phase = CampaignPhase.READY
        self._run: ProcedureRun[HandlingContext] | None = None
        self._thread: RunThread | None = None
        self._published: Event[[]] = Event()
        self._operation = ""
        self._abort: str | None = None
        self._broken: CosmicError | None = None
        self._end_reason = ""
        self._reached = False
        self._shortfall = ""
        self._recorded = 0
        self._unwritten = False
        self._stuck = 0
        self._stepping = False
        self._standards = StandardSchedule(
            work.settings.standard.at if treatment.standard is not None else ()
        )
        work.shared.enough = self._enough
        self._note_plate()

    # State

    @property
    def phase(self) -> CampaignPhase:
        """What it is at."""
        return self._phase

    @property
    def operation(self) -> str:
        """The operation under way, in words."""
        return self._operation

    @property
    def over(self) -> bool:
        """True when it has ended, well or not."""
        return self._phase in OVER

    @property
    def run(self) -> ProcedureRun[HandlingContext] | None:
        """The run of the procedure on the held fibre, for drawing; None before the first."""
        return self._run

    def on_change(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()` when anything changed, in any thread; returns what ends it."""
        return self._published.subscribe(listener)

    @property
    def procedure(self) -> Procedure[HandlingContext]:
        """What is done with each fibre."""
        return self._treatment.procedure

    @property
    def end_reason(self) -> str:
        """Why it ended; empty before."""
        return self._end_reason

    @property
    def shortfall(self) -> str:
        """What is missing of what was asked for, though the campaign has ended; empty: nothing."""
        return self._shortfall

    @property
    def request(self) -> str:
        """What a person is asked for, such as another plate; empty for nothing."""
        return "" if self._treatment.plates is None else self._treatment.plates.request

    @property
    def unfinished(self) -> bool:
        """True when it is over and could be gone on with: what the recipe asks for is not done."""
        return self.over and self._phase is not CampaignPhase.ENDED

    @property
    def left_s(self) -> float:
        """Time until it ends, on the platform's clock, as far as can be told; nan: it cannot."""
        if self.over:
            return 0.0 if self._phase is CampaignPhase.ENDED else math.nan
        return self._rule.left_s(self.progress)

    @property
    def plan(self) -> str:
        """How many fibres make the mean as precise as wanted, in words; empty: unknown."""
        return self._rule.plan(self.progress)

    @property
    def fibres(self) -> tuple[FibreRecord, ...]:
        """All fibres so far without curves and images, those of earlier runs included."""
        return self._recorder.fibres

    @property
    def times(self) -> OperationTimes:
        """How long operations took, and what they failed with."""
        return self._recorder.times

    @property
    def progress(self) -> CampaignProgress:
        """How it stands."""
        return self._recorder.progress()

    # Commands

    def start(self) -> None:
        """Begin, in a thread of its own; returns at once.

        Raises
        ------
        NotAvailable
            It was begun before, or something else runs on the platform.
        """
        self._begin()
        self._thread = RunThread(self._carry_out, self.abort, self.recipe.name, self._policy)
        self._thread.start()

    def run_here(self) -> None:
        """Carry it out in the calling thread, to its end.

        Raises
        ------
        NotAvailable
            It was begun before, or something else runs on the platform.
        """
        self._begin()
        self._carry_out()

    def pause(self) -> None:
        """Rest at the next safe point; harmless when it does not run."""
        with self._changed:
            if self._phase is not CampaignPhase.RUNNING:
                return
            self._phase, self._stepping = CampaignPhase.PAUSING, False
            run = self._run
        if run is not None:
            run.pause()
        self._publish()

    def resume(self) -> None:
        """Go on after a pause; harmless when it does not pause."""
        with self._changed:
            if self._phase not in (CampaignPhase.PAUSING, CampaignPhase.PAUSED):
                return
            self._phase, self._stepping = CampaignPhase.RUNNING, False
            self._changed.notify_all()
            run = self._run
        if run is not None:
            run.resume()
        self._publish()

    def step(self) -> None:
        """Carry out one operation, then rest; harmless when it is over."""
        with self._changed:
            run = None if self._run is None or self._run.over else self._run
            if self._phase in OVER or (run is None and self._phase is not CampaignPhase.PAUSED):
                return
            self._phase = CampaignPhase.PAUSING
            self._stepping = run is None  # between two fibres: that of the next
            self._changed.notify_all()
        if run is not None:
            run.step()

    def confirm_plate(self) -> None:
        """Say that the plate is there which `request` asks for.

        Raises
        ------
        NotAvailable
            None was asked for, or it cannot be there.
        """
        if self._treatment.plates is None:
            raise NotAvailable("no plate is waited for")
        self._treatment.plates.confirm()
        self._publish()

    def abort(self, reason: str = "ended by the operator") -> None:
        """End it at once: what moves is cancelled, then it is made safe; returns at once."""
        reason = str(reason) or "ended without a reason"  # whatever is given, it ends
        with self._changed:
            if self._phase in OVER:
                return
            begun = self._phase is not CampaignPhase.READY
            self._abort = self._abort or reason
            self._phase = CampaignPhase.ENDING
            self._changed.notify_all()
            run = self._run
        if run is not None:
            run.abort(reason)
        if not begun:
            self._end_reason = reason
            self._leave(failed=False)
        self._publish()

    def join(self) -> None:
        """Wait until its thread is gone; for whoever closes the platform, after `abort`."""
        if self._thread is not None:
            self._thread.join()

    # The campaign's own thread

    def _begin(self) -> None:
        with self._changed:
            if self._phase is not CampaignPhase.READY:
                raise NotAvailable(f"campaign {self.recipe.name} has already started")
            if other := self._busy():
                raise NotAvailable(f"campaign {self.recipe.name}: {other} is running; end it first")
            self._phase = CampaignPhase.RUNNING
        self._publish()

    def _carry_out(self) -> None:
        failed = False
        leading = self.work.clock.worker(leads=True)  # between two runs as well
        try:
            with armed_beyond_parking(self.work):
                self._end_reason = self._treat_all()
        except CosmicError as exc:
            failed, self._end_reason = True, str(exc)
        except Exception as exc:  # noqa: BLE001 - it must be said, and the store closed in order
            self._policy.report(exc, f"campaign {self.recipe.name!r}")
            failed, self._end_reason = True, f"program error: {exc}"
        finally:
            try:
                self._leave(failed=failed)
            finally:
                leading.close()

    def _leave(self, *, failed: bool) -> None:
        """Close all and come to the end, whatever fails on the way."""
        kept = False
        try:
            self.work.close()
            self._recorder.close(self._end_reason)
            self._analyse()
            kept = True
        except CosmicError as exc:
            failed = kept = True
            if str(exc) not in self._end_reason:  # a disk that is full says it each time
                self._end_reason = f"{self._end_reason}; {exc}"
        finally:
            self.store.close()
            if not kept:
                self._end_reason = f"{self._end_reason}; program error at its end"
            self._be_over(failed=failed or not kept)

    def _be_over(self, *, failed: bool) -> None:
        end = CampaignPhase.ENDED if self._reached else CampaignPhase.STOPPED
        log = logger.error if failed else logger.info if self._reached else logger.warning
        log("campaign %s: %s", self.recipe.name, self._end_reason)
        self._operation = ""
        self._enter(CampaignPhase.FAILED if failed else end)
        self._publish()

    def _analyse(self) -> None:
        """Put final values into the record, and see whether all is there that was asked for."""
        good = self.progress.good
        with self.work.clock.at_work():
            analysis = finish(self.store)
        self._recorder.read_again()
        if self._treatment.standard is not None and not (analysis and analysis.scale.verified):
            self._shortfall = "the standard did not verify the scale of the force"
        elif self._reached and not self._rule.reason(self.progress):
            now = self.progress
            self._shortfall = (
                f"by the final analysis {now.good} fibres are good, fewer than the campaign had "
                "come to itself"
                if now.good < good
                else "by the final analysis the mean stiffness is known to "
                f"+/-{now.mean.precision_percent:.1f} %, less well than the campaign had come to "
                "itself"
            )

    def _treat_all(self) -> str:
        if reason := self._go_on():
            return reason
        while True:
            self._rest()
            if self._abort is not None:
                return self._abort
            reason = self._rule.reason(self.progress)
            if due := self._standards.due(self._share, ending=bool(reason)):
                if ended := self._measure_standard(due):
                    return ended
                continue
            if reason:
                self._reached = True
                return reason
            if reason := self._treat_one():
                if self._abort is None and self._stopped() is None:
                    self._measure_last_standard()
                return reason

    def _go_on(self) -> str:
        """Have all as an earlier run left it; returns why the campaign ends instead."""
        if self._known is None:
            return ""
        skip_known(self.work, self._known)
        plates = self._treatment.plates
        if plates is None:
            return ""
        plates.restore()
        return self._put_plate(plates) if plates.pending else ""

    @property
    def _share(self) -> float:
        """Part of the campaign that is over, as far as can be told; nan: it cannot."""
        now = self.progress
        return now.elapsed_s / max(now.elapsed_s + self._rule.left_s(now), 1e-9)

    def _measure_last_standard(self) -> None:
        if due := self._standards.due(math.nan, ending=True):
            self._measure_standard(due)

    def _measure_standard(self, due: str) -> str:
        """Measure the standard; returns why the campaign ends, or nothing.

        A campaign goes on without it: its report says that the scale is not verified.
        """
        assert self._treatment.standard is not None
        self._standards.done(due)
        failure = self._carry_through(self._treatment.standard)
        if isinstance(failure, str):
            return failure
        if failure is None:
            return ""
        if failure.cause == STOPPED:
            self._record_cut_off(str(failure))
            return str(failure)
        self._record_finished()
        for arm in self.work.arms:
            if arm.fibre is not None:
                self._record_held(arm, failure)
        self.work.shared.surveyed = False
        self._standards.not_measured(due)
        logger.warning("the standard was not measured at the %s: %s", due, failure)
        self.store.note(
            "standard",
            "not measured",
            {"at": due, "why": str(failure)},
            time_s=self.work.clock.now_s(),
        )
        return ""

    def _treat_one(self) -> str:
        """Treat one fibre; returns why the campaign ends, or nothing."""
        taken = len(self.work.shared.finished)
        self.work.shared.seeking.clear()
        failure = self._carry_through(self._treatment.procedure)
        if isinstance(failure, OperationFailed):
            return self._after_failure(failure, taken)
        return failure or ""

    def _carry_through(self, procedure: Procedure[HandlingContext]) -> str | OperationFailed | None:
        """Run a procedure to its end; returns why the campaign ends, or what failed."""
        run = ProcedureRun(
            procedure,
            self.work,
            self.work.clock,
            self._policy,
            stopped=self._stopped,
        )
        run.subscribe(self._on_event)
        self._recorder.begin_run()
        if reason := self._follow(run):
            return reason
        try:
            run.run_here()
        except ProcedureAborted as exc:
            if self._broken is not None:
                raise self._broken from exc
            self._record_cut_off(str(exc))
            return self._abort or str(exc)
        except OperationFailed as exc:
            return exc
        self._record_finished()
        return None

    def _after_failure(self, failure: OperationFailed, taken: int) -> str:
        if failure.cause == STOPPED:
            self._record_cut_off(str(failure))
            return str(failure)
        self._record_finished()
        if failure.cause == NONE_LEFT:
            return self._worked_off(str(failure))
        if len(self.work.shared.finished) > taken:
            return ""
        held = [each for each in self.work.arms if each.fibre is not None]
        if not held:
            raise failure
        for arm in held:
            self._record_held(arm, failure)
        self.work.shared.surveyed = False
        self._stuck += 1
        if self._stuck >= MOST_STUCK:
            return f"{self._stuck} fibres in a row were not released; the last: {failure}"
        return ""

    def _worked_off(self, text: str) -> str:
        """Have the next plate put there; returns why the campaign ends instead."""
        plates = self._treatment.plates
        if plates is None:
            return text
        self._recorder.worked_off = plates.number
        if self._rule.reason(self.progress):
            return ""  # seen where the campaign goes on, after the standard that may be due
        # What lay too near it is gone by now.
        if (due := self._standards.due_once_more) and (ended := self._measure_standard(due)):
            return ended
        if reason := plates.why_no_other(self.fibres):
            return f"{reason}; {text}"
        return self._put_plate(plates)

    def _put_plate(self, plates: CampaignPlates) -> str:
        failure = self._carry_through(plates.change(self.store, self.work.clock.now_s()))
        if failure is not None:
            return str(failure)
        plates.there(self.store, self.work.clock.now_s())
        self._note_plate()
        self._standards.new_plate()
        return ""

    def _note_plate(self) -> None:
        if self._treatment.plates is not None:
            self._recorder.plate = self._treatment.plates.number
            self._recorder.worked_off = self._recorder.plate - 1

    def _enter(self, phase: CampaignPhase) -> CampaignPhase:
        """Enter another phase; returns the one before."""
        with self._changed:
            before, self._phase = self._phase, phase
            self._changed.notify_all()
        return before

    def _follow(self, run: ProcedureRun[HandlingContext]) -> str | None:
        """Have this run steered from now on; returns why it must not begin, or None."""
        run.on_change(self._on_run_changed)
        with self._changed:
            self._run = run
            return self._abort

    def _rest(self) -> None:
        """Wait between two fibres while a pause is wanted."""
        with self._changed:
            if self._phase is CampaignPhase.PAUSING:
                self._phase = CampaignPhase.PAUSED
            resting = self._phase is CampaignPhase.PAUSED
        if not resting:
            return
        self._publish()
        with self._changed:
            while self._phase is CampaignPhase.PAUSED and self._abort is None:
                self._changed.wait(_POLL_S)

    def _insist(self, write: Callable[[], None]) -> None:
        """Write what must not be lost; where that fails, again and again while it may yet succeed.

        Raises
        ------
        NotWrittenError
            It was not written in `RETRY_TIMEOUT_WALL_S`, or before the end was wanted.
        """
        until_s = WALL.now_s() + RETRY_TIMEOUT_WALL_S
        before = self._operation
        while True:
            try:
                write()
                break
            except NotWrittenError as exc:
                if self._abort is not None or WALL.now_s() >= until_s:
                    raise NotWrittenError(f"the last fibre is not saved: {exc}") from exc
                if self._operation != WAITING:
                    self._operation = WAITING
                    logger.error("%s; retried every %g s", exc, RETRY_INTERVAL_WALL_S)
                    self._publish()
            with self._changed:
                self._changed.wait(RETRY_INTERVAL_WALL_S)
        self._operation = before

    def _on_run_changed(self) -> None:
        run = self._run
        with self._changed:
            pausing = run is not None and self._phase is CampaignPhase.PAUSING
            if pausing and run is not None and run.state is RunState.PAUSED:
                self._phase = CampaignPhase.PAUSED
        if pausing and run is not None and run.state is RunState.RUNNING:
            # It was wanted while the run had not begun.
            stepping, self._stepping = self._stepping, False
            if stepping:
                run.step()
            else:
                run.pause()
        self._publish()

    # Recording

    def _record_held(self, arm: HandlingContext, failure: OperationFailed) -> None:
        """Keep a fibre that could not be put away."""
        fibre, arm.fibre = arm.fibre, None
        if fibre is not None:
            fibre.failure = fibre.failure or failure
            self._insist(lambda: self._recorder.record(fibre))

    def _record_cut_off(self, reason: str) -> None:
        """Keep the fibres of a run that was cut off: one that was done with by then is no less."""
        self._record_finished()
        for fibre in self._recorder.in_work:
            self._insist(partial(self._recorder.record, fibre, interrupted=reason))

    def _record_finished(self) -> None:
        """Keep the fibres that were done with and are not kept yet."""
        while self._recorded < len(self.work.shared.finished):
            fibre = self.work.shared.finished[self._recorded]
            with self.work.clock.at_work():
                self._insist(partial(self._recorder.record, fibre))
            self._recorded += 1
            self._stuck = 0
            self._publish()
        self._unwritten = False

    def _enough(self) -> bool:
        """Tell whether no further fibre is to be begun, if those in work become good ones."""
        arms = {each.arm for each in self._recorder.in_work} | self.work.shared.seeking
        now, more = self.progress, len(arms)
        if self._standards.due(self._share, ending=False):
            return True
        then = replace(now, done=now.done + more, good=now.good + more)
        return self._unwritten or self._abort is not None or bool(self._rule.reason(then))

    def _record_meanwhile(self) -> None:
        """Keep what one arm is done with, while the other goes on."""
        while self._recorded < len(self.work.shared.finished):
            try:
                self._recorder.record(self.work.shared.finished[self._recorded])
            except NotWrittenError as exc:
                # Once both arms are done with theirs, it is tried again.
                logger.error("%s; no further fibre is started", exc)
                self._unwritten = True
                return
            self._recorded += 1
            self._publish()

    def _on_event(self, event: NodeEvent) -> None:
        if event.kind == OPERATION and event.state is NodeState.RUNNING:
            self._operation = f"{event.role}: {event.name}" if event.role else event.name
        try:
            self._recorder.note(event)
            if event.role and not self._unwritten:
                self._record_meanwhile()
        except CosmicError as exc:  # what cannot be written down must not be done
            self._broken = exc
            if self._run is not None:
                self._run.abort(str(exc))

    def _publish(self) -> None:
        self._published.emit()
