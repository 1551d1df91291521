"""The process that `benchmarks.live_view` starts on a display: shows images, and times it."""

import json
import sys
import time
from pathlib import Path
from typing import Final

import numpy as np
from PySide6.QtCore import QTimer
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import QApplication, QLabel

from cosmic.frame.gui.theme import apply_theme
from cosmic.vico.core.image import CameraImage
from cosmic.vico.gui.camera_view import CameraView
from cosmic.vico.hw.interface import PixelFormat

# The port that the tests of the widgets use; it stands in for the application and does nothing.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from gui.vico.fake_vico import FakeCamera, FakeVico, Found, Seen, fibre_image

WINDOW_PX: Final = (1100, 950)
IMAGES: Final = 8
RATE_HZ: Final = 30.0


class Stand:
    """A view of a camera with images of a fibre, one after the other."""

    def __init__(self) -> None:
        port = FakeVico(Path())
        self.camera: FakeCamera = port.camera("top")
        self.data = [fibre_image(seed=seed) for seed in range(IMAGES)]
        self.view = CameraView(port, "top")
        self.view.resize(*WINDOW_PX)
        self.view.show()
        self.shown = 0
        self._next = 0
        self.form = PixelFormat.MONO8
        self.push()
        self.view.look()
        QApplication.processEvents()

    def push(self) -> CameraImage:
        """Take an image, with a fibre found in it."""
        image = self.camera.push(self.data[self._next % IMAGES], pixel_format=self.form)
        self.camera.analysis = Found(image, (Seen(),))
        self._next += 1
        return image


def spent(begin: tuple[float, float], count: int) -> tuple[float, float]:
    """Return processor time an image: of this thread, and of all."""
    thread, process = begin
    return (time.thread_time() - thread) / count, (time.process_time() - process) / count


def label(stand: Stand, count: int) -> list[float]:
    """Return the cost of a bare label with a pixmap of the size shown."""
    shown = QLabel()
    shown.setScaledContents(True)
    size = stand.view.view.size()
    width, height = stand.view.view.size_px
    scale = min(size.width() / width, size.height() / height)
    shown.resize(round(width * scale), round(height * scale))
    shown.show()
    QApplication.processEvents()
    found = []
    for number in range(count):
        data = stand.data[number % IMAGES]
        began = time.process_time()
        image = QImage(data.data, width, height, width, QImage.Format.Format_Grayscale8)
        shown.setPixmap(QPixmap.fromImage(image))
        QApplication.processEvents()
        found.append(time.process_time() - began)
    shown.close()
    return found


def view(stand: Stand, count: int) -> list[float]:
    """Return the cost of an image in the view, one after the other."""
    found = []
    for _ in range(count):
        stand.push()
        stand.view._drawn_s = 0.0  # the next one at once
        began = time.process_time()
        stand.view.look()
        QApplication.processEvents()
        found.append(time.process_time() - began)
    return found


def live(stand: Stand, seconds: float) -> dict[str, float]:
    """Let images come at 30 Hz; return the share of a core and how many were drawn."""
    pushing = QTimer(interval=round(1000.0 / RATE_HZ))
    pushing.timeout.connect(stand.push)
    app = QApplication.instance()
    assert app is not None
    QTimer.singleShot(round(1000.0 * seconds), app.quit)
    paints, first = stand.view.view.paints, stand._next
    began, cpu = time.perf_counter(), time.process_time()
    pushing.start()
    app.exec()
    passed = time.perf_counter() - began
    share = (time.process_time() - cpu) / passed
    pushing.stop()
    drawn = stand.view.view.paints - paints
    return {"share": share, "came_hz": (stand._next - first) / passed, "drawn_hz": drawn / passed}


def answer(count: int, seconds: float) -> dict[str, object]:
    """Return all that is measured."""
    stand = Stand()
    found: dict[str, object] = {"label_s": label(stand, count)}
    stand.view.row.found.click()
    found["bare_s"] = view(stand, count)
    stand.view.row.found.click()
    stand.view.row.cross.click()
    found["full_s"] = view(stand, count)
    stand.data = [each.astype(np.uint16) * 16 for each in stand.data]
    stand.form = PixelFormat.MONO12
    found["deep_s"] = view(stand, count)
    stand.data = [(each // 16).astype(np.uint8) for each in stand.data]
    stand.form = PixelFormat.MONO8
    view(stand, 2)
    stand.view.row.more.click()
    found["live"] = live(stand, seconds)
    stand.view.close()
    return found


if __name__ == "__main__":
    application = QApplication([])
    apply_theme(application, "dark")
    print(json.dumps(answer(int(sys.argv[1]), float(sys.argv[2]))))
