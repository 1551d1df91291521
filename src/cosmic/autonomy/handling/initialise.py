"""The initialisation sequence as an operation: positions of before are not trusted."""

import logging
from typing import Final

from typing_extensions import override

from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, Steps
from cosmic.frame.errors import DeviceError, MoveRefused, NotAvailable
from cosmic.frame.verdict import Reason
from cosmic.vico.api.lens import LensHandle
from cosmic.vico.hw.peripherals import LensAxis

logger = logging.getLogger(__name__)

TRIES: Final = 4
APART_S: Final = 8.0


class InitialiseAgain(FibreOperation):
    """The sequence of the platform file, and meanwhile the lens is homed.

    Only where the run before ended without warning. Whoever goes on with a campaign has consented
    to it.
    """

    name = "initialise again"

    @override
    def steps(self, work: FibreWork) -> Steps:
        if not work.distrusted:
            return
        lens = work.vico.lens
        homing = None if lens is None or lens.problem else _Homing(lens)
        try:
            yield from _initialise(work)
            if homing is not None:
                yield from homing.steps(work)
        finally:
            if homing is not None:
                homing.end()
        work.distrusted, work.zoomed = False, None
        yield SAFE_POINT


class _Homing:
    """The lens runs to where counting begins, and then focuses as before, or on what lies there."""

    def __init__(self, lens: LensHandle) -> None:
        focus = lens.state(LensAxis.FOCUS)
        self._lens = lens
        self._before = focus.position_counts if focus is not None and focus.homed else None
        self._task = lens.home()

    def steps(self, work: FibreWork) -> Steps:
        lens = self._lens
        yield self._task
        if self._before is not None:
            yield lens.seek_focus(self._before)
            return
        focus = lens.state(LensAxis.FOCUS)
        yield lens.zoom_to(work.settings.zoom)
        if focus is None:
            return
        yield lens.seek_focus(focus.limit_counts // 2)
        try:
            yield lens.autofocus(work.settings.camera)
        except (NotAvailable, DeviceError) as exc:
            logger.warning("the middle of its travel is taken for the focus: %s", exc)

    def end(self) -> None:
        if not self._task.done:
            self._lens.abort()


def _initialise(work: FibreWork) -> Steps:
    for left in reversed(range(TRIES)):
        try:
            yield work.mico.initialise(wait=False, may_hold=True)
        except MoveRefused as refusal:
            if refusal.verdict.reason is not Reason.NO_ANSWER or not left:
                raise
            yield APART_S  # the gate is being restarted, or the machine is busy
        else:
            return
