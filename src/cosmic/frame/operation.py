"""`Operation`: something that takes a while, with its result, its progress and a way to end it."""

from collections.abc import Callable, Generator
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from threading import Condition, Lock, RLock
from typing import Any, ClassVar, Final, Generic, Self, TypeVar

from typing_extensions import override

from cosmic.frame.arguments import checked
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceTimeout
from cosmic.frame.events import Event, Unsubscribe, notify
from cosmic.frame.threads import forbid_waiting_here

T = TypeVar("T")

LEFT_KNOWN_FRACTION: Final = 0.05
"""Earlier than this nothing is said about the time left."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far an operation is.

    Attributes
    ----------
    title : str
        What is being done, such as "Initialisation".
    text : str
        What it is at.
    fraction : float
        0 to 1.
    elapsed_s, left_s : float or None
        Time of the operation's clock; `left_s` is None while nothing can be said.
    done : bool
        It has ended.
    error : str
        Why it failed; empty when it did not.
    """

    title: str
    text: str
    fraction: float
    elapsed_s: float
    left_s: float | None
    done: bool
    error: str


class _Listeners:
    """Who hears how far an operation is, in order."""

    def __init__(self) -> None:
        self.order = RLock()
        self.progressed: Event[Progress] = Event()


class _Once:
    """What a future calls at its end, and then holds no longer: it keeps its callbacks for ever."""

    __slots__ = ("_action",)

    def __init__(self, action: Callable[[], object]) -> None:
        self._action: Callable[[], object] | None = action

    def __call__(self, _future: object) -> None:
        action, self._action = self._action, None
        if action is not None:
            action()


