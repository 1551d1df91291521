"""The one tree of exceptions."""

import inspect

import pytest

from cosmic.frame import errors
from cosmic.frame.errors import (
    CollisionError,
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    LimitError,
    MoveRefused,
    NotConnectedError,
    StoppedError,
    UnknownAxisError,
    refusal,
)
from cosmic.frame.verdict import MoveVerdict, Reason


def test_every_exception_of_the_module_is_a_cosmic_error() -> None:
    own = [each for _, each in inspect.getmembers(errors, inspect.isclass)]
    exceptions = [each for each in own if issubclass(each, Exception)]
    assert len(exceptions) > 10
    assert all(issubclass(each, CosmicError) for each in exceptions)


@pytest.mark.parametrize(
    ("reason", "kind"),
    [
        (Reason.LIMIT, LimitError),
        (Reason.COLLISION, CollisionError),
        (Reason.STOPPED, StoppedError),
        (Reason.NO_ANSWER, MoveRefused),
        (Reason.NOT_FINITE, MoveRefused),
    ],
)
def test_a_refusal_has_the_type_of_its_reason_and_carries_the_verdict(
    reason: Reason, kind: type[MoveRefused]
) -> None:
    verdict = MoveVerdict(allowed=False, reason=reason, text="left.x must not go there")
    error = refusal(verdict)
    assert type(error) is kind
    assert error.verdict is verdict
    assert str(error) == "left.x must not go there"


def test_a_refusal_without_text_says_its_reason() -> None:
    assert str(refusal(MoveVerdict(allowed=False, reason=Reason.DEVICE))) == "DEVICE"


def test_a_device_error_says_where_and_what() -> None:
    error = DeviceTimeout("no answer", fault=DeviceFault.TIMEOUT, code=9, device=1, channel=2)
    assert isinstance(error, DeviceError)
    assert (error.fault, error.code, error.device, error.channel) == (DeviceFault.TIMEOUT, 9, 1, 2)


def test_a_device_error_without_particulars_is_unclassified() -> None:
    error = NotConnectedError("gone")
    assert (error.fault, error.code, error.device, error.channel) == (
        DeviceFault.OTHER,
        None,
        None,
        None,
    )


def test_an_unknown_axis_lists_the_known_ones_without_quotes_around_the_text() -> None:
    error = UnknownAxisError("lefty", ["left.x", "left.y"])
    assert isinstance(error, KeyError)
    assert str(error) == "there is no axis 'lefty'; known axes: left.x, left.y"


def test_an_unknown_axis_on_an_empty_platform_says_that_there_is_none() -> None:
    assert str(UnknownAxisError("x", [])).endswith("known axes: none")
