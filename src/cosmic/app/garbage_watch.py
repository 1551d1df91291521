"""When a process with a platform may look through old objects, and who does it."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QThread, QTimer
from typing_extensions import override

from cosmic.autonomy.control.loop import ControlLoop
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.garbage import GARBAGE
from cosmic.frame.threads import WorkerThread, running_threads
from cosmic.mico.api.mico import Mico

PERIOD_S: Final = 0.5
YOUNG_PERIOD_S: Final = 0.1


class GarbageThread(WorkerThread):
    """Looks through old objects at rests, in a process without a window."""

    def __init__(self, policy: FailurePolicy) -> None:
        super().__init__("garbage", policy)

    @override
    def run_body(self) -> None:
        while not self._end_requested.wait(PERIOD_S):
            GARBAGE.tick()


class GarbageWatch:
    """Keeps garbage collection from the movements of a platform, from `begin` to `end`.

    Parameters
    ----------
    mico : Mico or None
        What moves.
    daqco : DaqcoApplication or None
        What guards movements elsewhere, where there is no `mico`.
    """

    def __init__(
        self,
        mico: Mico | None,
        daqco: DaqcoApplication | None,
        policy: FailurePolicy,
    ) -> None:
        self._mico = mico
        self._daqco = daqco
        self._policy = policy
        self._end: Callable[[], None] | None = None
        self._thread: GarbageThread | None = None
        self._timer: QTimer | None = None
        self._ticks = 0

    def begin(self, *, window: bool = False) -> None:
        """Freeze what is loaded and begin; with a `window`, in its thread, which is this one."""
        if self._end is not None:
            return
        self._end = GARBAGE.begin(self.moves, by_hand=window)
        if not window:
            self._thread = GarbageThread(self._policy)
            self._thread.start()
            return
        self._timer = QTimer(interval=round(1000 * YOUNG_PERIOD_S))
        self._timer.timeout.connect(self._on_timer)
        self._timer.start()

    def _on_timer(self) -> None:
        self._ticks += 1
        GARBAGE.tick_young()
        if self._ticks % round(PERIOD_S / YOUNG_PERIOD_S) == 0:
            GARBAGE.tick()
        self._stop_timer()

    def _stop_timer(self) -> None:
        """Stop the timer where it runs; a platform may be closed from another thread."""
        timer = self._timer
        if timer is not None and self._end is None and timer.thread() is QThread.currentThread():
            timer.stop()

    def moves(self) -> bool:
        """Return whether anything moves, is held by a control loop, or guarded from here."""
        if any(isinstance(each, ControlLoop) for each in running_threads()):
            return True
        if self._mico is not None:
            return any(state.in_motion for state in self._mico.states().values())
        return self._daqco is not None and self._daqco.guard.armed

    def end(self) -> None:
        """Put everything back; any state."""
        if self._thread is not None:
            self._thread.request_end()
            self._thread.join()
            self._thread = None
        if self._end is not None:
            self._end()
            self._end = None
        self._stop_timer()
