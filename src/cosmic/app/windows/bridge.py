"""Brings what happens in any thread to the window."""

from PySide6.QtCore import QObject, Signal

from cosmic.frame.failure import Failure
from cosmic.mico.core.motion.stop_latch import StopState


class WindowBridge(QObject):
    """Tells in the GUI thread what it is told in any; outlives the window, so nothing is lost."""

    failure_reported = Signal(object)
    latch_changed = Signal(object)

    def tell_failure(self, failure: Failure) -> None:
        """Tell of a failure."""
        self.failure_reported.emit(failure)

    def tell_latch(self, state: StopState) -> None:
        """Tell that the stop was latched or reset."""
        self.latch_changed.emit(state)
