"""The boards of one acquisition, received from by one call: simulated, and NI's."""

from collections.abc import Iterator

import numpy as np
import pytest

from contract.board_rig import BoardRig, LabjackRig, NidaqmxRig, SimulatedRig, one_input
from cosmic.daqco.hw.board_group import BoardGroup
from cosmic.daqco.hw.interface import BoardChunk, OverrunError
from cosmic.frame.errors import DeviceError, LimitError, ProtocolError

INPUTS = {
    "Dev1": [one_input("ai3"), one_input("ai1")],
    "Dev2": [one_input("ai7")],
}
LEVELS_V = [0.3, 0.1, 0.7]


@pytest.fixture(params=[SimulatedRig, NidaqmxRig])
def rig(request: pytest.FixtureRequest) -> Iterator[BoardRig]:
    made: BoardRig = request.param()
    yield made
    made.close()


def running(rig: BoardRig, *names: str) -> BoardGroup:
    group = BoardGroup([rig.open(name) for name in names or ("Dev1", "Dev2")])
    group.configure(INPUTS, 1000.0, 10)
    group.start()
    return group


def received(group: BoardGroup) -> BoardChunk:
    chunk = group.receive(0.0)
    assert chunk is not None
    return chunk


def test_one_call_brings_the_rows_of_all_boards_in_their_order(rig: BoardRig) -> None:
    group = running(rig)
    rig.go_on(20)
    chunks = [received(group), received(group)]
    assert [each.first_sample for each in chunks] == [0, 10]
    assert chunks[1].time_s - chunks[0].time_s == pytest.approx(0.01)
    for chunk in chunks:
        assert chunk.volts.shape == (3, 10)
        assert chunk.volts.dtype == np.float64
        assert chunk.volts.mean(axis=1) == pytest.approx(LEVELS_V, abs=5e-3)
    assert group.receive(0.0) is None


def test_one_board_alone_is_a_group_too(rig: BoardRig) -> None:
    group = running(rig, "Dev2")
    rig.go_on(10)
    assert received(group).volts.mean(axis=1) == pytest.approx([0.7], abs=5e-3)


def test_what_one_board_has_brought_waits_for_the_others(rig: BoardRig) -> None:
    first, second = rig.open("Dev1"), Late(rig.open("Dev2"))
    group = BoardGroup([first, second])
    group.configure(INPUTS, 1000.0, 10)
    group.start()
    rig.go_on(20)
    second.late = True
    assert group.receive(0.0) is None
    assert group.receive(0.0) is None
    second.late = False
    assert [received(group).first_sample, received(group).first_sample] == [0, 10]


def test_boards_that_are_not_in_step_end_the_acquisition(rig: BoardRig) -> None:
    first, other = rig.open("Dev1"), rig.open("Dev2")
    group = BoardGroup([first, other])
    group.configure(INPUTS, 1000.0, 10)
    group.start()
    rig.go_on(20)
    assert other.receive(0.0) is not None  # somebody else took it
    with pytest.raises(OverrunError, match=r"Dev2 is not in step with Dev1.*10.*sample 0"):
        group.receive(0.0)
    rig.go_on(20)
    assert group.receive(0.0) is None


@pytest.mark.parametrize("gone", ["Dev1", "Dev2"])
def test_a_board_that_is_lost_stops_the_others(rig: BoardRig, gone: str) -> None:
    group = running(rig)
    rig.unplug(gone)
    with pytest.raises(DeviceError, match=gone):
        for _ in range(3):
            group.receive(0.0)
    rig.plug_in(gone)
    rig.go_on(20)
    assert group.receive(0.0) is None
    group.start()
    rig.go_on(10)
    assert received(group).first_sample == 0


def test_a_board_that_cannot_start_leaves_none_running(rig: BoardRig) -> None:
    group = BoardGroup([rig.open("Dev1"), rig.open("Dev2")])
    group.configure(INPUTS, 1000.0, 10)
    rig.unplug("Dev2")
    with pytest.raises(DeviceError, match="Dev2"):
        group.start()
    rig.go_on(20)
    assert group.receive(0.0) is None


