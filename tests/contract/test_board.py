"""Our boards under the suite that other packages import, and what else these makes do."""

import threading
from collections.abc import Callable, Iterator

import pytest

from contract.board_rig import (
    BoardRig,
    LabjackRig,
    NidaqmxRig,
    SimulatedRig,
    failure_of,
    one_input,
    received,
    some_inputs,
)
from cosmic.daqco.hw.board_checks import negative_input
from cosmic.daqco.hw.interface import BoardLibrary, InputMode
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    NotConnectedError,
)
from cosmic.testing.boards import BoardContract

DIFFERENTIAL = InputMode.DIFFERENTIAL


class _Suite(BoardContract):
    made: Callable[[], BoardRig]

    @pytest.fixture(autouse=True)
    def nothing_is_left(self) -> Iterator[None]:
        self._rigs: list[BoardRig] = []
        yield
        for each in self._rigs:
            each.close()

    def make_library(self) -> tuple[BoardLibrary, Callable[[float], None]]:
        rig = type(self).made()
        self._rigs.append(rig)
        return rig.library, lambda seconds: rig.go_on(round(seconds * 1000.0))


class TestSimulatedBoards(_Suite):
    made = SimulatedRig


class TestBoardsOfNationalInstruments(_Suite):
    made = NidaqmxRig


class TestBoardsOfLabJack(_Suite):
    made = LabjackRig


@pytest.fixture(params=[SimulatedRig, NidaqmxRig, LabjackRig])
def rig(request: pytest.FixtureRequest) -> Iterator[BoardRig]:
    made: BoardRig = request.param()
    yield made
    made.close()


# --- which boards there are -------------------------------------------------------------------


def test_the_library_lists_its_boards_with_what_they_can(rig: BoardRig) -> None:
    boards = rig.library.list_boards()
    assert [(each.name, each.product) for each in boards] == [
        (rig.one, rig.product),
        (rig.other, rig.product),
    ]
    board = boards[0]
    assert board.inputs == tuple(f"ai{number}" for number in range(rig.count))
    assert board.ranges_v == rig.ranges_v
    assert board.highest_rate_hz(1) == rig.sum_hz
    assert board.highest_rate_hz(rig.count) == pytest.approx(rig.sum_hz / rig.count)
    assert len({each.serial for each in boards}) == 2
    assert rig.open().info == board
    assert rig.library.name


def test_a_missing_driver_is_named(rig: BoardRig) -> None:
    rig.uninstall()
    for attempt in (rig.library.list_boards, lambda: rig.library.open(rig.one)):
        with pytest.raises(NotConnectedError, match=r"driver .*not installed"):
            attempt()
    assert rig.library.name


# --- chunks -----------------------------------------------------------------------------------


def test_chunks_follow_each_other_without_a_gap(rig: BoardRig) -> None:
    board = rig.open()
    rate_hz = board.configure(some_inputs(4), 1000.0, 10)
    rig.clock.advance(3.0)
    board.start()
    rig.go_on(50)
    chunks = received(board, 5)
    assert [each.first_sample for each in chunks] == [0, 10, 20, 30, 40]
    start_s = 3.0 + rig.first_after / rate_hz
    times_s = [start_s + number / rate_hz for number in (0, 10, 20, 30, 40)]
    assert [each.time_s for each in chunks] == pytest.approx(times_s, abs=1e-9)
    assert board.receive(0.0) is None


def test_the_rate_that_is_reported_is_near_the_one_asked(rig: BoardRig) -> None:
    asked_hz = 0.9 * rig.sum_hz / 12
    made_hz = rig.open().configure(some_inputs(12), asked_hz, 140)
    assert made_hz == pytest.approx(asked_hz, rel=1e-3)


def test_rows_stand_in_the_order_configured(rig: BoardRig) -> None:
    board = rig.open()
    numbers = (7, 0, rig.count - 1, 3)
    board.configure([one_input(f"ai{number}") for number in numbers], 1000.0, 10)
    board.start()
    rig.go_on(10)
    levels_v = received(board, 1)[0].volts.mean(axis=1)
    assert levels_v == pytest.approx([0.1 * number for number in numbers], abs=5e-3)


def test_several_boards_acquire_at_once(rig: BoardRig) -> None:
    boards = [rig.running(name, inputs=12) for name in (rig.one, rig.other)]
    rig.go_on(30)
    boards[0].stop()
    assert [each.first_sample for each in received(boards[1], 3)] == [0, 10, 20]
    rig.go_on(10)
    assert received(boards[1], 1)[0].first_sample == 30
    assert boards[0].receive(0.0) is None


def test_two_boards_together_carry_many_channels_near_their_highest_rate(rig: BoardRig) -> None:
    count = rig.count // 2
    rate_hz = 0.95 * rig.sum_hz / count
    boards = [
        rig.running(name, inputs=count, rate_hz=rate_hz, chunk=150) for name in (rig.one, rig.other)
    ]
    rig.go_on(1501, rate_hz=0.999 * rate_hz)
    for board in boards:
        assert sum(each.volts.shape[1] for each in received(board, 10)) == 1500


# --- order of calls ---------------------------------------------------------------------------


def test_starting_and_stopping_a_hundred_times_leaves_nothing_behind(rig: BoardRig) -> None:
    board = rig.running()
    threads = threading.active_count()
    for _ in range(100):
        board.stop()
        board.start()
        rig.go_on(10)
        assert received(board, 1)[0].first_sample == 0
    assert threading.active_count() <= threads  # those of earlier tests may be forgotten meanwhile


