"""The button that begins calibrations of a camera, and says what was calibrated."""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QMenu, QToolButton, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.amounts import duration_text
from cosmic.frame.gui.build import named, retip, styled, tipped
from cosmic.frame.gui.task_watch import TaskWatch
from cosmic.frame.gui.theme import State, state_look
from cosmic.frame.operation import Progress, Task
from cosmic.vico.api.camera import CameraHandle

REFUSED: Final = state_look(State.REFUSED).glyph
TIP: Final = "Calibrate pixels to platform coordinates: a tool visits nine points and returns"


class CalibrateButton(QToolButton):
    """Opens a menu: a calibration by each tool, the rotation centre, and what there is.

    Signals
    -------
    message(str)
        How far a calibration is, how it ended, or why it could not be begun.
    """

    message = Signal(str)

    def __init__(
        self,
        camera: CameraHandle,
        parent: QWidget | None = None,
        *,
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        super().__init__(parent)
        self._camera, self._now = camera, now
        self._filled: object = None
        self._watch = TaskWatch(self)
        self._watch.progressed.connect(self._on_progressed)
        self.setText("Calibrate")
        named(tipped(self, TIP), "calibrate")
        styled(self, "tool menu")
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        shown = QMenu(self)
        shown.setToolTipsVisible(True)
        shown.aboutToShow.connect(self.fill)
        self.setMenu(shown)
        self.fill()

    def fill(self) -> None:
        """Offer what can be done now; an open menu stays as it is."""
        menu = self.menu()
        if menu.isVisible():
            return
        tools, lines = tuple(self._camera.targets), self.lines()
        wanted = (self._watch.busy, tools, lines)
        if wanted == self._filled:
            return  # a menu made anew sends more events than the rest of the window
        self._filled = wanted
        menu.clear()
        if self._watch.busy:
            menu.addAction("Cancel").triggered.connect(self._on_cancel)
            return
        self.setEnabled(bool(tools))
        retip(self, TIP if tools else "Not here: no tool can be moved from this window")
        for tool in tools:
            action = menu.addAction(f"Move {tool}")
            action.setToolTip("Its tip must be in the image and in focus")
            action.triggered.connect(lambda _=False, tool=tool: self._begin_stage(tool))
        action = menu.addAction("Find the table's rotation centre")
        action.setToolTip("Turns the table by 24° to both sides; a fibre must lie near the middle")
        action.triggered.connect(lambda _=False: self._begin_rotation())
        menu.addSeparator()
        for text in lines or ["not calibrated yet"]:
            menu.addAction(text).setEnabled(False)

    def lines(self) -> list[str]:
        """Return what is calibrated, a line each."""
        lines = [
            f"{each.tool}: {each.scale_um_px:.4g} µm a pixel at zoom {each.zoom_counts:.0f}, "
            f"height {each.height_um:.0f} µm; {each.residual_px:.2f} px off, "
            f"{self._age(each.measured)}"
            for each in self._camera.calibrated
        ]
        turns = self._camera.rotation
        if turns is not None:
            x_um, y_um = turns.centre_um
            lines.append(
                f"rotation centre: x {x_um:.1f}, y {y_um:.1f} µm, known to {turns.std_um:.1f} µm; "
                f"{self._age(turns.measured)}"
            )
        return lines

    def _age(self, measured: datetime) -> str:
        return f"{duration_text((self._now() - measured).total_seconds())} old"

    def _begin_stage(self, tool: str) -> None:
        self._begin(lambda: self._camera.calibrate_stage(tool))

    def _begin_rotation(self) -> None:
        self._begin(self._camera.find_rotation_centre)

    def _begin(self, start: Callable[[], Task]) -> None:
        try:
            self._watch.follow(start())
        except CosmicError as exc:
            self.message.emit(f"{REFUSED} {exc}")

    def _on_cancel(self) -> None:
        if self._watch.task is not None:
            self._watch.task.cancel()

    def _on_progressed(self, progress: Progress) -> None:
        if progress.error:
            self.message.emit(f"{REFUSED} {progress.title}: {progress.error}")
        else:
            self.message.emit(f"{progress.title}: {progress.text}")
        if progress.done:
            self.fill()
