"""`VisionThread`: runs machine vision on the newest image, at the pace it can keep (V5)."""

import math
from collections.abc import Callable
from threading import Condition
from typing import Final, Generic, TypeVar

from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread, may_wait_here
from cosmic.vico.core.image import CameraImage
from cosmic.vico.hw.interface import FrameStatus

T = TypeVar("T")

LOOK_S: Final = 0.2
LOOKED_S: Final = 1.0
"""So long after somebody looked, images are analysed for the next look, wall time."""
WAIT_S: Final = 1.0
"""How long the first look waits for what it asks for, wall time."""


class VisionThread(WorkerThread, Generic[T]):
    """Analyses images one at a time; those that arrive meanwhile are passed over but the newest.

    It does so while somebody listens or looks again and again, and else not at all.

    Parameters
    ----------
    analyse : callable
        From an image to what was found in it, or None where nothing is to be done.
    """

    may_wait = False

    def __init__(
        self,
        name: str,
        analyse: Callable[[CameraImage], T | None],
        policy: FailurePolicy,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(f"vision {name}", policy, parent)
        self._analyse = analyse
        self._next: CameraImage | None = None
        self._newest: T | None = None
        self._passed_over = 0
        self._looked_s = -math.inf
        self._analysed = 0
        self._changed = Condition()
        self._found: Event[T] = Event()
        self._wanted: tuple[Callable[[], bool], ...] = ()

    @property
    def newest(self) -> T | None:
        """What was found last; None before.

        Who looks for the first time in a while waits for the newest image to be analysed, or
        gets None where nothing may wait.
        """
        awake, self._looked_s = self.awake, WALL.now_s()
        if awake:
            return self._newest
        with self._changed:
            self._changed.notify_all()
            if self._next is None or not self.isRunning():
                return self._newest
            if not may_wait_here():
                return None
            before = self._analysed
            self._changed.wait_for(lambda: self._analysed != before or self.end_requested, WAIT_S)
        return self._newest

    @property
    def awake(self) -> bool:
        """True while images are analysed, because somebody wants to know."""
        return WALL.now_s() - self._looked_s < LOOKED_S or any(wanted() for wanted in self._wanted)

    @property
    def passed_over(self) -> int:
        """Images that nobody had time for."""
        return self._passed_over

    def subscribe(
        self, listener: Callable[[T], object], wanted: Callable[[], bool] = lambda: True
    ) -> None:
        """Call `listener(found)` after each image, in this thread, while it is `wanted`."""

        def hear(found: T) -> None:
            if wanted():
                listener(found)

        self._wanted = (*self._wanted, wanted)
        self._found.subscribe(hear)

    def put(self, image: CameraImage) -> None:
        """Offer an image; any thread, returns at once."""
        if image.frame.status is not FrameStatus.COMPLETE:
            return
        awake = self.awake
        with self._changed:
            self._passed_over += awake and self._next is not None
            self._next = image
            if awake:
                self._changed.notify_all()

    def forget(self) -> None:
        """Forget what was found."""
        self._newest = None

    @override
    def run_body(self) -> None:
        while not self.end_requested:
            with self._changed:
                self._changed.wait_for(self._due, LOOK_S)
                if not self._due():
                    continue
                image, self._next = self._next, None
            if image is None:
                continue
            found = self._analyse(image)
            with self._changed:
                self._newest = found
                self._analysed += 1
                self._changed.notify_all()
            if found is not None:
                self._found.emit(found)

    def _due(self) -> bool:
        return self.end_requested or (self._next is not None and self.awake)

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._changed:
            self._changed.notify_all()
