"""Worker threads: they end in order, and their failure cannot pass unseen."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
from PySide6.QtCore import QObject, QThread, Signal, Slot
from pytestqt.qtbot import QtBot
from typing_extensions import override

from cosmic.frame.errors import DeviceError, WrongThreadError
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.threads import (
    WorkerThread,
    declare_gui_thread,
    forbid_waiting_here,
    running_threads,
    urgent,
)


class Waiting(WorkerThread):
    """Waits in its body until it is asked to end, or set free."""

    def __init__(self, policy: FailurePolicy) -> None:
        super().__init__("waiting", policy)
        self.entered = threading.Event()
        self.free = threading.Event()
        self.body_name = ""

    @override
    def run_body(self) -> None:
        self.body_name = threading.current_thread().name
        self.entered.set()
        self.free.wait()

    @override
    def request_end(self) -> None:
        super().request_end()
        self.free.set()


class Failing(WorkerThread):
    """Raises in its body."""

    def __init__(self, policy: FailurePolicy, error: BaseException) -> None:
        super().__init__("failing", policy)
        self._error = error

    @override
    def run_body(self) -> None:
        raise self._error


@pytest.fixture
def policy() -> FailurePolicy:
    return FailurePolicy()


@pytest.fixture
def waiting(policy: FailurePolicy) -> Iterator[Waiting]:
    thread = Waiting(policy)
    thread.start()
    assert thread.entered.wait(20.0)
    yield thread
    thread.request_end()
    assert thread.join()


def test_the_body_runs_under_the_threads_name(waiting: Waiting) -> None:
    assert waiting.name == waiting.body_name == "waiting"


def test_a_thread_is_among_the_running_ones_until_it_has_ended(waiting: Waiting) -> None:
    assert waiting in running_threads()
    waiting.request_end()
    assert waiting.join()
    assert waiting not in running_threads()


def test_a_thread_that_never_started_does_not_run_and_is_joined_at_once(
    policy: FailurePolicy,
) -> None:
    thread = Waiting(policy)
    assert thread not in running_threads()
    assert thread.join()


def test_join_says_when_a_thread_has_not_ended(waiting: Waiting) -> None:
    assert not waiting.join(0.01)
    assert not waiting.end_requested


def test_asking_to_end_returns_at_once_and_is_seen_by_the_body(waiting: Waiting) -> None:
    waiting.request_end()
    assert waiting.end_requested


def test_threads_deleted_by_their_parent_are_not_asked_whether_they_run(
    qapp: QObject, policy: FailurePolicy
) -> None:
    parent = QObject()
    thread = WorkerThread("child", policy, parent)
    del parent
    assert thread not in running_threads()


def test_threads_can_be_made_in_any_thread_while_others_are_listed(policy: FailurePolicy) -> None:
    def make(number: int) -> int:
        threads = [WorkerThread(f"{number}", policy) for _ in range(20)]
        running_threads()
        return len(threads)

    with ThreadPoolExecutor(4) as pool:
        assert sum(pool.map(make, range(20))) == 400


class Echo(QObject):
    """Lives in another thread and says which."""

    def __init__(self) -> None:
        super().__init__()
        self.served_in: list[QThread] = []

    @Slot()
    def ask(self) -> None:
        self.served_in.append(QThread.currentThread())


class Asker(QObject):
    asked = Signal()


def test_objects_moved_to_a_thread_without_a_body_are_served_there(
    qtbot: QtBot, policy: FailurePolicy
) -> None:
    thread, echo, asker = WorkerThread("loop", policy), Echo(), Asker()
    echo.moveToThread(thread)
    asker.asked.connect(echo.ask)
    thread.start()
    asker.asked.emit()
    qtbot.waitUntil(lambda: bool(echo.served_in))
    thread.request_end()
    assert thread.join()
    assert echo.served_in == [thread]


def test_a_thread_asked_to_end_before_it_starts_ends_when_it_starts(
    qapp: QObject, policy: FailurePolicy
) -> None:
    thread = WorkerThread("early", policy)
    thread.request_end()
    thread.start()
    assert thread.join(10.0)


@pytest.mark.defects
@pytest.mark.parametrize("error", [ValueError("hm"), SystemExit(3)])
def test_a_body_that_raises_stops_all_motion_and_is_reported_with_the_threads_name(
    policy: FailurePolicy, error: BaseException
) -> None:
    stops: list[str] = []
    failures: list[Failure] = []
    policy.on_safe_stop(stops.append)
    policy.subscribe(failures.append)
    thread = Failing(policy, error)
    thread.start()
    assert thread.join()
    (failure,) = failures
    assert (failure.where, failure.defect) == ("thread 'failing'", True)
    assert len(stops) == 1


def test_a_body_that_ends_with_a_foreseen_failure_stops_all_motion_too(
    policy: FailurePolicy,
) -> None:
    stops: list[str] = []
    policy.on_safe_stop(stops.append)
    thread = Failing(policy, DeviceError("unplugged"))
    thread.start()
    assert thread.join()
    assert stops == ["thread 'failing': unplugged"]


LEFT_RUNNING = """
import threading
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

class Waiting(WorkerThread):
    wake = threading.Event()
    def run_body(self):
        self.wake.wait()
        print("left in order")
    def request_end(self):
        super().request_end()
        self.wake.set()

waiting = Waiting("forgotten", FailurePolicy())
waiting.start()
"""


def test_a_process_that_forgot_a_thread_ends_it_in_order() -> None:
    done = subprocess.run(
        [sys.executable, "-c", LEFT_RUNNING],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "left in order\n", "")


HANGS = """
import sys
import threading
from PySide6.QtCore import QCoreApplication
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

application = QCoreApplication([])
made = []

class Hanging(WorkerThread):
    def run_body(self):
        threading.Event().wait()

class Making(WorkerThread):
    def run_body(self):
        hang()

def hang():
    made.append(Hanging("hangs in a driver", FailurePolicy()))
    made[-1].start()

hang()
making = Making("makes another", FailurePolicy())
making.start()
making.join()
sys.exit(3)
"""


def test_a_program_keeps_its_exit_code_with_threads_that_never_end() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANGS], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (3, "")


def test_waiting_is_forbidden_in_a_declared_gui_thread_only() -> None:
    take_back = declare_gui_thread()
    with pytest.raises(WrongThreadError, match="moving would freeze the window"):
        forbid_waiting_here("moving")
    with ThreadPoolExecutor() as pool:
        pool.submit(forbid_waiting_here, "moving").result()
    take_back()
    forbid_waiting_here("moving")


def test_what_is_urgent_waits_for_the_interpreter_a_tenth_of_a_millisecond_each_time() -> None:
    before_s = sys.getswitchinterval()
    try:
        sys.setswitchinterval(0.005)
        with urgent():
            assert sys.getswitchinterval() <= 0.0001
            with urgent():
                pass
            assert sys.getswitchinterval() <= 0.001
        assert sys.getswitchinterval() == pytest.approx(0.005)
    finally:
        sys.setswitchinterval(before_s)


def test_what_keeps_the_interpreter_is_not_asked_for_it_meanwhile() -> None:
    before_s = sys.getswitchinterval()
    try:
        sys.setswitchinterval(0.001)
        with urgent(kept=True):
            assert sys.getswitchinterval() >= 0.002
            with urgent(kept=True):
                pass
        assert sys.getswitchinterval() <= 0.005
    finally:
        sys.setswitchinterval(before_s)
