"""What an application offers, and what may be given to it."""

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import pytest

from cosmic.frame.errors import MoveRefused
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import Access, Caller, current_call
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.invoker import ApplicationInvoker
from cosmic.frame.network.lease import StationLease
from cosmic.frame.network.remote import offered_by, remote
from cosmic.frame.verdict import Reason


def checker(annotation: Any) -> Any:
    """Return what checks one argument of that type."""

    class Application:
        def function(self, value: Any) -> None:
            pass

        function.__annotations__["value"] = annotation
        function = remote(function)

    return offered_by(Application())["function"]


FITS: list[tuple[Any, Any]] = [
    (int, 3),
    (float, 3),
    (float, float("inf")),
    (float | None, None),
    (int | float, 3),
    (str, "a"),
    (bytes, b"a"),
    (Reason, Reason.LIMIT),
    (Literal["a", 2], 2),
    (list[int], [1, 2]),
    (tuple[float, str], (1, "a")),
    (tuple[int, ...], (1, 2, 3)),
    (dict[str, float], {"a": 1}),
    (Mapping[str, float], {"a": 1.0}),
    (Sequence[float], (1.0, 2.0)),
    (np.ndarray, np.zeros(2)),
    (np.typing.NDArray[np.uint8], np.zeros(2)),
    (object, {"anything": 1}),
    (Callable[[int], None] | None, None),
]
DOES_NOT: list[tuple[Any, Any]] = [
    (int, True),
    (int, 3.0),
    (int, "3"),
    (float, True),
    (float, "1"),
    (float, None),
    (float, b"5"),
    (float, "5"),
    (float, 10**400),
    (int, b"5"),
    (bool, 1),
    (str, b"a"),
    (bytes, "a"),
    (Reason, "LIMIT"),
    (Literal["a", 2], True),
    (Literal["a", 1], True),
    (list[int], [1, 2.5]),
    (tuple[float, str], (1.0,)),
    (tuple[float, str], [1.0, "a"]),
    (dict[str, float], {1: 1.0}),
    (Sequence[float], "ab"),
    (np.ndarray, [1.0]),
    (Callable[[int], None] | None, 1),
]


@pytest.mark.parametrize(("annotation", "value"), FITS)
def test_what_fits_is_let_through(annotation: Any, value: Any) -> None:
    checker(annotation).checked({"value": value})


@pytest.mark.parametrize(("annotation", "value"), DOES_NOT)
def test_what_does_not_fit_is_refused(annotation: Any, value: Any) -> None:
    with pytest.raises(CallRefused, match="wrong argument"):
        checker(annotation).checked({"value": value})


def test_a_refusal_names_the_argument_and_what_came() -> None:
    with pytest.raises(CallRefused, match="wrong argument value: b'5' is not float"):
        checker(float).checked({"value": b"5"})


def test_an_integer_arrives_as_the_float_that_was_asked_for() -> None:
    assert type(checker(float).checked({"value": 3})["value"]) is float
    assert type(checker(int | float).checked({"value": 3})["value"]) is int


@pytest.mark.parametrize("annotation", [Callable[[int], None], set[int], type, "FailurePolicy"])
def test_what_cannot_be_checked_cannot_be_offered(annotation: Any) -> None:
    with pytest.raises((TypeError, NameError)):
        checker(annotation)


def test_every_parameter_needs_a_name_and_an_annotation() -> None:
    class Many:
        @remote
        def many(self, *values: int) -> None:
            pass

    class Bare:
        @remote
        def bare(self, value) -> None:  # type: ignore[no-untyped-def]
            pass

    for application in (Many(), Bare()):
        with pytest.raises(TypeError, match="cannot be remote"):
            offered_by(application)


class Application:
    """One function of each kind."""

    @remote(reads=True)
    def look(self) -> int:
        return 1

    @remote
    def change(self) -> None:
        pass

    @remote(moves=True, limit_s=0.3)
    def move(self) -> float:
        call = current_call()
        assert call is not None
        assert call.dead_man is not None
        return call.dead_man.limit_s

    @remote(at_once=True)
    def stop(self) -> None:
        pass


def call(access: Access, function: str, lease: StationLease | None = None) -> object:
    invoker = ApplicationInvoker("stage", Application(), lease or StationLease(), FailurePolicy())
    return invoker.invoke(Caller("vision", "token", access), function, {})


def test_a_viewer_looks_and_stops_and_does_nothing_else() -> None:
    assert call(Access.VIEW, "look") == 1
    call(Access.VIEW, "stop")
    for function in ("change", "move"):
        with pytest.raises(CallRefused, match="may not call"):
            call(Access.VIEW, function)


def test_who_may_not_move_may_not_move_with_the_lease_either() -> None:
    lease = StationLease()
    lease.take("vision", "token")
    call(Access.CALL, "change", lease)
    with pytest.raises(CallRefused):
        call(Access.CALL, "move", lease)
    assert call(Access.MOVE, "move", lease) == 0.3
    with pytest.raises(MoveRefused):
        call(Access.MOVE, "move")


def test_nobody_calls_outside_of_a_call() -> None:
    assert current_call() is None


def test_reading_is_not_in_the_log_of_commands(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        call(Access.MOVE, "look")
        assert not caplog.records
        call(Access.MOVE, "change")
    assert "vision: stage.change()" in caplog.text
