"""The chain of algorithms run on the images, and the background taken off them."""

from collections.abc import Callable
from functools import partial

from PySide6.QtWidgets import QCheckBox, QVBoxLayout, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import push_button, tight_row
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.vico.api.camera import CameraHandle


class ChainPanel(QWidget):
    """A tick a link, with what is wrong below it; then the background."""

    def __init__(self, camera: CameraHandle, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._camera = camera
        self.ticks: dict[str, QCheckBox] = {}
        self._problems: dict[str, ElidedLabel] = {}
        self._links = QVBoxLayout()
        self._links.setSpacing(STEP_PX // 2)
        self.take = push_button(
            "Take background", "Correct uneven light with the image shown; the field must be empty"
        )
        self.clear = push_button("Clear", "")
        self.reason = ElidedLabel()
        row, beside = tight_row(STEP_PX // 2)
        beside.addWidget(self.take, 1)
        beside.addWidget(self.clear)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addLayout(self._links)
        column.addWidget(row)
        column.addWidget(self.reason)
        self.reason.hide()
        self.take.clicked.connect(self._on_take)
        self.clear.clicked.connect(self._on_clear)

    def refresh(self) -> None:
        """Show what is on."""
        chain = self._camera.algorithms
        if [each.name for each in chain] != list(self.ticks):
            self._rebuild()
        for each in chain:
            tick, problem = self.ticks[each.name], self._problems[each.name]
            tick.setChecked(each.on)
            problem.set_text(
                f"{state_look(State.ERROR).glyph} {each.problem}" if each.problem else ""
            )
            problem.setVisible(bool(each.problem))
        taken = self._camera.has_background
        self.clear.setEnabled(taken)
        self.clear.setToolTip(
            "Remove the background correction" if taken else "No background has been taken"
        )

    def _rebuild(self) -> None:
        for old in (*self.ticks.values(), *self._problems.values()):
            old.hide()
            old.deleteLater()
        self.ticks, self._problems = {}, {}
        for each in self._camera.algorithms:
            tick, problem = QCheckBox(each.name), ElidedLabel()
            tick.setToolTip(each.description)
            tick.clicked.connect(self._on_clicked)
            self._links.addWidget(tick)
            self._links.addWidget(problem)
            self.ticks[each.name], self._problems[each.name] = tick, problem

    def _on_clicked(self) -> None:
        for each in self._camera.algorithms:
            wanted = self.ticks[each.name].isChecked()
            if wanted != each.on:
                self._try(partial(self._camera.switch, each.name, on=wanted))

    def _on_take(self) -> None:
        self._try(self._camera.set_background)

    def _on_clear(self) -> None:
        self._try(self._camera.clear_background)

    def _try(self, action: Callable[[], object]) -> None:
        self.reason.hide()
        try:
            action()
        except CosmicError as exc:
            self.reason.set_text(f"{state_look(State.REFUSED).glyph} {exc}")
            self.reason.show()
        self.refresh()
