"""`UDaqFileWidget`: records what is acquired (thesis, Table F.2)."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Final, TypeVar

from PySide6.QtCore import QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QGridLayout,
    QLabel,
    QLineEdit,
    QMessageBox,
    QRadioButton,
    QWidget,
)

from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.files import NamedFile
from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.core.recording_format import SUFFIX
from cosmic.daqco.gui.asking import Asking
from cosmic.frame.background import OnResult
from cosmic.frame.errors import CosmicError
from cosmic.frame.file_names import NameOption, name_problem
from cosmic.frame.gui.amounts import duration_text, size_text
from cosmic.frame.gui.ask_directory import ask_directory
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.build import named, push_button, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.overwrite_question import overwrite_question
from cosmic.frame.gui.refusal import mark_refusal
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, number_font
from cosmic.frame.overrides import override

_TAILS: Final = {
    NameOption.TIME: "_yyyy-mm-dd_hh-mm-ss",
    NameOption.NUMBER: "_nnn",
    NameOption.NONE: "",
}


def name_pattern(base: str, option: NameOption) -> str:
    """Return the whole name with the format of what is appended."""
    return f"{base.strip().removesuffix(SUFFIX)}{_TAILS[option]}{SUFFIX}"


_OPTIONS: Final = {
    NameOption.TIME: ("Append with time", "Append date, hour, minute and second of the start"),
    NameOption.NUMBER: ("Append with number", "Append the next free number"),
    NameOption.NONE: ("Don't append", "Keep the name as it is"),
}


def append_row(group: QButtonGroup) -> QWidget:
    """Return the options side by side; their property "append" says which is which."""
    row, layout = tight_row(2 * STEP_PX)
    for option, (text, tip) in _OPTIONS.items():
        button = tipped(QRadioButton(text), tip)
        button.setProperty("append", option.value)
        button.setChecked(option is NameOption.TIME)
        group.addButton(button)
        layout.addWidget(button)
    layout.addStretch(1)
    return row


LITTLE_ROOM_S: Final = 600.0
LATE_S: Final = 1.0


def recording_text(recording: RecordingState, behind_s: float) -> str:
    """Return how long and how large a recording is; empty when there has been none."""
    amount = f"{duration_text(recording.duration_s)}, {size_text(recording.size_bytes)}"
    if recording.active:
        return f"recording: {amount}" + (f", {behind_s:.1f} s behind" if behind_s >= LATE_S else "")
    return f"{recording.path.name}: {amount}" if recording.path is not None else ""


def room_text(free_bytes: float, left_s: float) -> str:
    """Return how much room there is, and for how long."""
    text = f"{size_text(free_bytes)} free on the disk: {duration_text(left_s)} at this rate"
    return f"◆ little room: {text}" if left_s < LITTLE_ROOM_S else text


T = TypeVar("T")

LOOK_MS: Final = 500
BYTES_A_SAMPLE: Final = 8
WIDE_PX: Final = 110 * STEP_PX
_BROWSE: Final = "Choose the directory"


class UDaqFileWidget(QWidget):
    """Asks for a file name and a directory, starts and stops recordings, and tells of them.

    Parameters
    ----------
    now : callable
        Returns the local time that a name is stamped with.
    """

    def __init__(
        self,
        daqco: Daqco,
        parent: QWidget | None = None,
        *,
        now: Callable[[], datetime] = datetime.now,
    ) -> None:
        super().__init__(parent)
        self._daqco, self._now = daqco, now
        self._question: QMessageBox | None = None
        self._waits = ""
        self._asking = Asking(daqco, self)
        self._error, self._columns, self._chosen = "", 0, False
        self.base = tipped(QLineEdit("recording"), "Base of the file name")
        self.full_name = tipped(QLineEdit(), "")
        self.full_name.setReadOnly(True)
        self._offered = str(daqco.directory)
        self.directory = tipped(QLineEdit(self._offered), "Where the file is stored")
        self.browse = push_button("Browse…", _BROWSE)
        self.start = named(push_button("Start recording", ""), "startRecording")
        self.stop = named(push_button("Stop recording", ""), "stopRecording")
        self.badge, self.message = StateBadge(State.UNKNOWN), ElidedLabel()
        self.room = ElidedLabel()
        self.room.setProperty("role", "dim")
        self.options = QButtonGroup(self)
        self._build()
        self._connect()
        self._look = QTimer(self, interval=LOOK_MS)
        self._look.timeout.connect(self.refresh)
        self._look.start()
        self._relay = Relay(self.refresh).follow(daqco.on_change)
        self.refresh()

    def _build(self) -> None:
        options = append_row(self.options)
        where, beside = tight_row(STEP_PX)
        beside.addWidget(self.directory, 1)
        beside.addWidget(self.browse)
        self._buttons, self._below = tight_row(STEP_PX)
        self._below.addWidget(self.start)
        self._below.addWidget(self.stop)
        self._below.addWidget(self.badge)
        self._below.addWidget(self.message, 1)
        self.message.setFont(number_font())
        self.fields = push_button("File…", "Show the fields for name and directory")
        self.fields.setCheckable(True)
        self.fields.setChecked(True)
        self._below.addWidget(self.fields)
        self._cells = (
            (QLabel("Base name"), self.base),
            (QLabel("Full file name"), self.full_name),
            (QLabel("Save options"), options),
            (QLabel("Directory"), where),
        )
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX)
        self._grid.setHorizontalSpacing(STEP_PX)
        self._grid.setVerticalSpacing(STEP_PX // 2)
        self._arrange()

    def _arrange(self) -> None:
        """Put the fields into two columns where there is room, so that the image keeps it."""
        columns = 2 if self.width() >= WIDE_PX else 1
        if columns == self._columns:
            return
        self._columns = columns
        for number, (label, widget) in enumerate(self._cells):
            row, column = divmod(number, columns)
            self._grid.addWidget(label, row, 2 * column)
            self._grid.addWidget(widget, row, 2 * column + 1)
        self._grid.setColumnStretch(3, columns - 1)
        rows = len(self._cells) // columns
        self._grid.addWidget(self._buttons, rows, 0, 1, 2 * columns)
        if columns == 2:
            self._below.addWidget(self.room, 1)
        else:
            self._grid.addWidget(self.room, rows + 1, 0, 1, 2)

    def set_compact(self, compact: bool) -> None:
        """Show the buttons alone, unless the operator chose otherwise."""
        if not self._chosen:
            self.fields.setChecked(not compact)

    def _on_fields_clicked(self) -> None:
        self._chosen = True

    def _show_fields(self, shown: bool) -> None:
        for cell in self._cells:
            for widget in cell:
                widget.setVisible(shown)

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange()

    def _connect(self) -> None:
        self.base.textEdited.connect(self._on_edited)
        self.directory.textEdited.connect(self._on_edited)
        self.options.buttonClicked.connect(self.refresh)
        self.browse.clicked.connect(self._on_browse)
        self.fields.clicked.connect(self._on_fields_clicked)
        self.fields.toggled.connect(self._show_fields)
        self.start.clicked.connect(self._on_start)
        self.stop.clicked.connect(self._on_stop)

    # What is chosen

    @property
    def append(self) -> NameOption:
        """What is appended to the base name."""
        chosen = self.options.checkedButton()
        return NameOption.NONE if chosen is None else NameOption(chosen.property("append"))

    @property
    def folder(self) -> Path:
        """The directory as it stands in its field."""
        return Path(self.directory.text()).expanduser()

    # Looking

    def refresh(self) -> None:
        """Show what is being recorded, what may be done now and how much room there is."""
        self._offer_directory()
        recording = self._daqco.recording
        wrong_name = "" if recording.active else name_problem(self.base.text(), SUFFIX)
        wrong_folder = "" if recording.active else self._folder_problem()
        mark_refusal(self.base, wrong_name)
        mark_refusal(self.directory, wrong_folder)
        self._show_name(wrong_name)
        for widget in (self.base, self.directory, self.browse, *self.options.buttons()):
            widget.setEnabled(not recording.active)
        self._show_browse()
        self._enable(wrong_name or wrong_folder)
        self._show_message()
        self._show_room(wrong_folder)

    def _folder_problem(self) -> str:
        """Return why nothing can be recorded there, as a station that is away does too."""
        try:
            return self._daqco.folder_problem(self.directory.text())
        except CosmicError as exc:
            return str(exc)

    def _offer_directory(self) -> None:
        """Take over another usual directory, unless the operator typed one."""
        before, self._offered = self._offered, str(self._daqco.directory)
        if before != self._offered and self.directory.text() == before:
            self.directory.setText(self._offered)

    def _show_name(self, wrong: str) -> None:
        recording = self._daqco.recording
        if recording.active and recording.path is not None:
            text, tip = recording.path.name, str(recording.path)
        elif wrong:
            text, tip = "", wrong
        else:
            text, tip = name_pattern(self.base.text(), self.append), self._example()
        if self.full_name.text() != text:
            self.full_name.setText(text)
        self.full_name.setToolTip(tip)

    def _show_browse(self) -> None:
        where = self._daqco.remote
        self.browse.setEnabled(self.browse.isEnabled() and not where)
        self.browse.setToolTip(f"The files lie {where}; type the directory" if where else _BROWSE)

    def _example(self) -> str:
        if self._daqco.remote:
            return "The name is completed when the recording begins"
        try:
            return f"Now: {self._name_now().path.name}"
        except CosmicError as exc:
            return str(exc)

    def _name_now(self) -> NamedFile:
        when = self._now().astimezone()  # the station's clock may be in another zone
        return self._daqco.name_recording(self.base.text(), self.append, self.folder, when)

    def _enable(self, wrong: str) -> None:
        recording, asking = self._daqco.recording, self._question is not None
        reasons = (
            (bool(self._waits), self._waits),
            (recording.active, "A recording is running"),
            (asking, "Answer the question first"),
            (not self._daqco.running, "Nothing is being acquired: start the acquisition first"),
            (bool(wrong), wrong),
        )
        reason = next((text for applies, text in reasons if applies), "")
        self.start.setEnabled(not reason)
        self.start.setToolTip(reason or "Record what is acquired into the file named above")
        self.stop.setEnabled(recording.active and not self._waits)
        self.stop.setToolTip(
            "Stop recording and close the file" if recording.active else "Nothing is being recorded"
        )

    def _show_message(self) -> None:
        recording = self._daqco.recording
        error = self._error or ("" if recording.active else recording.failure)
        state = State.ERROR if error else State.BUSY if recording.active else State.OK
        self.badge.set_state(state, error)
        self.badge.setVisible(bool(error) or recording.active or recording.path is not None)
        behind_s = self._daqco.counters.backlog / self._daqco.rate_hz
        self.message.set_text(error or recording_text(recording, behind_s))

    def _show_room(self, wrong: str) -> None:
        if wrong:
            self.room.set_text(wrong)
            return
        try:
            free = self._daqco.free_bytes(self.folder)
        except CosmicError as exc:
            self.room.set_text(str(exc))
        else:
            active = sum(each.active for each in self._daqco.settings.channel)
            bytes_a_second = max(1.0, active * self._daqco.rate_hz * BYTES_A_SAMPLE)
            self.room.set_text(room_text(free, free / bytes_a_second))

    # Reactions

    def _on_edited(self) -> None:
        self._error = ""
        self.refresh()

    def _on_browse(self) -> None:
        title = "Directory for recordings"
        ask_directory(self, title, self.directory.text(), self._on_chosen)

    def _on_chosen(self, folder: str) -> None:
        self.directory.setText(folder)
        self._on_edited()

    def _on_start(self) -> None:
        self._ask(self._name_now, self._on_named, "The name is being completed")

    def _ask(
        self, action: Callable[[], T], on_result: OnResult[T], what: str, *, slow: bool = False
    ) -> None:
        self._error, self._waits = "", what
        self.refresh()
        self._asking.ask(action, on_result, slow=slow)

    def _answered(self, error: CosmicError | None) -> None:
        self._waits = ""
        self._error = str(error) if error is not None else ""
        self.refresh()

    def _on_named(self, named: NamedFile | None, error: CosmicError | None) -> None:
        self._answered(error)
        if named is None:
            return
        if named.size_bytes is not None:
            self._ask_to_overwrite(named.path, named.size_bytes)
        else:
            self._record(named.path)

    def _ask_to_overwrite(self, path: Path, size_bytes: int) -> None:
        box = overwrite_question(self, path, lambda: self._record(path, overwrite=True), size_bytes)
        box.finished.connect(self._on_answered)
        self._question = box
        open_beside(box)
        self.refresh()

    def _on_answered(self) -> None:
        self._question = None
        self.refresh()

    def _record(self, path: Path, *, overwrite: bool = False) -> None:
        self._ask(
            lambda: self._daqco.start_recording(path, overwrite=overwrite),
            self._on_done,
            "The recording begins",
        )

    def _on_stop(self) -> None:
        what = "The file is being closed"
        self._ask(self._daqco.stop_recording, self._on_done, what, slow=True)

    def _on_done(self, _result: object, error: CosmicError | None) -> None:
        self._answered(error)
