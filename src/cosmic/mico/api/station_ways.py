"""A search for a way, followed from another process."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from cosmic.frame.errors import CosmicError
from cosmic.frame.operation import Progress, Task
from cosmic.mico.api.ways import Way

if TYPE_CHECKING:
    from cosmic.mico.api.application import MicoApplication


class WaySearch:
    """Looks for a way in the application's thread; `wait` returns it. Any thread."""

    def __init__(
        self, application: "MicoApplication", targets: Mapping[str, float], budget_s: float
    ) -> None:
        self._application = application
        self._targets, self._budget_s = dict(targets), budget_s
        self._way: Way | None = None
        self._task = application.begin("Looking for a way", self._search)

    @property
    def title(self) -> str:
        """What is being done."""
        return self._task.title

    @property
    def done(self) -> bool:
        """True when it has ended."""
        return self._task.done

    def cancel(self) -> None:
        """Nobody waits for it any more; it ends by itself when its time is over."""
        self._task.cancel()

    def subscribe(self, listener: Callable[[Progress], None]) -> None:
        """Call `listener(progress)` at each step."""
        self._task.subscribe(listener)

    def wait(self, timeout_s: float | None = None) -> Way | None:
        """Wait for the end and return the way; raises why there is none."""
        self._task.wait(timeout_s)
        return self._way

    def _search(self, task: Task) -> None:
        try:
            self._way = self._application.find_way(self._targets, self._budget_s)
        except CosmicError as exc:
            task.fail(exc)
        else:
            task.finish()
