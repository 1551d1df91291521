"""The program of the gate's own process: answers questions about the scene, one at a time.

``python -m cosmic.mico.core.collision.helper PIPE [KIND=MODULE:FUNCTION ...]``; the scene comes
as a pickle on the standard input. Started by `GateProcess`, never by hand. It ends when the pipe
closes, so that it outlives nobody.
"""

import faulthandler
import pickle
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any, Final

from cosmic.frame.garbage import freeze_what_is_loaded
from cosmic.frame.helper_process import READY, End, encode
from cosmic.frame.platform_services import end_process_after
from cosmic.mico.core.collision.answer import Approach, SweepAnswer
from cosmic.mico.core.collision.checker import unpack_spans
from cosmic.mico.core.collision.clear_travel import clear_travel
from cosmic.mico.core.collision.sweep import Sweep

Handler = Callable[[Sweep, Any], object]

IDLE_S: Final = 0.3
"""So long without a first question, and what is seldom needed is loaded."""
ORPHAN_S: Final = 5.0
"""How long after the question's time limit it ends itself, should nobody be left to end it."""


def _check(sweep: Sweep, payload: Any) -> SweepAnswer:
    spans, ignored = payload
    return sweep.check(unpack_spans(spans), ignored)


def _nearest(sweep: Sweep, payload: Any) -> Approach | None:
    positions, ignored = payload
    return sweep.nearest(positions, ignored)


def _clear_travel(sweep: Sweep, payload: Any) -> float | None:
    spans, axis, ignored = payload
    return clear_travel(sweep, unpack_spans(spans), axis, ignored)


HANDLERS: Final[Mapping[str, Handler]] = {
    "check": _check,
    "nearest": _nearest,
    "clear_travel": _clear_travel,
}


def load_handlers(arguments: Sequence[str]) -> dict[str, Handler]:
    """Return the handlers by kind of question, with those named "KIND=MODULE:FUNCTION"."""
    handlers = dict(HANDLERS)
    for argument in arguments:
        kind, _, place = argument.partition("=")
        module, _, function = place.partition(":")
        handlers.setdefault(kind, getattr(import_module(module), function))
    return handlers


def serve(pipe: End, sweep: Sweep, handlers: Mapping[str, Handler]) -> None:
    """Answer until the other end closes."""
    if not pipe.poll(IDLE_S):
        import_module("scipy.spatial")  # seldom needed, slow to load: now nobody waits for it
    while True:
        number, kind, payload, limit_s = pickle.loads(pipe.recv_bytes())
        end_process_after(limit_s + ORPHAN_S)
        try:
            message = encode((number, True, handlers[kind](sweep, payload)))
        except Exception as exc:  # noqa: BLE001 - told to the one who asked, who refuses
            message = encode((number, False, f"{type(exc).__name__}: {exc}"))
        end_process_after(0.0)
        pipe.send_bytes(message)


def main(arguments: Sequence[str]) -> int:
    """Load the scene, say that it is ready, answer; returns the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C in a console is meant for the parent
    faulthandler.enable()
    pipe = End(int(arguments[0]))
    try:
        sweep = Sweep(pickle.load(sys.stdin.buffer))
        handlers = load_handlers(arguments[1:])
        freeze_what_is_loaded()  # the scene stays: nothing to look through at every collection
        pipe.send_bytes(encode((READY, True, None)))
        serve(pipe, sweep, handlers)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return 0
    except Exception as exc:
        text = f"it could not load the scene: {type(exc).__name__}: {exc}"
        pipe.send_bytes(encode((READY, False, text)))
        raise
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
