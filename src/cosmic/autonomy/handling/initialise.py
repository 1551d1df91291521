"""The initialisation sequence as an operation: positions of before are not trusted."""

from typing import Final

from typing_extensions import override

from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, Steps
from cosmic.frame.errors import MoveRefused
from cosmic.frame.verdict import Reason

TRIES: Final = 4
APART_S: Final = 8.0


class InitialiseAgain(FibreOperation):
    """The sequence of the platform file; only where the run before ended without warning.

    Whoever goes on with a campaign has consented to it.
    """

    name = "initialise again"

    @override
    def steps(self, work: FibreWork) -> Steps:
        if not work.distrusted:
            return
        for left in reversed(range(TRIES)):
            try:
                yield work.mico.initialise(wait=False)
            except MoveRefused as refusal:
                if refusal.verdict.reason is not Reason.NO_ANSWER or not left:
                    raise
                yield APART_S  # the gate is being restarted, or the machine is busy
            else:
                break
        work.distrusted = False
        yield SAFE_POINT
