import sys
import threading
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QMainWindow, QPushButton
from pytestqt.qtbot import QtBot

from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.gui.console_input import ConsoleInput
from cosmic.frame.gui.console_panel import ConsolePanel
from cosmic.frame.gui.drawer import Drawer
from cosmic.frame.hooks import install_hooks

SHORT_MS = 5000


class Rig:
    """Something with a name to complete and a wait to cancel."""

    def __init__(self) -> None:
        self.cancelled = threading.Event()

    def wait_for_move(self) -> None:
        if self.cancelled.wait(30.0):
            raise ConfigError("the movement was cancelled")

    def refuse(self) -> None:
        raise ConfigError("left.x: 500.0 µm is beyond the limit")


@pytest.fixture
def rig() -> Rig:
    return Rig()


@pytest.fixture
def failures() -> list[Failure]:
    return []


@pytest.fixture
def console(qtbot: QtBot, rig: Rig, failures: list[Failure]) -> Iterator[ConsolePanel]:
    policy = FailurePolicy()
    policy.subscribe(failures.append)
    undo = install_hooks(policy)
    panel = ConsolePanel(policy, {"rig": rig}, on_interrupt=rig.cancelled.set)
    qtbot.addWidget(panel)
    panel.resize(800, 300)
    panel.show()
    yield panel
    panel.shut_down()
    undo()


def line(console: ConsolePanel) -> ConsoleInput:
    return console.findChildren(ConsoleInput)[0]


def wait_for(qtbot: QtBot, console: ConsolePanel, text: str) -> None:
    qtbot.waitUntil(lambda: text in console.text(), timeout=SHORT_MS)


def type_in(qtbot: QtBot, console: ConsolePanel, text: str) -> None:
    qtbot.keyClicks(line(console), text)
    qtbot.keyClick(line(console), Qt.Key.Key_Return)


def test_an_expression_is_echoed_and_answered(qtbot: QtBot, console: ConsolePanel) -> None:
    type_in(qtbot, console, "6 * 7")
    wait_for(qtbot, console, ">>> 6 * 7\n42\n")


def test_what_other_threads_print_does_not_come_here(
    qtbot: QtBot, console: ConsolePanel, capsys: pytest.CaptureFixture[str]
) -> None:
    console.run("print('from the console')")
    wait_for(qtbot, console, "\nfrom the console\n")
    sys.stdout.write("from the test")
    console.run("print('after'); sleep(0.2)")
    wait_for(qtbot, console, "\nafter\n")
    sys.stdout.write("meanwhile")
    qtbot.waitUntil(lambda: not console.busy)
    assert "from the test" not in console.text()
    assert "meanwhile" not in console.text()
    assert capsys.readouterr().out == "from the testmeanwhile"


def test_the_streams_are_given_back(qtbot: QtBot, rig: Rig) -> None:
    before = (sys.stdin, sys.stdout, sys.stderr)
    panel = ConsolePanel(FailurePolicy(), {"rig": rig})
    qtbot.addWidget(panel)
    panel.run("import sys; mine = sys.stdout; sys.stderr.write('ready' + chr(10)); sleep(60)")
    wait_for(qtbot, panel, "\nready\n")
    assert sys.stdout is not before[1]
    assert panel.shut_down()
    assert (sys.stdin, sys.stdout, sys.stderr) == before


def test_a_failure_is_shown_here_and_is_no_defect(
    qtbot: QtBot, console: ConsolePanel, failures: list[Failure]
) -> None:
    console.run("1 / 0")
    wait_for(qtbot, console, "ZeroDivisionError: division by zero")
    assert 'File "<console>", line 1' in console.text()
    assert "code.py" not in console.text()
    console.run("def (")
    wait_for(qtbot, console, "SyntaxError")
    assert failures == []


def test_a_refusal_is_one_line_without_a_traceback(qtbot: QtBot, console: ConsolePanel) -> None:
    console.run("rig.refuse()")
    wait_for(qtbot, console, "ConfigError: left.x: 500.0 µm is beyond the limit")
    assert "Traceback" not in console.text()


def test_a_block_is_asked_for_line_by_line_and_indented(
    qtbot: QtBot, console: ConsolePanel
) -> None:
    type_in(qtbot, console, "for i in range(3):")
    qtbot.waitUntil(lambda: line(console).toPlainText() == "    ")
    type_in(qtbot, console, "print('fibre', i)")
    qtbot.waitUntil(lambda: line(console).toPlainText() == "    ")
    qtbot.keyClick(line(console), Qt.Key.Key_Return)
    wait_for(qtbot, console, "fibre 0\nfibre 1\nfibre 2\n")


def test_a_pasted_script_runs_as_a_whole(qtbot: QtBot, console: ConsolePanel) -> None:
    line(console).insertPlainText("def f(x):\n\n    return x * 2\n\nprint('twice', f(21))")
    qtbot.keyClick(line(console), Qt.Key.Key_Return)
    wait_for(qtbot, console, "\ntwice 42\n")


