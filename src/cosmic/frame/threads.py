"""The only threads there are: `WorkerThread` and its subclasses."""

import atexit
import os
import sys
import threading
import weakref
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import ClassVar, Final

import shiboken6
from PySide6.QtCore import QCoreApplication, QObject, QThread
from typing_extensions import override

from cosmic.frame.errors import WrongThreadError
from cosmic.frame.failure import FailurePolicy

JOIN_TIMEOUT_S: Final = 5.0
SWITCH_S: Final = 0.001
"""So long may one thread of Python keep the others waiting for the interpreter."""
URGENT_SWITCH_S: Final = 0.0001
"""The same while something is urgent."""
_PYTHONS_SWITCH_S: Final = 0.005
KEPT_SWITCH_S: Final = 0.004
"""The same while who has the interpreter is to keep it: ten times as long as a stop takes."""


class WorkerThread(QThread):
    """A named thread that ends in order and whose failure cannot pass unseen.

    Either a subclass overrides `run_body`, the only code that runs in the new thread, or the
    default runs an event loop for the QObjects moved to it. Everything else a subclass offers
    must be thread-safe and return at once: slots of a QThread run where it was made.

    Parameters
    ----------
    name : str
        Shown in logs and debuggers.
    policy : FailurePolicy
        Told when the body raises; motion is then stopped.
    """

    may_wait: ClassVar[bool] = True
    """False for a thread that brings movements about, and so must never wait for one."""
    _left_in_parent = False

    def __init__(self, name: str, policy: FailurePolicy, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        window = QCoreApplication.instance()
        if parent is None and window is not None:
            self.moveToThread(window.thread())  # which leaves it behind where it hangs at the end
        self._policy = policy
        self._end_requested = threading.Event()
        with _alive.lock:
            _alive.threads.add(self)

    @property
    def name(self) -> str:
        """Name of the thread."""
        return self.objectName()

    @property
    def end_requested(self) -> bool:
        """True once `request_end` was called; a body leaves its loop then."""
        return self._end_requested.is_set()

    def run_body(self) -> None:
        """Run in the new thread; override it."""
        if not self.end_requested:  # a `quit` before the start is forgotten by Qt
            self.exec()

    def request_end(self) -> None:
        """Ask the body to leave; returns at once. Subclasses wake their waits here as well."""
        self._end_requested.set()
        self.quit()

    def join(self, timeout_s: float = JOIN_TIMEOUT_S) -> bool:
        """Wait until the thread has ended; False when it had not after `timeout_s` of wall time."""
        return self._left_in_parent or self.wait(int(timeout_s * 1000))

    @override
    def run(self) -> None:
        trace = threading.gettrace()
        if trace is not None:  # coverage does not see threads that Qt started
            sys.settrace(trace)
        threading.current_thread().name = self.name
        take_back = None if self.may_wait else _declare_never_waiting(self.name)
        try:
            self.run_body()
        except BaseException as exc:  # noqa: BLE001 - the end of the thread body, SystemExit too
            self._policy.report(exc, f"thread {self.name!r}", thread_died=True)
        finally:
            if take_back is not None:
                take_back()

    def on_fork(self) -> None:
        """Count as ended: called in a process that was forked, which has none of the threads."""
        self._left_in_parent = True
        _not_here.append(self)
        self._end_requested = threading.Event()
        self._end_requested.set()


class _Alive:
    """The threads that were made and not deleted."""

    def __init__(self) -> None:
        self.threads: weakref.WeakSet[WorkerThread] = weakref.WeakSet()
        self.lock = threading.Lock()


_alive: Final = _Alive()
_not_here: list[WorkerThread] = []
"""In a process that was forked, those of the other one: Qt takes them for running."""


def _on_fork() -> None:
    _alive.lock = threading.Lock()  # whoever held it is not here
    for thread in list(_alive.threads):
        thread.on_fork()


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_on_fork)


def running_threads() -> list[WorkerThread]:
    """Return the worker threads that run now."""
    with _alive.lock:
        threads = list(_alive.threads)
    return [
        thread
        for thread in threads
        if shiboken6.isValid(thread) and thread.isRunning() and thread not in _not_here
    ]


@atexit.register
def _end_what_still_runs() -> None:
    """End threads that nobody ended: Qt aborts the process over a running thread."""
    left = running_threads()
    for thread in left:
        thread.request_end()
    hang = [thread for thread in left if not thread.join(2.0)]
    here = QThread.currentThread()
    for thread in (*hang, *_not_here):
        if shiboken6.isValid(thread) and thread.parent() is None and thread.thread() == here:
            # What has a parent is not destroyed with the interpreter, which would end in an abort.
            thread.setParent(here)


_busy_threads: dict[int, str] = {}


def share_interpreter() -> None:
    """Let a thread that needs the interpreter have it within a millisecond, instead of five.

    Every call into a vendor's library gives it up and has to win it back: beside threads that
    compute, the eleven calls of a stop took 60 to 100 ms at worst, and 12 to 16 ms so. It costs 6 %
    of the processor while three threads do nothing but compute in Python.
    """
    sys.setswitchinterval(min(sys.getswitchinterval(), SWITCH_S))


@contextmanager
def urgent(*, kept: bool = False) -> Generator[None]:
    """Let who needs the interpreter have it at once meanwhile; any thread, takes no lock.

    For a few calls into a library in C, each of which has to win the interpreter back. With
    `kept`, for calls that never give it up: then the others wait.
    """
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(KEPT_SWITCH_S if kept else min(before_s, URGENT_SWITCH_S))
    try:
        yield
    finally:
        # Of two that overlap neither leaves it short, or long, for ever.
        sys.setswitchinterval(min(max(before_s, SWITCH_S), _PYTHONS_SWITCH_S))


def declare_gui_thread() -> Callable[[], None]:
    """Say that the calling thread runs a window, so that nothing may block it.

    Returns the function that takes it back.
    """
    return _declare_never_waiting("the window")


def _declare_never_waiting(whom: str) -> Callable[[], None]:
    ident = threading.get_ident()
    _busy_threads[ident] = whom

    def take_back() -> None:
        _busy_threads.pop(ident, None)

    return take_back


def may_wait_here() -> bool:
    """Return whether the calling thread may wait for what other threads bring about."""
    return threading.get_ident() not in _busy_threads


def forbid_waiting_here(what: str) -> None:
    """Raise where `what` would freeze a window, or a thread that has to bring about its end.

    Raises
    ------
    WrongThreadError
        The calling thread must never wait.
    """
    whom = _busy_threads.get(threading.get_ident())
    if whom is not None:
        raise WrongThreadError(
            f"{what} would freeze {whom}; use wait=False, or do it in the console or a thread"
        )