class Operation(Generic[T]):
    """A movement, a task, a call: something under way that ends exactly once; any thread.

    It needs no event loop to end, and can be awaited in one. It has the shape of a bluesky status:
    `done`, `success`, `exception()`, `add_callback`.

    Parameters
    ----------
    title : str
        What it is, as messages name it.
    clock : Clock
        By which time-outs and progress are counted: `WALL` for the patience of a person or a
        peer, the platform's where physics sets the pace.
    """

    _text = ""
    _fraction = 0.0
    _cancel_requested = False
    _on_cancel: tuple[Callable[[], object], ...] = ()
    _done = False
    _listeners: "_Listeners | None" = None
    _future: Future[T] | None = None
    sent_kind: ClassVar[Any] = None
    """What is told of its result to another process; None: what its annotation names."""

    @classmethod
    def followed(cls, title: str) -> "Operation[Any]":
        """Return one that stands for another of its kind, which goes on elsewhere."""
        return Operation(title)

    def sent_result(self) -> object:
        """Return what is told of its result to another process; raises as `result`."""
        return self.result

    def finish_as_sent(self, sent: Any) -> bool:
        """End well as the one did of which `sent_result` was told."""
        return self.finish(sent)

    def __init__(self, title: str, *, clock: Clock = WALL) -> None:
        self._title = title
        self._clock = clock
        self._began_s = clock.now_s()
        self._lock = Lock()  # only held to change what is here, so that `cancel` never waits

    @override
    def __repr__(self) -> str:
        if not self.done:
            return f"<{self._title}: running>"
        return f"<{self._title}: {self.failure or 'done'}>"

    # For whoever waits for it

    @property
    def title(self) -> str:
        """What it is."""
        return self._title

    @property
    def done(self) -> bool:
        """True when it has ended, well or not."""
        return self._done

    @property
    def success(self) -> bool:
        """True when it has ended well."""
        return self.done and self.failure is None

    @property
    def failure(self) -> Exception | None:
        """What it failed with; None while it runs, and when it ended well."""
        return self.exception() if self.done else None

    @property
    def cancel_requested(self) -> bool:
        """True once `cancel` was called."""
        return self._cancel_requested

    def exception(self, timeout: float | None = 0.0) -> Exception | None:
        """Return why it failed, or None; waits up to `timeout` seconds (None: for ever).

        The parameter has bluesky's name, which gives it by that.

        Raises
        ------
        DeviceTimeout
            It had not ended by then.
        WrongThreadError
            Called in the GUI thread, which must never wait.
        """
        if not self._done:
            self._await_end(timeout)
        error = self._end.exception()  # it is there, or will be at once
        assert error is None or isinstance(error, Exception)
        return error

    def wait(self, timeout_s: float | None = None) -> T:
        """Wait for the end and return the result; raises what it failed with.

        Raises
        ------
        DeviceTimeout
            It had not ended after `timeout_s`; it goes on.
        WrongThreadError
            Called in the GUI thread, which must never wait.
        """
        error = self.exception(timeout_s)
        if error is not None:
            raise error
        return self._end.result()

    def __await__(self) -> Generator[Any, None, T]:
        """Wait for the end in an event loop of asyncio, which goes on meanwhile.

        A task that is cancelled while it awaits the operation cancels it, so that nothing moves
        for somebody who is gone. In a thread with an event loop.
        """
        import asyncio  # here, for most programs do without

        loop = asyncio.get_running_loop()
        ended: asyncio.Future[None] = loop.create_future()

        def note_end() -> None:
            if not ended.done():
                ended.set_result(None)

        def wake(_future: object) -> None:
            with suppress(RuntimeError):  # the loop was closed
                loop.call_soon_threadsafe(note_end)

        self._end.add_done_callback(wake)
        try:
            yield from ended
        except asyncio.CancelledError:
            self.cancel()
            raise
        return self.result

    @property
    def result(self) -> T:
        """What it ended with; raises what it failed with, and `DeviceTimeout` while it runs."""
        return self.wait(0.0)

    def cancel(self) -> None:
        """Ask it to end; what it has set in motion is stopped. Harmless once it has ended."""
        with self._lock:
            self._cancel_requested = True
            actions = self._on_cancel
        if not self.done:
            for action in actions:
                action()

    def add_callback(self, callback: Callable[[Self], object]) -> None:
        """Call `callback(operation)` at the end, in the thread that ends it, or now.

        It must return at once.
        """
        self._end.add_done_callback(_Once(partial(notify, callback, self)))

    def when_failed(self, callback: Callable[[CosmicError], object]) -> None:
        """Call `callback(error)` once it fails by what is foreseen; a defect is told elsewhere."""

        def look(ended: Self) -> None:
            if isinstance(ended.failure, CosmicError):
                callback(ended.failure)

        self.add_callback(look)

    def subscribe(self, subscriber: Callable[[Progress], object]) -> Unsubscribe:
        """Call `subscriber(progress)` at each step, one at a time, in the thread that makes it.

        It is called at once with what has been reported so far, and last when all is over.
        """
        with self._lock:
            listeners = self._listeners = self._listeners or _Listeners()
        with listeners.order:
            notify(subscriber, self.progress)
            return listeners.progressed.subscribe(subscriber)

    @property
    def progress(self) -> Progress:
        """How far it is now."""
        done, error = self.done, self.failure
        fraction = 1.0 if done and error is None else self._fraction
        elapsed_s = self._clock.now_s() - self._began_s
        left_s = elapsed_s * (1 / fraction - 1) if fraction > LEFT_KNOWN_FRACTION else None
        return Progress(
            title=self._title,
            text=self._text,
            fraction=fraction,
            elapsed_s=elapsed_s,
            left_s=left_s,
            done=done,
            error=str(error) if error else "",
        )

    # For whoever carries it out

    def on_cancel(self, action: Callable[[], object]) -> None:
        """Call `action` when it is cancelled, or now if it was."""
        with self._lock:
            if not self._done:
                self._on_cancel = (*self._on_cancel, action)
            cancelled = self._cancel_requested
        if cancelled:
            action()

    @checked
    def report(self, fraction: float, text: str) -> None:
        """Say how far it is."""
        self._fraction, self._text = min(max(fraction, 0.0), 1.0), text
        self._publish()

    def finish(self, result: T) -> bool:
        """End it well; False where it had ended before."""
        if not self._may_end():
            return False
        self._end.set_result(result)
        self._publish()
        return True

    def fail(self, error: Exception) -> bool:
        """End it badly; False where it had ended before."""
        if not self._may_end():
            return False
        self._end.set_exception(error)
        self._publish()
        return True

    @property
    def _end(self) -> Future[T]:
        """The future, made when it is first of use: who begins a movement does not wait for it."""
        future = self._future
        if future is None:
            with self._lock:
                future = self._future = self._future or Future()
        return future

    def _may_end(self) -> bool:
        with self._lock:
            first, self._done = not self._done, True
            self._on_cancel = ()  # they often hold what holds this, which only the collector frees
        return first

    def _publish(self) -> None:
        listeners = self._listeners
        if listeners is not None:
            with listeners.order:
                listeners.progressed.emit(self.progress)

    def _await_end(self, timeout_s: float | None) -> None:
        """Wait for the end; raises `DeviceTimeout`."""
        if timeout_s != 0.0:
            forbid_waiting_here(f"waiting for {self._title}")
        try:
            if timeout_s is None or self._clock is WALL:
                self._end.exception(timeout_s)
            else:
                self._await_until(self._clock.now_s() + timeout_s)
        except TimeoutError:
            raise DeviceTimeout(f"{self._title} had not ended after {timeout_s:g} s") from None

    def _await_until(self, until_s: float) -> None:
        """Wait until then on a clock that is not that of the wall; raises `TimeoutError`."""
        changed = Condition()

        def wake(_future: object) -> None:
            with changed:
                changed.notify_all()

        future = self._end
        future.add_done_callback(wake)
        with changed:
            while not future.done():
                if self._clock.now_s() >= until_s:
                    raise TimeoutError
                self._clock.wait(changed, until_s)


class Task(Operation[None]):
    """A long operation that has no result."""

    @classmethod
    @override
    def followed(cls, title: str) -> Self:
        return cls(title)

    @override
    def finish(self, result: None = None) -> bool:
        return super().finish(result)


def wait_or_cancel(operation: Operation[T]) -> T:
    """Wait as a script does: who is interrupted while it waits leaves nothing moving."""
    try:
        return operation.wait()
    except KeyboardInterrupt:
        operation.cancel()
        raise
