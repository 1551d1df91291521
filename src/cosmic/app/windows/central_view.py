"""The middle of the window: one picture as large as there is room, and another as its inset."""

from typing import Final

from PySide6.QtCore import QRect, QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QVBoxLayout, QWidget

from cosmic.app.panels.scene import ScenePanel
from cosmic.frame.gui.build import named
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.vico.gui.camera_view import CameraView

SCENE_TITLE: Final = "Scene"
_INSET_SHARE: Final = 0.22
_INSET_LEAST_PX: Final = 16 * STEP_PX
_INSET_ASPECT: Final = 4 / 3
_USUAL_ASPECT: Final = 4 / 3
_CARD_ABOVE_PX: Final = 4 * STEP_PX
"""Room below the card, in which the image says where the mouse is."""


class CentralView(QWidget):
    """Shows a camera large and the scene as inset, or the other way round; GUI thread.

    Only places change: no picture is made anew, so a swap is seen at once.

    Parameters
    ----------
    cameras : dict of str to CameraView
        By their titles.
    scene : ScenePanel
        The other picture.

    Signals
    -------
    changed(str)
        Title of what is large now.
    """

    changed = Signal(str)

    def __init__(
        self, cameras: dict[str, CameraView], scene: ScenePanel, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setObjectName("centralView")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self.setMinimumSize(30 * STEP_PX, 20 * STEP_PX)
        self._cameras = dict(cameras)
        self._scene = scene
        self._camera = next(iter(cameras))
        self._scene_large = False
        self._inset_wanted = True
        self._bar: QWidget | None = None
        self._card: QWidget | None = None
        self._frame = named(QFrame(self), "centralInset")
        self._frame.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        for each in (*self._cameras.values(), scene):
            each.setParent(self)
        self._lay_out()

    @property
    def titles(self) -> tuple[str, ...]:
        """What can be shown large."""
        return (*self._cameras, SCENE_TITLE)

    @property
    def large(self) -> str:
        """Title of what is shown large."""
        return SCENE_TITLE if self._scene_large else self._camera

    @property
    def camera(self) -> CameraView:
        """The camera that is shown, large or as inset."""
        return self._cameras[self._camera]

    def set_bar(self, bar: QWidget) -> None:
        """Have `bar` along the lower edge: below the image where there is room, else on it."""
        bar.setParent(self)
        self._bar = bar
        self._lay_out()

    def set_card(self, card: QWidget) -> None:
        """Have `card` over the picture, at the lower left, whenever it is shown."""
        card.setParent(self)
        card.hide()
        self._card = card
        self._lay_out()

    def lay_card(self) -> None:
        """Put the card where it belongs; it has grown or shrunk."""
        if self._card is None:
            return
        bar_px = self._bar.height() if self._bar is not None else 0
        top = self.height() - bar_px - self._card.height() - _CARD_ABOVE_PX
        self._card.move(STEP_PX, max(0, top))
        self._card.raise_()

    def show_large(self, title: str) -> None:
        """Show a camera or the scene large; the other becomes the inset."""
        if title in self._cameras:
            self._camera, self._scene_large = title, False
        elif title == SCENE_TITLE:
            self._scene_large = True
        self._lay_out()
        self.changed.emit(self.large)

    def swap(self) -> None:
        """Exchange the large picture and the inset."""
        self.show_large(self._camera if self._scene_large else SCENE_TITLE)

    def set_inset_shown(self, shown: bool) -> None:
        """Show the other picture as inset, or not."""
        self._inset_wanted = shown
        self._lay_out()

    def picture_rect(self) -> QRect:
        """Return where the drawn picture is, without the empty margins round it."""
        if self._scene_large:
            return self._scene.geometry()
        view = self.camera.view
        width, height = view.size_px
        area = QRect(view.mapTo(self, view.rect().topLeft()), view.size())
        if not width:
            return area
        drawn = view.to_screen.mapRect(QRect(0, 0, width, height)).translated(area.topLeft())
        return drawn.intersected(area)

    # Places

    @property
    def _aspect(self) -> float:
        width, height = self.camera.view.size_px
        return width / height if height else _USUAL_ASPECT

    def _lay_out(self) -> None:
        room = self.rect()
        bar_px = self._lay_bar(room)
        for title, each in self._cameras.items():
            each.setVisible(title == self._camera and (not self._scene_large or self._inset_wanted))
        self._scene.setVisible(self._scene_large or self._inset_wanted)
        self._scene.set_compact(not self._scene_large)
        pictures: tuple[QWidget, QWidget] = (self._scene, self.camera)
        large, small = pictures if self._scene_large else pictures[::-1]
        if self._scene_large or room.width() / self._aspect <= room.height() - bar_px:
            room.setHeight(room.height() - bar_px)
        large.setGeometry(room)
        large.lower()
        inset = self._inset_rect(bar_px)
        self._frame.setVisible(self._inset_wanted)
        self._frame.setGeometry(inset.adjusted(-1, -1, 1, 1))
        self._frame.raise_()
        small.setGeometry(inset)
        small.raise_()
        if self._bar is not None:
            self._bar.raise_()
        self.lay_card()

    def _lay_bar(self, room: QRect) -> int:
        if self._bar is None:
            return 0
        wanted: QSize = self._bar.sizeHint()
        width = min(wanted.width(), room.width())
        height = wanted.height()
        left = room.left() + (room.width() - width) // 2
        self._bar.setGeometry(left, room.bottom() + 1 - height, width, height)
        return height

    def _inset_rect(self, bar_px: int) -> QRect:
        width = max(_INSET_LEAST_PX, round(_INSET_SHARE * self.width()))
        height = round(width / _INSET_ASPECT)
        margin = STEP_PX
        return QRect(
            self.width() - width - margin, self.height() - height - bar_px - margin, width, height
        )

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._lay_out()


def column_of(*parts: QWidget) -> QWidget:
    """Return a panel with these one above the other, as narrow as they allow."""
    panel = QWidget()
    column = QVBoxLayout(panel)
    column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
    column.setSpacing(STEP_PX // 2)
    for part in parts:
        column.addWidget(part)
    column.addStretch(1)
    return panel
