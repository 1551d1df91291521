"""The thread that a run has of its own."""

from collections.abc import Callable

from typing_extensions import override

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

_kept: list[WorkerThread] = []


def _keep(thread: WorkerThread) -> None:
    """Hold on to it until it has ended: Qt aborts the process over one let go before."""
    _kept[:] = [*(each for each in _kept if not each.isFinished()), thread]


class RunThread(WorkerThread):
    """The thread of one run."""

    def __init__(
        self,
        carry_out: Callable[[], None],
        abort: Callable[[str], None],
        name: str,
        policy: FailurePolicy,
    ) -> None:
        super().__init__(f"procedure {name}", policy)
        self._carry_out: Callable[[], None] | None = carry_out
        self._abort = abort
        _keep(self)

    @override
    def run_body(self) -> None:
        carry_out, self._carry_out = self._carry_out, None
        if carry_out is not None:
            carry_out()

    @override
    def request_end(self) -> None:
        self._abort("the program is closing")
        super().request_end()
