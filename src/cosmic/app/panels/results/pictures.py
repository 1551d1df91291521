"""What was to be seen at one moment: the recorded image, the fibres on it, and the scene."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, cast

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLabel, QSplitter, QStackedWidget, QVBoxLayout, QWidget

from cosmic.app.results.sessions import STILLS
from cosmic.app.results.timeline import Film
from cosmic.frame.background import BackgroundJobs
from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.frame.gui.build import named
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.gui.scene.scene_widget import SceneWidget
from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.recording.reading import (
    ImageRecording,
    RecordedImage,
    open_image_recording,
)
from cosmic.vico.gui.image_view import CameraImageView
from cosmic.vico.gui.layers import ScaleBar
from cosmic.vico.gui.levels import Levels
from cosmic.vico.gui.seen_layer import SeenLayer
from cosmic.vico.hw.interface import Frame, PixelFormat, Pixels

_NO_IMAGE: Final = "No image was recorded at this moment"


@dataclass(frozen=True, slots=True, eq=False)
class ShownImage:
    """An image that was read, and what was found on it if that was asked for."""

    image: CameraImage
    index: int
    seen: Seen | None


class FilmReader:
    """Keeps the recording of images open that is looked at; in one thread, the background's."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._open: ImageRecording | None = None

    def read(self, film: Film, index: int, *, find: bool) -> ShownImage:
        """Return an image of a film, with its fibres where `find`.

        Raises
        ------
        RecordingError
            It cannot be read.
        """
        try:
            recorded = self._recorded(film, index)
        except (IndexError, OSError, ValueError) as exc:
            raise RecordingError(f"{film.path}: image {index} cannot be read ({exc})") from exc
        image = _camera_image(film.camera, recorded)
        return ShownImage(image, index, _found(image) if find else None)

    def close(self) -> None:
        """Give the files back."""
        if self._open is not None:
            self._open.close()
        self._open = self._path = None

    def _recorded(self, film: Film, index: int) -> RecordedImage:
        if film.path.suffix.lower() in STILLS:
            from cosmic.vico.core.measuring.image_files import read_images

            data = still_pixels(next(iter(read_images(film.path))).pixels)
            return RecordedImage(data, 0, None)
        if self._open is None or film.path != self._path or index >= len(self._open):
            self.close()
            self._open, self._path = open_image_recording(film.path), film.path
        return self._open[index]


def still_pixels(pixels: npt.NDArray[np.generic]) -> Pixels:
    """Return an image of another program as a camera would give it: grey, or red, green and blue.

    Colours have 8 bits; what a camera cannot give, such as floats, becomes grey of 16 bits.
    """
    # Imported here: it loads OpenCV.
    from cosmic.vico.core.vision.grey import grey_image

    unsigned = pixels.dtype.kind == "u" and pixels.dtype.itemsize <= 2
    if unsigned and pixels.ndim == 2:
        return cast("Pixels", pixels.astype(pixels.dtype.newbyteorder("="), copy=False))
    if unsigned and pixels.ndim == 3 and pixels.shape[2] in (3, 4):
        colours = pixels[..., 2::-1]
        wide = colours.astype(np.uint16) >> (8 * (pixels.dtype.itemsize - 1))
        return wide.astype(np.uint8)
    return grey_image(pixels)


def _camera_image(camera: str, recorded: RecordedImage) -> CameraImage:
    row, data = recorded.row, recorded.data
    usual = PixelFormat.RGB8 if data.ndim == 3 else PixelFormat.MONO8
    if data.dtype.itemsize == 2:
        usual = PixelFormat.MONO16
    if row is None:
        frame = Frame(data, recorded.index, 0.0, 0.0, pixel_format=usual)
        return CameraImage(camera, frame, Circumstances())
    frame = Frame(
        data,
        row.frame_id,
        row.time_s,
        row.exposed_s,
        row.device_ns,
        pixel_format=PixelFormat(row.pixel_format) if row.pixel_format else usual,
    )
    return CameraImage(row.camera, frame, row.circumstances, row.lost_before)


def _found(image: CameraImage) -> Seen:
    # Imported here: it loads OpenCV and scipy.
    from cosmic.vico.core.vision.finding import find_fibres

    data = image.data[..., ::-1] if image.data.ndim == 3 else image.data
    return Seen(image, tuple(find_fibres(data)), ())


