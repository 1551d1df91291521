"""Overrides that fail while Qt calls them on behalf of Python."""

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QObject

from cosmic.frame.overrides import override


class Touchy(QObject):
    """Fails in an event, with an exception that the interpreter makes itself."""

    @override
    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.User:
            return bool({}["missing"])
        return super().event(event)


def test_an_override_that_fails_raises_where_qt_was_called(qapp: QObject) -> None:
    with pytest.raises(KeyError, match="missing"):
        QCoreApplication.sendEvent(Touchy(), QEvent(QEvent.Type.User))


def test_a_marked_method_keeps_its_name_its_value_and_its_mark() -> None:
    @override
    def answer(question: str, *, unit: str) -> str:
        """Answer."""
        return f"{question}: 42 {unit}"

    assert answer("x", unit="um") == "x: 42 um"
    assert (answer.__name__, answer.__doc__) == ("answer", "Answer.")
    assert getattr(answer, "__override__", False)


def test_a_marked_property_stays_a_property() -> None:
    class Base:
        @property
        def rate(self) -> float:
            return 0.0

    class Rated(Base):
        @property
        @override
        def rate(self) -> float:
            return 2.0

    assert Rated().rate == 2.0