@pytest.mark.parametrize(
    "source",
    [
        "while True: pass\n",
        "def f():\n    while True:\n        pass\nf()",
        "any(False for i in iter(int, 1))",
        "sleep(60)",
        "while True: print('flood')\n",
        "input('name? ')",
    ],
)
def test_interrupt_breaks_what_runs(qtbot: QtBot, console: ConsolePanel, source: str) -> None:
    console.run("'ready'")
    wait_for(qtbot, console, "'ready'\n")
    console.run(source)
    qtbot.waitUntil(lambda: console.busy)
    button = next(b for b in console.findChildren(QPushButton) if b.text() == "Interrupt")
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    wait_for(qtbot, console, "KeyboardInterrupt")
    console.run("'still ' + 'here'")
    wait_for(qtbot, console, "'still here'")


def test_ctrl_c_ends_a_wait_for_a_movement(qtbot: QtBot, console: ConsolePanel, rig: Rig) -> None:
    console.run("rig.wait_for_move()")
    wait_for(qtbot, console, "wait_for_move()\n")
    qtbot.keyClick(line(console), Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    wait_for(qtbot, console, "KeyboardInterrupt")
    assert rig.cancelled.is_set()


def test_ctrl_c_forgets_a_block_under_way(qtbot: QtBot, console: ConsolePanel) -> None:
    console.run("if True:")
    qtbot.waitUntil(lambda: line(console).toPlainText() == "    ")
    line(console).clear()
    qtbot.keyClick(line(console), Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    wait_for(qtbot, console, "KeyboardInterrupt")
    console.run("1 + 1")
    wait_for(qtbot, console, ">>> 1 + 1\n2\n")


def test_input_reads_the_next_line(qtbot: QtBot, console: ConsolePanel) -> None:
    console.run("name = input('who? ')")
    wait_for(qtbot, console, "who? ")
    console.run("Ada")
    console.run("name * 2")
    wait_for(qtbot, console, "'AdaAda'")


def test_exit_leaves_the_console_open(qtbot: QtBot, console: ConsolePanel) -> None:
    console.run("exit()")
    wait_for(qtbot, console, "The console stays open")
    console.run("1 + 1")
    wait_for(qtbot, console, "2\n")


def test_up_and_down_recall_what_was_typed(qtbot: QtBot, console: ConsolePanel) -> None:
    for text in ("a = 1", "b = 2"):
        type_in(qtbot, console, text)
    field = line(console)
    qtbot.keyClicks(field, "draft")
    seen = []
    for key in (Qt.Key.Key_Up, Qt.Key.Key_Up, Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_Down):
        qtbot.keyClick(field, key)
        seen.append(field.toPlainText())
    assert seen == ["b = 2", "a = 1", "a = 1", "b = 2", "draft"]


def test_tab_completes_names_and_attributes(qtbot: QtBot, console: ConsolePanel) -> None:
    console.run("'ready'")
    wait_for(qtbot, console, "'ready'\n")
    qtbot.waitUntil(lambda: not console.busy)
    field = line(console)
    qtbot.keyClicks(field, "x = rig.wait_f")
    qtbot.keyClick(field, Qt.Key.Key_Tab)
    qtbot.waitUntil(lambda: field.toPlainText().startswith("x = rig.wait_for_move("))


def test_tab_lists_what_is_possible(qtbot: QtBot, console: ConsolePanel) -> None:
    console.run("apple = apricot = 1; 'ready'")
    wait_for(qtbot, console, "'ready'\n")
    qtbot.waitUntil(lambda: not console.busy)
    qtbot.keyClicks(line(console), "ap")
    qtbot.keyClick(line(console), Qt.Key.Key_Tab)
    wait_for(qtbot, console, "apple  apricot")


def test_closing_breaks_what_runs_and_does_not_hang(qtbot: QtBot, rig: Rig) -> None:
    for source in ("while True: pass\n", "rig.wait_for_move()", "while True: print('flood')\n"):
        rig.cancelled.clear()
        panel = ConsolePanel(FailurePolicy(), {"rig": rig}, on_interrupt=rig.cancelled.set)
        qtbot.addWidget(panel)
        panel.run(source)
        wait_for(qtbot, panel, source.split("(")[0].strip())
        qtbot.waitUntil(lambda panel=panel: panel.busy)  # type: ignore[misc]
        assert panel.shut_down()


def test_what_cannot_be_broken_is_left_behind_in_time(
    qtbot: QtBot, caplog: pytest.LogCaptureFixture
) -> None:
    gate = threading.Event()
    before = sys.stdout
    panel = ConsolePanel(FailurePolicy(), {"gate": gate})
    qtbot.addWidget(panel)
    panel.run("gate.wait()")
    wait_for(qtbot, panel, "gate.wait()\n")
    assert not panel.shut_down(timeout_s=0.2)
    assert "did not end" in caplog.text
    assert sys.stdout is before
    gate.set()
    assert panel.shut_down()


def test_a_line_typed_after_the_drawer_opened_the_console_goes_into_it(
    console: ConsolePanel, qtbot: QtBot
) -> None:
    window = QMainWindow()
    drawer = Drawer(window)
    window.statusBar().addWidget(drawer)
    drawer.add_page("Console", console, "")
    qtbot.addWidget(window)
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()
    window.setFocus()
    qtbot.mouseClick(drawer.button("Console"), Qt.MouseButton.LeftButton)
    qtbot.keyClicks(QApplication.focusWidget(), "print('dear reader')")
    qtbot.keyClick(QApplication.focusWidget(), Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: "\ndear reader" in console.text())
    drawer.close_page()
    assert QApplication.focusWidget() is window
