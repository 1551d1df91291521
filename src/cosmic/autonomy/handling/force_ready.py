"""Seeing to it that the force can be measured, before a fibre is pushed and before one is taken."""

import logging
from typing import Final

from typing_extensions import override

from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.prepare import retract_probe
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.frame.errors import DeviceError, NotAvailable

logger = logging.getLogger(__name__)

NO_FORCE: Final = "force sensor"
LOOKS: Final = 8
APART_S: Final = 4.0
LOOK_S: Final = 0.02
HIGHEST_PART: Final = 0.5
"""Of the force that stops everything: what the sensor may read with nothing at the probe."""


class SeeForce(FibreOperation):
    """The force sensor reads what it should with nothing at the probe; no fibre is taken before."""

    name = "see the force"

    @override
    def steps(self, work: FibreWork) -> Steps:
        yield from ready_force(work)
        yield SAFE_POINT


def ready_force(work: FibreWork) -> Steps:
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
            logger.warning("%s; looked at again in %g s", trouble, APART_S)
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
        f"{trouble}; look at the sensor, its cable and the acquisition, and begin again",
    )
