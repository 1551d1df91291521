"""The memory of the C library: in one piece, and given back to the system at a rest.

What is large (images, samples, buffers of libraries) comes from the allocator of the C library.
That of glibc gives threads that ask at the same time arenas of their own, eight for each core, and
no arena uses what was freed in another: each platform that was opened and closed left 15 MB of
such gaps behind. Other systems' allocators have their own ways; nothing is done there.

Knows no Qt. ctypes is used, as `cosmic.frame.windows_api` does, for the system's own library.
"""

import ctypes
import sys
from functools import cache
from typing import Any, Final

ARENA_MAX: Final = -8
"""M_ARENA_MAX of <malloc.h>."""


@cache
def _glibc() -> Any:
    """Return the library of this process if it is glibc, else None."""
    if sys.platform != "linux":
        return None
    library = ctypes.CDLL(None)
    return library if hasattr(library, "gnu_get_libc_version") else None


def share_one_arena() -> bool:
    """Have all threads take memory from one piece, from now on; False: the system decides.

    Call it before there are many threads: an arena that exists is used further.
    """
    library = _glibc()
    return library is not None and bool(library.mallopt(ARENA_MAX, 1))


def give_memory_back() -> bool:
    """Give the system whole pages that were freed; False: it is not asked. Any thread.

    It takes 2 to 6 ms on a large program, in which other threads may wait for memory: for moments
    when nothing moves.
    """
    library = _glibc()
    if library is None:
        return False
    library.malloc_trim(0)
    return True
