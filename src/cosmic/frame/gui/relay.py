"""`Relay`: the one way from whatever thread something happens in to the GUI thread."""

from collections.abc import Callable
from typing import Generic, Self, TypeVarTuple
from weakref import WeakMethod

from PySide6.QtCore import QObject, Qt, QThread, QTimer, Signal
from shiboken6 import isValid

from cosmic.frame.events import Unsubscribe

Ts = TypeVarTuple("Ts")


class Relay(QObject, Generic[*Ts]):
    """Called in any thread, it calls a method of a QObject in the GUI thread; made there.

    It has no parent: whoever calls it keeps it alive, and meets no deleted object. Once the
    QObject is gone, nothing is called any more, and what it follows is unsubscribed.

    A call without arguments says only that there is something to look at: while one has yet to
    arrive, further ones are one with it. So a window that is slow falls no further behind, and a
    key for STOP waits behind one look and not behind hundreds.

    Parameters
    ----------
    receiver : bound method of a QObject
        What is called, with the arguments that the relay was called with.
    queued : bool
        In the GUI thread too it is called by the event loop, after what was sent before.
    least_ms : int
        It is called no more often: of calls that come sooner the last one is made afterwards.
    """

    _called = Signal(object)

    def __init__(
        self, receiver: Callable[[*Ts], object], *, queued: bool = False, least_ms: int = 0
    ) -> None:
        super().__init__()
        owner = getattr(receiver, "__self__", None)
        if not isinstance(owner, QObject):
            raise TypeError(f"a relay calls a method of a QObject, not {receiver!r}")
        self._receiver = WeakMethod(receiver)
        self._ends: list[Unsubscribe] = []
        self._queued = queued
        self._arriving = False
        self._later: tuple[*Ts] | None = None
        self._rest: QTimer | None = None
        if least_ms:
            # The receiver's: the last to let go of a relay may be another thread, which must not
            # end a timer that runs here.
            self._rest = QTimer(owner, interval=least_ms, singleShot=True)
            self._rest.timeout.connect(self._on_rested)
        owner.destroyed.connect(_ender(self._ends))
        kind = Qt.ConnectionType
        self._called.connect(
            self._on_called, kind.QueuedConnection if queued else kind.AutoConnection
        )

    def __call__(self, *args: *Ts) -> None:
        """Have the receiver called; any thread."""
        if not args and (self._queued or QThread.currentThread() is not self.thread()):
            if self._arriving:
                return
            self._arriving = True
        self._called.emit(args)

    def follow(self, subscribe: Callable[[Callable[[*Ts], object]], Unsubscribe]) -> Self:
        """Subscribe to something, until the receiver goes or `end` is called."""
        self.keep(subscribe(self))
        return self

    def keep(self, unsubscribe: Unsubscribe) -> None:
        """Call this as well when the receiver goes."""
        self._ends.append(unsubscribe)

    def end(self) -> None:
        """Unsubscribe now; harmless the second time."""
        _end_all(self._ends)

    def _on_called(self, args: tuple[*Ts]) -> None:
        if not args:
            self._arriving = False  # before it looks, so that no change is missed
        if self._rest is not None:
            if not isValid(self._rest):
                return  # with its receiver
            if self._rest.isActive():
                self._later = args
                return
            self._rest.start()
        self._deliver(args)

    def _on_rested(self) -> None:
        args, self._later = self._later, None
        if args is not None:
            self._on_called(args)

    def _deliver(self, args: tuple[*Ts]) -> None:
        receiver = self._receiver()
        if receiver is not None and isValid(getattr(receiver, "__self__", None)):
            receiver(*args)


def _ender(ends: list[Unsubscribe]) -> Callable[[], None]:
    return lambda: _end_all(ends)  # must not hold the receiver, which is gone by then


def _end_all(ends: list[Unsubscribe]) -> None:
    while ends:
        ends.pop()()
