"""What nothing caught, and what Qt says, reaches the policy and the log."""

import logging
import sys
import threading
from collections.abc import Iterator

import pytest
from PySide6.QtCore import QtMsgType, qCritical, qWarning

from cosmic.frame.errors import DeviceError
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.hooks import install_hooks
from cosmic.frame.units import parse_quantity

pytestmark = pytest.mark.defects


@pytest.fixture
def failures() -> Iterator[list[Failure]]:
    policy, heard = FailurePolicy(), []
    policy.subscribe(heard.append)
    undo = install_hooks(policy)
    yield heard
    undo()


def _pass_to_excepthook(error: BaseException) -> None:
    sys.excepthook(type(error), error, error.__traceback__)


def test_an_uncaught_exception_is_reported(failures: list[Failure]) -> None:
    _pass_to_excepthook(ValueError("x"))
    assert failures == [Failure(where="window", text="ValueError: x", defect=True)]


def test_the_origin_is_the_innermost_function_of_cosmic(failures: list[Failure]) -> None:
    try:
        parse_quantity(5, "um")  # type: ignore[arg-type]
    except AttributeError as error:
        _pass_to_excepthook(error)
    assert failures[0].where == "cosmic.frame.units.parse_quantity"


def test_a_foreseen_failure_stays_foreseen(failures: list[Failure]) -> None:
    _pass_to_excepthook(DeviceError("left.x: end stop reached"))
    assert not failures[0].defect


@pytest.mark.parametrize("error", [KeyboardInterrupt(), SystemExit(2)])
def test_a_request_to_end_the_program_is_no_failure(
    error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[BaseException] = []
    monkeypatch.setattr(sys, "excepthook", lambda _kind, error, _trace: seen.append(error))
    policy, heard = FailurePolicy(), []
    policy.subscribe(heard.append)
    undo = install_hooks(policy)
    _pass_to_excepthook(error)
    undo()
    assert (seen, heard) == ([error], [])


def test_a_plain_python_thread_that_dies_is_reported_by_name(failures: list[Failure]) -> None:
    thread = threading.Thread(target=lambda: 1 // 0, name="foreign")
    thread.start()
    thread.join()
    assert failures[0].where == "thread 'foreign'"
    assert failures[0].defect


def test_an_exception_in_a_finaliser_is_reported(failures: list[Failure]) -> None:
    class Leaky:
        def __del__(self) -> None:
            raise ValueError("in del")

    Leaky()
    assert [failure.text for failure in failures] == ["ValueError: in del"]


@pytest.mark.parametrize(
    ("say", "level"), [(qWarning, logging.WARNING), (qCritical, logging.ERROR)]
)
def test_qts_own_messages_go_to_the_log(
    failures: list[Failure], caplog: pytest.LogCaptureFixture, say: type, level: int
) -> None:
    say("QPainter::begin failed")
    assert caplog.record_tuples == [("cosmic.qt", level, "QPainter::begin failed")]
    assert not failures
    assert QtMsgType.QtWarningMsg != QtMsgType.QtCriticalMsg


def test_undoing_leaves_the_hooks_as_they_were() -> None:
    before = (sys.excepthook, threading.excepthook, sys.unraisablehook)
    undo = install_hooks(FailurePolicy())
    assert sys.excepthook is not before[0]
    undo()
    assert (sys.excepthook, threading.excepthook, sys.unraisablehook) == before
