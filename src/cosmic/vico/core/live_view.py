"""The images of a camera as views at other stations show them."""

from collections.abc import Callable
from threading import Lock

from cosmic.frame.events import Unsubscribe
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.delivery import Backlog, InboxReader
from cosmic.frame.network.transport import Rule
from cosmic.vico.core.image import CameraImage
from cosmic.vico.hw.interface import FrameStatus

Viewer = tuple[Callable[[CameraImage], object], Callable[[], bool]]


class LiveView:
    """Corrects the newest image and hands it on in a thread of its own, while it is wanted.

    Parameters
    ----------
    correct : callable
        Makes of an image what is shown.
    """

    def __init__(
        self, name: str, correct: Callable[[CameraImage], CameraImage], policy: FailurePolicy
    ) -> None:
        self._correct = correct
        self._lock = Lock()
        self._viewers: tuple[Viewer, ...] = ()
        self._newest: Backlog[CameraImage] = Backlog(Rule.LATEST)
        self._thread = InboxReader(f"view of {name}", policy, self._newest, self._view)

    def subscribe(
        self, receiver: Callable[[CameraImage], object], wanted: Callable[[], bool]
    ) -> Unsubscribe:
        """Call `receiver(image)` with the newest, while it is `wanted`; any thread."""
        viewer = (receiver, wanted)
        with self._lock:
            self._viewers = (*self._viewers, viewer)

        def end() -> None:
            with self._lock:
                self._viewers = tuple(each for each in self._viewers if each is not viewer)

        return end

    def put(self, image: CameraImage) -> None:
        """Offer an image; returns at once."""
        if image.frame.status is not FrameStatus.COMPLETE:
            return
        if any(wanted() for _, wanted in self._viewers):
            self._newest.put(image)

    def start(self) -> None:
        """Begin to hand on what comes."""
        self._thread.start()

    def request_end(self) -> None:
        """Ask the thread to end; returns at once."""
        self._thread.request_end()

    def join(self) -> None:
        """Wait until it has ended."""
        self._thread.join()

    def _view(self, image: CameraImage) -> None:
        shown = self._correct(image)
        for receiver, wanted in self._viewers:
            if wanted():
                receiver(shown)
