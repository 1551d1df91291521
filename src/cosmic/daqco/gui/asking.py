"""Has the application do what may take a while, without the window waiting for it."""

from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Protocol, TypeVar

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from cosmic.frame.background import OnResult
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.relay import Relay

T = TypeVar("T")


class CarriesOut(Protocol):
    """What an application offers to its widgets, as far as it matters here."""

    @abstractmethod
    def carry_out(
        self, action: Callable[[], T], on_result: OnResult[T], *, slow: bool = False
    ) -> None:
        """Do `action`; `on_result(result, error)` at its end, maybe in another thread."""


class Asking(QObject):
    """Belongs to a widget, which is told in the GUI thread; nothing is told once it is gone."""

    def __init__(self, daqco: CarriesOut, widget: QWidget) -> None:
        super().__init__(widget)
        self._daqco = daqco
        self._relay = Relay(self._on_report)

    def ask(self, action: Callable[[], T], on_result: OnResult[T], *, slow: bool = False) -> None:
        """Have `action` done and call `on_result(result, error)`.

        At home that is before this returns, unless it is `slow`: then a thread waits for it.
        """

        def report(result: T | None, error: CosmicError | None) -> None:
            self._relay(partial(on_result, result, error))

        self._daqco.carry_out(action, report, slow=slow)

    def _on_report(self, report: Callable[[], object]) -> None:
        report()
