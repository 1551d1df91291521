"""What each system does in its own way; Windows by a stand-in for its libraries."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from ctypes import CFUNCTYPE, POINTER, c_int, c_int64, c_uint32, c_void_p, cast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.frame import platform_services
from cosmic.frame.clock import RatedClock
from cosmic.frame.errors import NotAvailable
from cosmic.frame.file_holder import FileHold, Life, ProcessMark, own_mark
from cosmic.frame.platform_services import (
    end_process_after,
    ending_signals,
    lock_file,
    process_exists,
    process_start,
    run_thread_first,
    sync_folder,
    tick_finely,
)
from cosmic.frame.windows_api import Overlapped, PowerThrottling, WindowsApi, load_windows_api

BEYOND_ANY_FILE = 1 << 62
DENIED, NO_SUCH_PROCESS, LOCKED = 5, 87, 33


class FakeWindows:
    """kernel32 and winmm as they are documented, for a handful of processes and one disk."""

    def __init__(self) -> None:
        self.starts = {os.getpid(): 133_000_000_000, 77: 133_000_000_007}
        self.ended: set[int] = set()
        self.denied: set[int] = set()
        self.locks: dict[int, bool] = {}  # by handle: alone?
        self.locked_at: set[int] = set()
        self.priority = 0
        self.period_ms: int | None = None
        self.throttled: int | None = None
        self.refuses_priority = False
        self.open_handles: list[int] = []
        self.error = 0

    def api(self) -> WindowsApi:
        times = POINTER(c_int64)
        lap = POINTER(Overlapped)
        dword, handle, flag = c_uint32, c_void_p, c_int
        lock = (flag, handle, dword, dword, dword, dword, lap)
        kernel32 = {
            "OpenProcess": ((handle, dword, flag, dword), self.open_process),
            "CloseHandle": ((flag, handle), self.close_handle),
            "WaitForSingleObject": ((dword, handle, dword), self.wait),
            "GetProcessTimes": ((flag, handle, times, times, times, times), self.times),
            "LockFileEx": (lock, self.lock),
            "UnlockFileEx": ((flag, handle, dword, dword, dword, lap), self.unlock),
            "GetCurrentThread": ((handle,), lambda: 0xFFFE),
            "GetCurrentProcess": ((handle,), lambda: 0xFFFF),
            "SetThreadPriority": ((flag, handle, c_int), self.set_priority),
            "SetProcessInformation": ((flag, handle, c_int, c_void_p, dword), self.set_process),
        }
        winmm = {"timeBeginPeriod": ((dword, dword), self.begin_period)}
        return WindowsApi(
            self._library(kernel32), self._library(winmm), lambda: self.error, lambda file: file
        )

    @staticmethod
    def _library(functions: dict[str, tuple[tuple[Any, ...], Callable[..., Any]]]) -> Any:
        return SimpleNamespace(
            **{name: CFUNCTYPE(*types)(call) for name, (types, call) in functions.items()}
        )

    def open_process(self, rights: int, inherit: int, pid: int) -> int:
        assert rights == 0x1000 | 0x100000
        assert not inherit
        if pid in self.denied or pid not in self.starts:
            self.error = DENIED if pid in self.denied else NO_SUCH_PROCESS
            return 0
        self.open_handles.append(pid)
        return pid

    def close_handle(self, handle: int) -> int:
        self.open_handles.remove(handle)
        return 1

    def wait(self, handle: int, limit_ms: int) -> int:
        assert limit_ms == 0
        return 0 if handle in self.ended else 0x102

    def times(self, handle: int, begun: Any, *_others: Any) -> int:
        begun[0] = self.starts[handle]
        return 1

    def lock(self, handle: int, how: int, _r: int, low: int, high: int, where: Any) -> int:
        assert how & 1, "it must not wait"
        assert (low, high) == (1, 0)
        at = where[0].OffsetHigh << 32 | where[0].Offset
        self.locked_at.add(at)
        alone = bool(how & 2)
        # One's own lock is in the way as well, as on Windows.
        if any(alone or other for other in self.locks.values()):
            self.error = LOCKED
            return 0
        self.locks[handle] = alone
        return 1

    def unlock(self, handle: int, _r: int, _low: int, _high: int, _where: Any) -> int:
        return 1 if self.locks.pop(handle, None) is not None else 0

    def set_priority(self, thread: int, priority: int) -> int:
        assert thread == 0xFFFE
        self.error = DENIED
        if self.refuses_priority:
            return 0
        self.priority = priority
        return 1

    def set_process(self, process: int, kind: int, state: int, size: int) -> int:
        assert (process, kind, size) == (0xFFFF, 4, 12)
        given = cast(state, POINTER(PowerThrottling))[0]
        assert (given.Version, given.ControlMask) == (1, 4)
        self.throttled = given.StateMask
        return 1

    def begin_period(self, period_ms: int) -> int:
        self.period_ms = period_ms
        return 0


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeWindows]:
    fake = FakeWindows()
    api = fake.api()
    monkeypatch.setattr(platform_services, "_windows", lambda: api)
    monkeypatch.setattr(sys, "platform", "win32")
    yield fake
    assert not fake.open_handles, "a handle of a process was left open"


def test_there_is_no_windows_here() -> None:
    with pytest.raises(NotAvailable):
        load_windows_api()


def test_this_process_lives() -> None:
    assert own_mark().life is Life.LIVES


def test_a_process_that_has_ended_is_gone() -> None:
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    mark = ProcessMark(own_mark().host, child.pid, process_start(child.pid) or "")
    assert mark.life is Life.LIVES
    child.communicate(b"\n")
    assert mark.life is Life.GONE


def test_windows_distinguishes_a_process_from_a_later_one_of_its_number(
    windows: FakeWindows,
) -> None:
    mark = own_mark()
    assert mark.start
    assert mark.life is Life.LIVES
    windows.starts[mark.pid] += 1
    assert mark.life is Life.GONE


def test_windows_keeps_a_process_that_has_ended_and_it_is_gone_all_the_same(
    windows: FakeWindows,
) -> None:
    mark = ProcessMark(own_mark().host, 77, process_start(77) or "")
    windows.ended.add(77)
    assert mark.life is Life.GONE
    del windows.starts[77]
    assert mark.life is Life.GONE


def test_another_users_process_on_windows_is_not_called_gone(windows: FakeWindows) -> None:
    mark = ProcessMark(own_mark().host, 77, process_start(77) or "")
    windows.denied.add(77)
    assert mark.life is Life.UNKNOWN
    assert process_exists(77) is None, "a signal would end it"


@pytest.fixture(params=["here", "windows"])
def locks(request: pytest.FixtureRequest) -> dict[int, bool]:
    """The locks that the system does not forget by itself, by the number of the file."""
    return request.getfixturevalue("windows").locks if request.param == "windows" else {}


def test_a_file_is_held_by_many_or_by_one(locks: dict[int, bool], tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    file.touch()
    with FileHold(file) as first:
        before = set(locks)
        with FileHold(file) as second:
            assert first.held
            assert second.held
            assert not first.take(alone=True)
            assert first.take(alone=False)
            for each in set(locks) - before:  # a real handle takes its locks along
                del locks[each]
        assert first.take(alone=True)
        with FileHold(file) as third:
            assert not third.held


def test_a_lock_on_windows_keeps_nobody_from_reading(windows: FakeWindows, tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    file.touch()
    with file.open("rb") as opened:
        assert lock_file(opened.fileno(), alone=True)
    assert min(windows.locked_at) > BEYOND_ANY_FILE


def test_waits_are_made_fine_on_windows(windows: FakeWindows) -> None:
    assert tick_finely()
    assert windows.period_ms == 1
    assert windows.throttled == 0, "also while the window is hidden"


def test_waits_are_fine_in_other_threads() -> None:
    assert tick_finely()


def test_the_clock_on_windows_has_no_coarse_steps(
    windows: FakeWindows, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 15.6)
    clock = RatedClock()
    seen = {clock.now_s() for _ in range(100)}
    assert len(seen) > 50


def test_a_thread_comes_first_on_windows_or_says_why_not(windows: FakeWindows) -> None:
    assert run_thread_first(10) == ""
    assert windows.priority == 15
    windows.refuses_priority = True
    assert "error 5" in run_thread_first(10)


@pytest.mark.parametrize("system", [sys.platform, "win32"])
def test_a_process_that_hangs_is_ended(system: str) -> None:
    code = (
        f"import sys; sys.platform = {system!r}\n"
        "from cosmic.frame.platform_services import end_process_after\n"
        "end_process_after(5.0); end_process_after(0.0); end_process_after(0.05)\n"
        "while True: pass\n"
    )
    with pytest.raises(subprocess.CalledProcessError):
        subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60, check=True)


def test_a_process_that_is_done_in_time_is_not_ended() -> None:
    end_process_after(0.02)
    end_process_after(0.0)
    time.sleep(0.05)


def test_signals_are_heard_while_asked_for() -> None:
    heard: list[str] = []
    before = signal.getsignal(signal.SIGTERM)
    with ending_signals(heard.append):
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
    assert heard == ["SIGTERM", "SIGINT"]
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has none")
def test_under_nohup_the_end_of_the_terminal_is_not_heard() -> None:
    heard: list[str] = []
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ending_signals(heard.append):
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert not heard


def test_names_in_a_folder_are_written_through(tmp_path: Path) -> None:
    sync_folder(tmp_path)
    with pytest.raises(FileNotFoundError):
        sync_folder(tmp_path / "missing")


@pytest.mark.usefixtures("windows")
def test_windows_writes_names_through_by_itself(tmp_path: Path) -> None:
    sync_folder(tmp_path)
