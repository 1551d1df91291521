"""`Campaign`: fibre after fibre by one recipe, kept so that it can be gone on with."""

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.campaign.keeper import Keeper, skip_known
from cosmic.autonomy.campaign.keeping import CampaignKeeping
from cosmic.autonomy.campaign.recipe import Recipe
from cosmic.autonomy.campaign.resume import ResumePlan
from cosmic.autonomy.campaign.steering import OVER, CampaignPhase
from cosmic.autonomy.campaign.stop_rule import StopRule
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.handling.push import armed_while_pushing
from cosmic.autonomy.handling.survey import NONE_LEFT
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.failures import STOPPED, ProcedureAborted
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.procedures.run_thread import RunThread
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.failure import FailurePolicy

logger = logging.getLogger(__name__)

MOST_STUCK: Final = 3
"""Fibres in a row that cannot be put away before a person is asked for."""


@dataclass(frozen=True, slots=True)
class Doing:
    """What a campaign does with each fibre.

    Attributes
    ----------
    procedure : Procedure
        Treats one fibre; run once for each.
    measures : bool
        A fibre without a result is no good one.
    """

    procedure: Procedure[FibreWork]
    measures: bool = True


class Campaign(CampaignKeeping):
    """Runs a procedure again and again on one platform, and keeps what comes of it; any thread.

    Parameters
    ----------
    work : FibreWork
        The platform with the settings of the recipe; the campaign closes it.
    doing : Doing
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
        work: FibreWork,
        doing: Doing,
        recipe: Recipe,
        store: CampaignStore,
        *,
        policy: FailurePolicy,
        stopped: Callable[[], str | None],
        known: ResumePlan | None = None,
    ) -> None:
        keeper = Keeper(work, store, measures=doing.measures, pictures=recipe.file.output.pictures)
        super().__init__(work, keeper, StopRule(recipe.file.stop))
        self.recipe = recipe
        self.store = store
        self._doing = doing
        self._policy = policy
        self._stopped = stopped
        self._known = known
        self._broken: CosmicError | None = None
        self._end_reason = ""
        self._reached = False
        self._thread: RunThread | None = None

    # What is known of it

    @property
    def procedure(self) -> Procedure[FibreWork]:
        """What is done with each fibre."""
        return self._doing.procedure

    @property
    def end_reason(self) -> str:
        """Why it ended; empty before."""
        return self._end_reason

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

    # What can be asked of it

    def start(self) -> None:
        """Begin, in a thread of its own; returns at once.

        Raises
        ------
        NotAvailable
            It was begun before.
        """
        self._begin()
        self._thread = RunThread(self._carry_out, self.abort, self.recipe.name, self._policy)
        self._thread.start()

    def run_here(self) -> None:
        """Carry it out in the calling thread, to its end.

        Raises
        ------
        NotAvailable
            It was begun before.
        """
        self._begin()
        self._carry_out()

    def abort(self, reason: str = "ended by the operator") -> None:
        """End it at once: what moves is cancelled, then it is made safe; returns at once."""
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
        self._tell()

    def join(self) -> None:
        """Wait until its thread is gone; for whoever closes the platform, after `abort`."""
        if self._thread is not None:
            self._thread.join()

    # The campaign's own thread

    def _begin(self) -> None:
        with self._changed:
            if self._phase is not CampaignPhase.READY:
                raise NotAvailable(f"campaign {self.recipe.name} was begun already")
            self._phase = CampaignPhase.RUNNING
        self._tell()

    def _carry_out(self) -> None:
        failed = False
        leading = self.work.clock.worker(leads=True)  # between two runs as well
        try:
            with armed_while_pushing(self.work):
                self._end_reason = self._treat_all()
        except CosmicError as exc:
            failed, self._end_reason = True, str(exc)
        except Exception as exc:  # noqa: BLE001 - it must be said, and the store closed in order
            self._policy.report(exc, f"campaign {self.recipe.name!r}")
            failed, self._end_reason = True, f"a mistake in the program: {exc}"
        finally:
            self._leave(failed=failed)
            leading.close()

    def _leave(self, *, failed: bool) -> None:
        self.work.close()
        try:
            self._keeper.close(self._end_reason)
        except CosmicError as exc:
            failed, self._end_reason = True, f"{self._end_reason}; {exc}"
        finally:
            self.store.close()
        end = CampaignPhase.ENDED if self._reached else CampaignPhase.STOPPED
        told = logger.error if failed else logger.info if self._reached else logger.warning
        told("campaign %s: %s", self.recipe.name, self._end_reason)
        self._operation = ""
        self._move_on(CampaignPhase.FAILED if failed else end)
        self._tell()

    def _treat_all(self) -> str:
        if self._known is not None:
            skip_known(self.work, self._known)
        while True:
            self._rest()
            if self._abort is not None:
                return self._abort
            if reason := self._rule.reason(self.progress):
                self._reached = True
                return reason
            if reason := self._treat_one():
                return reason

    def _treat_one(self) -> str:
        """Treat one fibre; returns why the campaign ends, or nothing."""
        run = ProcedureRun(
            self._doing.procedure,
            self.work,
            self.work.clock,
            self._policy,
            stopped=self._stopped,
        )
        run.subscribe(self._on_event)
        self._keeper.begin_run()
        taken = len(self.work.finished)
        if reason := self._follow(run):
            return reason
        try:
            run.run_here()
        except ProcedureAborted as exc:
            if self._broken is not None:
                raise self._broken from exc
            self._keep_cut_off(str(exc))
            return self._abort or str(exc)
        except OperationFailed as exc:
            return self._after_failure(exc, taken)
        self._keep_finished()
        return ""

    def _after_failure(self, failure: OperationFailed, taken: int) -> str:
        if failure.cause == STOPPED:
            self._keep_cut_off(str(failure))
            return str(failure)
        self._keep_finished()
        if failure.cause == NONE_LEFT:
            return str(failure)
        if len(self.work.finished) > taken:
            return ""
        held = [each for each in self.work.hands if each.fibre is not None]
        if not held:
            raise failure
        for hand in held:
            self._keep_held(hand, failure)
        self.work.surveyed = False
        self._stuck += 1
        if self._stuck >= MOST_STUCK:
            return f"{self._stuck} fibres in a row could not be put away, the last: {failure}"
        return ""

    # What happens meanwhile

    def _on_event(self, event: NodeEvent) -> None:
        if event.kind == OPERATION and event.state is NodeState.RUNNING:
            self._operation = f"{event.role}: {event.name}" if event.role else event.name
        try:
            self._keeper.note(event)
            if event.role and not self._unwritten:
                self._keep_meanwhile()
        except CosmicError as exc:  # what cannot be written down must not be done
            self._broken = exc
            if self._run is not None:
                self._run.abort(str(exc))
