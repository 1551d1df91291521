"""What is asked of Windows itself, where Python has no call for it.

Free of Qt. The functions come from kernel32.dll and winmm.dll, or from a stand-in in a test; names
and numbers are those of the Windows SDK.
"""

import sys
from collections.abc import Callable
from ctypes import POINTER, Structure, byref, c_int, c_int64, c_uint32, c_void_p, sizeof
from typing import Any, Final

from cosmic.frame.errors import NotAvailable

PROCESS_QUERY_LIMITED_INFORMATION: Final = 0x1000
SYNCHRONIZE: Final = 0x100000
WAIT_OBJECT_0: Final = 0
ERROR_LOCK_VIOLATION: Final = 33
ERROR_INVALID_PARAMETER: Final = 87
LOCKFILE_FAIL_IMMEDIATELY: Final = 1
LOCKFILE_EXCLUSIVE_LOCK: Final = 2
THREAD_PRIORITY_TIME_CRITICAL: Final = 15
PROCESS_POWER_THROTTLING: Final = 4
IGNORE_TIMER_RESOLUTION: Final = 4
TICK_MS: Final = 1
LOCKED_BYTE: Final = (1 << 63) - 2
"""Locks of Windows keep others from reading: this byte lies behind the end of every file."""


class Overlapped(Structure):
    """OVERLAPPED: which byte of a file is meant."""

    _fields_ = (
        ("Internal", c_void_p),
        ("InternalHigh", c_void_p),
        ("Offset", c_uint32),
        ("OffsetHigh", c_uint32),
        ("hEvent", c_void_p),
    )


class PowerThrottling(Structure):
    """PROCESS_POWER_THROTTLING_STATE."""

    _fields_ = (("Version", c_uint32), ("ControlMask", c_uint32), ("StateMask", c_uint32))


_FILE_TIME: Final = POINTER(c_int64)
_KERNEL32: Final = (
    ("OpenProcess", c_void_p, (c_uint32, c_int, c_uint32)),
    ("CloseHandle", c_int, (c_void_p,)),
    ("WaitForSingleObject", c_uint32, (c_void_p, c_uint32)),
    ("GetProcessTimes", c_int, (c_void_p, _FILE_TIME, _FILE_TIME, _FILE_TIME, _FILE_TIME)),
    (
        "LockFileEx",
        c_int,
        (c_void_p, c_uint32, c_uint32, c_uint32, c_uint32, POINTER(Overlapped)),
    ),
    ("UnlockFileEx", c_int, (c_void_p, c_uint32, c_uint32, c_uint32, POINTER(Overlapped))),
    ("GetCurrentThread", c_void_p, ()),
    ("GetCurrentProcess", c_void_p, ()),
    ("SetThreadPriority", c_int, (c_void_p, c_int)),
    ("SetProcessInformation", c_int, (c_void_p, c_int, c_void_p, c_uint32)),
)
_WINMM: Final = (("timeBeginPeriod", c_uint32, (c_uint32,)),)


class WindowsApi:
    """The functions that are used; any thread.

    Parameters
    ----------
    kernel32, winmm : ctypes.WinDLL or object
        The libraries, or what has their functions as ctypes function pointers.
    last_error : callable
        Returns the error code of this thread's last call.
    handle_of : callable
        Returns the handle of a file's descriptor.
    """

    def __init__(
        self,
        kernel32: Any,
        winmm: Any,
        last_error: Callable[[], int],
        handle_of: Callable[[int], int],
    ) -> None:
        self._calls: dict[str, Any] = {}
        for library, functions in ((kernel32, _KERNEL32), (winmm, _WINMM)):
            for name, result, arguments in functions:
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
                self._calls[name] = function
        self._last_error = last_error
        self._handle_of = handle_of

    def process_start(self, pid: int) -> str | None:
        """Return when a process began; empty when it has ended, None when that is kept from us."""
        rights = PROCESS_QUERY_LIMITED_INFORMATION | SYNCHRONIZE
        handle = self._calls["OpenProcess"](rights, 0, pid)
        if not handle:
            return "" if self._last_error() == ERROR_INVALID_PARAMETER else None
        try:
            # A process that has ended is kept while anybody has it open.
            if self._calls["WaitForSingleObject"](handle, 0) == WAIT_OBJECT_0:
                return ""
            begun, ended, kernel, user = c_int64(), c_int64(), c_int64(), c_int64()
            times = (byref(begun), byref(ended), byref(kernel), byref(user))
            return str(begun.value) if self._calls["GetProcessTimes"](handle, *times) else None
        finally:
            self._calls["CloseHandle"](handle)

    def lock_file(self, descriptor: int, *, alone: bool) -> bool:
        """Lock a file in place of an earlier lock; False where somebody else has it."""
        handle = self._handle_of(descriptor)
        self._calls["UnlockFileEx"](handle, 0, 1, 0, byref(_locked_byte()))
        how = LOCKFILE_FAIL_IMMEDIATELY | (LOCKFILE_EXCLUSIVE_LOCK if alone else 0)
        if self._calls["LockFileEx"](handle, how, 0, 1, 0, byref(_locked_byte())):
            return True
        return self._last_error() != ERROR_LOCK_VIOLATION  # else it is a disk without locks

    def run_thread_first(self) -> str:
        """Let the calling thread run before all others; returns "" or why it does not."""
        thread = self._calls["GetCurrentThread"]()
        if self._calls["SetThreadPriority"](thread, THREAD_PRIORITY_TIME_CRITICAL):
            return ""
        return f"error {self._last_error()} of Windows"

    def tick_finely(self) -> bool:
        """Let waits of this process end at the millisecond instead of every 15.6 ms.

        In force until the process ends. Windows 11 would take it back from a program whose window
        is hidden, and is asked not to; older ones do not know that question.
        """
        fine = bool(self._calls["timeBeginPeriod"](TICK_MS) == 0)
        state = PowerThrottling(1, IGNORE_TIMER_RESOLUTION, 0)
        process = self._calls["GetCurrentProcess"]()
        self._calls["SetProcessInformation"](
            process, PROCESS_POWER_THROTTLING, byref(state), sizeof(state)
        )
        return fine


def _locked_byte() -> Overlapped:
    return Overlapped(Offset=LOCKED_BYTE & 0xFFFFFFFF, OffsetHigh=LOCKED_BYTE >> 32)


def load_windows_api() -> WindowsApi:
    """Load the libraries of this system.

    Raises
    ------
    NotAvailable
        It is not Windows.
    """
    if sys.platform == "win32":
        import ctypes
        import msvcrt

        return WindowsApi(
            ctypes.WinDLL("kernel32", use_last_error=True),
            ctypes.WinDLL("winmm", use_last_error=True),
            ctypes.get_last_error,
            msvcrt.get_osfhandle,
        )
    raise NotAvailable("this system is not Windows")
