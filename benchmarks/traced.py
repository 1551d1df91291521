"""A library object that tells when its functions are called, and passes everything on."""

import time
from collections.abc import Callable
from typing import Any

from cosmic.mico.hw.scu3d_ctypes import python_function

Hook = Callable[[float, tuple[Any, ...]], None]


class TracedLibrary:
    """Stands in front of a simulated library; hooks may be set and taken away at any time.

    Attributes
    ----------
    entered : dict
        By C name: called with time and arguments before the function.
    left : dict
        By C name: called with time and arguments after the function.
    lets_go : bool
        Every call gives the interpreter up once, as one into a library in C does.
    cpu_s : float
        CPU time spent in the library's functions, where `count_cpu` is set.
    """

    def __init__(self, library: Any, *, count_cpu: bool = False) -> None:
        self._library = library
        self._count_cpu = count_cpu
        self._cpu_s: dict[str, float] = {}
        self.entered: dict[str, Hook] = {}
        self.left: dict[str, Hook] = {}
        self.lets_go = False

    @property
    def keeps_interpreter(self) -> bool:
        """No call lets another thread of Python in."""
        return not self.lets_go

    @property
    def cpu_s(self) -> float:
        """CPU seconds spent in the functions so far."""
        return sum(self._cpu_s.copy().values())

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._library, name)
        if not name.startswith("SA_"):
            return False if name == "in_python" else found  # what is handed out is no C function
        if getattr(self._library, "in_python", False):
            found = python_function(name, found)
        return self._counted(name, found) if self._count_cpu else self._timed(name, found)

    def _timed(self, name: str, function: Callable[..., int]) -> Callable[..., int]:
        def call(*args: Any) -> int:
            hook = self.entered.get(name)
            if hook is not None:
                hook(time.perf_counter(), args)
            status = function(*args)
            if self.lets_go:
                time.sleep(0.0)
            hook = self.left.get(name)
            if hook is not None:
                hook(time.perf_counter(), args)
            return status

        return call

    def _counted(self, name: str, function: Callable[..., int]) -> Callable[..., int]:
        def call(*args: Any) -> int:
            before_s = time.thread_time()
            status = function(*args)
            spent_s = time.thread_time() - before_s
            self._cpu_s[name] = self._cpu_s.get(name, 0.0) + spent_s
            return status

        return call
