"""`VisionThread`: runs machine vision on the newest picture, at the pace it can keep (V5)."""

from collections.abc import Callable
from threading import Condition
from typing import Final, Generic, TypeVar

from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.frame.failure import FailurePolicy
from cosmic.frame.listeners import tell
from cosmic.frame.threads import WorkerThread
from cosmic.vico.core.picture import Picture
from cosmic.vico.hw.interface import FrameStatus

T = TypeVar("T")

LOOK_S: Final = 0.2


class VisionThread(WorkerThread, Generic[T]):
    """Analyses pictures one at a time; those that arrive meanwhile are passed over but the newest.

    Parameters
    ----------
    analyse : callable
        From a picture to what was found in it, or None where nothing is to be done.
    """

    may_wait = False

    def __init__(
        self,
        name: str,
        analyse: Callable[[Picture], T | None],
        policy: FailurePolicy,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(f"vision {name}", policy, parent)
        self._analyse = analyse
        self._next: Picture | None = None
        self._newest: T | None = None
        self._passed_over = 0
        self._changed = Condition()
        self._listeners: tuple[Callable[[T], object], ...] = ()

    @property
    def newest(self) -> T | None:
        """What was found last; None before."""
        return self._newest

    @property
    def passed_over(self) -> int:
        """Pictures that nobody had time for."""
        return self._passed_over

    def subscribe(self, listener: Callable[[T], object]) -> None:
        """Call `listener(found)` after each picture, in this thread."""
        self._listeners = (*self._listeners, listener)

    def put(self, picture: Picture) -> None:
        """Offer a picture; any thread, returns at once."""
        if picture.frame.status is not FrameStatus.COMPLETE:
            return
        with self._changed:
            self._passed_over += self._next is not None
            self._next = picture
            self._changed.notify()

    def forget(self) -> None:
        """Forget what was found."""
        self._newest = None

    @override
    def run_body(self) -> None:
        while not self.end_requested:
            with self._changed:
                self._changed.wait_for(lambda: self._next or self.end_requested, LOOK_S)
                picture, self._next = self._next, None
            if picture is None:
                continue
            found = self._analyse(picture)
            self._newest = found
            if found is not None:
                tell(self._listeners, found)

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._changed:
            self._changed.notify()
