"""Named poses in the window: teach, go, remove."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QComboBox, QLabel, QLineEdit, QVBoxLayout, QWidget

from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.gui.build import named, push_button, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.operation import Progress
from cosmic.frame.overrides import override
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.poses import Pose
from cosmic.mico.core.settings import GroupSettings

ALL: Final = "all axes"


class ReplacedPose:
    """Asks once before a pose is taught over another of its name.

    Parameters
    ----------
    again : str
        What is done a second time to replace it.
    """

    def __init__(self, mico: Mico, again: str) -> None:
        self._mico = mico
        self._again = again
        self._asked = ""

    def question(self, name: str) -> str:
        """Return what is to be said before `name` is taught; empty where it may be."""
        if name in self._mico.poses.names and name != self._asked:
            self._asked = name
            return f"There is a pose {name} already: {self._again} again replaces it"
        self.forget()
        return ""

    def forget(self) -> None:
        """Ask again, also about the last name."""
        self._asked = ""


class PosesBox(QWidget):
    """The named poses of the platform, and what can be done with them.

    Signals
    -------
    poses_changed()
        One was taught or removed here.
    """

    poses_changed = Signal()

    def __init__(self, mico: Mico, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._mico = mico
        self._relay = Relay(self._on_progressed)
        self._taught, self._removed = Relay(self._on_taught), Relay(self._on_removed)
        self.poses = named(tipped(QComboBox(), "Named poses"), "poses")
        self.go = named(push_button("Go", "Move all axes of the pose there, together"), "goPose")
        self.around = named(
            push_button("Plan a path", "Plan a path around obstacles and follow it"), "goPoseDetour"
        )
        self.remove = named(push_button("Remove", "Forget this pose"), "removePose")
        self.name = named(tipped(QLineEdit(), "Name of the pose to teach"), "poseName")
        self.name.setPlaceholderText("name")
        self.group = tipped(QComboBox(), "Which axes the pose holds")
        self.group.addItems([ALL, *(each.title for each in self._settings_groups())])
        self.teach = named(push_button("Teach", "Keep the positions of the axes now"), "teachPose")
        self.message = ElidedLabel()
        self._replacing = ReplacedPose(mico, "Teach")
        self._arrange()
        self.go.clicked.connect(lambda: self._go(around=False))
        self.around.clicked.connect(lambda: self._go(around=True))
        self.remove.clicked.connect(self._on_remove)
        self.teach.clicked.connect(self._on_teach)
        self.name.returnPressed.connect(self._on_teach)
        self.refresh()

    def _settings_groups(self) -> tuple[GroupSettings, ...]:
        return self._mico.settings.group

    def _arrange(self) -> None:
        first, second = tight_row(STEP_PX), tight_row(STEP_PX)
        first[1].addWidget(QLabel("Poses"))
        first[1].addWidget(self.poses, 1)
        for button in (self.go, self.around, self.remove):
            first[1].addWidget(button)
        second[1].addWidget(self.name, 1)
        second[1].addWidget(self.group)
        second[1].addWidget(self.teach)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        for row, _ in (first, second):
            column.addWidget(row)
        column.addWidget(self.message)

    def refresh(self) -> None:
        """Show the poses there are now."""
        names, chosen = self._mico.poses.names, self.poses.currentText()
        self.poses.clear()
        self.poses.addItems(names)
        if chosen in names:
            self.poses.setCurrentText(chosen)
        has_model = self._mico.checks_collisions
        for button in (self.go, self.remove):
            button.setEnabled(bool(names))
        self.around.setEnabled(bool(names) and has_model)

    @override
    def showEvent(self, event: QShowEvent) -> None:
        self.refresh()  # others teach poses too: the console, a script
        super().showEvent(event)

    def _on_teach(self) -> None:
        name, group = self.name.text().strip(), self.group.currentText()
        poses, axes = self._mico.poses, None if group == ALL else group
        if question := self._replacing.question(name):
            self.message.set_text(question)
            return
        self._mico.carry_out(lambda: poses.teach(name, axes), self._taught)

    def _on_taught(self, pose: Pose | None, error: CosmicError | None) -> None:
        if pose is None:
            self.message.set_text(str(error))
            return
        where = self._mico.poses.path
        kept = f"kept in {where.name}" if where is not None else "kept until the program ends"
        self.message.set_text(f"{pose.name}: {len(pose.positions)} axes, {kept}")
        self.name.clear()
        self.refresh()
        self.poses.setCurrentText(pose.name)
        self.poses_changed.emit()

    def _on_remove(self) -> None:
        poses, name = self._mico.poses, self.poses.currentText()
        self._mico.carry_out(lambda: poses.remove(name), self._removed)

    def _on_removed(self, _nothing: None, error: CosmicError | None) -> None:
        if error is not None:
            self.message.set_text(str(error))
        self.refresh()
        self.poses_changed.emit()

    def _go(self, *, around: bool) -> None:
        """Begin to go; how it ends is shown by the window's task bar."""
        try:
            if why := self._mico.application.busy():
                raise NotAvailable(why)
            task = self._mico.poses.go(self.poses.currentText(), detour=around, wait=False)
        except CosmicError as exc:
            self.message.set_text(str(exc))
            return
        self.message.set_text("")
        task.subscribe(self._relay)

    def _on_progressed(self, progress: Progress) -> None:
        if progress.done:
            self.message.set_text(progress.error or "there")
