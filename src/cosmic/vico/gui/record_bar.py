"""Snap, record and time-lapse of one camera."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QIcon, QKeyEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.amounts import duration_text, size_text
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.key_focus import ENTER_KEYS
from cosmic.frame.gui.overwrite_question import overwrite_question
from cosmic.frame.gui.task_bar import TaskBar
from cosmic.frame.gui.theme import STEP_PX, State, number_font, state_look
from cosmic.frame.operation import Task
from cosmic.frame.overrides import override
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.camera_shown import FormatShown
from cosmic.vico.gui.amount_field import AmountField
from cosmic.vico.gui.file_fields import FileFields


class TimeLapseDialog(QDialog):
    """Asks for interval and number of images.

    Signals
    -------
    agreed(float, int)
        Interval in seconds, number of images.
    """

    agreed = Signal(float, int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Time-lapse")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.interval = AmountField("Time between images", "s", low=0.1, high=86400.0, value=10.0)
        self.count = AmountField(
            "Number of images", "", low=1.0, high=1e6, value=60.0, integers=True
        )
        self.total = QLabel()
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        self.begin = buttons.addButton("Begin", QDialogButtonBox.ButtonRole.AcceptRole)
        for each in buttons.buttons():
            each.setIcon(QIcon())
        form = QFormLayout(self)
        form.setSpacing(STEP_PX)
        form.addRow("One image every", self.interval)
        form.addRow("Images", self.count)
        form.addRow("Takes", self.total)
        form.addRow(buttons)
        buttons.accepted.connect(self._on_begin)
        buttons.rejected.connect(self.reject)
        for field in (self.interval, self.count):
            field.committed.connect(self._show_total)
        self._show_total()

    def _show_total(self) -> None:
        interval_s, count = self.interval.value(), self.count.value()
        if interval_s is not None and count is not None:
            self.total.setText(duration_text(interval_s * max(0.0, count - 1.0)))

    def _on_begin(self) -> None:
        committed = [field.commit() for field in (self.interval, self.count)]
        interval_s, count = self.interval.value(), self.count.value()
        if all(committed) and interval_s is not None and count is not None:
            self.agreed.emit(interval_s, round(count))
            self.accept()

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in ENTER_KEYS:
            event.accept()  # Enter judges a field here; a dialog would begin at once
            return
        super().keyPressEvent(event)


STILL: Final = ".png"


class RecordBar(QWidget):
    """Buttons, fields for file and format (folded away), and what has been written.

    Parameters
    ----------
    now : callable
        Returns the local time that names are stamped with.
    """

    def __init__(
        self,
        camera: CameraHandle,
        parent: QWidget | None = None,
        *,
        now: Callable[[], datetime] = datetime.now,
    ) -> None:
        super().__init__(parent)
        self._camera = camera
        self._error = ""
        self.snap = named(push_button("Snap", "Save the image shown"), "snap")
        self.record = named(push_button("Record", ""), "record")
        self.record.setCheckable(True)
        self.lapse = push_button("Time-lapse…", "Record a time-lapse")
        self.more = push_button("File…", "Show the fields for name, directory and format")
        self.more.setCheckable(True)
        self.format = tipped(QComboBox(), "File format of recordings")
        self.files = FileFields(camera.directory, camera.name, now=now, station=camera.remote)
        self.message, self.tasks = ElidedLabel(), TaskBar()
        self.message.setFont(number_font())
        self._fields = QWidget()
        self._build()
        self.snap.clicked.connect(self._on_snap)
        self.record.clicked.connect(self._on_record)
        self.lapse.clicked.connect(self._on_lapse)
        self.more.toggled.connect(self._fields.setVisible)
        self.format.activated.connect(self.refresh)
        self.files.edited.connect(self.refresh)
        self.refresh()

    def _build(self) -> None:
        self.record.setFixedWidth(
            max(self.record.fontMetrics().horizontalAdvance("■ Stop"), 7 * STEP_PX) + 3 * STEP_PX
        )
        folded = QVBoxLayout(self._fields)
        folded.setContentsMargins(0, 0, 0, 0)
        folded.setSpacing(STEP_PX // 2)
        line = QHBoxLayout()
        caption = QLabel("Format")
        caption.setProperty("role", "dim")
        line.addWidget(caption)
        line.addWidget(self.format, 1)
        folded.addWidget(self.files)
        folded.addLayout(line)
        self._fields.hide()
        self._lines = QStackedWidget()
        self._lines.addWidget(self.message)
        self._lines.addWidget(self.tasks)
        self._lines.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._top = QHBoxLayout()
        self._top.setSpacing(STEP_PX // 2)
        for button in (self.snap, self.record, self.lapse, self.more):
            self._top.addWidget(button)
        self._top.addSpacing(STEP_PX // 2)
        self._top.addWidget(self._lines, 1)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(STEP_PX // 2)
        self._column.addLayout(self._top)
        self._column.addWidget(self._fields)

    def stack(self) -> None:
        """Put the buttons above each other, for a column too narrow for a row."""
        self.files.stack()
        self.format.setMinimumContentsLength(6)
        self.format.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        second = QHBoxLayout()
        second.setSpacing(STEP_PX // 2)
        for button in (self.lapse, self.more):
            styled(button, "narrow")
            self._top.removeWidget(button)
            second.addWidget(button)
        second.addStretch(1)
        self._top.removeWidget(self._lines)
        self._column.insertLayout(1, second)
        self._column.insertWidget(2, self._lines)

    # Looking

    @property
    def chosen(self) -> FormatShown | None:
        """The format that is chosen."""
        row = self.format.currentIndex()
        formats = self._camera.formats
        return formats[row] if 0 <= row < len(formats) else None

    def refresh(self) -> None:
        """Show what is being recorded and what may be done now."""
        self._show_formats()
        recording, wrong = self._camera.recording, self.files.problem
        self.files.setEnabled(not recording.active)
        self.format.setEnabled(not recording.active)
        away = self._camera.problem if self._camera.remote else ""
        still_wrong = wrong or away or ("" if self._camera.latest() else "There is no image yet")
        chosen = self.chosen
        wrong = wrong or (chosen.problem if chosen is not None else "No format is available")
        wrong = wrong or ("" if self._camera.running else "No images are taken: start the camera")
        _allow(self.snap, still_wrong, "Save the image shown")
        _allow(self.lapse, wrong or _busy(recording.active), "Record a time-lapse")
        self.record.setChecked(recording.active)
        self.record.setText("■ Stop" if recording.active else "● Record")
        _allow(
            self.record,
            "" if recording.active else wrong,
            "Stop recording and close the file" if recording.active else "Record every image",
        )
        self._show_message()

    def _show_formats(self) -> None:
        formats = self._camera.formats
        texts = [f"{each.name} – {each.problem or each.description}" for each in formats]
        if [self.format.itemText(row) for row in range(self.format.count())] != texts:
            row = max(0, self.format.currentIndex())
            self.format.clear()
            self.format.addItems(texts)
            self.format.setCurrentIndex(min(row, len(texts) - 1))
            self.format.setMinimumContentsLength(12)

    def _show_message(self) -> None:
        recording = self._camera.recording
        failure = self._error or ("" if recording.active else recording.failure)
        if failure:
            self.message.set_text(f"{state_look(State.ERROR).glyph} {failure}")
        elif recording.active or recording.path is not None:
            self.message.set_text(self._recording_text())
        else:
            self.message.set_text(self._room_text())

    def _recording_text(self) -> str:
        now = self._camera.recording
        name = now.path.name if now.path is not None else ""
        left = "" if now.left_s is None else f", disk lasts {duration_text(now.left_s)}"
        waiting = f", {now.waiting} waiting" if now.active else ""
        return (
            f"{now.written} written, {now.dropped} dropped{waiting}, "
            f"{size_text(now.size_bytes)}{left if now.active else ''}  {name}"
        )

    def _room_text(self) -> str:
        if self.files.problem:
            return self.files.problem
        chosen = self.chosen
        try:
            room_s = self._camera.room_s(self.files.existing, chosen.name if chosen else "")
        except CosmicError as exc:
            return str(exc)
        return "" if room_s is None else f"disk lasts {duration_text(room_s)}"

    # Reactions

    def _try(self, action: Callable[[], object]) -> None:
        self._error = ""
        if not self.tasks.watch.busy:
            self._lines.setCurrentWidget(self.message)
        try:
            action()
        except (CosmicError, OSError) as exc:
            self._error = str(exc)
        self.refresh()

    def _unless_there(self, path: Path, act: Callable[[bool], object]) -> None:
        """Do it, after a question where it would overwrite something."""
        if not self._camera.remote and path.exists():
            open_beside(overwrite_question(self, path, lambda: self._try(lambda: act(True))))
            self.refresh()
        else:
            self._try(lambda: self._into_new(act))

    def _into_new(self, act: Callable[[bool], object]) -> None:
        self.files.make_directory()
        act(False)

    def _on_snap(self) -> None:
        path = self.files.path(STILL, exact=True)
        self._unless_there(path, lambda over: self._follow_snap(path, overwrite=over))

    def _follow_snap(self, path: Path, *, overwrite: bool) -> None:
        self._follow(self._camera.snap(path, overwrite=overwrite))

    def _follow(self, task: Task) -> None:
        self._lines.setCurrentWidget(self.tasks)
        self.tasks.follow(task)

    def _on_record(self) -> None:
        self.record.setChecked(self._camera.recording.active)
        if self._camera.recording.active:
            self._try(self._camera.stop_recording)
            return
        chosen = self.chosen
        if chosen is None:
            return
        path = self.files.path(chosen.suffix)
        self._unless_there(
            path, lambda over: self._camera.record(path, chosen.name, overwrite=over)
        )

    def _on_lapse(self) -> None:
        dialog = TimeLapseDialog(self)
        dialog.agreed.connect(self.begin_lapse)
        open_beside(dialog)

    def begin_lapse(self, interval_s: float, count: int) -> None:
        """Record `count` images, one each `interval_s`."""
        chosen = self.chosen
        if chosen is None:
            return
        path = self.files.path(chosen.suffix)

        def begin(over: bool) -> None:
            task = self._camera.time_lapse(
                path, chosen.name, interval_s=interval_s, count=count, overwrite=over
            )
            self._follow(task)

        self._unless_there(path, begin)


def _busy(active: bool) -> str:
    return "A recording is running" if active else ""


def _allow(button: QWidget, reason: str, tip: str) -> None:
    button.setEnabled(not reason)
    if button.toolTip() != (reason or tip):
        button.setToolTip(reason or tip)
