"""The program of the process that draws the twin's images, one after the other.

``python -m cosmic.twin.optics.drawing_helper PIPE``; started by `DrawingProcess`, never by hand.
It ends when the pipe closes.
"""

import pickle
import signal
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import cv2

from cosmic.frame.arrays import Pixels
from cosmic.frame.garbage import freeze_what_is_loaded
from cosmic.frame.helper_process import READY, End, encode
from cosmic.frame.platform_services import run_in_background
from cosmic.twin.optics.drawing import make_views

if TYPE_CHECKING:
    from cosmic.twin.optics.subjects import Lying
    from cosmic.twin.optics.view import View


NICE: Final = 10
"""A process that holds the interpreter of the platform must not wait for a core that draws."""


class Studio:
    """The views of all scenes, by number, with what lay on their plates last."""

    def __init__(self) -> None:
        self._views: dict[int, dict[str, View]] = {}
        self._lying: dict[int, tuple[Lying, ...]] = {}

    def answer(self, kind: str, payload: Any) -> Pixels | None:
        """Do what a message asks for."""
        if kind == "set":
            number, settings, seed = payload
            self._views[number] = make_views(settings, seed)
            return None
        if kind == "end":
            self._views.pop(payload, None)
            self._lying.pop(payload, None)
            return None
        number, view, shot, lying = payload
        if lying is not None:
            self._lying[number] = lying
        subject = replace(shot.subject, lying=self._lying[number])
        return self._views[number][view].draw(replace(shot, subject=subject))


def serve(pipe: End) -> None:
    """Answer until the other end closes."""
    studio = Studio()
    while True:
        number, kind, payload, _ = pickle.loads(pipe.recv_bytes())
        try:
            message = encode((number, True, studio.answer(kind, payload)))
        except Exception as exc:  # noqa: BLE001 - told to the one who asked
            message = encode((number, False, f"{type(exc).__name__}: {exc}"))
        pipe.send_bytes(message)


def main(arguments: list[str]) -> int:
    """Say that it is ready, and draw; returns the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C in a console is meant for the parent
    run_in_background(NICE)
    cv2.setNumThreads(1)  # the other cores belong to whoever commands the platform
    pipe = End(int(arguments[0]))
    try:
        freeze_what_is_loaded()
        pipe.send_bytes(encode((READY, True, None)))
        serve(pipe)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return 0
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
