"""The one way from a failure to the stop, the log and the operator."""

import logging

import pytest

from cosmic.frame.errors import ConfigError, CosmicError, DeviceError
from cosmic.frame.failure import Failure, FailurePolicy


class Witness:
    """Notes in which order a policy stops and tells."""

    def __init__(self, policy: FailurePolicy) -> None:
        self.events: list[str] = []
        self.failures: list[Failure] = []
        policy.on_safe_stop(lambda reason: self.events.append(f"stop: {reason}"))
        policy.subscribe(self.hear)

    def hear(self, failure: Failure) -> None:
        self.events.append("tell")
        self.failures.append(failure)


@pytest.fixture
def policy() -> FailurePolicy:
    return FailurePolicy()


@pytest.fixture
def witness(policy: FailurePolicy) -> Witness:
    return Witness(policy)


@pytest.mark.defects
def test_a_defect_stops_all_motion_and_then_notifies_the_operator(
    policy: FailurePolicy, witness: Witness
) -> None:
    failure = policy.report(ZeroDivisionError("oh"), "window")
    assert witness.events == ["stop: window: ZeroDivisionError: oh", "tell"]
    assert witness.failures == [failure]
    assert failure == Failure(where="window", text="ZeroDivisionError: oh", defect=True)


@pytest.mark.defects
def test_a_defect_is_logged_with_its_traceback(
    policy: FailurePolicy, caplog: pytest.LogCaptureFixture
) -> None:
    policy.report(ZeroDivisionError("oh"), "window")
    (record,) = caplog.records
    assert record.levelno == logging.ERROR
    assert record.exc_info is not None
    assert record.exc_info[0] is ZeroDivisionError


def test_a_foreseen_failure_is_reported_and_logged_without_traceback_and_stops_nothing(
    policy: FailurePolicy, witness: Witness, caplog: pytest.LogCaptureFixture
) -> None:
    failure = policy.report(DeviceError("left.x: end stop reached"), "thread 'device 0'")
    assert witness.events == ["tell"]
    assert not failure.defect
    assert failure.text == "left.x: end stop reached"
    (record,) = caplog.records
    assert (record.levelno, record.exc_info) == (logging.ERROR, None)
    assert record.getMessage() == "thread 'device 0': left.x: end stop reached"


def test_the_death_of_a_thread_stops_motion_even_when_its_error_was_foreseen(
    policy: FailurePolicy, witness: Witness
) -> None:
    failure = policy.report(ConfigError("bad"), "thread 'x'", thread_died=True)
    assert witness.events == ["stop: thread 'x': bad", "tell"]
    assert not failure.defect


@pytest.mark.defects
@pytest.mark.parametrize("error", [CosmicError(), KeyError()])
def test_an_error_without_text_is_named_by_its_type(
    policy: FailurePolicy, error: Exception
) -> None:
    assert type(error).__name__ in policy.report(error, "here").text


@pytest.mark.defects
def test_a_safe_stop_that_fails_does_not_keep_the_others_from_stopping(
    policy: FailurePolicy, caplog: pytest.LogCaptureFixture
) -> None:
    stopped: list[str] = []

    def broken(_reason: str) -> None:
        raise RuntimeError("no line")

    policy.on_safe_stop(broken)
    policy.on_safe_stop(stopped.append)
    policy.report(ValueError("x"), "here")
    assert stopped == ["here: ValueError: x"]
    assert "a safe stop failed" in caplog.text


@pytest.mark.defects
def test_a_listener_that_fails_does_not_keep_the_others_from_hearing(
    policy: FailurePolicy, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(_failure: Failure) -> None:
        raise RuntimeError("no window")

    policy.subscribe(broken)
    witness = Witness(policy)
    policy.report(DeviceError("x"), "here")
    assert witness.events == ["tell"]
    assert "a failure listener failed" in caplog.text


@pytest.mark.defects
def test_a_defect_met_while_reporting_a_foreseen_failure_still_stops_all_motion(
    policy: FailurePolicy, witness: Witness, caplog: pytest.LogCaptureFixture
) -> None:
    policy.subscribe(lambda _failure: policy.report(ValueError("inner"), "window") and None)
    policy.report(DeviceError("outer"), "device")
    assert witness.events == ["tell", "stop: window: ValueError: inner"]
    assert "inner" in caplog.text


@pytest.mark.defects
def test_a_defect_met_while_stopping_ends_there_and_is_logged(
    policy: FailurePolicy, caplog: pytest.LogCaptureFixture
) -> None:
    policy.on_safe_stop(lambda _reason: policy.report(ValueError("inner"), "stop") and None)
    witness = Witness(policy)
    policy.report(KeyError("outer"), "window")
    assert len([event for event in witness.events if event.startswith("stop")]) == 1
    assert "inner" in caplog.text


@pytest.mark.defects
def test_a_policy_works_again_after_a_failure_within_a_failure(
    policy: FailurePolicy, witness: Witness
) -> None:
    end = policy.subscribe(lambda _failure: policy.report(ValueError("inner"), "x") and None)
    policy.report(KeyError("outer"), "window")
    end()
    witness.events.clear()
    policy.report(KeyError("next"), "window")
    assert witness.events == ["stop: window: KeyError: 'next'", "tell"]


@pytest.mark.defects
def test_who_has_left_is_neither_stopped_nor_notified(policy: FailurePolicy) -> None:
    stopped: list[str] = []
    heard: list[Failure] = []
    policy.on_safe_stop(stopped.append)()
    policy.subscribe(heard.append)()
    policy.report(ValueError("x"), "here")
    assert (stopped, heard) == ([], [])


def test_a_guarded_callback_gives_back_what_the_function_gives(policy: FailurePolicy) -> None:
    add = policy.guarded("driver", lambda left, right: left + right, 0)
    assert add(2, right=3) == 5


@pytest.mark.defects
def test_a_guarded_callback_that_fails_gives_its_fallback_and_notifies_the_policy(
    policy: FailurePolicy, witness: Witness
) -> None:
    call = policy.guarded("driver callback", lambda count: 1 // count, -1)
    assert call(0) == -1
    assert witness.events[0].startswith("stop: driver callback: ZeroDivisionError")


@pytest.mark.defects
def test_a_stop_that_was_interrupted_keeps_no_later_failure_from_stopping() -> None:
    policy, stops, told = FailurePolicy(), list[str](), list[Failure]()

    def stop(reason: str) -> None:
        stops.append(reason)
        if len(stops) == 1:
            raise KeyboardInterrupt

    def tell(failure: Failure) -> None:
        told.append(failure)
        if len(told) == 1:
            raise KeyboardInterrupt

    policy.on_safe_stop(stop)
    policy.subscribe(tell)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            policy.report(ZeroDivisionError("first"), "script")
    policy.report(ZeroDivisionError("then"), "script")
    assert stops[-1] == "script: ZeroDivisionError: then"
    assert told[-1].text == "ZeroDivisionError: then"
