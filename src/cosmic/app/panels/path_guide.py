"""ECM in the window: a blocked move has a way looked for, offered, and gone on the word Go."""

import logging
from dataclasses import replace
from functools import partial
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal

from cosmic.app.panels.path_preview import Stage, WayBar
from cosmic.app.panels.scene import ScenePanel
from cosmic.frame.errors import NotAvailable
from cosmic.frame.gui.relay import Relay
from cosmic.frame.operation import Progress, Task
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.ways import Way
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.way_request import WayRequest

logger = logging.getLogger(__name__)

_THERE: Final = 1.0
"""How far, um or deg, an axis may stand from where a way begins, or ends."""


class WayGuide(QObject):
    """Leads a move round what is in its way; GUI thread.

    Nothing moves before the operator presses Go, and the gate decides each part again.

    Parameters
    ----------
    panel : MicoWidget
        Where the moves come from.
    scene : ScenePanel
        Where the way is drawn.
    bar : WayBar
        Where it is offered.

    Signals
    -------
    offered()
        There is something in the bar to be looked at.
    """

    offered = Signal()

    def __init__(
        self, panel: MicoWidget, scene: ScenePanel, bar: WayBar, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._mico = panel.mico
        self._application = panel.mico.application
        self._scene = scene
        self._bar = bar
        self._request: WayRequest | None = None
        self._task: Task | None = None
        self._answer: Way | MoveVerdict | None = None
        self._way: Way | None = None
        # Queued even from this thread: the answer was sent before, and comes before its end.
        queued = Qt.ConnectionType.QueuedConnection
        self._relay = Relay(self._on_progressed, queued=True)
        self._application.way_found.connect(self._on_answer, queued)
        self._application.way_missing.connect(self._on_answer, queued)
        panel.way_wanted.connect(self.seek)
        scene.refused_gone.connect(self._on_refused_gone)
        bar.go_requested.connect(self.go)
        bar.cancel_requested.connect(self.cancel)

    @property
    def stage(self) -> Stage:
        """What it is at."""
        return self._bar.stage

    # Looking

    def seek(self, request: WayRequest) -> None:
        """Look for a way; an offer made before is gone."""
        if self._mico[request.axis].details.in_motion:
            self._refuse(request, f"{request.axis} is moving; wait until it stands")
            return
        try:
            task = self._application.search_way({request.axis: request.target})
        except NotAvailable as exc:
            self._refuse(request, str(exc))
            return
        self._forget()
        self._request, self._task = request, task
        request.note("the straight way is blocked; looking for a way round")
        self._bar.show_search(_what(request), str(request.verdict))
        self.offered.emit()
        task.subscribe(partial(self._relay, task))

    def _refuse(self, request: WayRequest, why: str) -> None:
        """Let the refusal of the straight way stand."""
        text = f"{request.verdict}; no way round was looked for: {why}"
        request.refuse(replace(request.verdict, text=text))

    def _on_answer(self, answer: object) -> None:
        if isinstance(answer, Way | MoveVerdict):
            self._answer = answer

    def _on_progressed(self, task: Task, progress: Progress) -> None:
        if task is not self._task:
            return
        if not progress.done:
            self._bar.show_progress(progress.fraction, progress.text)
            return
        self._task = None
        if self.stage is Stage.SEARCHING:
            self._end_search(progress)
        elif self.stage is Stage.GOING:
            self._end_going(task, progress)

    def _end_search(self, progress: Progress) -> None:
        request, answer, self._answer = self._request, self._answer, None
        if request is None:
            return
        if isinstance(answer, Way) and not progress.error:
            self._offer(request, answer)
            return
        verdict = replace(request.verdict, text=progress.error)
        if isinstance(answer, MoveVerdict) and str(answer) == progress.error:
            verdict = answer
        logger.info("no way for %s: %s", _what(request), verdict)
        request.refuse(verdict)
        self._bar.show_end(f"No way for {_what(request)}", str(verdict))

    def _offer(self, request: WayRequest, way: Way) -> None:
        self._way = way
        self._scene.clear_refused()
        self._scene.set_planned(poses_along(way, self._positions()))
        self._bar.show_found(_what(request), way)
        request.note("a way round was found: Go or Cancel in the panel Scene")
        self.offered.emit()

    def _positions(self) -> dict[str, float]:
        states = {axis.name: axis.details for axis in self._mico}
        return {name: each.position for name, each in states.items() if each.position is not None}

    # Going

    def go(self) -> None:
        """Go the way on offer; looks anew where it no longer begins where the axes stand."""
        request, way = self._request, self._way
        if self.stage is not Stage.FOUND or request is None or way is None:
            return
        if self._left_start(way):
            logger.info("an axis moved since the way was found: looking again")
            self.seek(request)
            return
        try:
            task = self._application.follow_way(way, self._mico[request.axis].commander.source)
        except NotAvailable as exc:
            self._bar.say(f"Not yet: {exc}. Then press Go again.")
            return
        logger.info("going round: %s, in %d parts", _what(request), len(way.waypoints))
        self._task = task
        request.note("going round")
        self._bar.show_going(_what(request))
        task.subscribe(partial(self._relay, task))

    def _left_start(self, way: Way) -> bool:
        for name, start in way.start.items():
            state = self._mico[name].details
            if state.in_motion or state.position is None or abs(state.position - start) > _THERE:
                return True
        return False

    def _end_going(self, task: Task, progress: Progress) -> None:
        request = self._request
        what = _what(request) if request is not None else ""
        self._forget()
        if progress.error and not task.cancel_requested:
            self._bar.show_end(f"The way was left: {what}", progress.error)
            self.offered.emit()

    def cancel(self) -> None:
        """Leave it: the search, the offer, the note, or the way itself, where it is."""
        if self.stage is Stage.GOING and self._task is not None:
            self._task.cancel()  # its end clears the bar
            return
        if self._task is not None:
            self._task.cancel()
        if self.stage in (Stage.SEARCHING, Stage.FOUND) and self._request is not None:
            logger.info("the way round for %s was not gone", _what(self._request))
        self._forget()

    def _forget(self) -> None:
        if self._request is not None:
            self._request.note("")
        self._request = self._task = self._answer = self._way = None
        self._scene.set_planned(None)
        self._bar.clear()

    def _on_refused_gone(self) -> None:
        if self.stage is Stage.ENDED:
            self._forget()


def _what(request: WayRequest) -> str:
    return f"{request.axis} to {request.where}"


def poses_along(way: Way, positions: dict[str, float]) -> list[dict[str, float]]:
    """Return where all axes stand at the start of a way and after each of its parts."""
    poses = [{**positions, **way.start}]
    for waypoint in way.waypoints:
        poses.append({**poses[-1], **waypoint})
    return poses
