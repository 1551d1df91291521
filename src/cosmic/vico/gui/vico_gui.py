"""The widgets of ViCo together: one view a camera, and the lens."""

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QSplitter, QVBoxLayout, QWidget

from cosmic.frame.application import CosmicApplicationBase
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.remote_application import RemoteVicoApplication
from cosmic.vico.api.vico import Vico
from cosmic.vico.gui.camera_view import CameraView
from cosmic.vico.gui.lens_panel import LensPanel
from cosmic.vico.gui.ports import VicoPort


class VicoGui(QObject):
    """What a window makes docks of; none has a parent, whoever asks puts each into a dock.

    Attributes
    ----------
    cameras : dict of str to CameraView
        By the name of the camera, in the order of the platform.
    lens : LensPanel
        Zoom, focus and light; says so where there are none.
    """

    def __init__(self, port: VicoPort) -> None:
        super().__init__()
        self.cameras = {name: CameraView(port, name) for name in port.cameras}
        self.lens = LensPanel(port)


def make_vico_gui(application: CosmicApplicationBase) -> VicoGui:
    """Make the GUI component of ViCo; GUI thread."""
    if not isinstance(application, VicoApplication | RemoteVicoApplication):
        raise TypeError(f"{application.title} is not ViCo")
    vico = Vico(application)
    gui = VicoGui(vico)
    for name, view in gui.cameras.items():
        view.setWindowTitle(vico.camera(name).title)
    return gui


class VicoWidget(QWidget):
    """All of it in one widget, for a window without docks."""

    def __init__(self, port: VicoPort, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("ViCo")
        self.gui = VicoGui(port)
        side = QSplitter(Qt.Orientation.Horizontal)
        for view in self.gui.cameras.values():
            side.addWidget(view)
        side.addWidget(self.gui.lens)
        for place in range(len(self.gui.cameras)):
            side.setStretchFactor(place, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(side)
