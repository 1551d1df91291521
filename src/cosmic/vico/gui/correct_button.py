"""The button that opens the fibres of the image shown, to be corrected by the operator."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QStandardPaths, Qt, Signal
from PySide6.QtWidgets import QToolButton, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, styled, tipped
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import State, state_look
from cosmic.frame.operation import Operation
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.camera_shown import utc_of
from cosmic.vico.core.image import CameraImage

# The editor loads what finds fibres, and that a part of SciPy: too much for a window to open with.
if TYPE_CHECKING:
    from cosmic.vico.core.measuring.corrections import Corrections
    from cosmic.vico.gui.fibre_editor import FibreEditor

TIP = "Correct the fibres of this image: add, cut, join, delete, drag an end"


class CorrectButton(QToolButton):
    """Finds the fibres of the image shown, and opens an editor for them; the camera goes on.

    Signals
    -------
    message(str)
        What goes on, or why it cannot be done.

    Parameters
    ----------
    image : callable
        Returns the image that is shown.
    now : callable
        Returns the local time, which names the files.
    """

    message = Signal(str)

    def __init__(
        self,
        camera: CameraHandle,
        image: Callable[[], CameraImage | None],
        parent: QWidget | None = None,
        *,
        now: Callable[[], datetime] = datetime.now,
    ) -> None:
        super().__init__(parent)
        self._camera, self._image, self._now = camera, image, now
        self._chosen: CameraImage | None = None
        self._found: Relay[Operation[Corrections]] = Relay(self._on_found)
        self.editor: FibreEditor | None = None
        self.setText("Correct fibres…")
        named(tipped(self, TIP), "correct")
        styled(self, "tool")
        self.clicked.connect(self._on_clicked)

    def _on_clicked(self) -> None:
        image = self._image()
        if image is None:
            self._refuse("there is no image yet")
            return
        self._chosen = image
        self.setEnabled(False)
        self.message.emit("looking for fibres")
        try:
            self._camera.corrections(image).add_callback(self._found)
        except CosmicError as exc:
            self.setEnabled(True)
            self._refuse(str(exc))

    def _on_found(self, ended: "Operation[Corrections]") -> None:
        self.setEnabled(True)
        image, self._chosen = self._chosen, None
        try:
            corrections = ended.result
        except CosmicError as exc:
            self._refuse(str(exc))
            return
        if image is None:
            return
        from cosmic.vico.gui.fibre_editor import FibreEditor

        path = self._folder / f"fibres-{self._now():%Y%m%d-%H%M%S}.tif"
        taken = utc_of(image, self._camera.clock)
        editor = FibreEditor(image.data, corrections, lambda: save(image, corrections, path, taken))
        editor.setParent(self.window(), Qt.WindowType.Window)
        editor.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        editor.setWindowTitle(f"Fibres of {self._camera.name}")
        editor.destroyed.connect(self._on_closed)
        editor.resize(1000, 780)
        editor.show()
        self.editor = editor
        self.message.emit("")

    @property
    def _folder(self) -> Path:
        """Where images go; the editor is here, and so is its disk."""
        if not self._camera.remote:
            return self._camera.directory
        place = QStandardPaths.StandardLocation.DocumentsLocation
        documents = Path(QStandardPaths.writableLocation(place))
        return documents if documents.is_dir() else Path.home()

    def _on_closed(self) -> None:
        self.editor = None

    def _refuse(self, reason: str) -> None:
        self.message.emit(f"{state_look(State.REFUSED).glyph} {reason}")


def save(
    image: CameraImage, corrections: "Corrections", path: Path, utc: datetime | None = None
) -> str:
    """Keep an image, once, and its corrections beside it; raises `RecordingError`."""
    from cosmic.vico.core.recording.snap import save_image

    if not path.exists():
        save_image(image, path, utc=utc)
    return f"Kept in {corrections.save(path)}."
