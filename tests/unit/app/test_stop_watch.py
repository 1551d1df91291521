"""What was stopped does not go on by itself, however soon the stop was reset."""

from typing import Any

import pytest

from cosmic.app.platform import RESET_SINCE, stopped_since
from cosmic.mico.core.motion.stop_latch import StopLatch, StopState


@pytest.fixture
def latch() -> StopLatch:
    return StopLatch()


def mico(latch: StopLatch) -> Any:
    class Axes:
        @property
        def stop_state(self) -> StopState:
            return latch.state

    return Axes()


def test_a_stop_is_reported_with_its_reason_and_after_its_reset_too(latch: StopLatch) -> None:
    stopped = stopped_since(mico(latch))
    assert stopped() is None
    latch.set("a hand on the button")
    assert stopped() == "a hand on the button"
    latch.reset()
    assert stopped() == RESET_SINCE


def test_a_stop_that_nobody_looked_at_before_its_reset_is_reported(latch: StopLatch) -> None:
    stopped = stopped_since(mico(latch))
    assert stopped() is None
    latch.set("quick")
    latch.reset()
    assert stopped() == RESET_SINCE


def test_a_stop_that_was_reset_before_it_began_does_not_concern_it(latch: StopLatch) -> None:
    latch.set("long ago")
    latch.reset()
    assert stopped_since(mico(latch))() is None


def test_one_that_begins_while_stopped_is_reported_why(latch: StopLatch) -> None:
    latch.set("still")
    assert stopped_since(mico(latch))() == "still"


def test_where_nothing_moves_nothing_is_stopped() -> None:
    assert stopped_since(None)() is None
