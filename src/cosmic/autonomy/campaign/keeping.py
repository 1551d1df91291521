"""What a campaign keeps of its fibres, and when: at the end of a run, or while it goes on."""

import logging
from dataclasses import replace
from functools import partial

from cosmic.autonomy.campaign.keeper import Keeper
from cosmic.autonomy.campaign.records import FibreRecord
from cosmic.autonomy.campaign.statistics import CampaignProgress
from cosmic.autonomy.campaign.steering import CampaignSteering
from cosmic.autonomy.campaign.stop_rule import StopRule
from cosmic.autonomy.campaign.store_files import NotWrittenError
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.procedures.times import OperationTimes

logger = logging.getLogger(__name__)


class CampaignKeeping(CampaignSteering):
    """Keeps the fibres of a campaign; what is public may be asked from any thread."""

    def __init__(self, work: FibreWork, keeper: Keeper, rule: StopRule) -> None:
        super().__init__()
        self.work = work
        self._keeper = keeper
        self._rule = rule
        self._unwritten = False
        self._kept = 0
        self._stuck = 0
        work.bench.enough = self._enough

    @property
    def fibres(self) -> tuple[FibreRecord, ...]:
        """All fibres so far without curves and pictures, those of earlier runs included."""
        return self._keeper.fibres

    @property
    def times(self) -> OperationTimes:
        """How long operations took, and what they failed with."""
        return self._keeper.times

    @property
    def progress(self) -> CampaignProgress:
        """How it stands."""
        return self._keeper.progress()

    def _keep_held(self, hand: FibreWork, failure: OperationFailed) -> None:
        """Keep a fibre that could not be put away."""
        fibre, hand.fibre = hand.fibre, None
        if fibre is not None:
            fibre.failure = fibre.failure or failure
            self._insist(lambda: self._keeper.keep(fibre))

    def _keep_cut_off(self, reason: str) -> None:
        """Keep the fibres of a run that was cut off: one that was done with by then is no less."""
        self._keep_finished()
        for fibre in self._keeper.in_work:
            self._insist(partial(self._keeper.keep, fibre, interrupted=reason))

    def _keep_finished(self) -> None:
        """Keep the fibres that were done with and are not kept yet."""
        while self._kept < len(self.work.finished):
            fibre = self.work.finished[self._kept]
            with self.work.clock.at_work():
                self._insist(partial(self._keeper.keep, fibre))
            self._kept += 1
            self._stuck = 0
            self._tell()
        self._unwritten = False

    def _enough(self) -> bool:
        """Tell whether no further fibre is to be begun, if those in work become good ones."""
        now, more = self.progress, len(self._keeper.in_work)
        then = replace(now, done=now.done + more, good=now.good + more)
        return self._unwritten or self._abort is not None or bool(self._rule.reason(then))

    def _keep_meanwhile(self) -> None:
        """Keep what one hand is done with, while the other goes on."""
        while self._kept < len(self.work.finished):
            try:
                self._keeper.keep(self.work.finished[self._kept])
            except NotWrittenError as exc:
                # Once both hands are done with theirs, it is tried again.
                logger.error("%s; no further fibre is begun", exc)
                self._unwritten = True
                return
            self._kept += 1
            self._tell()
