"""The list of named poses, each with a picture of how the platform stands there."""

from PySide6.QtCore import QSize
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QComboBox, QSizePolicy, QWidget

from cosmic.frame.gui.build import named, tipped
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.mico.api.mico import Mico
from cosmic.mico.gui.scene.pose_picture import SIZE, PosePictures


class PoseChoice(QComboBox):
    """Offers the poses there are; their pictures are drawn when the list opens. GUI thread."""

    def __init__(self, mico: Mico, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._mico = mico
        self._pictures: PosePictures | None = None
        named(tipped(self, "Named poses"), "toolPoses")
        self.setPlaceholderText("no pose yet")
        # Only in the list: beside the name of the chosen one there is no room.
        self.setIconSize(QSize(0, 0))
        self.view().setIconSize(SIZE)
        self.setMinimumWidth(7 * STEP_PX)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)

    def refresh(self) -> None:
        """Offer the poses there are now; the chosen one stays chosen."""
        names, chosen = list(self._mico.poses.names), self.currentText()
        if [self.itemText(row) for row in range(self.count())] == names:
            return
        self.clear()
        self.addItems(names)
        if chosen in names:
            self.setCurrentText(chosen)

    @override
    def showPopup(self) -> None:
        self._draw()
        self.view().setMinimumWidth(SIZE.width() + 16 * STEP_PX)
        super().showPopup()

    def _draw(self) -> None:
        model = self._mico.application.scene
        if model is None:
            return
        if self._pictures is None:
            self._pictures = PosePictures(model)
        poses = {each.name: each for each in self._mico.poses}
        for row in range(self.count()):
            pose = poses.get(self.itemText(row))
            if pose is not None:
                self.setItemIcon(row, QIcon(self._pictures.of(pose)))
