"""ECM in the window: a detour for a blocked move is planned, previewed, and driven after Go."""

import logging
import math
from dataclasses import replace
from enum import StrEnum
from functools import partial
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QVBoxLayout, QWidget

from cosmic.app.panels.scene import ScenePanel
from cosmic.frame.errors import NotAvailable
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.key_focus import ENTER_KEYS
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, ui_font
from cosmic.frame.operation import Progress, Task
from cosmic.frame.overrides import override
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.gui.detour_request import DetourRequest
from cosmic.mico.gui.mico_widget import MicoWidget

logger = logging.getLogger(__name__)

_MILLIMETRE_UM: Final = 1000.0
_TENTHS_BELOW_S: Final = 10.0
_AT_START: Final = 1.0
"""How far, um or deg, an axis may be from where a path starts."""


class PreviewState(StrEnum):
    """What the preview shows."""

    NONE = "none"
    PLANNING = "planning"
    FOUND = "found"
    MOVING = "moving"
    ENDED = "ended"


class PathPreview(QWidget):
    """The bar above the scene that shows what becomes of a blocked move; it decides nothing.

    It takes no focus by itself: Enter presses Go only after the operator has moved the focus there.

    Signals
    -------
    go_requested()
        The operator wants to drive the path shown.
    cancel_requested()
        The operator does not want it, or has read why there is none.
    """

    go_requested = Signal()
    cancel_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("pathPreview")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Detour")
        self._state = PreviewState.NONE
        self._badge = StateBadge(State.BUSY)
        self._head = named(ElidedLabel(), "pathHead")
        self._head.setFont(ui_font(bold=True))
        self._words = named(QLabel(), "pathWords")
        self._words.setTextFormat(Qt.TextFormat.PlainText)
        self._words.setWordWrap(True)
        self._words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._progress = named(QProgressBar(), "pathProgress")
        self._progress.setAccessibleName("Progress of the detour")
        self._go = named(push_button("Go", "Drive this path, waypoint by waypoint"), "pathGo")
        self._cancel = named(push_button("Cancel", ""), "pathCancel")
        self._go.clicked.connect(self.go_requested)
        self._cancel.clicked.connect(self.cancel_requested)
        self._arrange()
        self.clear()

    def _arrange(self) -> None:
        first = QHBoxLayout()
        first.setSpacing(STEP_PX)
        first.addWidget(self._badge)
        first.addWidget(self._head, 1)
        last = QHBoxLayout()
        last.setSpacing(STEP_PX)
        last.addWidget(self._progress, 1)
        last.addStretch(0)
        last.addWidget(self._go)
        last.addWidget(self._cancel)
        for button in (self._go, self._cancel):
            button.setMinimumWidth(10 * STEP_PX)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX // 2)
        column.addLayout(first)
        column.addWidget(self._words)
        column.addLayout(last)

    @property
    def state(self) -> PreviewState:
        """What it shows."""
        return self._state

    @property
    def text(self) -> str:
        """The text shown; empty when there is none."""
        parts = (self._head.text(), self._words.text())
        shown = self._state is not PreviewState.NONE
        return "\n".join(part for part in parts if part) if shown else ""

    def clear(self) -> None:
        """Show nothing."""
        self._state = PreviewState.NONE
        self.hide()

    def show_planning(self, what: str, why: str) -> None:
        """Show that a detour is being planned, and why the straight path is refused."""
        self._show(PreviewState.PLANNING, State.BUSY, f"Planning a detour for {what}", why)
        self._progress.setRange(0, 0)

    def show_found(self, what: str, path: PlannedPath) -> None:
        """Offer a path."""
        words = f"{path_text(path)}. Nothing moves before you press Go."
        self._show(PreviewState.FOUND, State.OK, f"Detour found for {what}", words)

    def show_moving(self, what: str) -> None:
        """Show that the path is being driven."""
        self._show(PreviewState.MOVING, State.BUSY, f"Driving the detour: {what}", "")
        self._progress.setRange(0, 100)
        self._progress.setValue(0)

    def show_progress(self, fraction: float, text: str) -> None:
        """Show how much of the path is done."""
        if self._state is PreviewState.MOVING:
            self._progress.setValue(round(100 * fraction))
            self._words.setText(text)

    def show_end(self, head: str, why: str) -> None:
        """Show why there is no detour, or why it was abandoned."""
        self._show(PreviewState.ENDED, State.REFUSED, head, why)

    def set_words(self, words: str) -> None:
        """Replace the text below the heading."""
        self._words.setText(words)

    def _show(self, preview: PreviewState, state: State, head: str, words: str) -> None:
        self._state = preview
        self._badge.set_state(state)
        self._head.set_text(head)
        self._words.setText(words)
        self._words.ensurePolished()  # two lines always: the scene below keeps its position
        self._words.setMinimumHeight(2 * self._words.fontMetrics().lineSpacing() + 2)
        self._go.setVisible(preview is PreviewState.FOUND)
        self._progress.setVisible(preview in (PreviewState.PLANNING, PreviewState.MOVING))
        self._cancel.setText("Close" if preview is PreviewState.ENDED else "Cancel")
        self._cancel.setToolTip(_CANCEL_TIPS[preview])
        self.show()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() not in ENTER_KEYS or event.isAutoRepeat():
            super().keyPressEvent(event)
        elif self._cancel.hasFocus():
            self._cancel.click()
        elif self._state is PreviewState.FOUND:
            self._go.click()


