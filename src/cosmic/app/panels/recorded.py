"""The panel "Recorder": what is done by hand becomes a list of steps, kept and replayed."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QGridLayout,
    QLineEdit,
    QListWidget,
    QMenu,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from cosmic.daqco.gui.value_field import ValueField
from cosmic.frame.errors import CosmicError
from cosmic.frame.file_names import name_problem
from cosmic.frame.gui.ask_directory import ask_open_file, ask_save_file
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.build import named, push_button, styled, tight_row, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.theme import STEP_PX, State, state_look

if TYPE_CHECKING:
    from cosmic.autonomy.recorded.recorder import ProcedureRecorder
    from cosmic.autonomy.recorded.steps import RecordedProcedure, RecordedStep

RECORDER: Final = "Recorder"
LOOK_MS: Final = 250
SUFFIX: Final = ".toml"
_FILES: Final = f"Recorded procedures (*{SUFFIX})"
_USUAL_FORCE_UN: Final = 20.0
_USUAL_PAUSE_S: Final = 1.0


class ValuesDialog(QDialog):
    """Asks for the values that a replay, or a step, is to have.

    Parameters
    ----------
    title : str
        What they are for.
    asked : dict
        By step and key: the words, and the value recorded.
    """

    def __init__(
        self,
        title: str,
        asked: dict[tuple[int, str], tuple[str, float]],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self._fields: dict[tuple[int, str], ValueField] = {}
        form = QFormLayout()
        for key, (words, value) in asked.items():
            field = ValueField(words, "")
            field.set_value(value)
            form.addRow(words, field)
            self._fields[key] = field
        kinds = QDialogButtonBox.StandardButton
        self.buttons = QDialogButtonBox(kinds.Ok | kinds.Cancel)
        self.buttons.accepted.connect(self._on_accepted)
        self.buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addWidget(self.buttons)

    @property
    def fields(self) -> list[ValueField]:
        """The fields, in order."""
        return list(self._fields.values())

    @property
    def values(self) -> dict[tuple[int, str], float]:
        """What was entered."""
        return {key: field.value() for key, field in self._fields.items()}

    def _on_accepted(self) -> None:
        taken = [each.take() for each in self._fields.values()]  # each says what is wrong
        if all(taken):
            self.accept()


class RecorderPanel(QWidget):
    """Records, edits, keeps and replays procedures; GUI thread.

    Parameters
    ----------
    make : callable
        Returns what watches the platform.
    frames : callable
        Returns what points can be relative to.
    folder : callable
        Returns where files are kept.
    config : Path or None
        The platform file that a script is to use; None: the simulated platform.

    Signals
    -------
    replay_requested(object)
        A `RecordedProcedure`, with its values, is to be replayed.
    continued()
        What waits for the operator is to go on.
    """

    replay_requested = Signal(object)
    continued = Signal()

    def __init__(
        self,
        make: "Callable[[], ProcedureRecorder]",
        frames: Callable[[], tuple[str, ...]],
        folder: Callable[[], Path],
        config: Path | None = None,
    ) -> None:
        super().__init__()
        self.setObjectName("recorderPanel")
        self._make, self._frames, self._folder = make, frames, folder
        self._config = config
        self._recorder: ProcedureRecorder | None = None
        self._steps: list[RecordedStep] = []
        self._running = ""
        self._look = QTimer(self, interval=LOOK_MS)
        self._look.timeout.connect(self.look)
        self._make_widgets()
        self._arrange()
        self._show_buttons()

    def _make_widgets(self) -> None:
        self.line = named(ElidedLabel(), "recorderLine")
        self.record = named(push_button("● Record steps", ""), "recordSteps")
        self.record.setCheckable(True)
        self.record.toggled.connect(self._on_record)
        self.frame = named(tipped(QComboBox(), "What points are counted from"), "recordFrame")
        self.frame.addItems(list(self._frames()))
        self.frame.currentTextChanged.connect(self._on_frame)
        self.list = named(QListWidget(), "recordedSteps")
        self.list.setAccessibleName("Recorded steps, in order")
        self.list.setToolTip("Double-click a step, or press Enter, to change its numbers")
        self.list.itemActivated.connect(lambda _item: self.edit())
        self.list.setWordWrap(True)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.setMinimumHeight(8 * STEP_PX)
        self.list.currentRowChanged.connect(lambda _row: self._show_buttons())
        self.up = self._button("↑", "Move the step up", lambda: self._shift(-1))
        self.down = self._button("↓", "Move the step down", lambda: self._shift(1))
        self.delete = self._button("✕", "Delete the step", self._on_delete)
        self.ask = self._button("ask", "Ask for its value at each replay", self._on_ask)
        self.add = styled(push_button("add", "Add a step that waits"), "narrow")
        menu = QMenu(self.add)
        for text in ("Wait for force", "Wait for key", "Wait for mark", "Pause"):
            menu.addAction(text).triggered.connect(lambda _=False, text=text: self.add_wait(text))
        self.add.setMenu(menu)
        self.name = named(tipped(QLineEdit("procedure"), "Name of the procedure"), "recordedName")
        self.save = self._button("Save…", "Save as a file, and as Python beside it", self._on_save)
        self.open = self._button("Open…", "Open a procedure that was saved", self._on_open)
        self.replay = named(push_button("Replay", ""), "replaySteps")
        self.replay.clicked.connect(self.request_replay)
        self.go_on = named(push_button("Continue", ""), "continueReplay")
        self.go_on.clicked.connect(self.continued)
        self.show_waiting("")

    @staticmethod
    def _button(text: str, tip: str, act: Callable[[], None]) -> QPushButton:
        button = styled(push_button(text, tip), "narrow")
        button.clicked.connect(lambda: act())
        return button

    def _arrange(self) -> None:
        edits, row = tight_row(STEP_PX // 2)
        for each in (self.up, self.down, self.delete, self.ask, self.add):
            row.addWidget(each)
        files, grid = QWidget(), QGridLayout()
        files.setLayout(grid)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(STEP_PX // 2)
        grid.addWidget(self.save, 0, 0)
        grid.addWidget(self.open, 0, 1)
        grid.addWidget(self.replay, 1, 0)
        grid.addWidget(self.go_on, 1, 1)
        boxes: tuple[QWidget, ...] = (self.frame, self.name)
        for box in boxes:
            box.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX // 2, STEP_PX // 2, STEP_PX // 2, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self.record)
        column.addWidget(self.frame)
        column.addWidget(self.list, 1)
        below: tuple[QWidget, ...] = (edits, self.name, files, self.line)
        for widget in below:
            column.addWidget(widget)

    # The list

    @property
    def procedure(self) -> "RecordedProcedure":
        """What is in the list, with its name."""
        from cosmic.autonomy.recorded.steps import RecordedProcedure

        name = self.name.text().strip() or "procedure"
        return RecordedProcedure.model_validate({"name": name, "step": list(self._steps)})

    def show_steps(self, steps: "list[RecordedStep]", chosen: int = -1) -> None:
        """Show steps in place of those shown."""
        self._steps = steps
        self.list.clear()
        for number, each in enumerate(steps, 1):
            self.list.addItem(f"{number}  {each.words}{'  (asks)' if each.ask else ''}")
        if steps:
            self.list.setCurrentRow(chosen if chosen >= 0 else len(steps) - 1)
        self._show_buttons()

    def _show_buttons(self) -> None:
        row, count = self.list.currentRow(), len(self._steps)
        chosen = 0 <= row < count
        self.up.setEnabled(chosen and row > 0)
        self.down.setEnabled(chosen and row < count - 1)
        self.delete.setEnabled(chosen)
        self.ask.setEnabled(chosen and bool(self._steps[row].numbers))
        self.save.setEnabled(bool(count))
        recording = self.record.isChecked()
        why_not = "" if count else "There are no steps yet"
        why_not = why_not or ("End the recording of steps first" if recording else self._running)
        self.replay.setEnabled(not why_not)
        self.replay.setToolTip(why_not or "Carry the steps out, in order")
        self.record.setToolTip(
            "End the recording of steps" if recording else "Note what is moved, lit and measured"
        )

    def _shift(self, by: int) -> None:
        row = self.list.currentRow()
        steps = list(self._steps)
        steps[row], steps[row + by] = steps[row + by], steps[row]
        self._put(steps, row + by)

    def _on_delete(self) -> None:
        row = self.list.currentRow()
        self._put([*self._steps[:row], *self._steps[row + 1 :]], max(0, row - 1))

    def _on_ask(self) -> None:
        """Have a replay ask for the numbers of the step, or no longer."""
        row = self.list.currentRow()
        step = self._steps[row]
        words = {key: text for key, (text, _) in _asked(step).items()}
        asking = step.model_copy(update={"ask": {} if step.ask else words})
        self._put([*self._steps[:row], asking, *self._steps[row + 1 :]], row)

    def edit(self) -> None:
        """Ask for the numbers of the step that is chosen, where it has some."""
        row = self.list.currentRow()
        step = self._steps[row]
        asked = {(row, key): found for key, found in _asked(step).items()}
        if asked:
            dialog = self._asking("Change the step", asked)
            dialog.accepted.connect(lambda: self._on_edited(step, dialog.values))

    def _on_edited(self, step: "RecordedStep", values: dict[tuple[int, str], float]) -> None:
        # The list can be changed while the numbers are asked for.
        row = next((at for at, each in enumerate(self._steps) if each is step), None)
        if row is None:
            look = state_look(State.REFUSED)
            self.say(f"{look.glyph} {step.words} is no longer in the list; nothing was changed")
            return
        here = {(row, key): value for (_, key), value in values.items()}
        procedure = self._given(self.procedure, here)
        if procedure is not None:
            self._put(list(procedure.step), row)

    def add_wait(self, what: str) -> None:
        """Add a step that waits, behind the one that is chosen."""
        from cosmic.autonomy.recorded.steps import (
            PauseStep,
            WaitForForceStep,
            WaitForOperatorStep,
        )

        steps: dict[str, RecordedStep] = {
            "Wait for force": WaitForForceStep(force_un=_USUAL_FORCE_UN),
            "Wait for key": WaitForOperatorStep(kind="wait for key"),
            "Wait for mark": WaitForOperatorStep(kind="wait for mark"),
            "Pause": PauseStep(seconds=_USUAL_PAUSE_S),
        }
        row = self.list.currentRow() + 1 if self._steps else 0
        self._put([*self._steps[:row], steps[what], *self._steps[row:]], row)

    def _put(self, steps: "list[RecordedStep]", chosen: int) -> None:
        if self._recorder is not None:
            self._recorder.steps = steps
        self.show_steps(steps, chosen)

    # Recording

    def _on_record(self, on: bool) -> None:
        if not on:
            self._look.stop()
            self.say("")
            self.look()
            self._recorder = None
            self._show_buttons()
            return
        try:
            self._recorder = self._make()
        except CosmicError as exc:
            self.say(f"{state_look(State.REFUSED).glyph} {exc}")
            self.record.setChecked(False)
            return
        self._recorder.relative_to = self.frame.currentText()
        self._recorder.steps = list(self._steps)
        self.say("Noting what you do")
        self._look.start()
        self._show_buttons()

    def _on_frame(self, name: str) -> None:
        if self._recorder is not None:
            self._recorder.relative_to = name

    def look(self) -> None:
        """Note what was done since the last look."""
        if self._recorder is None:
            return
        try:
            if self._recorder.look():
                self.show_steps(list(self._recorder.steps))
        except CosmicError as exc:
            self.say(f"{state_look(State.REFUSED).glyph} not noted: {exc}")
            self._recorder.begin()

    def say(self, text: str) -> None:
        """Say one line below the list."""
        self.line.set_text(text)

    # Files and replay

    def _on_save(self) -> None:
        name = self.procedure.name
        base = "procedure" if name_problem(name) else name
        ask_save_file(
            self,
            "Save the procedure",
            str(self._folder() / f"{base}{SUFFIX}"),
            files=_FILES,
            suffix=SUFFIX,
            chosen=lambda path: self.save_as(Path(path)),
        )

    def save_as(self, path: Path) -> None:
        """Write the file, and the script beside it, which must not take its place."""
        if path.suffix.lower() != SUFFIX:
            look = state_look(State.REFUSED)
            self.say(f"{look.glyph} {path.name}: the name of a procedure ends in {SUFFIX}")
            return
        try:
            self.procedure.save(path)
            self.procedure.save_python(path.with_suffix(".py"), self._config)
        except OSError as exc:
            self.say(f"{state_look(State.ERROR).glyph} not saved: {exc}")
            return
        self.say(f"written: {path} and {path.with_suffix('.py').name}")

    def _on_open(self) -> None:
        ask_open_file(
            self,
            "Open a procedure",
            str(self._folder()),
            files=_FILES,
            chosen=lambda path: self.open_file(Path(path)),
        )

    def open_file(self, path: Path) -> None:
        """Show what was saved."""
        from cosmic.autonomy.recorded.steps import load_recorded

        try:
            read = load_recorded(path)
        except CosmicError as exc:
            self.say(f"{state_look(State.ERROR).glyph} {exc}")
            return
        self.name.setText(read.name)
        self.show_steps(list(read.step), 0)
        self.say(f"opened: {path}")

    def request_replay(self) -> None:
        """Ask for the values that are asked for, then have it replayed."""
        procedure = self.procedure
        if not procedure.asked:
            self.replay_requested.emit(procedure)
            return
        dialog = self._asking("Replay", procedure.asked)
        dialog.accepted.connect(lambda: self._on_values(procedure, dialog.values))

    def _asking(self, title: str, asked: dict[tuple[int, str], tuple[str, float]]) -> ValuesDialog:
        dialog = ValuesDialog(title, asked, self)
        dialog.finished.connect(dialog.deleteLater)
        open_beside(dialog)
        return dialog

    def _on_values(
        self, procedure: "RecordedProcedure", values: dict[tuple[int, str], float]
    ) -> None:
        if self.procedure != procedure:
            look = state_look(State.REFUSED)
            self.say(f"{look.glyph} the steps were changed meanwhile; press Replay again")
            return
        given = self._given(procedure, values)
        if given is not None:
            self.replay_requested.emit(given)

    def _given(
        self, procedure: "RecordedProcedure", values: dict[tuple[int, str], float]
    ) -> "RecordedProcedure | None":
        try:
            return procedure.with_values(values)
        except CosmicError as exc:
            self.say(f"{state_look(State.REFUSED).glyph} {exc}")
            return None

    def show_running(self, title: str) -> None:
        """Offer no replay while an operation runs, by its title; empty: none does."""
        self._running = f"{title} is running; end it first" if title else ""
        self._show_buttons()

    def show_waiting(self, words: str) -> None:
        """Offer to go on with a replay that waits; empty: it waits no longer."""
        waited = self.go_on.isEnabled()
        self.go_on.setEnabled(bool(words))
        self.go_on.setToolTip("Go on with the replay" if words else "No replay waits for you")
        if words or waited:
            self.say(words)


def _asked(step: "RecordedStep") -> dict[str, tuple[str, float]]:
    """Return the words and the value of each number of a step, by its key."""
    from cosmic.autonomy.recorded.steps import NUMBERS

    return {key: (f"{step.words}: {NUMBERS[key]}", value) for key, value in step.numbers.items()}
