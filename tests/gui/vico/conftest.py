from datetime import datetime

import pyqtgraph as pg
import pytest
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication

from cosmic.frame.gui.theme import apply_theme, current_palette
from cosmic.vico.gui.camera_view import CameraView
from gui.vico.fake_vico import FakeVico

WHEN = datetime(2026, 11, 21, 12, 16, 40)
LEFT, NONE = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton


@pytest.fixture(autouse=True)
def _dark(qapp):
    """Colours are those of the dark theme, whatever theme an earlier test put on."""
    if current_palette().name != "dark":
        apply_theme(qapp, "dark")


@pytest.fixture
def port(tmp_path) -> FakeVico:
    """One camera, a lens and a lamp."""
    return FakeVico(tmp_path)


@pytest.fixture
def camera(port):
    return port.camera("top")


@pytest.fixture
def own(qtbot):
    """Keep widgets until the test ends, and delete them then and there.

    Deleted later, they would cost each test a collection of garbage.
    """
    owned = []
    yield owned.append
    for widget in owned:
        widget.close()
        widget.deleteLater()
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


@pytest.fixture
def view(own, port):
    """The view of the camera, on the screen, before the first image."""
    made = CameraView(port, "top", now=lambda: WHEN)
    own(made)
    made.resize(900, 700)
    made.show()
    return made


@pytest.fixture
def shown(qtbot, view, camera):
    """The view with an image in it."""
    image = camera.push()
    qtbot.waitUntil(lambda: view.view.image is image)
    QApplication.processEvents()
    return view


class Mouse:
    """Moves and presses over an image, at places given in its pixels."""

    def __init__(self, view) -> None:
        self._target = view.viewport()
        self._view = view

    def screen(self, point_px) -> QPointF:
        return self._view.to_screen.map(QPointF(*point_px))

    def _send(self, kind, there, button, buttons) -> None:
        everywhere = QPointF(self._target.mapToGlobal(there.toPoint()))
        none = Qt.KeyboardModifier.NoModifier
        event = QMouseEvent(kind, there, everywhere, button, buttons, none)
        QApplication.sendEvent(self._target, event)

    def move(self, point_px) -> None:
        self._send(QEvent.Type.MouseMove, self.screen(point_px), NONE, NONE)

    def click(self, point_px) -> None:
        self.drag(point_px, point_px)

    def drag(self, begin_px, end_px) -> None:
        """Press, move, let go; the places are those before the image moves along."""
        begin, end = self.screen(begin_px), self.screen(end_px)
        self._send(QEvent.Type.MouseButtonPress, begin, LEFT, LEFT)
        if begin != end:
            for there in ((begin + end) / 2.0, end, end):
                self._send(QEvent.Type.MouseMove, there, NONE, LEFT)
        self._send(QEvent.Type.MouseButtonRelease, end, LEFT, NONE)


@pytest.fixture
def mouse(shown, monkeypatch) -> Mouse:
    monkeypatch.setitem(pg.CONFIG_OPTIONS, "mouseRateLimit", -1)  # as slow as a hand is
    return Mouse(shown.view)
