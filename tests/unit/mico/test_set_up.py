"""What a controller stores of a positioner is changed with consent, and never while it moves."""

import pytest

import cosmic
from cosmic.mico.hw.interface import Direction


@pytest.fixture
def rig():
    with cosmic.connect(applications=("mico",), rate=20) as opened:
        yield opened


def test_nothing_is_stored_without_consent(rig):
    axis = rig.mico["left.x"]
    with pytest.raises(cosmic.NotAvailable, match="consent=True"):
        axis.set_safe_direction("forward")
    with pytest.raises(cosmic.NotAvailable, match="consent=True"):
        axis.set_sensor_type(21)
    assert axis.confidence == "known"


def test_nothing_is_stored_while_the_axis_moves(rig):
    axis = rig.mico["left.x"]
    move = axis.move_by(2000.0, wait=False)
    with pytest.raises(cosmic.NotAvailable, match="it is moving"):
        axis.set_safe_direction("forward", consent=True)
    move.cancel()


def test_a_new_safe_direction_asks_for_a_new_reference(rig):
    axis = rig.mico["left.x"]
    axis.set_safe_direction("forward", consent=True)
    assert axis.details.safe_direction is Direction.FORWARD
    assert axis.confidence == "unknown"
    with pytest.raises(cosmic.MoveRefused) as refused:
        axis.move_to(10.0)
    assert refused.value.verdict.reason == "POSITION_UNKNOWN"


def test_a_new_sensor_type_takes_the_axis_away_until_it_is_searched_again(rig):
    axis = rig.mico["left.x"]
    axis.set_sensor_type(1, consent=True)
    with pytest.raises(cosmic.MoveRefused, match="press Rescan"):
        axis.move_by(1.0, consent=True)
    assert rig.mico["left.y"].move_by(5.0) is not None


def test_a_type_that_the_controller_cannot_hold_is_refused(rig):
    with pytest.raises(cosmic.CosmicError):
        rig.mico["left.x"].set_sensor_type(2**32, consent=True)
    assert rig.mico["left.x"].confidence == "known"
