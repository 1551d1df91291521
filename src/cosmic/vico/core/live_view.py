"""The pictures of a camera as views at other stations show them."""

from collections.abc import Callable
from threading import Lock

from cosmic.frame.events import Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.delivery import Backlog, InboxReader
from cosmic.frame.network.transport import Rule
from cosmic.vico.core.picture import Picture
from cosmic.vico.hw.interface import FrameStatus

Viewer = tuple[Callable[[Picture], object], Callable[[], bool]]


class LiveView:
    """Corrects the newest picture and hands it on in a thread of its own, while it is wanted.

    Parameters
    ----------
    correct : callable
        Makes of a picture what is shown.
    """

    def __init__(
        self, name: str, correct: Callable[[Picture], Picture], policy: FailurePolicy
    ) -> None:
        self._correct = correct
        self._lock = Lock()
        self._viewers: tuple[Viewer, ...] = ()
        self._newest: Backlog[Picture] = Backlog(Rule.LATEST)
        self._thread = InboxReader(f"view of {name}", policy, self._newest, self._view)

    def subscribe(
        self, receiver: Callable[[Picture], object], wanted: Callable[[], bool]
    ) -> Unsubscribe:
        """Call `receiver(picture)` with the newest, while it is `wanted`; any thread."""
        viewer = (receiver, wanted)
        with self._lock:
            self._viewers = (*self._viewers, viewer)

        def end() -> None:
            with self._lock:
                self._viewers = tuple(each for each in self._viewers if each is not viewer)

        return end

    def put(self, picture: Picture) -> None:
        """Offer a picture; returns at once."""
        if picture.frame.status is not FrameStatus.COMPLETE:
            return
        if any(wanted() for _, wanted in self._viewers):
            self._newest.put(picture)

    def start(self) -> None:
        """Begin to hand on what comes."""
        self._thread.start()

    def request_end(self) -> None:
        """Ask the thread to end; returns at once."""
        self._thread.request_end()

    def join(self) -> None:
        """Wait until it has ended."""
        self._thread.join()

    def _view(self, picture: Picture) -> None:
        shown = self._correct(picture)
        for receiver, wanted in self._viewers:
            if wanted():
                receiver(shown)
