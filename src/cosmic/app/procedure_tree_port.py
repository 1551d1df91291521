"""What the panel of procedures needs of a run, and the way of its changes to the window."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from cosmic.autonomy.procedures.run_state import RunState
from cosmic.autonomy.procedures.tree import NodeView


class ProcedurePort(Protocol):
    """A run of a procedure, as the window sees it; a `ProcedureRun` is one."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name of the procedure."""

    @property
    @abstractmethod
    def state(self) -> RunState:
        """What it is at."""

    @property
    @abstractmethod
    def failure(self) -> Exception | None:
        """What it failed with."""

    @property
    @abstractmethod
    def not_safe(self) -> str:
        """Why things could not be made safe at the end; empty when they were."""

    @property
    @abstractmethod
    def tree(self) -> NodeView:
        """What each part is at."""

    @abstractmethod
    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()` when anything changed, in any thread; returns what ends it."""

    @abstractmethod
    def start(self) -> None:
        """Begin."""

    @abstractmethod
    def pause(self) -> None:
        """Rest at the next safe point."""

    @abstractmethod
    def resume(self) -> None:
        """Go on."""

    @abstractmethod
    def step(self) -> None:
        """Carry out one operation, then rest."""

    @abstractmethod
    def abort(self, reason: str = "aborted") -> None:
        """End it at once."""

    @abstractmethod
    def join(self) -> None:
        """Wait until its thread is gone."""


class ChangeBridge(QObject):
    """Brings changes to the window's thread: one signal for all that happened meanwhile.

    Signals
    -------
    changed()
        Something changed since `take` was called last.
    """

    changed = Signal()

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self._due = False
        self._ends: list[Callable[[], None]] = []
        widget.destroyed.connect(_ender(self._ends))

    def follow(self, port: ProcedurePort) -> None:
        """Tell of the changes of `port`, and of no other."""
        self.end()
        self._due = False
        self._ends.append(port.on_change(self.tell))

    def tell(self) -> None:
        """Say that something changed; any thread."""
        if not self._due:
            self._due = True
            self.changed.emit()

    def take(self) -> None:
        """Say that what changed until now is about to be shown."""
        self._due = False

    def end(self) -> None:
        """Listen no more; harmless the second time."""
        _end_all(self._ends)


def _ender(ends: list[Callable[[], None]]) -> Callable[[], None]:
    return lambda: _end_all(ends)  # must not hold the widget, which is gone by then


def _end_all(ends: list[Callable[[], None]]) -> None:
    while ends:
        ends.pop()()
