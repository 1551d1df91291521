"""What all operations on fibres have in common."""

from typing_extensions import override

from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.failures import failure_of
from cosmic.autonomy.procedures.operation import Steps, UnitOperation
from cosmic.frame.errors import CosmicError


class FibreOperation(UnitOperation[FibreWork]):
    """An operation that leaves word in the work of what it failed with.

    Subclasses override `steps` instead of `run`.
    """

    @override
    def run(self, work: FibreWork) -> Steps:
        try:
            yield from self.steps(work)
        except CosmicError as exc:
            work.failures.append((self.name, failure_of(exc)))
            raise

    def steps(self, work: FibreWork) -> Steps:
        """Carry it out."""
        raise NotImplementedError
