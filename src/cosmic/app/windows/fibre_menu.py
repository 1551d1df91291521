"""Operations on a fibre from the picture: right-click it, see what would happen, choose."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QMenu

from cosmic.app.panels.operation_card import OperationCard
from cosmic.app.panels.scene import ScenePanel
from cosmic.app.rig import Rig
from cosmic.app.windows.central_view import CentralView
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.relay import Relay
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.gui.camera_view import CameraView
from cosmic.vico.gui.mark_layer import NEAR_PX, fibre_at

if TYPE_CHECKING:
    from cosmic.autonomy.handling.context import HandlingContext
    from cosmic.autonomy.handling.marked import MarkedFibre
    from cosmic.autonomy.procedures.run import ProcedureRun
    from cosmic.autonomy.recorded.operations import OperatorSignal
    from cosmic.autonomy.recorded.steps import RecordedProcedure
    from cosmic.autonomy.shipped.fibre_handling import FibreHandling
    from cosmic.autonomy.shipped.single_operation import OperationRequest

USUAL_FORCE_UN: Final = 50.0
_FIBRES: Final = "fibres"
_FOUND: Final = (_FIBRES, "tips", "held fibre")


def _nothing() -> None:
    return None


class FibreOperations(QObject):
    """Joins the pictures to `rig.handling`; GUI thread.

    Parameters
    ----------
    rig : Rig
        The platform.
    central_view : CentralView
        Where cameras are shown, and the card.
    scene : ScenePanel
        Where the path of an operation is drawn before it begins.

    Signals
    -------
    began(str)
        An operation has begun, by its title.
    ended()
        One has ended, or was refused.
    replay_wanted()
        What is offered is to be replayed on the fibre that is marked.
    waiting(str)
        A replay waits for the operator, in words; empty: it goes on.
    """

    began = Signal(str)
    ended = Signal()
    waiting = Signal(str)
    replay_wanted = Signal()

    def __init__(
        self,
        rig: Rig,
        central_view: CentralView,
        scene: ScenePanel,
        cameras: list[CameraView],
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._rig, self._central_view, self._scene = rig, central_view, scene
        self.card = OperationCard(USUAL_FORCE_UN)
        central_view.set_card(self.card)
        self._relay: Relay[()] | None = None
        self._shown: object = None
        self._worked = False
        self._title = ""
        self._waits = False
        self._said_on: CameraView | None = None
        self._cameras, self._found_on = list(cameras), list[CameraView]()
        self.marked: MarkedFibre | None = None
        self.offered: Callable[[], RecordedProcedure | None] = _nothing
        """What the menu offers to replay on a fibre."""
        self._going_on: OperatorSignal | None = None
        self._asks: Relay[str] = Relay(self._on_asked)
        self.card.resized.connect(central_view.lay_card)
        self.card.next_requested.connect(self._on_next)
        self.card.undo_requested.connect(self.undo)
        self.card.push_requested.connect(self.push)
        for view in cameras:
            view.tools.menu_made.connect(self._offer_on(view))

    def _offer_on(self, view: CameraView) -> Callable[[QMenu, Pixel], None]:
        return lambda menu, point_px: self.offer(view, menu, point_px)

    @property
    def handling(self) -> "FibreHandling":
        """What carries the operations out; raises `NotAvailable`."""
        found = self._rig.handling
        if self._relay is None:
            self._relay = Relay(self._on_change).follow(found.subscribe)
        return found

    @property
    def running(self) -> bool:
        """True while an operation runs."""
        return self.used and self.handling.running

    @property
    def title(self) -> str:
        """Title of the operation that runs; empty for none."""
        return self._title if self.running else ""

    @property
    def used(self) -> bool:
        """True once an operation was asked for: what carries them out is loaded."""
        return self._relay is not None

    @property
    def waits(self) -> bool:
        """True while a replay waits for the operator."""
        return self._waits

    @property
    def worked(self) -> bool:
        """True once an operation has begun."""
        return self._worked

    @property
    def failed(self) -> str:
        """Title of the operation that ended last, where it did not do what it should."""
        result = self.handling.result if self.used and not self.running else None
        return "" if result is None or result.good else result.title

    # The menu

    def offer(self, view: CameraView, menu: QMenu, point_px: Pixel) -> None:
        """Add what can be done with the fibre at a pixel, and with the one that is held."""
        from cosmic.autonomy.handling.marked import MarkedFibre
        from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation

        found = view.camera.analysis
        near = NEAR_PX / max(abs(view.view.to_screen.m11()), 1e-6)
        fibre = fibre_at(found, point_px, near)
        try:
            handling = self.handling
        except CosmicError as exc:
            menu.addSeparator()
            menu.addAction(f"Not available: {exc}").setEnabled(False)
            return
        menu.addSeparator()
        self._offer_finding(view, menu)
        marked = None
        if fibre is not None and found is not None:
            marked = MarkedFibre(found.image, np.asarray(fibre.centre_line_px, float))
        requests = [
            OperationRequest(SingleOperation.TAKE, gripper, marked=marked)
            for gripper in handling.grippers
        ]
        requests += [
            OperationRequest(SingleOperation.BRING),
            OperationRequest(SingleOperation.PUSH, force_un=self.card.force.value()),
            OperationRequest(SingleOperation.MEASURE),
            OperationRequest(SingleOperation.PUT_AWAY),
            OperationRequest(SingleOperation.UNDO),
        ]
        for request in requests:
            self._offer_one(view, menu, request, fibre)
        self.marked = marked or self.marked
        procedure = self.offered()
        if procedure is not None and marked is not None:
            action = menu.addAction(f"Replay {procedure.name}")
            action.hovered.connect(lambda: view.mark.show(marked.line_px))
            action.triggered.connect(lambda: self.replay_wanted.emit())
        menu.aboutToHide.connect(lambda: self._show_preview(view, None))
        menu.setToolTipsVisible(True)

    def _offer_finding(self, view: CameraView, menu: QMenu) -> None:
        action = menu.addAction("Find fibres")
        action.setCheckable(True)
        action.setChecked(self.finding(view))
        action.triggered.connect(lambda on: self.find(view, on=on))

    @staticmethod
    def finding(view: CameraView) -> bool:
        """Tell whether fibres are found on the images of a camera."""
        return any(each.name == _FIBRES and each.on for each in view.camera.algorithms)

    def find(self, view: CameraView, *, on: bool) -> None:
        """Have fibres, tips and what is held found on the images of a camera, or not."""
        try:
            for each in view.camera.algorithms:
                if each.name in _FOUND and each.on != on:
                    view.camera.switch(each.name, on=on)
        except CosmicError as exc:
            view.say(str(exc))

    def _offer_one(
        self, view: CameraView, menu: QMenu, request: "OperationRequest", fibre: Fibre | None
    ) -> None:
        action = menu.addAction(request.title)
        why = self.handling.why_not(request)
        action.setEnabled(not why)
        if why:
            action.setToolTip(f"Not now: {why}")
            return
        line = None if request.marked is None or fibre is None else request.marked.line_px
        action.hovered.connect(lambda: self._show_preview(view, request, line))
        action.triggered.connect(lambda: self.begin(request))

    def _show_preview(
        self, view: CameraView, request: "OperationRequest | None", line: np.ndarray | None = None
    ) -> None:
        """Outline the fibre, draw the path in the scene and say what would happen; None: end."""
        view.mark.show(line)
        if request is None:
            self._scene.set_planned(None)
            view.say("")
            return
        preview = self.handling.preview(request)
        self._scene.set_planned([dict(pose) for pose in preview.poses] or None)
        view.say(f"{request.title}: {preview.text}")

    # Carrying out

    def begin(self, request: "OperationRequest") -> None:
        """Begin an operation, or say on the card why it cannot begin."""
        try:
            run = self.handling.prepare(request)
        except CosmicError as exc:
            self._refuse(request.title, str(exc).removeprefix(f"{request.title}: "))
            return
        self._start(request.title, run)

    def _refuse(self, title: str, why: str) -> None:
        """Say why an operation does not begin; the card of one that runs stays, with End."""
        if self.running:
            self._said_on = self._central_view.camera
            self._said_on.say(f"{title}: {why}")
            return
        self.card.show_refused(title, why)
        if self.used:
            self._offer_next()
        self.ended.emit()

    def _start(self, title: str, run: "ProcedureRun[HandlingContext]") -> None:
        self._found_on = [view for view in self._cameras if self.finding(view)]
        for view in self._found_on:  # what an operation looks for, it finds by itself
            self.find(view, on=False)
        self._worked = True
        self._title = title
        self.card.follow(title, run)
        run.start()
        self.began.emit(title)

    def push(self, force_un: float) -> None:
        """Push the held fibre to a force."""
        from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation

        self.begin(OperationRequest(SingleOperation.PUSH, force_un=force_un))

    def replay(self, procedure: "RecordedProcedure", folder: Callable[[], Path]) -> None:
        """Replay a recorded procedure, on the marked fibre where it needs one."""
        from cosmic.autonomy.recorded.operations import Surroundings
        from cosmic.autonomy.recorded.replay import replay_on

        title = f"Replay {procedure.name}"
        around = Surroundings(self.marked, folder, asks=self._asks)
        try:
            run = replay_on(self.handling, procedure, around)
        except CosmicError as exc:
            self._refuse(title, str(exc).removeprefix(f"{procedure.name}: "))
            return
        self._going_on = around.going_on
        self._start(title, run)

    def _on_asked(self, words: str) -> None:
        self._waits = bool(words)
        self.waiting.emit(words)

    def go_on(self) -> None:
        """Have a replay that waits for the operator go on."""
        if self._going_on is not None:
            self._going_on.give()

    def close_card(self) -> None:
        """Close the card of an operation that is over: what it says holds no longer."""
        if not self.running:
            self.card.hide()

    def close_gently(self, gripper: str) -> None:
        """Close the jaws of a gripper slowly, until they hold."""
        from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation

        self.begin(OperationRequest(SingleOperation.CLOSE, gripper))

    def undo(self) -> None:
        """Take back what was done last with the held fibre."""
        from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation

        self.begin(OperationRequest(SingleOperation.UNDO))

    def _on_next(self) -> None:
        request = self.next_request()
        if request is not None:
            self.begin(request)

    def next_request(self) -> "OperationRequest | None":
        """Return the operation that usually comes next; None where none does, or one runs."""
        if not self.used or self.running:
            return None
        if not self.handling.held_by and not self.handling.may_hold:
            return None
        from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation

        pushed = self.handling.last in (SingleOperation.PUSH, SingleOperation.MEASURE)
        if pushed or self.handling.may_hold:
            return OperationRequest(SingleOperation.PUT_AWAY)
        if self.handling.at_probe:
            return OperationRequest(SingleOperation.PUSH, force_un=self.card.force.value())
        return OperationRequest(SingleOperation.BRING)

    def _on_change(self) -> None:
        result = self.handling.result
        if self.handling.running or result is None or result is self._shown:
            self.card.refresh()
            return
        self._shown = result
        for view in self._found_on:
            self.find(view, on=True)
        self._found_on = []
        if self._said_on is not None:
            self._said_on.say("")
        self._said_on = None
        self.card.show_result(result)
        self._offer_next()
        self.ended.emit()

    def _offer_next(self) -> None:
        from cosmic.autonomy.shipped.single_operation import UNDO_WORDS, SingleOperation

        handling, request = self.handling, self.next_request()
        at_probe = bool(handling.held_by) and handling.at_probe
        push = request is not None and request.operation is SingleOperation.PUSH
        self.card.offer(
            request.title if request is not None and not push else "",
            push=at_probe,
            undo=UNDO_WORDS[handling.last] if handling.held_by and handling.last else "",
        )
