"""The one filter on all events of the program, which asks only those who wait for an event."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QTimer
from PySide6.QtGui import QInputEvent
from PySide6.QtWidgets import QApplication, QWidget

from cosmic.frame.overrides import override

Handler = Callable[[QObject, QEvent], bool]
"""Looks at an event before its receiver does; True keeps it from there."""

_NAME: Final = "applicationEvents"


@contextmanager
def at_one_go(window: QWidget) -> Iterator[None]:
    """Do something that changes much of a window, and lay it out and paint it at the end.

    All that happens with the filter at rest, while other threads want the interpreter.
    """
    app = QApplication.instance()
    if not isinstance(app, QApplication):
        yield
        return
    with ApplicationEvents.of(app).resting():
        yield
        for kind in (QEvent.Type.LayoutRequest, QEvent.Type.UpdateLater):
            QCoreApplication.sendPostedEvents(None, kind.value)
        window.repaint()


class ApplicationEvents(QObject):
    """Hands events of some classes to who wants them, before their receivers get them.

    Every event of every widget comes by here, and each costs a wait for the interpreter where
    other threads work; so there is one such filter, and it does no more than look up the class.
    What a hand does comes by the event loop, so a filter for that alone begins with it: making a
    window is some forty thousand events that nobody waits for. GUI thread.
    """

    def __init__(self, app: QApplication) -> None:
        super().__init__(app)
        self.setObjectName(_NAME)
        self._app = app
        self._handlers: dict[type[QEvent], tuple[tuple[QObject, Handler], ...]] = {}
        self._resting = 0

    @staticmethod
    def of(app: QApplication) -> "ApplicationEvents":
        """Return that of the program."""
        return app.findChild(ApplicationEvents, _NAME) or ApplicationEvents(app)

    def add(self, owner: QObject, handler: Handler, *kinds: type[QEvent]) -> None:
        """Ask `handler` about events of just these classes, before those added earlier.

        It is asked no more once its owner is deleted.
        """
        for kind in kinds:
            self._handlers[kind] = ((owner, handler), *self._handlers.get(kind, ()))
        if all(issubclass(kind, QInputEvent) for kind in kinds):
            QTimer.singleShot(0, self._begin)
        else:
            self._begin()
        owner.destroyed.connect(lambda: self.remove(owner))

    def remove(self, owner: QObject, *kinds: type[QEvent]) -> None:
        """Ask `owner` no more; without classes about nothing."""
        for kind in kinds or tuple(self._handlers):
            left = tuple(each for each in self._handlers.get(kind, ()) if each[0] is not owner)
            if left:
                self._handlers[kind] = left
            else:
                self._handlers.pop(kind, None)
        if not self._handlers:
            self._app.removeEventFilter(self)

    @contextmanager
    def resting(self) -> Iterator[None]:
        """Ask nobody meanwhile: for what is done in one go and sends events that no hand caused.

        No event loop may run in it.
        """
        self._resting += 1
        self._app.removeEventFilter(self)
        try:
            yield
        finally:
            self._resting -= 1
            self._begin()

    def _begin(self) -> None:
        if self._handlers and not self._resting:
            self._app.installEventFilter(self)

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        handlers = self._handlers.get(type(event))
        return handlers is not None and any(ask(watched, event) for _, ask in handlers)
