"""The Python console of the main window."""

from collections.abc import Callable, Mapping
from typing import Final

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QTextCursor
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPlainTextEdit, QVBoxLayout, QWidget

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.build import push_button
from cosmic.frame.gui.console_input import ConsoleInput
from cosmic.frame.gui.console_thread import BUSY, CLOSE_TIMEOUT_S, MORE, PROMPT, ConsoleThread
from cosmic.frame.gui.theme import STEP_PX, code_font

REFRESH_MS: Final = 50
_MOST_LINES: Final = 5000
_BANNER: Final = "Python console. Ctrl+C or Interrupt stops running code, sleep(s) waits.\n"


class ConsolePanel(QWidget):
    """Types into a `ConsoleThread` and shows what it prints; `shut_down` it before it goes.

    Parameters
    ----------
    policy : FailurePolicy
        Told of defects of the console itself.
    namespace : mapping
        The names that the user finds, such as ``rig`` and ``cosmic``.
    on_interrupt : callable or None
        Ends what the user's code waits for; called in the GUI thread, returns at once.
    banner : str
        First lines of the output.
    """

    def __init__(
        self,
        policy: FailurePolicy,
        namespace: Mapping[str, object] | None = None,
        *,
        on_interrupt: Callable[[], None] | None = None,
        banner: str = _BANNER,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._last = ""
        self._thread = ConsoleThread(policy, namespace, on_interrupt)
        self._make_widgets()
        self._arrange()
        self._append(banner)
        self._refresh = QTimer(self, singleShot=True, interval=REFRESH_MS)
        self._refresh.timeout.connect(self._on_refresh)
        self._thread.output_ready.connect(self._on_output_ready)
        self._thread.prompt_changed.connect(self._on_prompt_changed)
        self._thread.completed.connect(self._on_completed)
        self._thread.start()

    def _make_widgets(self) -> None:
        self._output = QPlainTextEdit()
        self._output.setReadOnly(True)
        self._output.setFont(code_font())
        self._output.setMaximumBlockCount(_MOST_LINES)
        self._output.setToolTip("Console output")
        self._output.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        self._prompt = QLabel(PROMPT)
        self._prompt.setFont(code_font())
        self._prompt.setFixedWidth(self._prompt.fontMetrics().horizontalAdvance(MORE))
        self._prompt.setProperty("role", "dim")
        self._input = ConsoleInput()
        self._input.submitted.connect(self.run)
        self._input.completion_requested.connect(self._on_completion_requested)
        self._input.interrupt_requested.connect(self.interrupt)
        self.setFocusProxy(self._input)
        self._interrupt = push_button("Interrupt", "Interrupt the running code (Ctrl+C)")
        self._interrupt.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._interrupt.clicked.connect(self.interrupt)

    def _arrange(self) -> None:
        line = QHBoxLayout()
        line.setSpacing(STEP_PX // 2)
        line.addWidget(self._prompt)
        line.addWidget(self._input, 1)
        line.addWidget(self._interrupt)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addWidget(self._output, 1)
        column.addLayout(line)
        self.setMinimumSize(40 * STEP_PX, 15 * STEP_PX)

    @property
    def busy(self) -> bool:
        """True while the user's code runs."""
        return self._thread.busy

    def text(self) -> str:
        """Return what the output shows."""
        return self._output.toPlainText()

    def run(self, text: str) -> None:
        """Run `text` as if it had been typed."""
        self._last = text
        self._thread.submit(text)

    def interrupt(self) -> None:
        """Break what runs, and what it waits for."""
        self._thread.interrupt()

    def shut_down(self, timeout_s: float = CLOSE_TIMEOUT_S) -> bool:
        """End the console's thread; False where what runs in it could not be ended in time."""
        self._refresh.stop()
        return self._thread.shut_down(timeout_s)

    def _on_output_ready(self) -> None:
        if not self._refresh.isActive():
            self._refresh.start()

    def _on_refresh(self) -> None:
        self._append(self._thread.take_output())

    def _append(self, text: str) -> None:
        bar = self._output.verticalScrollBar()
        follow = bar.value() >= bar.maximum()
        cursor = self._output.textCursor()
        cursor.movePosition(QTextCursor.MoveOperation.End)
        cursor.insertText(text)
        if follow:
            bar.setValue(bar.maximum())

    def _on_prompt_changed(self, prompt: str) -> None:
        self._prompt.setText(prompt if prompt != BUSY else "▶")
        self._prompt.setToolTip("Something runs" if prompt == BUSY else "Waiting for a line")
        if prompt == MORE and not self._input.is_editing:
            self._input.set_text(_indent_after(self._last))

    def _on_completion_requested(self, text: str) -> None:
        self._thread.complete(text)

    def _on_completed(self, text: str, matches: tuple[str, ...]) -> None:
        common = _common_start(matches)
        if len(common) > len(text):
            self._input.replace_before_cursor(text, common)
        elif len(matches) > 1:
            self._append("  ".join(match.split(".")[-1] for match in matches) + "\n")


def _common_start(texts: tuple[str, ...]) -> str:
    """Return what all of `texts` begin with."""
    if not texts:
        return ""
    first, last = min(texts), max(texts)
    same = next((i for i, char in enumerate(first) if char != last[i : i + 1]), len(first))
    return first[:same]


def _indent_after(line: str) -> str:
    last = line.splitlines()[-1] if line else ""
    blanks = last[: len(last) - len(last.lstrip())]
    return blanks + ("    " if last.rstrip().endswith(":") else "")
