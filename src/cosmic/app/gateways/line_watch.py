"""`keep_watch`: the system finds a line whose other end is gone without a word."""

import socket
from contextlib import suppress
from typing import Final

_ALIVE_S: Final = 1
"""How long a line may be silent until the system looks whether its other end is there."""
_MOST_MISSED: Final = 2


def keep_watch(line: socket.socket | None) -> None:
    """Have the system end a line within 3 s of a cut, also one that only waits.

    A program that is frozen is not found so: its system answers for it.
    """
    options = (
        ("SO_KEEPALIVE", socket.SOL_SOCKET, 1),
        ("TCP_KEEPIDLE", socket.IPPROTO_TCP, _ALIVE_S),
        ("TCP_KEEPINTVL", socket.IPPROTO_TCP, _ALIVE_S),
        ("TCP_KEEPCNT", socket.IPPROTO_TCP, _MOST_MISSED),
        ("TCP_USER_TIMEOUT", socket.IPPROTO_TCP, 1000 * _ALIVE_S * (_MOST_MISSED + 1)),
    )
    for name, level, value in options:
        option = getattr(socket, name, None)  # not every system has all of them
        if option is not None and line is not None:
            with suppress(OSError):
                line.setsockopt(level, option, value)
