"""The slim bar on the image: which camera, zoom, focus, light, exposure, and what lies over it."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QKeySequence, QResizeEvent, QShortcut
from PySide6.QtWidgets import (
    QHBoxLayout,
    QMenu,
    QSizePolicy,
    QSlider,
    QStackedWidget,
    QToolButton,
    QWidget,
)

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, styled, tipped
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.operation import Task
from cosmic.frame.overrides import override
from cosmic.vico.api.lens import LensHandle
from cosmic.vico.api.vico import Vico
from cosmic.vico.hw.peripherals import LensAxis

SWAP_KEY: Final = "F6"
LOOK_MS: Final = 250
FOCUS_STEP: Final = 20
BAR_PX: Final = 30
FIELD_PX: Final = 9 * STEP_PX
"""In so much room an exposure time is read."""


class ImageBar(QWidget):
    """Only what is reached for while looking; everything else stands in the workspace Look.

    Parameters
    ----------
    vico : Vico
        The application; lens and lamp may be missing.
    exposures : dict of str to QWidget
        The exposure field of each camera, by its title and in order.

    Signals
    -------
    camera_chosen(str)
        Title of the camera to be shown.
    swap_requested(), fit_requested()
        Image and scene are to change places; the whole image is to be seen.
    inset_toggled(bool)
        The inset is to be shown, or not.
    reported(str)
        Why something was refused.
    move_toggled(bool)
        A click on the image is to move the chosen tool, or not.
    """

    camera_chosen = Signal(str)
    move_toggled = Signal(bool)
    swap_requested = Signal()
    fit_requested = Signal()
    inset_toggled = Signal(bool)
    reported = Signal(str)

    def __init__(self, vico: Vico, exposures: dict[str, QWidget]) -> None:
        super().__init__()
        self.setObjectName("imageBar")
        # Opaque, so that an image below it does not have the bar and its buttons painted anew.
        self.setAutoFillBackground(True)
        self._vico = vico
        self._light_given: float | None = None
        self._make_camera(list(exposures))
        self._make_lens()
        self._exposures = QStackedWidget()
        self._pages = dict(exposures)
        for field in exposures.values():
            self._exposures.addWidget(field)
        self._exposures.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self._make_view_buttons()
        self._arrange()
        self._look = QTimer(self, interval=LOOK_MS)
        self._look.timeout.connect(self.refresh)
        self._look.start()
        self.refresh()

    def _make_camera(self, titles: list[str]) -> None:
        self.camera = _button(f"{titles[0]} ▾" if len(titles) > 1 else titles[0], "Camera shown")
        if len(titles) > 1:
            menu = QMenu(self.camera)
            for title in titles:
                menu.addAction(title).triggered.connect(
                    lambda _=False, title=title: self.camera_chosen.emit(title)
                )
            self.camera.setMenu(menu)
            self.camera.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
            styled(self.camera, "tool menu")

    def _make_lens(self) -> None:
        self.zoom = named(_button("zoom ▾", "Zoom of the lens"), "barZoom")
        self._zooms = QMenu(self.zoom)
        self._zooms.aboutToShow.connect(self._offer_zooms)
        self.zoom.setMenu(self._zooms)
        self.zoom.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        styled(self.zoom, "tool menu")
        self.nearer = _button("f−", f"Focus by −{FOCUS_STEP} counts")
        self.farther = _button("f+", f"Focus by +{FOCUS_STEP} counts")
        self.auto = named(_button("AF", "Autofocus: find the sharpest image"), "barAutofocus")
        self.nearer.clicked.connect(lambda: self._focus_by(-FOCUS_STEP))
        self.farther.clicked.connect(lambda: self._focus_by(FOCUS_STEP))
        self.auto.clicked.connect(self._on_autofocus)
        self.light = tipped(QSlider(Qt.Orientation.Horizontal), "Light, in percent")
        self.light.setRange(0, 100)
        self.light.setFixedWidth(8 * STEP_PX)
        self.light.setAccessibleName("Light")
        self.light.valueChanged.connect(self._on_light)

    def _make_view_buttons(self) -> None:
        self.click_move = named(_button("Move", ""), "barMove")
        self.click_move.setCheckable(True)
        self.click_move.clicked.connect(self.move_toggled)
        self.show_move("nothing is calibrated yet", "")
        self.fit = _button("Fit", "Show the whole image")
        self.fit.clicked.connect(self.fit_requested)
        self.inset = named(_button("▣", "Show the other image as inset"), "barInset")
        self.inset.setCheckable(True)
        self.inset.setChecked(True)
        self.inset.toggled.connect(self.inset_toggled)
        self.swap = named(_button("⇄", f"Exchange image and scene ({SWAP_KEY})"), "barSwap")
        self.swap.clicked.connect(self.swap_requested)
        shortcut = QShortcut(QKeySequence(SWAP_KEY), self)
        shortcut.setContext(Qt.ShortcutContext.WindowShortcut)
        shortcut.activated.connect(self.swap_requested)

    def _arrange(self) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX // 2, 1, STEP_PX // 2, 1)
        row.setSpacing(STEP_PX // 4)
        for widget in (
            self.camera,
            self.zoom,
            self.nearer,
            self.farther,
            self.auto,
            self.light,
        ):
            row.addWidget(widget)
        row.addWidget(self._exposures, 1)
        for button in (self.click_move, self.fit, self.inset, self.swap):
            row.addWidget(button)

    def show_camera(self, title: str) -> None:
        """Say which camera is shown."""
        if title in self._pages:
            self._exposures.setCurrentWidget(self._pages[title])
            several = len(self._pages) > 1
            self.camera.setText(f"{title} ▾" if several else title)

    def show_move(self, problem: str, tool: str, *, on: bool = False) -> None:
        """Offer that a click moves `tool`; a problem disables it and stands in its tooltip."""
        self.click_move.setEnabled(not problem)
        self.click_move.setChecked(on and not problem)
        tip = f"Not now: {problem}" if problem else f"A click on the image moves the {tool} there"
        if self.click_move.toolTip() != tip:
            self.click_move.setToolTip(tip)

    # Showing

    def refresh(self) -> None:
        """Show where the lens and the lamp are."""
        lens, lamp = self._vico.lens, self._vico.light
        homed = False
        if lens is not None:
            states = [lens.state(axis) for axis in LensAxis]
            homed = all(state is not None and state.homed for state in states)
            known = lens.zoom is not None and homed
            self.zoom.setText(f"{lens.zoom:.3g}x ▾" if known else "zoom ▾")
        why = "" if homed else "Not now: home the lens first, in the workspace Look"
        for button, tip in (
            (self.zoom, "Zoom of the lens"),
            (self.nearer, f"Focus by −{FOCUS_STEP} counts"),
            (self.farther, f"Focus by +{FOCUS_STEP} counts"),
            (self.auto, "Autofocus: find the sharpest image"),
        ):
            button.setEnabled(homed)
            if button.toolTip() != (why or tip):
                button.setToolTip(why or tip)
        self.light.setEnabled(lamp is not None and not lamp.problem)
        if lamp is not None and lamp.percent is not None and not self.light.isSliderDown():
            self.light.blockSignals(True)
            self.light.setValue(round(lamp.percent))
            self.light.blockSignals(False)

    def _offer_zooms(self) -> None:
        self._zooms.clear()
        lens = self._vico.lens
        for step in lens.steps if lens is not None else ():
            action = self._zooms.addAction(step.name)
            action.triggered.connect(
                lambda _=False, zoom=step.zoom: self._begin(lambda lens: lens.zoom_to(zoom))
            )

    # Commands

    def _begin(self, begin: Callable[[LensHandle], Task]) -> None:
        lens = self._vico.lens
        if lens is None:
            return
        try:
            begin(lens)
        except CosmicError as exc:
            self.reported.emit(str(exc))

    def _focus_by(self, step: int) -> None:
        state = None if self._vico.lens is None else self._vico.lens.state(LensAxis.FOCUS)
        if state is None:
            return
        target = state.position_counts + step
        if not 0 <= target <= state.limit_counts:
            self.reported.emit(f"focus {target} lies outside 0 to {state.limit_counts} counts")
            return
        self._begin(lambda lens: lens.seek_focus(target))

    def _on_autofocus(self) -> None:
        self._begin(lambda lens: lens.autofocus())

    def _on_light(self, percent: int) -> None:
        if self._vico.light is None:
            return
        try:
            self._vico.light.set_percent(float(percent))
        except CosmicError as exc:
            self.reported.emit(str(exc))

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._leave_out()

    def _leave_out(self) -> None:
        """Where there is no room for all, leave out what stands in Look as well."""
        spacing, row = STEP_PX // 4, self.layout()
        if row is None:
            return
        margins = row.contentsMargins()
        left_px = self.width() - margins.left() - margins.right() + spacing
        items = [row.itemAt(index) for index in range(row.count())]
        shown = [each for item in items if item is not None and (each := item.widget()) is not None]
        needed_px = sum(_least_px(each) + spacing for each in shown)
        for each in (self.light, self.nearer, self.farther, self._exposures, self.fit):
            each.setVisible(needed_px <= left_px)
            if needed_px > left_px:
                needed_px -= _least_px(each) + spacing

    @override
    def sizeHint(self) -> QSize:
        return QSize(max(super().sizeHint().width(), 90 * STEP_PX), BAR_PX)


def _least_px(widget: QWidget) -> int:
    if isinstance(widget, QStackedWidget):
        return FIELD_PX
    return min(max(widget.minimumSizeHint().width(), widget.minimumWidth()), widget.maximumWidth())


def _button(text: str, tip: str) -> QToolButton:
    button = tipped(QToolButton(), tip)
    button.setText(text)
    return styled(button, "tool")
