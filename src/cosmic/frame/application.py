"""The base of every CoSMic application (thesis 5.3.1, appendix D)."""

import logging
from collections.abc import Callable

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

GuiFactory = Callable[["CosmicApplicationBase"], QObject]


class CosmicApplicationBase(WorkerThread):
    """MiCo, DAQCo and ViCo derive from this; each runs stand-alone or hosted.

    An application never imports widgets: whoever composes a window hands it `gui_factory`, and
    `get_gui` makes the one GUI component with it, in the GUI thread and only when asked.

    Parameters
    ----------
    title : str
        What the operator reads, such as "MiCo".
    gui_factory : callable or None
        Makes the GUI component; None where no window is wanted.
    """

    status_changed = Signal()

    def __init__(
        self,
        title: str,
        policy: FailurePolicy,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(title, policy, parent)
        self._gui_factory = gui_factory
        self._gui: QObject | None = None

    @property
    def title(self) -> str:
        """What the operator reads."""
        return self.name

    @property
    def interface(self) -> object:
        """What scripts have of it: itself, or an object whose class declares what others may do."""
        return self

    def initialize(self) -> None:
        """Open what the application needs and start its threads; override it."""
        raise NotImplementedError(f"{type(self).__name__} does not say how it is initialised")

    def get_gui(self) -> QObject | None:
        """Return the one GUI component, made at the first call; GUI thread."""
        if self._gui is None and self._gui_factory is not None:
            self._gui = self._gui_factory(self)
        return self._gui

    def custom_event_loop(self) -> bool:
        """Run instead of Qt's event loop; return False to have Qt's after all."""
        return False

    @override
    def run_body(self) -> None:
        if not self.custom_event_loop():
            super().run_body()

    def shut_down(self) -> None:
        """Leave the hardware safe, end every thread and release what was opened; any state."""
        self.request_end()
        if not self.join():
            logger.error("%s did not end: its thread is still running", self.title)