# --- what is refused --------------------------------------------------------------------------


def test_what_cannot_be_wired_is_refused(rig: BoardRig) -> None:
    positive, negative = rig.pair
    positive_2, negative_2 = rig.other_pair
    impossible = [
        ([one_input(f"ai{rig.count}")], DeviceFault.NO_CHANNEL),
        ([one_input("port0")], DeviceFault.NO_CHANNEL),
        ([one_input("ai1"), one_input("ai1")], DeviceFault.PARAMETER),
        ([one_input(negative, DIFFERENTIAL)], DeviceFault.PARAMETER),
        ([one_input(negative_2, DIFFERENTIAL)], DeviceFault.PARAMETER),
        ([one_input(positive, DIFFERENTIAL), one_input(negative)], DeviceFault.PARAMETER),
        ([one_input(negative_2), one_input(positive_2, DIFFERENTIAL)], DeviceFault.PARAMETER),
    ]
    for inputs, fault in impossible:
        with pytest.raises(DeviceError, match=rf"{rig.one}.*ai|{rig.one}.*port0") as caught:
            rig.open().configure(inputs, 1000.0, 10)
        assert caught.value.fault is fault, inputs


def test_half_of_the_inputs_can_be_differential(rig: BoardRig) -> None:
    info = rig.open().info
    positives = [each for each in info.inputs if negative_input(info, each) is not None]
    assert len(positives) == rig.count // 2
    rig.open().configure([one_input(each, DIFFERENTIAL) for each in positives], 1000.0, 10)


def test_modes_and_ranges_can_be_mixed(rig: BoardRig) -> None:
    board = rig.open()
    low_v, high_v = rig.ranges_v[-1]
    board.configure(
        [
            one_input("ai0", DIFFERENTIAL, low_v, high_v),
            one_input("ai2", rig.single_modes[-1], 0.0, 5.0),
            one_input("ai9", InputMode.RSE, -3.0, 10.0),
        ],
        1000.0,
        10,
    )
    board.start()
    rig.go_on(10)
    assert received(board, 1)[0].volts.shape == (3, 10)


# --- trouble ----------------------------------------------------------------------------------


def test_a_board_that_another_program_has_is_reported_and_works_once_it_is_free(
    rig: BoardRig,
) -> None:
    board = rig.open()
    rig.take_away(rig.one, taken=True)
    with pytest.raises(DeviceError, match=rf"{rig.one}.*another program") as caught:
        board.configure(some_inputs(1), 1000.0, 10)
    assert caught.value.fault is DeviceFault.STATE
    rig.take_away(rig.one, taken=False)
    board.configure(some_inputs(1), 1000.0, 10)


def test_a_board_that_was_opened_twice_belongs_to_who_configured_it_first(rig: BoardRig) -> None:
    board, other = rig.running(), rig.open()
    with pytest.raises(DeviceError, match=rf"{rig.one}.*another program") as caught:
        other.configure(some_inputs(1), 1000.0, 10)
    assert caught.value.fault is DeviceFault.STATE
    other.close()
    rig.go_on(10)
    received(board, 1)
    board.close()
    rig.running()


def test_a_receiver_that_is_too_late_hears_of_an_overrun_and_can_start_again(
    rig: BoardRig,
) -> None:
    board = rig.running()
    rig.go_on(25_000)
    error = failure_of(board)
    assert error.fault is DeviceFault.OVERRUN
    assert rig.one in str(error)
    assert any(word.isdigit() and int(word) > 0 for word in str(error).split())
    assert board.receive(0.0) is None
    board.start()
    rig.go_on(10)
    assert received(board, 1)[0].first_sample == 0


def test_a_lost_board_ends_the_acquisition_and_works_when_it_is_back(rig: BoardRig) -> None:
    board = rig.running()
    rig.go_on(10)
    received(board, 1)
    rig.unplug(rig.one)
    error = failure_of(board)
    assert isinstance(error, NotConnectedError)
    assert error.fault is DeviceFault.COMMUNICATION
    assert rig.one in str(error) and "cable" in str(error)
    assert board.receive(0.0) is None
    with pytest.raises(NotConnectedError):
        board.start()
    with pytest.raises(NotConnectedError):
        rig.library.open(rig.one)
    rig.plug_in(rig.one)
    board.start()
    rig.go_on(10)
    assert received(board, 1)[0].first_sample == 0


def test_a_lost_board_can_be_closed_and_opened_again(rig: BoardRig) -> None:
    board = rig.running()
    rig.unplug(rig.one)
    board.stop()
    board.close()
    rig.plug_in(rig.one)
    again = rig.running()
    rig.go_on(10)
    received(again, 1)


def test_a_lost_board_does_not_disturb_the_other(rig: BoardRig) -> None:
    lost, other = rig.running(rig.one), rig.running(rig.other)
    rig.unplug(rig.one)
    rig.go_on(20)
    failure_of(lost)
    assert [each.first_sample for each in received(other, 2)] == [0, 10]


def test_every_error_names_the_board(rig: BoardRig) -> None:
    attempts: list[Callable[[], object]] = [
        lambda: rig.open(rig.other).start(),
        lambda: rig.open(rig.other).configure([], 1.0, 1),
        lambda: rig.open(rig.other).configure(some_inputs(rig.count), 1e6, 1),
        lambda: rig.open(rig.other).configure([one_input("ai99")], 1.0, 1),
    ]
    for attempt in attempts:
        with pytest.raises(CosmicError, match=rig.other):
            attempt()
