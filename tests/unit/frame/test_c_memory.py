"""Threads share one piece of memory where glibc would give each its own."""

import subprocess
import sys

import pytest

from cosmic.frame.c_memory import give_memory_back, share_one_arena

CHILD = """
import ctypes, sys, threading
from cosmic.frame.c_memory import give_memory_back, share_one_arena
if "shared" in sys.argv:
    assert share_one_arena()
ready = threading.Barrier(6)
def fill():
    ready.wait()
    kept = [bytearray(50_000) for _ in range(200)]
    ready.wait()
threads = [threading.Thread(target=fill) for _ in range(6)]
for each in threads: each.start()
for each in threads: each.join()
assert give_memory_back()
ctypes.CDLL(None).malloc_stats()
"""
glibc = pytest.mark.skipif(sys.platform != "linux", reason="glibc's way")


def arenas(*arguments: str) -> int:
    """Return how many pieces of memory threads that allocate at once have made."""
    command = [sys.executable, "-c", CHILD, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    return sum(line.startswith("Arena") for line in done.stderr.splitlines())


@glibc
def test_threads_share_one_arena() -> None:
    assert arenas("shared") == 1
    assert arenas() > 1


@pytest.mark.parametrize("system", ["win32", "darwin"])
def test_other_systems_decide_by_themselves(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from cosmic.frame import c_memory

    c_memory._glibc.cache_clear()
    monkeypatch.setattr(sys, "platform", system)
    try:
        assert not share_one_arena()
        assert not give_memory_back()
    finally:
        c_memory._glibc.cache_clear()
