"""The widgets of ViCo together: one view a camera, and the lens."""

from collections import Counter

from PySide6.QtCore import QObject

from cosmic.frame.application import CosmicApplicationBase
from cosmic.vico.api.vico import Vico, vico_of
from cosmic.vico.gui.camera_view import CameraView
from cosmic.vico.gui.lens_panel import LensPanel


class VicoGui(QObject):
    """What a window makes docks of; none has a parent, whoever asks puts each into a dock.

    Attributes
    ----------
    cameras : dict of str to CameraView
        By the name of the camera, in the order of the platform.
    lens : LensPanel
        Zoom, focus and light; says so where there are none.
    """

    def __init__(self, vico: Vico) -> None:
        super().__init__()
        self.cameras = {name: CameraView(vico, name) for name in vico.cameras}
        self.lens = LensPanel(vico)


def make_vico_gui(application: CosmicApplicationBase) -> VicoGui:
    """Make the GUI component of ViCo; GUI thread."""
    vico = vico_of(application)
    gui = VicoGui(vico)
    titles = {name: vico.camera(name).title for name in gui.cameras}
    alike = Counter(titles.values())
    for name, view in gui.cameras.items():
        # A window keeps its panels by their titles: of two of one title it would show one.
        title = titles[name]
        view.setWindowTitle(title if alike[title] == 1 else f"{title} ({name})")
    return gui
