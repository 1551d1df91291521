"""A movement under way, as seen by whoever asked for it."""

from collections.abc import Callable
from threading import Condition

from typing_extensions import override

from cosmic.frame.errors import DeviceTimeout
from cosmic.frame.listeners import tell
from cosmic.frame.threads import forbid_waiting_here


class Movement:
    """A future for one movement; any thread, and no event loop is needed to complete it.

    It has the shape of a bluesky status: `done`, `success`, `exception()`, `add_callback`.
    """

    def __init__(self) -> None:
        self._changed = Condition()
        self._done = False
        self._position: float | None = None
        self._error: Exception | None = None
        self._callbacks: list[Callable[[Movement], None]] = []
        self._halt: Callable[[], None] | None = None
        self._cancelled = False

    @override
    def __repr__(self) -> str:
        if not self._done:
            return "<Movement under way>"
        return f"<Movement ended: {self._error or 'at its target'}>"

    @property
    def done(self) -> bool:
        """True when it has ended, well or not."""
        return self._done

    @property
    def success(self) -> bool:
        """True when it has ended at its target."""
        return self._done and self._error is None

    @property
    def cancelled(self) -> bool:
        """True once `cancel` was called."""
        return self._cancelled

    def exception(self, timeout: float | None = 0.0) -> Exception | None:
        """Return why it failed, or None; waits up to `timeout` seconds (None: for ever).

        The parameter has bluesky's name, which gives it by that.

        Raises
        ------
        DeviceTimeout
            It had not ended after `timeout` seconds of wall time.
        """
        self._wait(timeout)
        return self._error

    def wait(self, timeout_s: float | None = None) -> float | None:
        """Wait for the end and return the position reached (None without a sensor).

        Raises
        ------
        MoveRefused
            The gate refused it, or a stop ended it (`StoppedError`).
        MoveCancelled
            It was cancelled or replaced by a newer command.
        DeviceError
            It failed at the hardware.
        DeviceTimeout
            It had not ended after `timeout_s` of wall time; it goes on.
        WrongThreadError
            Called in the GUI thread, which must never wait.
        """
        self._wait(timeout_s)
        if self._error is not None:
            raise self._error
        return self._position

    def _wait(self, timeout_s: float | None) -> None:
        if not self._done and timeout_s != 0.0:
            forbid_waiting_here("waiting for a movement")
        with self._changed:
            if not self._changed.wait_for(lambda: self._done, timeout_s):
                raise DeviceTimeout(f"the movement had not ended after {timeout_s:g} s")

    def cancel(self) -> None:
        """Stop this axis and give the movement up; harmless once it has ended."""
        with self._changed:
            self._cancelled = True
            halt = self._halt
        if halt is not None and not self._done:
            halt()

    def add_callback(self, callback: "Callable[[Movement], None]") -> None:
        """Call `callback(movement)` at the end, in the thread that ends it, or now.

        It must return at once: waiting there for a movement raises `WrongThreadError`.
        """
        with self._changed:
            if not self._done:
                self._callbacks.append(callback)
                return
        tell([callback], self)

    def on_cancel(self, halt: Callable[[], None]) -> None:
        """Say how it is halted; for whoever carries it out."""
        with self._changed:
            self._halt = halt
            cancelled = self._cancelled
        if cancelled:
            halt()

    def finish(self, position: float | None) -> None:
        """End it well; for whoever carries it out."""
        self._end(position, None)

    def fail(self, error: Exception) -> None:
        """End it badly; for whoever carries it out."""
        self._end(None, error)

    def _end(self, position: float | None, error: Exception | None) -> None:
        with self._changed:
            if self._done:
                return
            self._position, self._error, self._done = position, error, True
            callbacks, self._callbacks = self._callbacks, []
            self._changed.notify_all()
        tell(callbacks, self)
