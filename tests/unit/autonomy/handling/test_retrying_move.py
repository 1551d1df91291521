"""Movements that are ordered again where the gate had no answer."""

from collections.abc import Callable

import pytest

from cosmic.autonomy.handling import retrying_move
from cosmic.autonomy.handling.retrying_move import BUMPS, TRIES, UNANSWERED, RetryingMove
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    MoveRefused,
)
from cosmic.frame.operation import Operation
from cosmic.frame.verdict import MoveVerdict, Reason


class Moved:
    """A movement that has arrived."""

    done = True

    def __init__(self, error: CosmicError | None = None) -> None:
        self.error = error

    def wait(self, timeout_s: float | None = None) -> str:
        if self.error is not None:
            raise self.error
        return "there"

    def exception(self, timeout: float | None = 0.0) -> CosmicError | None:
        return self.error

    def cancel(self) -> None:
        """It has arrived already."""


def refusing(reason: Reason, times: int) -> tuple[Callable[[], Moved], list[int]]:
    orders: list[int] = []

    def order() -> Moved:
        orders.append(1)
        if len(orders) <= times:
            raise MoveRefused(MoveVerdict(allowed=False, reason=reason, text="no"))
        return Moved()

    return order, orders


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retrying_move, "APART_WALL_S", 0.0)
    monkeypatch.setattr(retrying_move, "BUMP_WALL_S", 0.0)


class Moving(Operation[str]):
    """A movement on its way; the test ends it."""

    def __init__(self) -> None:
        super().__init__("move")


def test_whoever_waits_hears_of_the_end_at_once_also_of_one_that_was_ordered_again():
    orders = [Moving(), Moving()]
    ordered = iter(orders)
    move = RetryingMove(lambda: next(ordered), to_a_position=True)
    heard: list[bool] = []
    move.add_callback(lambda ended: heard.append(ended.done))
    assert heard == []
    orders[0].fail(DeviceTimeout("it has not come on"))
    assert heard == [False]  # it is ordered again
    assert not move.done
    orders[1].finish("there")
    assert heard == [False, True]
    assert move.wait(0.0) == "there"


def test_a_movement_without_an_answer_is_ordered_again_until_there_is_one():
    order, orders = refusing(Reason.NO_ANSWER, 2)
    assert RetryingMove(order).wait(20.0) == "there"
    assert len(orders) == 3


def test_a_no_is_a_no():
    order, orders = refusing(Reason.COLLISION, 1)
    with pytest.raises(MoveRefused):
        RetryingMove(order)
    assert len(orders) == 1


def test_retries_end():
    order, orders = refusing(Reason.NO_ANSWER, 100)
    with pytest.raises(MoveRefused):
        RetryingMove(order).wait(20.0)
    assert len(orders) == UNANSWERED


def test_a_wait_ends_while_the_gate_has_not_answered(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(retrying_move, "APART_WALL_S", 60.0)
    move = RetryingMove(refusing(Reason.NO_ANSWER, 1)[0])
    assert not move.done
    with pytest.raises(DeviceTimeout):
        move.wait(0.01)


def test_a_cancelled_movement_is_not_ordered_again():
    order, orders = refusing(Reason.NO_ANSWER, 1)
    move = RetryingMove(order)
    move.cancel()
    assert move.done
    with pytest.raises(MoveRefused):
        move.wait(20.0)
    assert len(orders) == 1


def test_a_move_to_a_position_is_ordered_again_where_an_axis_did_not_come_on():
    moves = [Moved(DeviceTimeout("no progress")), Moved()]
    assert RetryingMove(lambda: moves.pop(0), to_a_position=True).wait(20.0) == "there"


def test_steps_are_not_for_some_of_them_may_have_been_made():
    moves = [Moved(DeviceTimeout("no progress")), Moved()]
    with pytest.raises(DeviceTimeout, match="no progress"):
        RetryingMove(lambda: moves.pop(0)).wait(20.0)
    assert len(moves) == 1


def test_an_axis_that_never_comes_on_is_reported_in_the_end():
    orders: list[int] = []

    def order() -> Moved:
        orders.append(1)
        return Moved(DeviceTimeout("no progress"))

    with pytest.raises(DeviceTimeout, match="no progress"):
        RetryingMove(order, to_a_position=True).wait(20.0)
    assert len(orders) == TRIES


def bumping(times: int) -> tuple[Callable[[], Moved], Callable[[], Moved], list[str]]:
    """Return a way that ends at an obstacle so often, the way back, and the list of both."""
    trace: list[str] = []

    def order() -> Moved:
        trace.append("on")
        stopped = trace.count("on") <= times
        return Moved(DeviceError("ran into it", fault=DeviceFault.END_STOP) if stopped else None)

    def back() -> Moved:
        trace.append("back")
        return Moved()

    return order, back, trace


def test_an_axis_that_runs_into_something_goes_back_a_little_and_tries_again():
    order, back, trace = bumping(2)
    assert RetryingMove(order, to_a_position=True, back=back).wait(20.0) == "there"
    assert trace == ["on", "back", "on", "back", "on"]


def test_an_obstacle_that_stays_is_reported_after_some_tries():
    order, back, trace = bumping(100)
    with pytest.raises(DeviceError, match="ran into it"):
        RetryingMove(order, to_a_position=True, back=back).wait(20.0)
    assert trace.count("back") == BUMPS
    assert trace.count("on") == BUMPS + 1


def test_an_undo_that_is_refused_does_not_move():
    order, _, trace = bumping(1)

    def refused() -> Moved:
        raise MoveRefused(MoveVerdict(allowed=False, reason=Reason.COLLISION, text="no"))

    assert RetryingMove(order, to_a_position=True, back=refused).wait(20.0) == "there"
    assert trace == ["on", "on"]


def test_a_path_without_a_way_back_ends_at_an_obstacle():
    order, _, trace = bumping(1)
    with pytest.raises(DeviceError, match="ran into it"):
        RetryingMove(order, to_a_position=True).wait(20.0)
    assert trace == ["on"]
