"""One test for each place that can fail: the log has it, the operator sees it, motion stops.

See docs/explanation/errors.md.
"""

import ctypes
import subprocess
import sys
from collections.abc import Iterator

import pytest
from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import QPushButton, QWidget
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.hooks import install_hooks
from cosmic.frame.overrides import override
from cosmic.frame.threads import WorkerThread, running_threads

pytestmark = pytest.mark.defects


class Outcome:
    """What came of a failure."""

    def __init__(self, policy: FailurePolicy) -> None:
        self.policy = policy
        self.stops: list[str] = []
        self.failures: list[Failure] = []
        policy.on_safe_stop(self.stops.append)
        policy.subscribe(self.failures.append)

    def assert_handled(self, log: str, where: str) -> None:
        """Stopped once, told once, logged with its traceback."""
        assert len(self.stops) == 1
        assert [failure.defect for failure in self.failures] == [True]
        assert where in self.failures[0].where
        assert "Traceback" in log
        assert "ZeroDivisionError" in log


@pytest.fixture
def outcome(qapp: QObject) -> Iterator[Outcome]:
    policy = FailurePolicy()
    undo = install_hooks(policy)
    yield Outcome(policy)
    undo()


def _fail() -> None:
    _ = 1 // 0


class Emitter(QObject):
    """Emits from wherever it is asked."""

    fired = Signal()


class Receiver(QObject):
    """Has a slot that fails once."""

    def __init__(self) -> None:
        super().__init__()
        self.calls = 0

    def on_fired(self) -> None:
        self.calls += 1
        if self.calls == 1:
            _fail()


def test_a_slot(qtbot: QtBot, outcome: Outcome, caplog: pytest.LogCaptureFixture) -> None:
    button, receiver = QPushButton(), Receiver()
    qtbot.addWidget(button)
    button.clicked.connect(receiver.on_fired)
    button.click()
    button.click()
    assert receiver.calls == 2, "the window goes on"
    outcome.assert_handled(caplog.text, "on_fired")


def test_a_slot_called_across_threads(
    qtbot: QtBot, outcome: Outcome, caplog: pytest.LogCaptureFixture
) -> None:
    thread, emitter, receiver = WorkerThread("loop", outcome.policy), Emitter(), Receiver()
    receiver.moveToThread(thread)
    emitter.fired.connect(receiver.on_fired)
    thread.start()
    emitter.fired.emit()
    emitter.fired.emit()
    qtbot.waitUntil(lambda: receiver.calls == 2)
    thread.request_end()
    assert thread.join()
    outcome.assert_handled(caplog.text, "on_fired")


def test_a_timer(qtbot: QtBot, outcome: Outcome, caplog: pytest.LogCaptureFixture) -> None:
    timer = QTimer(singleShot=True)
    timer.timeout.connect(_fail)
    timer.start(0)
    qtbot.waitUntil(lambda: bool(outcome.failures))
    outcome.assert_handled(caplog.text, "_fail")


class Canvas(QWidget):
    """Cannot paint itself at the first try."""

    paints = 0

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        self.paints += 1
        if self.paints == 1:
            _fail()

    def on_clicked(self) -> None:
        self.grab()


def test_a_paint_event(qtbot: QtBot, outcome: Outcome, caplog: pytest.LogCaptureFixture) -> None:
    canvas = Canvas()
    qtbot.addWidget(canvas)
    canvas.show()
    qtbot.waitUntil(lambda: canvas.paints == 1)
    canvas.update()
    qtbot.waitUntil(lambda: canvas.paints == 2)
    outcome.assert_handled(caplog.text, "paintEvent")


def test_an_override_that_a_slot_calls_through_qt(
    qtbot: QtBot, outcome: Outcome, caplog: pytest.LogCaptureFixture
) -> None:
    canvas, button = Canvas(), QPushButton()
    qtbot.addWidget(canvas)
    qtbot.addWidget(button)
    button.clicked.connect(canvas.on_clicked)
    button.click()
    button.click()
    assert canvas.paints == 2
    outcome.assert_handled(caplog.text, "on_clicked")


class Failing(WorkerThread):
    """Raises in its body."""

    @override
    def run_body(self) -> None:
        _fail()


def test_a_thread_body(outcome: Outcome, caplog: pytest.LogCaptureFixture) -> None:
    thread = Failing("device 0", outcome.policy)
    thread.start()
    assert thread.join()
    outcome.assert_handled(caplog.text, "thread 'device 0'")


def test_a_driver_callback(outcome: Outcome, caplog: pytest.LogCaptureFixture) -> None:
    kind = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int)
    callback = kind(outcome.policy.guarded("sample callback", lambda count: 1 // count, -1))
    assert callback(0) == -1
    assert callback(1) == 1
    outcome.assert_handled(caplog.text, "sample callback")


def test_a_driver_callback_that_nobody_guarded(
    outcome: Outcome, caplog: pytest.LogCaptureFixture
) -> None:
    callback = ctypes.CFUNCTYPE(ctypes.c_int)(lambda: 1 // 0)
    callback()
    outcome.assert_handled(caplog.text, "ctypes")


def test_a_script_leaves_as_python_does_and_its_motion_has_ended() -> None:
    with pytest.raises(ZeroDivisionError), cosmic.connect(rate=20.0) as rig:
        move = rig.mico["left.x"].move_to(3000.0, wait=False)
        _fail()
    assert move.done
    assert not running_threads()


SCRIPT = """
import cosmic
rig = cosmic.connect(rate=20.0)
rig.mico["left.x"].move_to(3000.0, wait=False)
1 // 0
"""


def test_a_script_without_a_with_block_ends_with_its_traceback() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[0] == "Traceback (most recent call last):"
    assert done.stderr.splitlines()[-1].startswith("ZeroDivisionError")
