"""`CameraView`: the live image of one camera, with all that belongs beside it."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QGroupBox, QHBoxLayout, QScrollArea, QSizePolicy, QVBoxLayout, QWidget

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.overrides import override
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.api.vico import Vico
from cosmic.vico.core.image import CameraImage
from cosmic.vico.gui.calibrate_menu import CalibrateButton
from cosmic.vico.gui.camera_chooser import CameraChooser
from cosmic.vico.gui.chain_panel import ChainPanel
from cosmic.vico.gui.contrast_panel import ContrastPanel
from cosmic.vico.gui.correct_button import CorrectButton
from cosmic.vico.gui.image_tools import ImageTools
from cosmic.vico.gui.image_view import CameraImageView
from cosmic.vico.gui.layers import CornerText, Crosshair, GhostLayer, Note, ScaleBar
from cosmic.vico.gui.levels import Histogram, histogram
from cosmic.vico.gui.mark_layer import MarkLayer
from cosmic.vico.gui.record_bar import RecordBar
from cosmic.vico.gui.seen_layer import SeenLayer
from cosmic.vico.gui.settings_form import SettingsForm
from cosmic.vico.gui.slider_field import SliderField
from cosmic.vico.gui.status_row import StatusRow
from cosmic.vico.gui.tool_row import ToolRow
from cosmic.vico.hw.interface import FrameStatus, Trigger


def pointer_text(camera: CameraHandle, image: CameraImage | None, point_px: Pixel | None) -> str:
    """Return point and brightness of a pixel, and where that is on the platform."""
    if image is None or point_px is None:
        return ""
    height, width = image.data.shape[:2]
    x, y = round(point_px[0]), round(point_px[1])
    if not (0 <= x < width and 0 <= y < height):
        return ""
    value = image.data[y, x]
    shown = f"{int(value)}" if value.ndim == 0 else ", ".join(f"{int(each)}" for each in value)
    there_um = camera.platform_um(point_px)
    where = "" if there_um is None else f"  at {', '.join(f'{v:.1f}' for v in there_um)} µm"
    return f"{x}, {y} px = {shown}{where}"


LOOK_MS: Final = 8
LEAST_S: Final = 0.025
"""Between two images: less than 1/30 s, as images of 30 Hz do not come evenly."""
READOUT_MS: Final = 200
SELDOM: Final = 5
"""Readouts between two looks at the disk."""
STALE_S: Final = 2.0
DRAWER_PX: Final = 38 * STEP_PX


@dataclass(frozen=True, slots=True)
class CameraParts:
    """What stands around the image of a camera, handed out by `CameraView.give_parts`."""

    row: ToolRow
    exposure: SliderField
    gain: SliderField
    status: StatusRow
    recorder: RecordBar
    settings: QWidget


class CameraView(QWidget):
    """Shows the newest image of a camera; content of a dock, or a window of its own.

    Parameters
    ----------
    vico : Vico
        The application.
    name : str
        Which camera.
    now : callable
        Returns the local time.
    """

    def __init__(
        self,
        vico: Vico,
        name: str,
        parent: QWidget | None = None,
        *,
        now: Callable[[], datetime] = datetime.now,
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Camera {name}")
        self._camera, self._now = vico.camera(name), now
        self._newest: CameraImage | None = None
        self._coming: CameraImage | None = None
        self._came, self._came_s, self._drawn_s = "", WALL.now_s(), 0.0
        self._histogram: Histogram | None = None
        self._readouts, self._was_running, self._refused = 0, False, ""
        self._failing = ""
        self._pointed: Pixel | None = None
        self.view = CameraImageView()
        self.cross, self.scale_bar = Crosshair(), ScaleBar()
        self.seen, self.mark, self.note = SeenLayer(), MarkLayer(), Note()
        self.ghost = GhostLayer()
        self.row, self.status = ToolRow(), StatusRow(self._camera)
        self.calibrate = self.row.add(CalibrateButton(self._camera))
        self.correct = CorrectButton(self._camera, lambda: self.view.image, now=now)
        self.contrast, self.chain = ContrastPanel(), ChainPanel(self._camera)
        self.form = SettingsForm(self._camera, self)
        self.chooser = CameraChooser(vico, name)
        self.recorder = RecordBar(self._camera, now=now)
        self.message = CornerText(beside=self.scale_bar)
        self.pointer = CornerText(below=(self.scale_bar, self.message))
        self.tools = ImageTools(self.view, self.row, self._camera, self)
        corners = (self.scale_bar, self.message, self.pointer)
        self.view.layers = [
            self.cross,
            self.seen,
            self.mark,
            *self.tools.layers,
            self.ghost,
            *corners,
            self.note,
        ]
        self._look = QTimer(self, timerType=Qt.TimerType.PreciseTimer, interval=LOOK_MS)
        self._readout = QTimer(self, interval=READOUT_MS)
        self._build()
        self._connect()
        self._relay = Relay(self.refresh, least_ms=READOUT_MS).follow(vico.on_change)
        self.refresh()

    @property
    def camera(self) -> CameraHandle:
        """Whose images are shown."""
        return self._camera

    # Putting it together

    def _build(self) -> None:
        self.view.setMinimumSize(24 * STEP_PX, 14 * STEP_PX)
        self.drawer = self._make_drawer()
        self._middle = QHBoxLayout()
        self._middle.setSpacing(STEP_PX)
        self._middle.addWidget(self.view, 1)
        self._middle.addWidget(self.drawer)
        light = QHBoxLayout()
        light.setSpacing(2 * STEP_PX)
        light.addWidget(self.form.exposure, 1)
        light.addWidget(self.form.gain, 1)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        self._column.setSpacing(STEP_PX // 2)
        self._column.addWidget(self.row)
        self._column.addLayout(self._middle, 1)
        self._column.addLayout(light)
        self._column.addWidget(self.status)
        self._column.addWidget(self.recorder)

    def give_parts(self) -> "CameraParts":
        """Keep the image alone and hand out all around it, for a window to place elsewhere."""
        settings = self.drawer.takeWidget()
        self.drawer.hide()
        self.row.more.hide()
        for margins in (self._column, self._middle):
            margins.setContentsMargins(0, 0, 0, 0)
            margins.setSpacing(0)
        self.view.setMinimumSize(12 * STEP_PX, 9 * STEP_PX)
        self.recorder.stack()
        form = self.form
        return CameraParts(self.row, form.exposure, form.gain, self.status, self.recorder, settings)

    def _make_drawer(self) -> QScrollArea:
        content = QWidget()
        column = QVBoxLayout(content)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        for title, widgets in (
            ("Contrast", (self.contrast,)),
            ("Machine vision", (self.chain, self.correct)),
            ("Camera", (self.chooser, self.form.panel)),
        ):
            group = QGroupBox(title)
            inner = QVBoxLayout(group)
            inner.setContentsMargins(0, 0, 0, 0)
            inner.setSpacing(STEP_PX // 2)
            for widget in widgets:
                inner.addWidget(widget)
            column.addWidget(group)
        column.addStretch(1)
        drawer = named(QScrollArea(), "dockScroll")
        drawer.setWidgetResizable(True)
        drawer.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        drawer.setFixedWidth(DRAWER_PX)
        drawer.setWidget(content)
        drawer.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Ignored)
        drawer.hide()
        return drawer

    def _connect(self) -> None:
        self._look.timeout.connect(self.look)
        self._readout.timeout.connect(self.read_out)
        row, view = self.row, self.view
        row.live.clicked.connect(self._on_live)
        row.fit.clicked.connect(view.fit)
        row.one_to_one.clicked.connect(view.one_to_one)
        row.more.toggled.connect(self.drawer.setVisible)
        for button, layer in (
            (row.cross, self.cross),
            (row.scale, self.scale_bar),
            (row.found, self.seen),
        ):
            button.toggled.connect(_shower(layer, view))
        self.contrast.levels_changed.connect(view.pixels.set_levels)
        self.contrast.marks_changed.connect(view.pixels.set_marks)
        view.pointed.connect(self._on_pointed)
        for messages in (self.calibrate.message, self.correct.message, self.tools.message):
            messages.connect(self.say)
        self.tools.region_chosen.connect(self.form.read_part)

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._look.start()
        self._readout.start()
        self.look()
        self.read_out()
        self.recorder.refresh()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._look.stop()  # nobody looks: the camera and its recording go on
        self._readout.stop()
        self._coming = None

    # Images

    def look(self) -> None:
        """Show the newest image, unless the last one was shown just now, or it is not drawn yet.

        The window waits for no image: it is shown at a later look.
        """
        newest = self._coming or self._camera.latest()
        if newest is self._newest or newest is None:
            return
        now_s = WALL.now_s()
        if now_s - self._drawn_s < LEAST_S or newest.frame.status is not FrameStatus.COMPLETE:
            return
        if not newest.frame.ready:
            newest.frame.prepare()
            self._coming = newest
            return
        self._coming = None
        first = self._newest is None
        self._newest, self._drawn_s = newest, now_s
        self._came, self._came_s = f"{self._now():%H:%M:%S}", now_s
        self.seen.analysis = self._camera.analysis
        self._show_old("")
        self.view.show_image(newest)
        if first:
            self.recorder.refresh()

    def read_out(self) -> None:
        """Show numbers, histogram and state."""
        image = self.view.image
        if image is not None and image is self._newest:
            self._histogram = histogram(image.data, self.view.pixels.full)
            self.contrast.show_histogram(self._histogram)
        self.status.refresh(self._histogram)
        self._readouts += 1
        if self._camera.recording.active or self._readouts % SELDOM == 0:
            self.recorder.refresh()
        self._show_state()
        self._show_failing()
        self._show_pointer()

    def _show_failing(self) -> None:
        """Say over the image that a step of machine vision fails, once, and until it works."""
        failing = next((each.problem for each in self._camera.algorithms if each.failing), "")
        if failing != self._failing:
            self._failing = failing
            self.say(f"{state_look(State.ERROR).glyph} {failing}" if failing else "")

    def _show_state(self) -> None:
        camera, settings = self._camera, self._camera.settings
        if camera.running and not self._was_running:
            self._came_s = WALL.now_s()  # give it time to begin
        self._was_running = camera.running
        since = f"no image since {self._came}" if self._came else "no image yet"
        if camera.problem:
            self._show_old(f"{camera.problem}\n{since}")
            self.status.show_state(State.ERROR, camera.problem)
        elif not camera.running:
            self._show_old(f"not live: {self._age}" if self._came else "not started")
            self.status.show_state(State.UNKNOWN, f"stopped; {since}")
        elif settings is not None and settings.trigger is not Trigger.FREE_RUN:
            self._show_old("")
            self.status.show_state(State.OK, f"waits for its trigger; {since}")
        elif WALL.now_s() - self._came_s > self._overdue_s:
            self._show_old(since)
            self.status.show_state(State.ERROR, since)
        else:
            self._show_old("")
            self.status.show_state(State.OK, "live")

    @property
    def _age(self) -> str:
        """How old the image shown is."""
        return f"image of {self._came}, {WALL.now_s() - self._came_s:.0f} s ago"

    @property
    def _overdue_s(self) -> float:
        settings = self._camera.settings
        return STALE_S if settings is None else max(STALE_S, 3.0 / max(settings.rate_hz, 1e-3))

    def _show_old(self, text: str) -> None:
        if text == self.note.text:
            return
        self.note.text = text
        self.view.pixels.set_greyed(bool(text))
        self.view.redraw()

    def refresh(self) -> None:
        """Show what is in force."""
        camera = self._camera
        self.form.refresh()
        self.chain.refresh()
        self.row.show_running(camera.running, camera.problem)
        self.calibrate.fill()
        self.row.show_targets(tuple(camera.targets), camera.calibration_problem)
        self.tools.refresh()
        if self.isVisible():
            self.recorder.refresh()
        self._show_state()
        if camera.refused != self._refused:
            self._refused = camera.refused
            self.say(
                f"{state_look(State.REFUSED).glyph} {camera.refused}" if camera.refused else ""
            )

    def _on_live(self) -> None:
        try:
            (self._camera.stop if self._camera.running else self._camera.start)()
        except CosmicError as exc:
            self.say(f"{state_look(State.REFUSED).glyph} {exc}")
        else:
            self.say("")
        self.row.show_running(self._camera.running, self._camera.problem)

    def _on_pointed(self, point_px: Pixel | None) -> None:
        self._pointed = point_px
        self._show_pointer()

    def _show_pointer(self) -> None:
        text = pointer_text(self._camera, self.view.image, self._pointed)
        if text != self.pointer.text:
            self.pointer.text = text
            self.view.redraw()

    def say(self, text: str) -> None:
        """Write one line over the image, such as a refusal; empty takes it away."""
        self.message.text = text
        self.view.redraw()

    @override
    def sizeHint(self) -> QSize:
        return QSize(90 * STEP_PX, 70 * STEP_PX)


def _shower(
    layer: Crosshair | ScaleBar | SeenLayer, view: CameraImageView
) -> Callable[[bool], None]:
    def show(shown: bool) -> None:
        layer.shown = shown
        view.redraw()

    return show
