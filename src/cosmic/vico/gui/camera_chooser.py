"""Which of the cameras found takes the images."""

from PySide6.QtWidgets import QComboBox, QGridLayout, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import push_button, tipped
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.task_bar import TaskBar
from cosmic.frame.gui.theme import STEP_PX
from cosmic.vico.api.vico import Vico
from cosmic.vico.hw.interface import CameraInfo


def camera_text(info: CameraInfo) -> str:
    """Return how a camera stands in the list."""
    origin = "simulated" if info.simulated else info.serial
    return f"{info.vendor} {info.model} ({origin})" if origin else f"{info.vendor} {info.model}"


class CameraChooser(QWidget):
    """A list of the cameras found, and a button to look for them again."""

    def __init__(self, vico: Vico, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._vico, self._name = vico, name
        self.box = tipped(QComboBox(), "The camera that takes the images shown here")
        self.box.setMinimumContentsLength(6)
        self.box.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.rescan = push_button("Rescan", "Rescan cameras")
        self.tasks = TaskBar()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(STEP_PX // 2)
        grid.addWidget(self.box, 0, 0)
        grid.addWidget(self.rescan, 0, 1)
        grid.addWidget(self.tasks, 1, 0, 1, 2)
        grid.setColumnStretch(0, 1)
        self.tasks.hide()
        self.box.activated.connect(self._on_chosen)
        self.rescan.clicked.connect(self._on_rescan)
        self.tasks.ended.connect(self.refresh)
        self._relay = Relay(self.refresh).follow(vico.on_change)
        self.refresh()

    def refresh(self) -> None:
        """List what was found, and choose the one in use."""
        used = self._vico.camera(self._name).info
        known = list(self._vico.found)
        if used is not None and used.key not in [each.key for each in known]:
            known.insert(0, used)
        shown = [(camera_text(each), each.key) for each in known]
        box = self.box
        if [(box.itemText(n), box.itemData(n)) for n in range(box.count())] != shown:
            box.clear()
            for text, key in shown:
                box.addItem(text, key)
        box.setCurrentIndex(-1 if used is None else box.findData(used.key))
        box.setPlaceholderText("choose a camera" if known else "none found")

    def _on_chosen(self) -> None:
        used = self._vico.camera(self._name).info
        key = str(self.box.currentData())
        if used is None or used.key != key:
            try:
                self.tasks.follow(self._vico.use(self._name, key))
            except CosmicError as exc:
                self.tasks.say(str(exc), refused=True)
                self.refresh()

    def _on_rescan(self) -> None:
        try:
            self.tasks.follow(self._vico.rescan())
        except CosmicError as exc:
            self.tasks.say(str(exc), refused=True)
