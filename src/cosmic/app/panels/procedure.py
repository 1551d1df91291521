"""The panel "Procedure": its tree, what it is at, and how to start, pause, step and end it."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Final, Protocol

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QHideEvent, QShowEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from cosmic.app.panels.procedure_tree import ProcedureTree
from cosmic.app.panels.state_indicator import StateIndicator
from cosmic.autonomy.procedures.run import OVER, RunState
from cosmic.autonomy.procedures.tree import NodeView
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.key_focus import set_usable
from cosmic.frame.gui.theme import STEP_PX, State
from cosmic.frame.overrides import override


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
        self._ends.append(port.on_change(self.publish))

    def publish(self) -> None:
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


PERIOD_MS: Final = 50
"""No more than so often is what changed drawn."""
TICK_MS: Final = 200
"""So often the times are drawn where nothing else changes."""
_BEGUN: Final = (RunState.RUNNING, RunState.PAUSING, RunState.PAUSED, RunState.ABORTING)
_LOOKS: Final[dict[RunState, State | None]] = {
    RunState.READY: None,
    RunState.RUNNING: State.BUSY,
    RunState.PAUSING: State.BUSY,
    RunState.PAUSED: State.REFUSED,
    RunState.ABORTING: State.REFUSED,
    RunState.DONE: State.OK,
    RunState.FAILED: State.ERROR,
    RunState.ABORTED: State.REFUSED,
}


class ProcedureTreePanel(QWidget):
    """Shows a run and lets the operator steer it; GUI thread.

    A run begun elsewhere can be shown as well. Closing the panel aborts the one begun here.

    Parameters
    ----------
    make_run : callable or None
        Returns a run that is ready to begin; called when Start is pressed and none is at hand.
    go_on : callable or None
        Returns a run that goes on where the one that is shown ended early; called when Resume is
        pressed then.

    Signals
    -------
    refused()
        What a button asked for cannot be; the reason stands in the panel.

    Attributes
    ----------
    buttons : QWidget
        Start, pause and the others, below the tree; another panel may have them elsewhere.
    """

    refused = Signal()

    def __init__(
        self,
        make_run: Callable[[], ProcedurePort] | None = None,
        go_on: Callable[[], ProcedurePort] | None = None,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("ProcedureTreePanel")
        self._make_run = make_run
        self._go_on = go_on
        self._run: ProcedurePort | None = None
        self._mine: ProcedurePort | None = None
        self._bridge = ChangeBridge(self)
        self.indicator = StateIndicator()
        self.state = Chip("no procedure", tip="State of the procedure")
        self.title = named(ElidedLabel(), "procedureTitle")
        self.reason = named(ElidedLabel(), "procedureReason")
        self.tree = ProcedureTree()
        self.start = named(push_button("Start", "Start the procedure"), "procedureStart")
        self.pause = named(
            push_button("Pause", "Pause at the next safe point: nothing moves and nothing is lost"),
            "procedurePause",
        )
        self.step = named(
            push_button("Step", "Carry out one operation, then pause"), "procedureStep"
        )
        self.resume = named(
            push_button("Resume", "Resume after a pause, or after an early end"), "procedureResume"
        )
        self.abort = named(
            push_button(
                "Abort", "End it at once: moves are cancelled, then the tools are made safe"
            ),
            "procedureAbort",
        )
        self._build()
        self._connect()
        self._redraw = QTimer(self, interval=PERIOD_MS, singleShot=True)
        self._redraw.timeout.connect(self.refresh)
        self._tick = QTimer(self, interval=TICK_MS)
        self._tick.timeout.connect(self.refresh)
        self._bridge.changed.connect(self._on_changed)
        self.refresh()

    def _build(self) -> None:
        head = QHBoxLayout()
        head.setSpacing(STEP_PX)
        head.addWidget(self.indicator)
        head.addWidget(self.state)
        head.addWidget(self.title, 1)
        self.buttons = QWidget()
        flow = FlowLayout(STEP_PX, self.buttons)
        for button in (self.start, self.pause, self.step, self.resume, self.abort):
            flow.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addLayout(head)
        column.addWidget(self.reason)
        column.addWidget(self.tree, 1)
        column.addWidget(self.buttons)

    def _connect(self) -> None:
        self.start.clicked.connect(self._on_start)
        self.pause.clicked.connect(self._on_pause)
        self.step.clicked.connect(self._on_step)
        self.resume.clicked.connect(self._on_resume)
        self.abort.clicked.connect(self._on_abort)

    @property
    def run(self) -> ProcedurePort | None:
        """What is shown."""
        return self._run

    def follow(self, run: ProcedurePort) -> None:
        """Show `run`, begun or not."""
        self._run = run
        self._bridge.follow(run)
        self.tree.lay_out(run.tree)
        self.refresh()

    # What the operator does

    def _on_start(self) -> None:
        def begin() -> None:
            self._ready_run().start()

        self._attempt(begin)

    def _on_step(self) -> None:
        def begin() -> None:
            run = self._run
            if run is None or run.state in OVER or run.state is RunState.READY:
                run = self._ready_run()
            run.step()

        self._attempt(begin)

    def _ready_run(self) -> ProcedurePort:
        """Return a run that can be begun, and be answerable for it."""
        run = self._run
        if self._make_run is not None and (run is None or run.state in OVER):
            run = self._make_run()
            self.follow(run)
        if run is None:
            raise CosmicError("there is no procedure to start: choose one")
        self._mine = run
        return run

    def _on_pause(self) -> None:
        if self._run is not None:
            self._run.pause()
        self.refresh()

    def _on_resume(self) -> None:
        def go_on() -> None:
            if self._run is None:
                return
            if self._run.state not in OVER:
                self._run.resume()
            elif self._go_on is not None:
                self._mine = self._go_on()
                self.follow(self._mine)
                self._mine.start()

        self._attempt(go_on)

    def _on_abort(self) -> None:
        if self._run is not None:
            self._run.abort("aborted by the operator")
        self.refresh()

    def _attempt(self, action: Callable[[], None]) -> None:
        try:
            action()
        except CosmicError as exc:
            self.indicator.set_state(State.REFUSED)
            self.state.setText("refused")
            self.reason.set_text(str(exc))
            self.refused.emit()
            return
        self.refresh()

    # Showing

    def _on_changed(self) -> None:
        if self._is_seen() and not self._redraw.isActive():
            self._redraw.start()

    def _is_seen(self) -> bool:
        return self.isVisible() or self.buttons.isVisible()

    def refresh(self) -> None:
        """Show the run as it is now."""
        self._bridge.take()
        run = self._run
        self._enable(None if run is None else run.state)
        if run is None:
            return
        state = run.state
        self.indicator.set_state(_LOOKS[state])
        self.state.setText(state.value)
        self.tree.show_view(run.tree)
        front = self.tree.front if state in _BEGUN else ""
        self.title.set_text(f"{run.name}: {front}" if front else run.name)
        self.reason.set_text(_reason(run))
        ticking = state in _BEGUN and self.isVisible()
        if ticking != self._tick.isActive():
            if ticking:
                self._tick.start()
            else:
                self._tick.stop()

    def _enable(self, state: RunState | None) -> None:
        fresh = state is RunState.READY or (
            self._make_run is not None and (state is None or state in OVER)
        )
        early = self._go_on is not None and state in (RunState.ABORTED, RunState.FAILED)
        for button, usable in (
            (self.start, fresh),
            (self.pause, state is RunState.RUNNING),
            (self.step, fresh or state is RunState.PAUSED),
            (self.resume, early or state in (RunState.PAUSED, RunState.PAUSING)),
            (self.abort, state in _BEGUN),
        ):
            set_usable(button, self, usable=usable)

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.refresh()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        if not self._is_seen():
            self._redraw.stop()
        self._tick.stop()

    @override
    def closeEvent(self, event: QCloseEvent) -> None:
        self.end_mine()
        super().closeEvent(event)

    def end_mine(self) -> None:
        """Abort the run that was begun here; for whoever closes the window."""
        if self._mine is not None:
            self._mine.abort("the window was closed")

    def shut_down(self) -> None:
        """Abort the run that was begun here, and wait until its thread is gone."""
        self.end_mine()
        self._bridge.end()
        if self._mine is not None:
            self._mine.join()


def _reason(run: ProcedurePort) -> str:
    text = "" if run.failure is None else str(run.failure)
    if run.not_safe:
        text = f"{text}; not made safe: {run.not_safe}" if text else run.not_safe
    return text
