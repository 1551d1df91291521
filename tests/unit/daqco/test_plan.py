"""A plan is refused before anything starts, with what would be possible."""

import pytest

from cosmic.daqco.core.plan import highest_rate_hz, make_plan
from cosmic.daqco.core.settings import ChannelSettings
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.errors import LimitError, NotConnectedError

INPUTS = tuple(f"ai{number}" for number in range(32))
BOARD = BoardInfo("Dev1", "PCI-6229", True, 1, INPUTS, 250e3, 250e3, ((-10.0, 10.0),))
BOARDS = {"Dev1": BOARD, "Dev2": BOARD}


def channel(number: int, board: str = "Dev1", **changes: object) -> ChannelSettings:
    fields = {"name": f"{board.lower()}_c{number}", "board": board, "input": f"ai{number}"}
    return ChannelSettings.model_validate(fields | changes)


def test_thirty_two_channels_at_15_khz_need_two_boards() -> None:
    one = [channel(number) for number in range(32)]
    two = [channel(number, board) for board in BOARDS for number in range(16)]
    with pytest.raises(LimitError, match=r"7812\.5 Hz"):
        make_plan(one, 15_000.0, 0.01, BOARDS)
    plan = make_plan(two, 15_000.0, 0.01, BOARDS)
    assert plan.chunk_samples == 150
    assert plan.boards == ("Dev1", "Dev2")
    assert highest_rate_hz(one, BOARDS) == 7812.5
    assert highest_rate_hz(two, BOARDS) == 15_000.0


@pytest.mark.parametrize("rate_hz", [9.9, 15_000.1, float("nan"), float("inf"), -1.0])
def test_rates_out_of_bounds_are_refused(rate_hz: float) -> None:
    with pytest.raises(LimitError, match="10 to 15000 Hz"):
        make_plan([channel(0)], rate_hz, 0.01, BOARDS)


def test_a_board_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(NotConnectedError, match=r"Dev9 is not there; there are Dev1, Dev2"):
        make_plan([channel(0, "Dev9")], 1000.0, 0.01, BOARDS)


def test_no_active_channel_is_refused() -> None:
    with pytest.raises(LimitError, match="no channel is active"):
        make_plan([channel(0, active=False)], 1000.0, 0.01, BOARDS)


def test_a_differential_channel_takes_its_partner() -> None:
    pair = channel(0, mode="differential")
    assert make_plan([pair, channel(1)], 1000.0, 0.01, BOARDS)
    with pytest.raises(LimitError, match="both use Dev1/ai8"):
        make_plan([pair, channel(8)], 1000.0, 0.01, BOARDS)
    with pytest.raises(LimitError, match="give its partner ai16"):
        make_plan([channel(24, mode="differential")], 1000.0, 0.01, BOARDS)


def test_rows_come_in_the_order_of_the_channels_whatever_their_boards() -> None:
    mixed = [channel(0, "Dev1"), channel(0, "Dev2"), channel(1, "Dev1")]
    assert make_plan(mixed, 1000.0, 0.01, BOARDS).rows == (0, 2, 1)
