import pytest

from cosmic.frame.errors import CosmicError, LimitError, MoveCancelled, MoveRefused, StoppedError
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.hw.interface import Channel
from unit.mico.rigs import mico, wait_until
from unit.mico.scripted_controller import ScriptedController

X = Channel(0, 0)


def targets(controller: ScriptedController) -> list[float]:
    return [call[2] for call in controller.of("move_to") if isinstance(call[2], float)]


def failure(move: StepwiseMove) -> Exception | None:
    return move.movement.exception(3.0)


def test_a_long_move_is_made_in_parts() -> None:
    with mico() as (api, controller):
        move = StepwiseMove.by(api["d0.c0"], 1000.0, 300.0)
        assert failure(move) is None
        assert targets(controller) == [300.0, 600.0, 900.0, 1000.0]
        assert (move.begun, move.planned) == (4, 4)
        assert move.movement.success


@pytest.mark.parametrize(
    ("way", "largest", "expected"),
    [
        (-500.0, 250.0, [-250.0, -500.0]),
        ("0.2 mm", "0.1 mm", [100.0, 200.0]),
        (0.3, 0.1, [0.1, 0.2, 0.3]),
        (50.0, 100.0, [50.0]),
        (0.0, 100.0, [0.0]),
    ],
)
def test_parts_are_never_larger_than_asked(
    way: float | str, largest: float | str, expected: list[float]
) -> None:
    with mico() as (api, controller):
        assert failure(StepwiseMove.by(api["d0.c0"], way, largest)) is None
        assert targets(controller) == pytest.approx(expected)


def test_targets_count_from_the_users_zero() -> None:
    with mico() as (api, controller):
        axis = api["d0.c0"]
        axis.move_to(100.0)
        axis.set_zero()
        assert failure(StepwiseMove(axis, 20.0, 10.0)) is None
        assert targets(controller)[1:] == [110.0, 120.0]


def test_a_target_beyond_the_limits_is_refused_before_the_first_part() -> None:
    with mico() as (api, controller):
        with pytest.raises(LimitError):
            StepwiseMove(api["d0.c0"], 5001.0, 100.0)
        assert targets(controller) == []


@pytest.mark.parametrize("largest", [0.0, -1.0, float("nan"), "abc", "1 V"])
def test_a_part_must_be_a_length_above_zero(largest: float | str) -> None:
    with mico() as (api, controller):
        with pytest.raises(MoveRefused):
            StepwiseMove(api["d0.c0"], 100.0, largest)
        assert targets(controller) == []


def begun(axis: Axis, controller: ScriptedController, parts: int) -> StepwiseMove:
    """Begin a series and end `parts` of it."""
    move = StepwiseMove.by(axis, 1000.0, 300.0)
    for number in range(1, parts + 1):
        wait_until(lambda number=number: len(targets(controller)) == number)
        controller.end(X, 300.0 * number)
    wait_until(lambda: len(targets(controller)) == parts + 1)
    return move


def test_a_stop_ends_the_series_for_good() -> None:
    with mico(instant=False) as (api, controller):
        move = begun(api["d0.c0"], controller, 1)
        api.application.manager.stop("test")
        assert isinstance(failure(move), StoppedError)
        api.application.manager.reset_stop()
        assert len(targets(controller)) == 2


def test_halting_the_axis_ends_the_series() -> None:
    with mico(instant=False) as (api, controller):
        move = begun(api["d0.c0"], controller, 2)
        api["d0.c0"].halt()
        assert isinstance(failure(move), MoveCancelled)
        assert len(targets(controller)) == 3


def test_a_newer_command_ends_the_series() -> None:
    with mico(instant=False) as (api, controller):
        axis = api["d0.c0"]
        move = begun(axis, controller, 1)
        axis.move_to(-50.0, wait=False)
        assert isinstance(failure(move), MoveCancelled)
        controller.end(X, -50.0)
        wait_until(lambda: not axis.details.in_motion)
        assert targets(controller) == [300.0, 600.0, -50.0]


def test_cancelling_the_series_stops_the_part_under_way() -> None:
    with mico(instant=False) as (api, controller):
        move = begun(api["d0.c0"], controller, 1)
        move.movement.cancel()
        assert isinstance(failure(move), MoveCancelled)
        assert controller.of("stop")
        assert len(targets(controller)) == 2


def test_an_abandoned_series_begins_no_further_part() -> None:
    with mico(instant=False) as (api, controller):
        move = begun(api["d0.c0"], controller, 1)
        move.abandon()
        controller.end(X, 600.0)
        assert isinstance(failure(move), MoveCancelled)
        assert len(targets(controller)) == 2


def test_an_unknown_position_needs_consent_for_every_part() -> None:
    def unknown(controller: ScriptedController) -> None:
        controller.known = False

    with mico(prepare=unknown) as (api, controller):
        axis = api["d0.c0"]
        wait_until(lambda: axis.confidence == "unknown")
        with pytest.raises(MoveRefused):
            StepwiseMove.by(axis, 200.0, 100.0)
        assert failure(StepwiseMove.by(axis, 200.0, 100.0, consent=True)) is None
        assert len(targets(controller)) == 2


def test_a_device_that_closes_ends_the_series() -> None:
    with mico(instant=False) as (api, controller):
        move = begun(api["d0.c0"], controller, 1)
        api.application.manager.shut_down()
        assert isinstance(failure(move), CosmicError)
