"""The settings of a camera: fields for each, and how a wish becomes what is in force."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QComboBox, QGridLayout, QLabel, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import push_button, retip, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.task_watch import TaskWatch
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.operation import Progress
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.gui.slider_field import SliderField
from cosmic.vico.hw.interface import (
    CameraRanges,
    CameraSettings,
    PixelFormat,
    Range,
    Roi,
    Trigger,
)

MS: Final = 1e3
Change = Callable[[CameraSettings], CameraSettings]
_LACKS: Final = "Not available on this camera"
_GONE: Final = "No camera is connected"


class SettingsForm(QObject):
    """Owns the fields, wherever they are put; refusals stand at the field that was changed.

    Attributes
    ----------
    exposure, gain : SliderField
        Beside the image.
    panel : QWidget
        The others, for the drawer.
    """

    def __init__(self, camera: CameraHandle, parent: QWidget) -> None:
        super().__init__(parent)
        self._camera = camera
        self._changed: SliderField | None = None
        self._watch = TaskWatch(self)
        self._watch.progressed.connect(self._on_progressed)
        self._waiting: list[tuple[Change, SliderField | None]] = []
        self.exposure = SliderField("Exposure time", "ms", caption="Exposure")
        self.gain = SliderField("Gain", "dB", caption="Gain")
        self.rate = SliderField("Frames a second", "Hz")
        self.binning = tipped(QComboBox(), "Pixels binned into one, in each direction")
        self.pixel_format = tipped(QComboBox(), "Pixel format: how a pixel is coded")
        self.trigger = tipped(QComboBox(), "What starts an exposure")
        self.shoot = push_button("Trigger", "Take one image now")
        self.full_sensor = push_button("Full sensor", "Read the whole sensor")
        self.roi_text, self.reason = QLabel(), ElidedLabel()
        self.panel = QWidget(parent)
        self._build()
        self.exposure.committed.connect(self._on_exposure)
        self.gain.committed.connect(self._on_gain)
        self.rate.committed.connect(self._on_rate)
        self.binning.activated.connect(self._on_binning)
        self.pixel_format.activated.connect(self._on_format)
        self.trigger.activated.connect(self._on_trigger)
        self.shoot.clicked.connect(self._on_shoot)
        self.full_sensor.clicked.connect(self.read_all)

    def _build(self) -> None:
        grid = QGridLayout(self.panel)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(STEP_PX // 2)
        rows: tuple[tuple[str, QWidget], ...] = (
            ("Rate", self.rate),
            ("Binning", self.binning),
            ("Format", self.pixel_format),
            ("Trigger", self.trigger),
            ("Region", self.roi_text),
        )
        for number, (caption, widget) in enumerate(rows):
            label = QLabel(caption)
            label.setProperty("role", "dim")
            grid.addWidget(label, number, 0)
            grid.addWidget(widget, number, 1)
        buttons, row = tight_row(STEP_PX // 2)
        row.addWidget(self.shoot, 1)
        row.addWidget(self.full_sensor, 1)
        grid.addWidget(buttons, len(rows), 0, 1, 2)
        grid.addWidget(self.reason, len(rows) + 1, 0, 1, 2)
        grid.setColumnStretch(1, 1)
        self.reason.hide()

    # Showing what is in force

    def refresh(self) -> None:
        """Show settings and ranges in force."""
        settings, ranges = self._camera.settings, self._camera.ranges
        there = settings is not None and ranges is not None
        for widget in (self.binning, self.pixel_format, self.trigger, self.full_sensor):
            widget.setEnabled(there)
        self.shoot.setEnabled(settings is not None and settings.trigger is Trigger.SOFTWARE)
        retip(
            self.shoot,
            "Take one image now" if self.shoot.isEnabled() else "Choose the software trigger first",
        )
        if settings is None or ranges is None:
            for field in (self.exposure, self.gain, self.rate):
                field.set_usable(self._camera.problem or _GONE)
            self.roi_text.setText("–")
            return
        _show(self.exposure, ranges.exposure_s, settings.exposure_s, MS)
        _show(self.gain, ranges.gain_db, settings.gain_db)
        _show(self.rate, ranges.rate_hz, settings.rate_hz)
        self._show_choices(settings, ranges)
        roi = settings.roi
        self.roi_text.setText(f"{roi.width_px} × {roi.height_px} px")
        retip(self.roi_text, f"from {roi.x_px}, {roi.y_px} px")

    def _show_choices(self, settings: CameraSettings, ranges: CameraRanges) -> None:
        _choose(
            self.binning, [f"{n} × {n}" for n in ranges.binnings], settings.binning, ranges.binnings
        )
        formats = ranges.pixel_formats
        _choose(self.pixel_format, [x.value for x in formats], settings.pixel_format, formats)
        triggers = ranges.triggers
        _choose(self.trigger, [x.value for x in triggers], settings.trigger, triggers)

    # Wishes

    def read_part(self, x_px: int, y_px: int, width_px: int, height_px: int) -> None:
        """Read a part of the image shown; widened to what the camera can do."""
        settings, ranges = self._camera.settings, self._camera.ranges
        if settings is None or ranges is None:
            return
        sensor = self._sensor(settings)
        x, width = _fitting(settings.roi.x_px + x_px, width_px, ranges.width_px, sensor[0])
        y, height = _fitting(settings.roi.y_px + y_px, height_px, ranges.height_px, sensor[1])
        roi = Roi(x, y, width, height)
        self._request(lambda now: replace(now, roi=roi))

    def read_all(self) -> None:
        """Read the whole sensor."""
        settings = self._camera.settings
        if settings is not None:
            width, height = self._sensor(settings)
            roi = Roi(0, 0, width, height)
            self._request(lambda now: replace(now, roi=roi))

    def _sensor(self, settings: CameraSettings) -> tuple[int, int]:
        """Return the sensor's size in binned pixels."""
        info, ranges = self._camera.info, self._camera.ranges
        if info is not None and info.sensor_px != (0, 0):
            return info.sensor_px[0] // settings.binning, info.sensor_px[1] // settings.binning
        if ranges is None:
            return settings.roi.width_px, settings.roi.height_px
        return int(ranges.width_px.high), int(ranges.height_px.high)

    def _on_exposure(self, exposure_ms: float) -> None:
        self._request(lambda now: replace(now, exposure_s=exposure_ms / MS), self.exposure)

    def _on_gain(self, gain_db: float) -> None:
        self._request(lambda now: replace(now, gain_db=gain_db), self.gain)

    def _on_rate(self, rate_hz: float) -> None:
        self._request(lambda now: replace(now, rate_hz=rate_hz), self.rate)

    def _on_binning(self) -> None:
        settings = self._camera.settings
        if settings is None:
            return
        binning = int(self.binning.currentData())
        width, height = self._sensor(replace(settings, binning=binning))
        roi = Roi(0, 0, width, height)
        self._request(lambda now: replace(now, binning=binning, roi=roi))

    def _on_format(self) -> None:
        chosen = PixelFormat(self.pixel_format.currentData())
        self._request(lambda now: replace(now, pixel_format=chosen))

    def _on_trigger(self) -> None:
        chosen = Trigger(self.trigger.currentData())
        self._request(lambda now: replace(now, trigger=chosen))

    def _on_shoot(self) -> None:
        try:
            self._camera.software_trigger()
        except CosmicError as exc:
            self._refuse(str(exc))

    def _request(self, change: Change, field: SliderField | None = None) -> None:
        self._waiting.append((change, field))
        if not self._watch.busy:
            self._ask()

    def _ask(self) -> None:
        """Ask for all wishes that came meanwhile at once: a slider that is dragged makes many."""
        settings = before = self._camera.settings
        waiting, self._waiting = self._waiting, []
        if settings is None:
            return
        for change, field in waiting:
            settings, self._changed = change(settings), field
        if settings == before:
            return
        self._refuse("")
        try:
            self._watch.follow(self._camera.configure(settings))
        except CosmicError as exc:
            self._refuse(str(exc))

    def _on_progressed(self, progress: Progress) -> None:
        if not progress.done:
            return
        if progress.error:
            self._refuse(progress.error)
        else:
            self.refresh()
        if self._waiting:
            self._ask()

    def _refuse(self, reason: str) -> None:
        if self._changed is not None:
            self._changed.refuse(reason)
            self.reason.hide()
            return
        self.reason.set_text(f"{state_look(State.REFUSED).glyph} {reason}" if reason else "")
        self.reason.setVisible(bool(reason))
        if reason:
            self.refresh()


def _show(field: SliderField, accepted: Range | None, value: float, factor: float = 1.0) -> None:
    field.set_usable("" if accepted is not None else _LACKS)
    if accepted is not None:
        field.set_range(accepted.low * factor, accepted.high * factor, accepted.step * factor)
    field.set_value(float(f"{value * factor:.9g}"))


def _choose(box: QComboBox, texts: list[str], value: object, values: tuple[object, ...]) -> None:
    if [box.itemText(row) for row in range(box.count())] != texts:
        box.clear()
        for text, data in zip(texts, values, strict=True):
            box.addItem(text, data)
    if value in values:
        box.setCurrentIndex(values.index(value))


def _fitting(begin_px: int, size_px: int, accepted: Range, sensor_px: int) -> tuple[int, int]:
    """Return the least begin and size that cover the wish and that the camera can do.

    Cameras point a region in the steps in which they size it.
    """
    step, least = max(1, round(accepted.step)), round(accepted.low)
    begin = begin_px // step * step
    steps = -(-(begin_px + size_px - begin - least) // step)
    size = min(max(least, least + steps * step), round(accepted.high))
    return max(0, min(begin, sensor_px - size)), size
