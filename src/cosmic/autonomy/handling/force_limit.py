"""The force limit of a campaign: armed whenever the probe is not where it is parked."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.errors import NotAvailable

logger = logging.getLogger(__name__)

UNWATCHED: Final = "no force limit"


def limit_of(work: HandlingContext) -> LimitSettings | None:
    """Return the force limit that is in force for the channel of the probe."""
    channel = work.settings.push.channel
    limits = (each.settings for each in work.daqco.limits)
    return next((each for each in limits if each.channel == channel), None)


def arm_force_limit(work: HandlingContext) -> LimitSettings | None:
    """Arm the force limit of a push, which stops everything; return the one that was there."""
    push, before = work.settings.push, limit_of(work)
    if push.stop_un > 0.0:
        limit = LimitSettings(
            channel=push.channel, low=-push.stop_un, high=push.stop_un, hysteresis=5.0, armed=True
        )
        if limit != before:
            work.daqco.set_limit(limit)
    return before


def check_watched(work: HandlingContext) -> None:
    """Raise `OperationFailed` where somebody took away the limit that a push has armed."""
    limit = limit_of(work)
    if work.settings.push.stop_un > 0.0 and (limit is None or not limit.armed):
        raise OperationFailed(
            UNWATCHED,
            f"the limit of {work.settings.push.channel} was disarmed during a push; the probe goes "
            "no further and is taken back. The next push arms it again",
        )


def put_back(work: HandlingContext, before: LimitSettings | None) -> None:
    """Have the force limit as it was before `arm_force_limit`."""
    now = limit_of(work)
    if now is None or now == before:
        return
    try:
        work.daqco.set_limit(before or now.model_copy(update={"armed": False}))
    except NotAvailable as exc:  # nothing is acquired: that has stopped everything already
        logger.warning("the force limit was not re-armed: %s", exc)


@contextmanager
def armed_beyond_parking(work: HandlingContext) -> Iterator[None]:
    """Have the force limit armed whenever the probe is out, and afterwards as it was.

    While the probe is parked nothing can touch it, and a campaign deals itself with a board or a
    sensor that fails.
    """
    before = limit_of(work)
    if before is None or not before.armed:
        yield
        return
    logger.warning("the force limit is disarmed while the probe is parked, until the campaign ends")
    work.daqco.disarm_limit(before.channel)
    work.shared.parks_limit = True
    try:
        yield
    finally:
        work.shared.parks_limit = False
        put_back(work, before)


def guard_probe(work: HandlingContext) -> None:
    """Arm the force limit: the probe is about to leave where it is parked.

    Raises
    ------
    NotAvailable, DeviceError
        No force is acquired, and it does not begin.
    """
    if not work.shared.parks_limit:
        return  # what the operator armed stands
    if not work.daqco.running:
        work.daqco.start()
    arm_force_limit(work)


def probe_parked(work: HandlingContext) -> None:
    """Disarm the force limit in a campaign: the probe is parked."""
    if not work.shared.parks_limit:
        return
    now = limit_of(work)
    if now is not None and now.armed:
        work.daqco.disarm_limit(now.channel)
