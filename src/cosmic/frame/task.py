"""Something that takes a while: how far it is, and a way to end it early."""

from collections.abc import Callable
from dataclasses import dataclass
from threading import Condition, RLock

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceTimeout
from cosmic.frame.listeners import tell
from cosmic.frame.threads import forbid_waiting_here


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a task is.

    Attributes
    ----------
    title : str
        What is being done, such as "Initialisation".
    text : str
        What it is at.
    fraction : float
        0 to 1.
    elapsed_s, left_s : float or None
        Wall time; `left_s` is None while nothing can be said.
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


class Task:
    """A long operation; any thread. Whoever carries it out polls `cancel_requested`."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._changed = Condition()
        self._telling = RLock()
        self._started_s = WALL.now_s()
        self._text = ""
        self._fraction = 0.0
        self._done = False
        self._error: Exception | None = None
        self._cancel_requested = False
        self._on_cancel: tuple[Callable[[], None], ...] = ()
        self._listeners: tuple[Callable[[Progress], None], ...] = ()

    @property
    def title(self) -> str:
        """What is being done."""
        return self._title

    @property
    def done(self) -> bool:
        """True when it has ended, well or not."""
        return self._done

    @property
    def cancel_requested(self) -> bool:
        """True once `cancel` was called."""
        return self._cancel_requested

    @property
    def failure(self) -> Exception | None:
        """What it failed with; None while it runs, and when it ended well."""
        return self._error

    @property
    def progress(self) -> Progress:
        """How far it is now."""
        elapsed_s = WALL.now_s() - self._started_s
        left_s = elapsed_s * (1 / self._fraction - 1) if self._fraction > 0.05 else None
        return Progress(
            title=self._title,
            text=self._text,
            fraction=self._fraction,
            elapsed_s=elapsed_s,
            left_s=left_s,
            done=self._done,
            error=str(self._error) if self._error else "",
        )

    def subscribe(self, listener: Callable[[Progress], None]) -> None:
        """Call `listener(progress)` at each step, one at a time, in the thread that makes it.

        It is called at once with what has been reported so far.
        """
        with self._telling:
            self._listeners = (*self._listeners, listener)
            tell([listener], self.progress)

    def cancel(self) -> None:
        """Ask it to end; what it has set in motion is stopped."""
        with self._changed:
            self._cancel_requested = True
            actions = self._on_cancel
        if not self._done:
            for action in actions:
                action()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the end; raises what it failed with.

        Raises
        ------
        DeviceTimeout
            It had not ended after `timeout_s` of wall time; it goes on.
        WrongThreadError
            Called in the GUI thread.
        """
        if not self._done:
            forbid_waiting_here(f"waiting for {self._title!r}")
        with self._changed:
            if not self._changed.wait_for(lambda: self._done, timeout_s):
                raise DeviceTimeout(f"{self._title} had not ended after {timeout_s:g} s")
        if self._error is not None:
            raise self._error

    # For whoever carries it out

    def on_cancel(self, action: Callable[[], None]) -> None:
        """Call `action` when it is cancelled, or now if it was."""
        with self._changed:
            self._on_cancel = (*self._on_cancel, action)
            cancelled = self._cancel_requested
        if cancelled:
            action()

    def report(self, fraction: float, text: str) -> None:
        """Say how far it is."""
        self._fraction, self._text = min(max(fraction, 0.0), 1.0), text
        self._tell()

    def finish(self) -> None:
        """End it well."""
        self._fraction = 1.0
        self._end(None)

    def fail(self, error: Exception) -> None:
        """End it badly."""
        self._end(error)

    def _end(self, error: Exception | None) -> None:
        with self._changed:
            self._error, self._done = error, True
            self._changed.notify_all()
        self._tell()

    def _tell(self) -> None:
        with self._telling:
            tell(self._listeners, self.progress)
