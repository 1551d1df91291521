"""The widgets of ViCo together: one view a camera, and the lens."""

from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter, QVBoxLayout, QWidget

from cosmic.vico.gui.camera_view import CameraView
from cosmic.vico.gui.lens_panel import LensPanel
from cosmic.vico.gui.ports import VicoPort


@dataclass(frozen=True, slots=True)
class VicoGui:
    """What a window makes docks of.

    Attributes
    ----------
    cameras : dict of str to CameraView
        By the name of the camera, in the order of the platform.
    lens : LensPanel
        Zoom, focus and light; says so where there are none.
    """

    cameras: dict[str, CameraView]
    lens: LensPanel


def make_vico_gui(port: VicoPort) -> VicoGui:
    """Make a widget for each camera and one for the lens; GUI thread.

    None has a parent: whoever asks puts each into a dock.
    """
    return VicoGui({name: CameraView(port, name) for name in port.cameras}, LensPanel(port))


class VicoWidget(QWidget):
    """All of it in one widget, for a window without docks."""

    def __init__(self, port: VicoPort, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("ViCo")
        self.gui = make_vico_gui(port)
        side = QSplitter(Qt.Orientation.Horizontal)
        for view in self.gui.cameras.values():
            side.addWidget(view)
        side.addWidget(self.gui.lens)
        for place in range(len(self.gui.cameras)):
            side.setStretchFactor(place, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(side)
