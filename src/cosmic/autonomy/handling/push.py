"""Operations of the probe: it looks for the held fibre and pushes it, span after span."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from typing_extensions import override

from cosmic.autonomy.bending.fit import fit_bending
from cosmic.autonomy.bending.plan import DRY_EI_N_M2, SpanLimits, guess_ei, plan_spans
from cosmic.autonomy.bending.result import BendingError
from cosmic.autonomy.handling.force_ready import ready_force
from cosmic.autonomy.handling.grasp import shape_of
from cosmic.autonomy.handling.in_hand import FibreInHand
from cosmic.autonomy.handling.one_span import NO_CONTACT, OneSpan
from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.errors import NotAvailable

logger = logging.getLogger(__name__)

TOO_SHORT: Final = "too short"
NOT_TRUSTED: Final = "not trusted"


class PushSpans(FibreOperation):
    """All spans of one grasp, the longest first; each one makes the plan of the next better."""

    name = "push the spans"

    @override
    def steps(self, work: FibreWork) -> Steps:
        fibre = work.in_hand()
        fibre.spans.clear()
        fibre.contacts.clear()
        fibre.zero_un = None
        fibre.free_um = min(fibre.free_um, shape_of(work, fibre).reach_um)
        try:
            plan_spans(fibre.free_um, limits=span_limits(work))
        except BendingError as exc:
            raise OperationFailed(TOO_SHORT, str(exc)) from exc
        yield from ready_force(work)
        if work.beside_another and not fibre.peak_un:
            work.forces.take_peak_un()  # was that of the fibre before
        before = arm(work)
        try:
            yield from self._spans(work, fibre)
        finally:
            put_back(work, before)
            fibre.peak_un = max(fibre.peak_un, work.forces.take_peak_un())

    @staticmethod
    def _spans(work: FibreWork, fibre: FibreInHand) -> Steps:
        push = work.settings.push
        while True:
            guess = fibre.ei_guess_n_m2 or DRY_EI_N_M2
            plan = plan_spans(fibre.free_um, guess, span_limits(work), done=fibre.spans)
            if not plan:
                break
            yield from OneSpan(work, fibre, plan[0]).steps()
            width = push.fit.model_copy(update={"fibre_width_um": fibre.width_um})
            fibre.ei_guess_n_m2 = guess_ei(fibre.spans, settings=width) or fibre.ei_guess_n_m2
            yield SAFE_POINT


def span_limits(work: FibreWork) -> SpanLimits:
    """Return what spans there may be; shorter ones for a fibre that points up or down."""
    push = work.settings.push
    if not work.in_hand().tilts:
        return push.spans
    longest = min(push.spans.longest_um, push.tilt_longest_um)
    return push.spans.model_copy(update={"longest_um": longest})


def limit_of(work: FibreWork) -> LimitSettings | None:
    """Return the force limit that is in force for the channel of the probe."""
    channel = work.settings.push.channel
    limits = (each.settings for each in work.daqco.limits)
    return next((each for each in limits if each.channel == channel), None)


def arm(work: FibreWork) -> LimitSettings | None:
    """Arm the force limit of a push, which stops everything; return the one that was there."""
    push, before = work.settings.push, limit_of(work)
    if push.stop_un > 0.0:
        limit = LimitSettings(
            channel=push.channel, low=-push.stop_un, high=push.stop_un, hysteresis=5.0, armed=True
        )
        work.daqco.set_limit(limit)
    return before


def put_back(work: FibreWork, before: LimitSettings | None) -> None:
    """Have the force limit as it was before `arm`."""
    now = limit_of(work)
    if now is None or work.settings.push.stop_un <= 0.0:
        return
    try:
        work.daqco.set_limit(before or now.model_copy(update={"armed": False}))
    except NotAvailable as exc:  # nothing is acquired: that has stopped everything already
        logger.warning("the force limit is not armed again: %s", exc)


@contextmanager
def armed_while_pushing(work: FibreWork) -> Iterator[None]:
    """Have the force limit armed while the probe pushes, and afterwards as it was.

    Between pushes a campaign deals itself with a board or a sensor that fails.
    """
    before = limit_of(work)
    if before is None or not before.armed:
        yield
        return
    logger.warning("the force limit is armed while the probe pushes, until the campaign ends")
    work.daqco.disarm_limit(before.channel)
    try:
        yield
    finally:
        put_back(work, before)


class FitSpans(FibreOperation):
    """The bending stiffness of what was measured; fails where it may not be trusted."""

    name = "fit the bending stiffness"

    @override
    def steps(self, work: FibreWork) -> Steps:
        fibre = work.in_hand()
        fit = work.settings.push.fit.model_copy(update={"fibre_width_um": fibre.width_um})
        fibre.bending = fit_bending(fibre.spans, settings=fit)
        if not fibre.bending.trusted:
            raise OperationFailed(NOT_TRUSTED, "; ".join(fibre.bending.reasons))
        yield SAFE_POINT


class StepBack(FibreOperation):
    """The probe goes back before the fibre is pushed again.

    One that was not met may point up or down: it is held lower then, and higher the next time.
    """

    name = "step back"

    @override
    def steps(self, work: FibreWork) -> Steps:
        fibre, push = work.in_hand(), work.settings.push
        _, failure = work.failures[-1]
        fibre.tilts += failure.cause == NO_CONTACT
        x, y = work.tip_now(work.probe)
        back = push.stand_off_um + push.search_um
        yield work.go(work.at(work.probe, x, y - back * (1.0 if work.probe.forward[1] > 0 else -1)))


class Retract(FibreOperation):
    """The probe goes back from the fibre, and out of the way."""

    name = "retract the probe"

    @override
    def steps(self, work: FibreWork) -> Steps:
        x, y = work.tip_now(work.probe)
        away = work.settings.places.probe_away_y_um
        if y < away - 1.0:
            yield work.go(work.at(work.probe, x, away))