@pytest.mark.parametrize("call", ["start", "receive"])
def test_a_board_that_fails_with_any_error_of_ours_stops_the_others(
    rig: BoardRig, call: str
) -> None:
    """A board that another package brings may say that it cannot, or that an answer is garbled."""

    def fails(*_args: object) -> None:
        raise ProtocolError(f"Dev2: {call}: the answer was garbled")

    first, second = rig.open("Dev1"), Late(rig.open("Dev2"))
    group = BoardGroup([first, second])
    group.configure(INPUTS, 1000.0, 10)
    setattr(second, call, fails)
    with pytest.raises(DeviceError, match="garbled"):
        group.start()
        group.receive(0.0)
    first.start()  # which it refuses while it acquires


def test_what_one_board_cannot_do_is_refused_for_all(rig: BoardRig) -> None:
    group = BoardGroup([rig.open("Dev1"), rig.open("Dev2")])
    with pytest.raises(LimitError):
        group.configure(INPUTS, 400_000.0, 10)


def test_those_that_take_the_clock_of_another_are_started_first(rig: BoardRig) -> None:
    started: list[str] = []
    boards = [Late(rig.open(name), started) for name in ("Dev1", "Dev2")]
    group = BoardGroup(boards, clocked=["Dev2"])
    group.configure(INPUTS, 1000.0, 10)
    group.start()
    assert started == ["Dev2", "Dev1"]


class Late:
    """A board that says when it is started, and brings nothing while it is late."""

    def __init__(self, board, started=None):
        self._board = board
        self._started = [] if started is None else started
        self.late = False

    def __getattr__(self, name):
        return getattr(self._board, name)

    def start(self):
        self._started.append(self._board.info.name)
        self._board.start()

    def receive(self, timeout_s):
        return None if self.late else self._board.receive(timeout_s)


# --- boards of different makes ----------------------------------------------------------------


@pytest.fixture
def makes() -> Iterator[tuple[NidaqmxRig, LabjackRig]]:
    ours = NidaqmxRig(), LabjackRig()
    yield ours
    for each in ours:
        each.close()


def both(makes: tuple[NidaqmxRig, LabjackRig], rate_hz: float = 1000.0) -> BoardGroup:
    group = BoardGroup([each.open() for each in makes], clock_ppm=50.0)
    inputs = [one_input("ai3"), one_input("ai1")]
    group.configure({each.one: inputs for each in makes}, rate_hz, 10)
    return group


def test_a_board_of_ni_and_one_of_labjack_acquire_together(
    makes: tuple[NidaqmxRig, LabjackRig],
) -> None:
    group = both(makes)
    group.start()
    for each in makes:
        each.go_on(20)
    chunks = [received(group), received(group)]
    assert [each.first_sample for each in chunks] == [0, 10]
    assert chunks[0].volts.mean(axis=1) == pytest.approx([0.3, 0.1, 0.3, 0.1], abs=5e-3)


def test_how_well_the_clocks_of_two_makes_agree_is_reported(
    makes: tuple[NidaqmxRig, LabjackRig],
) -> None:
    group = both(makes)
    assert group.agreement == ()
    group.start()
    for each in makes:
        each.go_on(10)
    received(group)
    (agreement,) = group.agreement
    assert (agreement.board, agreement.first) == ("T7_470010001", "Dev1")
    assert agreement.offset_s == pytest.approx(0.001), "the first scan comes a period later"
    assert agreement.parted_s(3600.0) == pytest.approx(0.001 + 0.36)
    assert "1.0 ms after those of Dev1" in agreement.text and "360 ms an hour" in agreement.text


def test_two_makes_that_make_different_rates_of_one_are_refused(
    makes: tuple[NidaqmxRig, LabjackRig],
) -> None:
    with pytest.raises(DeviceError, match="different rates"):
        both(makes, rate_hz=7013.0)


def test_boards_with_one_clock_need_no_statement(rig: BoardRig) -> None:
    group = BoardGroup([rig.open("Dev1"), rig.open("Dev2")], clocked=["Dev2"], clock_ppm=50.0)
    group.configure(INPUTS, 1000.0, 10)
    group.start()
    rig.go_on(10)
    received(group)
    assert group.agreement == ()
