"""Calls to ViCo on another station, so that no window ever waits for the line."""

import logging
from collections.abc import Callable
from queue import SimpleQueue
from threading import Condition, Lock

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, NotAvailable, ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.ongoing import Ongoing
from cosmic.frame.network.transport import Transport
from cosmic.frame.task import Progress, Task
from cosmic.frame.threads import WorkerThread, may_wait_here
from cosmic.vico.api.station_state import APPLICATION

logger = logging.getLogger(__name__)

Job = Callable[[], object]


class CallThread(WorkerThread):
    """Carries out calls one after the other; `put` from any thread, returns at once."""

    def __init__(self, name: str, policy: FailurePolicy) -> None:
        super().__init__(name, policy)
        self._jobs: SimpleQueue[tuple[Job, Callable[[CosmicError], object]] | None] = SimpleQueue()
        self._putting = Lock()
        self._over = False

    def put(self, job: Job, refused: Callable[[CosmicError], object]) -> None:
        """Have `job` done; `refused` is called with the `CosmicError` that it raises."""
        with self._putting:
            over = self._over
            if not over:
                self._jobs.put((job, refused))
        if over:
            refused(NotAvailable("the connection to ViCo is closed"))

    @override
    def run_body(self) -> None:
        while True:
            item = self._jobs.get()
            if item is None:
                return
            job, refused = item
            if self.end_requested:
                refused(NotAvailable("the connection to ViCo is closed"))
                continue
            try:
                job()
            except CosmicError as exc:
                refused(exc)

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._putting:
            self._over = True
            self._jobs.put(None)


class RemoteCalls:
    """Calls to one station; any thread.

    A thread that may wait (a script) makes its calls itself and gets what they raise; for a window
    they are made elsewhere, and what goes wrong ends the task or is logged.

    Parameters
    ----------
    refresh : callable
        Asks the station how things stand; called after commands, so that whoever waited for one
        sees what it did.
    """

    def __init__(
        self, transport: Transport, policy: FailurePolicy, refresh: Callable[[], object]
    ) -> None:
        self.transport = transport
        self._refresh = refresh
        self._ordinary = CallThread("calls to ViCo", policy)
        self._urgent = CallThread("urgent calls to ViCo", policy)

    def start(self) -> None:
        """Begin to carry out what is put."""
        self._ordinary.start()
        self._urgent.start()

    def close(self) -> None:
        """Carry out no more; what waits fails."""
        for thread in (self._ordinary, self._urgent):
            thread.request_end()
        for thread in (self._ordinary, self._urgent):
            thread.join()

    def call(self, function: str, **arguments: object) -> object:
        """Call a function there and return its result; raises as `Transport.call`."""
        return self.transport.call(APPLICATION, function, arguments)

    def later(self, job: Job) -> None:
        """Have `job` done in the thread of the calls; what it raises is logged."""
        self._ordinary.put(job, _log)

    def do(
        self, function: str, *, refused: Callable[[CosmicError], object], **arguments: object
    ) -> None:
        """Call a function there; in a window `refused` hears why not, a script gets it raised."""

        def job() -> None:
            self.call(function, **arguments)
            self._refresh()

        if may_wait_here():
            job()
        else:
            self._ordinary.put(job, refused)

    def urgently(self, function: str) -> None:
        """Call a function that overtakes everything, such as a stop; returns at once."""
        self._urgent.put(lambda: self.call(function), _log)

    def begin(self, title: str, function: str, **arguments: object) -> Task:
        """Begin something that takes its time there, and return a task that follows it."""
        task = Task(title)

        def job() -> None:
            result = self.call(function, **arguments)
            if isinstance(result, Ongoing):
                self._follow(result, task)
            else:
                self._refresh()
                task.finish()

        if may_wait_here():
            job()
        else:
            self._ordinary.put(job, task.fail)
        return task

    def _follow(self, ongoing: Ongoing, task: Task) -> None:
        def on_progress(progress: Progress) -> None:
            if progress.done:
                on_end()
            else:
                task.report(progress.fraction, progress.text)

        def on_end(*_: object) -> None:
            # Not here: this thread has to hear of the ends of others as well.
            self._ordinary.put(lambda: self._end(ongoing, task), task.fail)

        subscribe = getattr(ongoing, "subscribe", None)
        add_callback = getattr(ongoing, "add_callback", None)
        if subscribe is not None:
            subscribe(on_progress)
        if add_callback is not None:
            add_callback(on_end)
        task.on_cancel(lambda: self._urgent.put(ongoing.cancel, _log))

    def _end(self, ongoing: Ongoing, task: Task) -> None:
        if task.done:
            return
        try:
            self._refresh()
        except CosmicError as exc:
            logger.debug("how ViCo stands is not known: %s", exc)
        try:
            ongoing.wait(0.0)
        except Exception as exc:  # noqa: BLE001 - whoever carried it out has reported it
            task.fail(exc)
        else:
            task.finish()


class StationClock(Clock):
    """The platform's clock at a station, asked over the line.

    Parameters
    ----------
    rate : callable
        Returns how fast it runs.
    """

    def __init__(self, calls: RemoteCalls, rate: Callable[[], float]) -> None:
        self._calls, self._rate = calls, rate

    @property
    @override
    def rate(self) -> float:
        return self._rate()

    @override
    def now_s(self) -> float:
        now_s = self._calls.call("now_s")
        if not isinstance(now_s, float):
            raise ProtocolError(f"the station's clock reads {now_s!r}")
        return now_s

    @override
    def wait(self, condition: Condition, until_s: float) -> None:
        WALL.wait(condition, WALL.now_s() + (until_s - self.now_s()) / (self.rate or 1.0))

    @override
    def sleep(self, duration_s: float) -> None:
        WALL.sleep(duration_s / (self.rate or 1.0))


def _log(error: CosmicError) -> None:
    logger.warning("ViCo elsewhere: %s", error)
