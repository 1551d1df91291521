"""What MiCo, DAQCo and ViCo have in common."""

import threading

import pytest
from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.frame.application import CosmicApplicationBase
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import JOIN_TIMEOUT_S, running_threads


class Counting(CosmicApplicationBase):
    """An application with a loop of its own."""

    def __init__(self) -> None:
        super().__init__("Counting", FailurePolicy())
        self.looped = threading.Event()

    @override
    def custom_event_loop(self) -> bool:
        self.looped.set()
        return True


def test_an_application_that_does_not_say_how_it_starts_is_a_defect() -> None:
    with pytest.raises(NotImplementedError, match="Counting"):
        Counting().initialize()


def test_an_application_without_a_gui_factory_has_no_gui() -> None:
    assert Counting().get_gui() is None


def test_the_gui_is_made_once_when_first_asked_for_and_knows_its_application() -> None:
    made: list[CosmicApplicationBase] = []

    def factory(application: CosmicApplicationBase) -> QObject:
        made.append(application)
        return QObject()

    application = CosmicApplicationBase("MiCo", FailurePolicy(), factory)
    assert not made
    assert application.get_gui() is application.get_gui()
    assert made == [application]
    assert application.title == "MiCo"


def test_an_application_runs_its_own_loop_in_place_of_qts() -> None:
    application = Counting()
    application.start()
    assert application.join()
    assert application.looped.is_set()


def test_an_application_without_a_loop_of_its_own_runs_until_it_is_shut_down(
    qapp: QObject,
) -> None:
    application = CosmicApplicationBase("MiCo", FailurePolicy())
    application.start()
    assert not application.join(0.05)
    application.shut_down()
    assert application not in running_threads()


def test_shutting_down_is_harmless_in_any_state(qapp: QObject) -> None:
    application = CosmicApplicationBase("MiCo", FailurePolicy())
    application.shut_down()
    application.start()
    assert application.join()
    application.shut_down()


def test_an_application_that_does_not_end_is_said_so(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    application = Counting()

    def never(timeout_s: float = JOIN_TIMEOUT_S) -> bool:
        return timeout_s < 0.0

    monkeypatch.setattr(application, "join", never)
    application.shut_down()
    assert "Counting did not end" in caplog.text
