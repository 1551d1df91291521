"""The lines that the operator types into the console."""

from typing import Final

from PySide6.QtCore import QEvent, QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent, QTextCursor
from PySide6.QtWidgets import QPlainTextEdit, QSizePolicy, QWidget

from cosmic.frame.gui.key_focus import ENTER_KEYS
from cosmic.frame.gui.theme import STEP_PX, code_font
from cosmic.frame.overrides import override

_MOST_LINES: Final = 6
_MOST_HISTORY: Final = 500


class ConsoleInput(QPlainTextEdit):
    """One line that grows; Enter runs it, Up and Down recall, Tab completes."""

    submitted = Signal(str)
    completion_requested = Signal(str)
    interrupt_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFont(code_font())
        self.setToolTip(
            "Python. Enter runs, Shift+Enter adds a line, Up and Down recall, Tab completes, "
            "Ctrl+C interrupts, Esc empties"
        )
        self.setAccessibleName("Python console input")
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._history: list[str] = []
        self._index = 0
        self._draft = ""
        self.blockCountChanged.connect(self.updateGeometry)

    @property
    def is_editing(self) -> bool:
        """True while there is text that Escape takes away."""
        return bool(self.toPlainText())

    def set_text(self, text: str) -> None:
        """Replace the text; the cursor goes to its end."""
        self.setPlainText(text)
        self.moveCursor(QTextCursor.MoveOperation.End)

    def replace_before_cursor(self, old: str, new: str) -> None:
        """Put `new` in the place of `old`, where that stands right before the cursor."""
        if self._before_cursor().endswith(old):
            cursor = self.textCursor()
            for _ in old:
                cursor.deletePreviousChar()
            cursor.insertText(new)

    def _before_cursor(self) -> str:
        cursor = self.textCursor()
        return cursor.block().text()[: cursor.positionInBlock()]

    def _submit(self) -> None:
        text = self.toPlainText()
        if not text.strip():
            text = ""  # an empty line ends a block, blanks typed for us do not keep it open
        elif not self._history or self._history[-1] != text:
            self._history = [*self._history, text][-_MOST_HISTORY:]
        self._index = len(self._history)
        self._draft = ""
        self.clear()
        self.submitted.emit(text)

    def _recall(self, step: int) -> None:
        index = self._index + step
        if not 0 <= index <= len(self._history):
            return
        if self._index == len(self._history):
            self._draft = self.toPlainText()
        self._index = index
        self.set_text(self._draft if index == len(self._history) else self._history[index])

    def _complete(self) -> None:
        before = self._before_cursor()
        word = ""
        for char in reversed(before):
            if not (char.isalnum() or char in "_."):
                break
            word = char + word
        if word:
            self.completion_requested.emit(word)
        else:
            self.insertPlainText("    ")

    @override
    def keyPressEvent(self, event: QKeyEvent) -> None:
        if self._is_handled(event):
            event.accept()
            return
        super().keyPressEvent(event)

    def _is_handled(self, event: QKeyEvent) -> bool:
        key, modifiers = event.key(), event.modifiers()
        at = self.textCursor().blockNumber()
        if key in ENTER_KEYS and not modifiers & Qt.KeyboardModifier.ShiftModifier:
            self._submit()
        elif key == Qt.Key.Key_Tab:
            self._complete()
        elif key == Qt.Key.Key_Up and at == 0:
            self._recall(-1)
        elif key == Qt.Key.Key_Down and at == self.blockCount() - 1:
            self._recall(1)
        elif key == Qt.Key.Key_Escape and self.is_editing:
            self.clear()
        elif _is_ctrl_c(event) and not self.textCursor().hasSelection():
            self.interrupt_requested.emit()
        else:
            return False
        return True

    @override
    def event(self, event: QEvent) -> bool:
        # Ctrl+C without a selection interrupts: no shortcut of the window may come first.
        if (
            event.type() == QEvent.Type.ShortcutOverride
            and isinstance(event, QKeyEvent)
            and _is_ctrl_c(event)
        ):
            event.accept()
            return True
        return super().event(event)

    @override
    def sizeHint(self) -> QSize:
        lines = min(self.blockCount(), _MOST_LINES)
        height = lines * self.fontMetrics().lineSpacing() + 2 * STEP_PX
        return QSize(30 * STEP_PX, height)

    @override
    def minimumSizeHint(self) -> QSize:
        return QSize(15 * STEP_PX, self.sizeHint().height())


def _is_ctrl_c(event: QKeyEvent) -> bool:
    control = Qt.KeyboardModifier.ControlModifier
    return event.key() == Qt.Key.Key_C and event.modifiers() == control
