"""The initialisation sequence as an operation: positions of before are not trusted."""

from typing_extensions import override

from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, Steps


class InitialiseAgain(FibreOperation):
    """The sequence of the platform file; only where the run before ended without warning.

    Whoever goes on with a campaign has consented to it.
    """

    name = "initialise again"

    @override
    def steps(self, work: FibreWork) -> Steps:
        if not work.distrusted:
            return
        yield work.mico.initialise(wait=False)
        work.distrusted = False
        yield SAFE_POINT
