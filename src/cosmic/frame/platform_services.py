"""What each system does in its own way: every call that is POSIX's alone, beside that of Windows.

Free of Qt: helper processes use it too. Where helpers are started, and how, is in
`cosmic.frame.helper_process`.
"""

import faulthandler
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, Final

from cosmic.frame.windows_api import WindowsApi, load_windows_api

_PROC: Final = Path("/proc")
_START_FIELD: Final = 19
"""Of /proc/PID/stat, counted after the name of the program, which may hold anything."""
_ENDING: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""SIGBREAK is Ctrl+Break, and the end of the console's window, on Windows."""


@cache
def _windows() -> WindowsApi:
    return load_windows_api()


# Processes


def process_start(pid: int) -> str | None:
    """Return a text that no other process has, before this one or after it, under its number.

    Empty when there is no such process any more; None where the system does not say.
    """
    if sys.platform == "win32":
        return _windows().process_start(pid)
    try:
        boot = (_PROC / "sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return None
    try:
        stat = (_PROC / str(pid) / "stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    state, *fields = stat.rpartition(")")[2].split()
    ended = state in ("Z", "X")  # it holds nothing any more, whoever has not asked for its end yet
    return "" if ended else f"{boot}:{fields[_START_FIELD - 1]}"


def process_exists(pid: int) -> bool | None:
    """Return whether any process has this number; None where asking would end it."""
    if sys.platform == "win32":
        return None
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def own_session() -> dict[str, Any]:
    """Return the arguments of `Popen` by which a Ctrl+C in the console never reaches a process."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}


def run_in_background(nice: int) -> None:
    """Leave the processors to others; on Windows the helper has been started so."""
    if sys.platform != "win32":
        os.nice(nice)


def run_thread_first(priority: int) -> str:
    """Ask the system to run the calling thread before all others; returns "" or why it does not.

    What the thread starts runs as usual again.
    """
    if sys.platform == "win32":
        return _windows().run_thread_first()
    if sys.platform == "linux":
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        try:
            os.sched_setscheduler(0, policy, os.sched_param(priority))
        except OSError as exc:
            return exc.strerror or str(exc)
        return ""
    return "this system gives Python no real-time priority"


def end_process_after(limit_s: float) -> None:
    """End this process after `limit_s`, whatever it does then; 0 takes it back. Main thread.

    By a signal where there is one that needs nobody to listen, else by a thread of the
    interpreter's own, which costs a tenth of a millisecond.
    """
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_REAL, limit_s)
    elif limit_s > 0.0:
        faulthandler.dump_traceback_later(limit_s, exit=True)
    else:
        faulthandler.cancel_dump_traceback_later()


@contextmanager
def ending_signals(ended: Callable[[str], object]) -> Generator[None]:
    """Call `ended` with the name of the signal by which terminal or system end the program.

    Under nohup the terminal's end is ignored as before. Main thread.
    """

    def on_signal(number: int, _frame: object) -> None:
        ended(signal.Signals(number).name)

    known = [getattr(signal, name) for name in _ENDING if hasattr(signal, name)]
    before = {each: signal.signal(each, on_signal) for each in known if not _hushed(each)}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _hushed(one: signal.Signals) -> bool:
    return one.name == "SIGHUP" and signal.getsignal(one) is signal.SIG_IGN


# Files


def lock_file(descriptor: int, *, alone: bool) -> bool:
    """Lock an open file in place of an earlier lock of its own, without waiting.

    Parameters
    ----------
    alone : bool
        Nobody else may have it; False: beside others that have it so.

    Returns
    -------
    bool
        False when somebody else has it. True where the disk knows no locks.
    """
    if sys.platform == "win32":
        return _windows().lock_file(descriptor, alone=alone)
    import fcntl

    try:
        fcntl.flock(descriptor, (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a disk without locks
        return True
    return True


def sync_folder(folder: Path) -> None:
    """See that the names in a folder are on the disk; NTFS keeps a journal of them by itself.

    Raises
    ------
    OSError
        They cannot be written.
    """
    if sys.platform == "win32":
        return
    opened = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)


# Time


def tick_finely() -> bool:
    """Let waits end within about a millisecond, until this process ends; False: they may not.

    Windows else looks only every 15.6 ms who has waited long enough.
    """
    return _windows().tick_finely() if sys.platform == "win32" else True
