"""The operations of pushing a fibre: the force is ready, span after span is pushed, and fitted."""

import logging
from typing import Final

from typing_extensions import override

from cosmic.autonomy.bending.fit import (
    Certificate,
    assess_campaign,
    in_time,
    measure_fibre,
    measured_s,
)
from cosmic.autonomy.bending.plan import DRY_EI_N_M2, SpanLimits, guess_ei, plan_spans
from cosmic.autonomy.bending.result import BendingError
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.force_limit import (
    arm_force_limit,
    guard_probe,
    put_back,
)
from cosmic.autonomy.handling.grasp import see_it_follow, shape_of
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.one_span import NO_CONTACT as NO_CONTACT
from cosmic.autonomy.handling.one_span import OBSTRUCTED as OBSTRUCTED
from cosmic.autonomy.handling.one_span import TOO_HIGH as TOO_HIGH
from cosmic.autonomy.handling.one_span import OneSpan as OneSpan
from cosmic.autonomy.handling.one_span import ceiling_un as ceiling_un
from cosmic.autonomy.handling.one_span import places_back_um as places_back_um
from cosmic.autonomy.handling.prepare import retract_probe
from cosmic.autonomy.handling.settings import StandardSettings
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.frame.errors import DeviceError, NotAvailable

logger = logging.getLogger(__name__)

NO_FORCE: Final = "force sensor"
LOOKS: Final = 4
APART_S: Final = 3.0
"""A contact that was loose is back within three of these; a campaign that waits so twice, in the
fibre and before the next, still ends within half a minute."""
LOOK_S: Final = 0.02
HIGHEST_PART: Final = 0.5
"""Of the force that stops everything: what the sensor may read with nothing at the probe."""


class SeeForce(FibreOperation):
    """The force sensor reads what it should with nothing at the probe; no fibre is taken before."""

    name = "see the force"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        yield from ready_force(work)
        yield SAFE_POINT


def ready_force(work: HandlingContext) -> Steps:
    """Have samples come, and wait until they are near zero and alive; no limit is armed before.

    Acquisition that has ended is begun again. From a sensor that stands far from zero the probe is
    taken away: what was overloaded comes back, and what pressed on it is gone.

    Raises
    ------
    OperationFailed
        It is not so after some time; the text says what to look at.
    """
    push, trouble = work.settings.push, ""
    highest_un = HIGHEST_PART * max(push.stop_un, push.limit_un)
    for look in range(LOOKS):
        if look:
            logger.warning("%s; checked again in %g s", trouble, APART_S)
            yield APART_S
        try:
            if not work.daqco.running:
                work.daqco.start()
            mean = yield work.forces.wanted(LOOK_S, settle_s=push.settle_s)
        except (NotAvailable, DeviceError) as exc:
            trouble = str(exc)
            continue
        assert isinstance(mean, ForceMean)
        if not abs(mean.mean_un) <= highest_un:
            trouble = (
                f"the force sensor reads {mean.mean_un:.0f} uN with nothing at the probe, and at "
                f"most {highest_un:.0f} uN is allowed"
            )
            yield from retract_probe(work)
        elif not mean.spread_un >= push.quiet_un:
            trouble = (
                f"the force sensor reads {mean.mean_un:.1f} uN without any noise, as one does that "
                "is dead or cut off"
            )
        else:
            return
    raise OperationFailed(
        NO_FORCE,
        f"{trouble}; check the sensor, its cable and the acquisition, then start again",
    )


TOO_SHORT: Final = "too short"
NOT_TRUSTED: Final = "not trusted"


GUESSED_FROM: Final = 2
"""Spans from which the next ones are planned: more change the plan by nothing that counts."""


