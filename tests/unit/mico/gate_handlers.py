"""Questions that the gate's process is told to answer badly; loaded in that process only."""

import gc
import os
import signal
import sys
import threading

from cosmic.frame.helper_process import encode
from cosmic.mico.core.collision.sweep import Sweep

HANDLERS = {
    name: f"unit.mico.gate_handlers:{name}"
    for name in (
        "echo",
        "hang",
        "crash",
        "rubbish",
        "half",
        "endless",
        "say",
        "loaded",
        "frozen",
        "fail",
    )
}


def _write(data: bytes) -> None:
    os.write(int(sys.argv[1]), data)


def _frame(message: bytes) -> bytes:
    return len(message).to_bytes(4, "big") + message


def echo(sweep: Sweep, payload: object) -> object:
    return payload


def hang(sweep: Sweep, payload: object) -> None:
    threading.Event().wait(60.0)


def crash(sweep: Sweep, payload: object) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def rubbish(sweep: Sweep, payload: object) -> None:
    _write(_frame(b"rubbish"))


def half(sweep: Sweep, payload: object) -> None:
    _write(_frame(bytes(1000))[:500])
    hang(sweep, payload)


def endless(sweep: Sweep, payload: object) -> None:
    _write(b"\x7f\xff\xff\xff" + bytes(100))
    hang(sweep, payload)


def say(sweep: Sweep, payload: list[tuple[object, ...]]) -> str:
    """Write answers before the proper one."""
    for answer in payload:
        _write(_frame(encode(answer)))
    return "the proper answer"


def loaded(sweep: Sweep, payload: object) -> list[str]:
    return sorted({name.split(".")[0] for name in sys.modules})


def frozen(sweep: Sweep, payload: object) -> tuple[int, int]:
    """Return how many objects are frozen, and how many old ones are not."""
    return gc.get_freeze_count(), len(gc.get_objects(generation=2))


def fail(sweep: Sweep, payload: object) -> None:
    raise ValueError("no idea")