class ResultPictures(QWidget):
    """The image and the scene at one moment, beside each other; GUI thread.

    Images are read in a thread of their own; while one is read, only the newest wanted waits.

    Parameters
    ----------
    jobs : BackgroundJobs
        Where images are read.
    model : callable
        Returns the bodies of the platform; None without any.

    Signals
    -------
    image_shown(CameraImage)
        Another image is shown.
    """

    image_shown = Signal(object)

    def __init__(
        self,
        jobs: BackgroundJobs,
        model: Callable[[], SceneModel | None],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._jobs, self._model = jobs, model
        self._reader = FilmReader()
        self._film: Film | None = None
        self._wanted = self._shown = -1
        self._reading = False
        self._find = False
        self._scene: SceneWidget | None = None
        self._arrived = Relay(self._on_read)
        self.view = named(CameraImageView(), "resultImage")
        self.view.setAccessibleName("Recorded image")
        self.seen = SeenLayer()
        self.view.layers += [self.seen, ScaleBar()]
        self.note = named(ElidedLabel(), "resultImageNote")
        self._none = QLabel(_NO_IMAGE)
        self._none.setProperty("role", "dim")
        self._none.setMargin(STEP_PX)
        self._none.setWordWrap(True)
        self._images = QStackedWidget()
        self._images.addWidget(self.view)
        self._images.addWidget(self._none)
        left = QWidget()
        column = QVBoxLayout(left)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self._images, 1)
        column.addWidget(self.note)
        self.split = QSplitter()
        self.split.setChildrenCollapsible(False)
        self.split.addWidget(left)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(self.split)
        self.setMinimumHeight(16 * STEP_PX)

    @property
    def scene(self) -> SceneWidget | None:
        """The scene; None before a recording with positions was shown."""
        return self._scene

    @property
    def image(self) -> CameraImage | None:
        """What is shown; None where there is no image."""
        return self.view.image if self._images.currentWidget() is self.view else None

    def set_film(self, film: Film | None) -> None:
        """Show the images of another film, or none."""
        known = self._film is not None and film is not None and film.path == self._film.path
        self._film = film
        if not known:
            self._wanted = self._shown = -1
            self.seen.analysis = None
            self._images.setCurrentWidget(self._none)
            self.note.set_text("")

    def set_finding(self, find: bool) -> None:
        """Find the fibres on every image that is shown, or not."""
        self._find = find
        self.seen.shown = find
        self._shown = -1
        if find:
            self._read()
        self.view.redraw()

    def set_scene_shown(self, shown: bool) -> None:
        """Have the scene beside the image, or not."""
        if shown and self._scene is None and (model := self._model()) is not None:
            self._scene = SceneWidget(prefer_gl=False)
            self._scene.set_compact(True)
            self._scene.set_model(model)
            self.split.addWidget(self._scene)
            self.split.setSizes([3, 2])
        if self._scene is not None:
            self._scene.setVisible(shown)

    def show_moment(self, time_s: float, poses: Mapping[str, float]) -> None:
        """Show what was at a moment of the platform's clock.

        Parameters
        ----------
        poses : mapping of str to float
            Positions of the axes, gate coordinates.
        """
        if self._film is not None:
            self._wanted = self._film.index_at(time_s)
            self._read()
        if self._scene is not None and poses:
            self._scene.set_positions(poses)

    def _read(self) -> None:
        film, index, find = self._film, self._wanted, self._find
        if film is None or self._reading or index < 0 or index == self._shown:
            return
        self._reading = True
        reader = self._reader
        self._jobs.do(lambda: (film, reader.read(film, index, find=find)), self._arrived)

    def _on_read(self, found: tuple[Film, ShownImage] | None, error: CosmicError | None) -> None:
        self._reading = False
        film, shown = found if found is not None else (None, None)
        if shown is None or film is None:
            self._shown = self._wanted  # not again and again
            self._none.setText(str(error))
            self._images.setCurrentWidget(self._none)
            return
        if self._film is not None and film.path == self._film.path:
            self._show(shown, len(self._film.time_s))
        self._read()

    def _show(self, shown: ShownImage, count: int) -> None:
        self._shown = shown.index
        self.seen.analysis = shown.seen
        self._images.setCurrentWidget(self.view)
        self.view.show_image(shown.image)
        pixels = self.view.pixels
        if pixels.levels.high != pixels.full:
            pixels.set_levels(Levels(0.0, float(pixels.full)))
        words = f"{shown.image.camera}: image {shown.index + 1} of {count}"
        if shown.seen is not None:
            sure = sum(each.certain for each in shown.seen.fibres)
            words += f", {len(shown.seen.fibres)} fibres, {sure} certain"
        self.note.set_text(words)
        self.image_shown.emit(shown.image)

    def release(self) -> None:
        """Give files and the scene back; when the background has ended."""
        self._reader.close()
        if self._scene is not None:
            self._scene.close()