class PushSpans(FibreOperation):
    """All spans of one grasp, the longest first; each one makes the plan of the next better.

    Of a fibre that has a result already the spans of that are kept until there are all of the next.

    Parameters
    ----------
    seen_after : bool
        The fibre is to be seen afterwards: where the camera stays lost no further span is pushed.
    """

    name = "push the spans"

    def __init__(self, *, seen_after: bool = True) -> None:
        self._seen_after = seen_after

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, done = work.held_fibre(), False
        earlier = () if fibre.bending is None else tuple(fibre.spans)
        try:
            yield from self._pushed(work, fibre)
            fibre.bending, fibre.measured, done = None, None, True
        finally:
            if earlier and not done:
                fibre.spans[:] = earlier

    def _pushed(self, work: HandlingContext, fibre: HeldFibre) -> Steps:
        fibre.spans.clear()
        fibre.contacts.clear()
        fibre.zero_un = None
        gentle = shape_of(work, fibre).gentle_um(work.settings.push.steepest_deg)
        fibre.free_um = min(fibre.free_um, gentle)
        try:
            plan_spans(fibre.free_um, limits=span_limits(work), settings=fit_settings(work, fibre))
        except BendingError as exc:
            raise OperationFailed(TOO_SHORT, str(exc)) from exc
        yield from ready_force(work)
        if work.beside_another and not fibre.peak_un:
            work.forces.take_peak_un()  # was that of the fibre before
        if not work.beside_another:  # with two arms the probe is never parked between fibres
            guard_probe(work)
        before = arm_force_limit(work)
        try:
            yield from self._spans(work, fibre)
        finally:
            put_back(work, before)
            fibre.peak_un = max(fibre.peak_un, work.forces.take_peak_un())
        if work.shared.parks_limit and not work.beside_another:
            yield from retract_probe(work)

    def _spans(self, work: HandlingContext, fibre: HeldFibre) -> Steps:
        limits, fit = span_limits(work), fit_settings(work, fibre)
        while True:
            guess = fibre.ei_guess_n_m2 or DRY_EI_N_M2
            plan = plan_spans(fibre.free_um, guess, limits, done=fibre.spans, settings=fit)
            if not plan:
                break
            if self._seen_after:
                work.check_camera()
            yield from OneSpan(work, fibre, plan[0]).steps()
            if len(fibre.spans) <= GUESSED_FROM:
                guessed = guess_ei(fibre.spans, settings=fit)
                fibre.ei_guess_n_m2 = guessed or fibre.ei_guess_n_m2
            yield SAFE_POINT


def span_limits(work: HandlingContext) -> SpanLimits:
    """Return what spans there may be; shorter ones for a fibre that points up or down."""
    push, fibre = work.settings.push, work.held_fibre()
    ours = work.settings.standard if fibre.standard else push.spans
    longest = min(ours.longest_um, push.spans.longest_um) if fibre.nearer else ours.longest_um
    if fibre.tilts:
        longest = min(longest, push.tilt_longest_um)
    return push.spans.model_copy(
        update={"longest_um": longest, "longest_stroke_um": ours.longest_stroke_um}
    )


def fit_settings(work: HandlingContext, fibre: HeldFibre) -> FitSettings:
    """Return the instrument as the fit sees it, and how wide the fibre is."""
    width_um = work.settings.standard.width_um if fibre.standard else fibre.width_um
    return work.settings.push.fit.model_copy(update={"fibre_width_um": width_um})


LEARNED_FROM: Final = 20
"""Fibres before, from which what is common to all is learned."""

STANDARDS_FROM: Final = 6
"""Measurements of the standard before: of a day on many plates the last ones tell the scale."""


class FitSpans(FibreOperation):
    """The bending stiffness of what was measured; fails where it may not be trusted."""

    name = "fit the bending stiffness"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, standard = work.held_fibre(), work.settings.standard
        fit = fit_settings(work, fibre)
        fibre.measured = measure_fibre(
            fibre.spans,
            settings=fit,
            certificate=certificate_of(standard) if fibre.standard else None,
        )
        before = [each for each in work.shared.finished if each.measured is not None]
        # What is common to all fibres is learned from those before; the last ones are enough.
        fibres = [each for each in before if not each.standard][-LEARNED_FROM:]
        standards = [each for each in before if each.standard][-STANDARDS_FROM:]
        kept = [*fibres, *standards, fibre]
        measured = in_time(
            [each.measured for each in kept if each.measured is not None],
            [measured_s(each.spans) for each in kept],
        )
        found = assess_campaign(
            [each for each in measured if each.certificate is None],
            standards=[each for each in measured if each.certificate is not None],
            settings=fit,
            refits=work.shared.refits,
        )
        fibre.bending = (found.standards if fibre.standard else found.fibres)[-1]
        if not fibre.bending.trusted:
            raise OperationFailed(NOT_TRUSTED, "; ".join(fibre.bending.reasons))
        yield SAFE_POINT


def certificate_of(standard: StandardSettings) -> Certificate:
    """Return what a recipe says of the standard."""
    return Certificate(standard.ei_n_m2, standard.expanded_percent / 100.0)


class StepBack(FibreOperation):
    """The probe goes back before the fibre is pushed again, if it is still in the jaws.

    One that was not met may point up or down: it is held lower then, and higher the next time. A
    standard is first tried where fibres are pushed: nearer, the same tilt still meets the probe.
    """

    name = "step back"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, push = work.held_fibre(), work.settings.push
        _, failure = work.failures[-1]
        if failure.cause == NO_CONTACT:
            if fibre.standard and not fibre.nearer:
                fibre.nearer = True
            else:
                fibre.tilts += 1
        x, y = work.tip_now(work.probe)
        back = push.stand_off_um + push.search_um
        yield work.go(work.at(work.probe, x, y - back * (1.0 if work.probe.forward[1] > 0 else -1)))
        if failure.cause == NO_CONTACT:
            yield from see_it_follow(work, fibre)


class Retract(FibreOperation):
    """The probe goes back from the fibre, and out of the way."""

    name = "retract the probe"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        yield from retract_probe(work)