_CANCEL_TIPS: Final = {
    PreviewState.PLANNING: "Stop planning",
    PreviewState.FOUND: "Leave every axis at its position",
    PreviewState.MOVING: "Stop here and abandon the detour",
    PreviewState.ENDED: "Close this message",
}


class PathController(QObject):
    """Plans a detour for a blocked move and drives it after Go; GUI thread.

    Nothing moves before the operator presses Go, and the gate checks each part again.

    Parameters
    ----------
    panel : MicoWidget
        Where the moves come from.
    scene : ScenePanel
        Where the path is drawn.
    preview : PathPreview
        Where it is offered.

    Signals
    -------
    offered()
        The preview has something new to show.
    """

    offered = Signal()

    def __init__(
        self,
        panel: MicoWidget,
        scene: ScenePanel,
        preview: PathPreview,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._mico = panel.mico
        self._application = panel.mico.application
        self._scene = scene
        self._preview = preview
        self._request: DetourRequest | None = None
        self._task: Task | None = None
        self._answer: PlannedPath | MoveVerdict | None = None
        self._path: PlannedPath | None = None
        # Queued even from this thread: the answer was sent before, and comes before its end.
        queued = Qt.ConnectionType.QueuedConnection
        self._relay = Relay(self._on_progressed, queued=True)
        self._application.path_found.connect(self._on_answer, queued)
        self._application.path_missing.connect(self._on_answer, queued)
        panel.detour_wanted.connect(self.plan)
        scene.refused_gone.connect(self._on_refused_gone)
        preview.go_requested.connect(self.go)
        preview.cancel_requested.connect(self.cancel)

    @property
    def state(self) -> PreviewState:
        """What the preview shows."""
        return self._preview.state

    # Planning

    def plan(self, request: DetourRequest) -> None:
        """Plan a detour; an earlier offer is withdrawn."""
        if self._mico[request.axis].details.in_motion:
            self._refuse(request, f"{request.axis} is moving; wait until it is stationary")
            return
        try:
            task = self._application.search_path({request.axis: request.target, **request.others})
        except NotAvailable as exc:
            self._refuse(request, str(exc))
            return
        self._forget()
        self._request, self._task = request, task
        request.note("the straight path is blocked; planning a detour")
        self._preview.show_planning(_what(request), str(request.verdict))
        self.offered.emit()
        task.subscribe(partial(self._relay, task))

    def _refuse(self, request: DetourRequest, why: str) -> None:
        """Let the refusal of the straight path stand."""
        text = f"{request.verdict}; no detour was planned: {why}"
        request.refuse(replace(request.verdict, text=text))

    def _on_answer(self, answer: object) -> None:
        if isinstance(answer, PlannedPath | MoveVerdict):
            self._answer = answer

    def _on_progressed(self, task: Task, progress: Progress) -> None:
        if task is not self._task:
            return
        if not progress.done:
            self._preview.show_progress(progress.fraction, progress.text)
            return
        self._task = None
        if self.state is PreviewState.PLANNING:
            self._end_planning(progress)
        elif self.state is PreviewState.MOVING:
            self._end_moving(task, progress)

    def _end_planning(self, progress: Progress) -> None:
        request, answer, self._answer = self._request, self._answer, None
        if request is None:
            return
        if isinstance(answer, PlannedPath) and not progress.error:
            self._offer(request, answer)
            return
        verdict = replace(request.verdict, text=progress.error)
        if isinstance(answer, MoveVerdict) and str(answer) == progress.error:
            verdict = answer
        logger.info("no detour for %s: %s", _what(request), verdict)
        request.refuse(verdict)
        self._preview.show_end(f"No detour for {_what(request)}", str(verdict))

    def _offer(self, request: DetourRequest, path: PlannedPath) -> None:
        self._path = path
        self._scene.clear_refused()
        self._scene.set_planned(poses_along(path, self._positions()))
        self._preview.show_found(_what(request), path)
        request.note("a detour was found: Go or Cancel in the panel Scene")
        self.offered.emit()

    def _positions(self) -> dict[str, float]:
        states = {axis.key: axis.details for axis in self._mico}
        return {name: each.position for name, each in states.items() if each.position is not None}

    # Moving

    def go(self) -> None:
        """Drive the path on offer; plans again where an axis has left the start of the path."""
        request, path = self._request, self._path
        if self.state is not PreviewState.FOUND or request is None or path is None:
            return
        if self._left_start(path):
            logger.info("an axis moved since the detour was found: planning again")
            self.plan(request)
            return
        try:
            if why := self._mico.application.busy():
                raise NotAvailable(why)
            task = self._application.follow_path(path, self._mico.source)
        except NotAvailable as exc:
            self._preview.set_words(f"Not yet: {exc}. Then press Go again.")
            return
        logger.info("detour: %s, %d waypoints", _what(request), len(path.waypoints))
        self._task = task
        request.note("driving the detour")
        self._preview.show_moving(_what(request))
        task.subscribe(partial(self._relay, task))

    def _left_start(self, path: PlannedPath) -> bool:
        for name, start in path.start.items():
            state = self._mico[name].details
            away = state.position is None or abs(state.position - start) > _AT_START
            if state.in_motion or away:
                return True
        return False

    def _end_moving(self, task: Task, progress: Progress) -> None:
        request = self._request
        what = _what(request) if request is not None else ""
        self._forget()
        if progress.error and not task.cancel_requested:
            self._preview.show_end(f"The detour was abandoned: {what}", progress.error)
            self.offered.emit()

    def cancel(self) -> None:
        """Abandon what the preview shows: planning, offer, message, or the movement itself."""
        if self.state is PreviewState.MOVING and self._task is not None:
            self._task.cancel()  # its end clears the preview
            return
        if self._task is not None:
            self._task.cancel()
        offered = self.state in (PreviewState.PLANNING, PreviewState.FOUND)
        if offered and self._request is not None:
            logger.info("the detour for %s was abandoned", _what(self._request))
        self._forget()

    def _forget(self) -> None:
        if self._request is not None:
            self._request.note("")
        self._request = self._task = self._answer = self._path = None
        self._scene.set_planned(None)
        self._preview.clear()

    def _on_refused_gone(self) -> None:
        if self.state is PreviewState.ENDED:
            self._forget()


def path_text(path: PlannedPath) -> str:
    """Return a path in one line: "detour, 9.2 mm instead of 4.0 mm, about 3 s, 5 waypoints"."""
    count = len(path.waypoints)
    lengths = f"{_length_text(path.length)} instead of {_length_text(path.straight_length)}"
    parts = [path.method, lengths]
    if math.isfinite(path.duration_s):
        digits = 1 if path.duration_s < _TENTHS_BELOW_S else 0
        parts.append(f"about {path.duration_s:.{digits}f} s")
    parts.append(f"{count} waypoint{'' if count == 1 else 's'}")
    return ", ".join(parts)


def _length_text(length_um: float) -> str:
    if length_um < _MILLIMETRE_UM:
        return f"{length_um:.0f} µm"
    return f"{length_um / _MILLIMETRE_UM:.1f} mm"


def _what(request: DetourRequest) -> str:
    return f"{request.axis} to {request.where}"


def poses_along(path: PlannedPath, positions: dict[str, float]) -> list[dict[str, float]]:
    """Return where all axes are at the start of a path and after each of its waypoints."""
    poses = [{**positions, **path.start}]
    for waypoint in path.waypoints:
        poses.append({**poses[-1], **waypoint})
    return poses
