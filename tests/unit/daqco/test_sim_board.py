"""What is true of the simulated boards alone."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from typing_extensions import override

from cosmic.daqco.hw.board_group import BoardGroup
from cosmic.daqco.hw.interface import BoardChunk, InputMode, InputSettings
from cosmic.daqco.hw.sim_board import SimulatedBoard
from cosmic.daqco.hw.sim_library import PCI_6229, SimulatedLibrary
from cosmic.frame.clock import WALL, ManualClock, RatedClock
from cosmic.frame.errors import (
    ConfigError,
    DeviceError,
    DeviceFault,
    LimitError,
    NotConnectedError,
)
from cosmic.testing.fast_board import FastLibrary
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings

Array = npt.NDArray[np.float64]


class Ramp:
    """A source of `v_per_s` times the time, which remembers what it was asked."""

    def __init__(self, v_per_s: float = 1.0) -> None:
        self.v_per_s = v_per_s
        self.asked_s: list[Array] = []

    def volts(self, times_s: Array) -> Array:
        self.asked_s.append(times_s)
        return self.v_per_s * times_s


class Level:
    def __init__(self, level_v: float) -> None:
        self.level_v = level_v

    def volts(self, times_s: Array) -> Array:
        return np.full(times_s.shape, self.level_v)


def inputs(count: int, *, reach_v: float = 10.0, first: int = 0) -> list[InputSettings]:
    return [
        InputSettings(f"ai{number}", InputMode.RSE, -reach_v, reach_v)
        for number in range(first, first + count)
    ]


def stepping() -> ManualClock:
    return ManualClock(auto_advance=True)


def chunks(board: SimulatedBoard, count: int) -> list[BoardChunk]:
    got = [board.receive(1.0) for _ in range(count)]
    assert all(each is not None for each in got)
    return [each for each in got if each is not None]


def acquired(
    library: SimulatedLibrary,
    asked: Sequence[InputSettings],
    *,
    rate_hz: float = 1000.0,
    chunk: int = 100,
    count: int = 1,
    board: str = "Dev1",
) -> Array:
    """Return the volts of `count` chunks in a row."""
    opened = library.open(board)
    opened.configure(asked, rate_hz, chunk)
    opened.start()
    return np.concatenate([each.volts for each in chunks(opened, count)], axis=1)


# --- limits of the real board -----------------------------------------------------------------


def test_a_board_refuses_more_than_250_000_samples_a_second_in_all() -> None:
    board = SimulatedLibrary(stepping()).open("Dev1")
    assert board.configure(inputs(32), 7812.5, 100) == 7812.5
    with pytest.raises(LimitError, match=r"7812\.5 Hz") as caught:
        board.configure(inputs(32), 7812.6, 100)
    assert (caught.value.verdict.value, caught.value.verdict.limit) == (7812.6, 7812.5)


def test_two_boards_of_sixteen_inputs_make_15_khz_together() -> None:
    library = SimulatedLibrary(stepping())
    for name in ("Dev1", "Dev2"):
        library.open(name).configure(inputs(16), 15_000.0, 150)


def test_the_rate_is_the_time_base_over_a_whole_number_and_never_above_what_was_asked() -> None:
    board = SimulatedLibrary(stepping()).open("Dev1")
    for asked_hz in (10.0, 200.0, 1000.0, 7812.5, 15_000.0, 14_999.9, 3.3e4, 250_000.0):
        made_hz = board.configure(inputs(1), asked_hz, 10)
        assert 20e6 / made_hz == pytest.approx(round(20e6 / made_hz), abs=1e-6)
        assert asked_hz * 0.98 < made_hz <= asked_hz


def test_a_range_beyond_ten_volts_is_refused() -> None:
    board = SimulatedLibrary(stepping()).open("Dev1")
    with pytest.raises(LimitError, match="-10 to 10 V"):
        board.configure(inputs(1, reach_v=10.1), 100.0, 10)


# --- the converter ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("expected_v", "range_v"), [(10.0, 10.0), (5.1, 10.0), (5.0, 5.0), (0.9, 1.0), (0.1, 0.2)]
)
def test_samples_are_steps_of_sixteen_bits_of_the_narrowest_range(
    expected_v: float, range_v: float
) -> None:
    library = SimulatedLibrary(stepping(), {("Dev1", "ai0"): Ramp(range_v)})
    volts = acquired(library, inputs(1, reach_v=expected_v), count=9)
    step_v = 2.0 * range_v / 2**16
    steps = volts / step_v
    assert np.abs(steps - np.rint(steps)).max() < 1e-6
    assert np.unique(np.rint(steps)).size > 100


@pytest.mark.parametrize("level_v", [-50.0, 50.0, np.inf, -np.inf])
def test_what_is_beyond_the_range_in_force_is_clipped_to_it(level_v: float) -> None:
    library = SimulatedLibrary(stepping(), {("Dev1", "ai0"): Level(level_v)})
    volts = acquired(library, inputs(1, reach_v=1.0))
    end_v = -1.0 if level_v < 0.0 else 1.0 - 2.0 / 2**16
    assert np.allclose(volts, end_v)


def test_an_input_reads_its_source_to_within_the_noise_of_the_board() -> None:
    library = SimulatedLibrary(stepping(), {("Dev1", "ai3"): Ramp(0.5)})
    volts = acquired(library, inputs(1, first=3), rate_hz=1000.0, count=50)
    times_s = np.arange(volts.size) / 1000.0
    error_v = volts[0] - 0.5 * times_s
    assert abs(error_v.mean()) < 5e-5
    assert 2e-4 < error_v.std() < 4e-4


def test_an_open_input_carries_some_millivolts_of_noise_and_hum() -> None:
    volts = acquired(SimulatedLibrary(stepping()), inputs(16), rate_hz=5000.0, count=100)
    assert np.abs(volts.mean(axis=1)).max() < 6e-3
    assert np.all((volts.std(axis=1) > 2.5e-3) & (volts.std(axis=1) < 6e-3))
    spectrum = np.abs(np.fft.rfft(volts - volts.mean(axis=1, keepdims=True)))
    assert np.all(spectrum.argmax(axis=1) == round(50.0 * volts.shape[1] / 5000.0))
    crossed = np.corrcoef(np.diff(volts, axis=1))
    assert np.abs(crossed - np.eye(16)).max() < 0.3


# --- the same again ---------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_samples_whatever_is_waited_for() -> None:
    def read(waits: int) -> tuple[Array, set[int]]:
        clock = RatedClock(50.0)
        board = SimulatedLibrary(clock, {("Dev1", "ai0"): Level(1.0)}, seed=5).open("Dev1")
        board.configure(inputs(1), 1000.0, 600)
        board.start()
        pieces: list[Array] = []
        while sum(each.shape[1] for each in pieces) < 1800:
            if len(pieces) < waits:
                clock.expect(clock.now_s() + 0.1)
            pieces.append(chunks(board, 1)[0].volts)
        board.close()
        return np.concatenate(pieces, axis=1)[:, :1800], {each.shape[1] for each in pieces}

    whole, shorter = read(0), read(4)
    assert whole[1] == {600}
    assert min(shorter[1]) < 600, "somebody did wait"
    assert np.array_equal(whole[0], shorter[0])


def test_the_same_seed_gives_the_same_samples_whatever_the_chunks() -> None:
    def run(seed: int, chunk: int, count: int) -> Array:
        library = SimulatedLibrary(stepping(), seed=seed)
        return acquired(library, inputs(3), chunk=chunk, count=count)

    once = run(1, 100, 300)
    assert np.array_equal(once, run(1, 100, 300))
    assert np.array_equal(once, run(1, 3000, 10))
    assert not np.array_equal(once, run(2, 100, 300))


def test_boards_and_inputs_carry_different_noise() -> None:
    library = SimulatedLibrary(stepping())
    one, other = (acquired(library, inputs(2), board=name) for name in ("Dev1", "Dev2"))
    rows = [one[0], one[1], other[0], other[1]]
    assert all(not np.allclose(rows[i], rows[j]) for i in range(4) for j in range(i))


def test_an_input_reads_the_same_alone_and_among_others() -> None:
    library = SimulatedLibrary(stepping(), seed=4)
    alone = acquired(library, inputs(1, first=7))
    among = acquired(SimulatedLibrary(stepping(), seed=4), inputs(9))
    assert np.array_equal(alone[0], among[7])


# --- pace -------------------------------------------------------------------------------------


def test_nothing_comes_before_it_is_due_and_then_it_comes_by_number() -> None:
    clock = ManualClock()
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(2), 1000.0, 10)
    clock.advance(5.0)
    board.start()
    assert board.receive(0.0) is None
    clock.advance(0.0099)
    assert board.receive(0.0) is None
    clock.advance(0.0202)
    first, second, third = chunks(board, 3)
    assert [each.first_sample for each in (first, second, third)] == [0, 10, 20]
    assert [each.time_s for each in (first, second, third)] == pytest.approx([5.0, 5.01, 5.02])
    assert board.receive(0.0) is None


def test_whoever_waits_is_woken_when_a_test_moves_the_time() -> None:
    clock = ManualClock()
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(1), 1000.0, 10)
    board.start()
    got: list[BoardChunk | None] = []
    waiting = threading.Thread(target=lambda: got.append(board.receive(20.0)))
    waiting.start()
    clock.advance(0.01)
    waiting.join(10.0)
    assert got and got[0] is not None and got[0].first_sample == 0


def test_a_source_is_asked_for_each_time_once_in_order_and_never_for_the_future() -> None:
    clock, ramp = stepping(), Ramp()
    library = SimulatedLibrary(clock, {("Dev1", "ai0"): ramp})
    acquired(library, inputs(1), count=20)
    asked_s = np.concatenate(ramp.asked_s)
    assert np.allclose(np.diff(asked_s), 1e-3)
    assert asked_s[-1] <= clock.now_s()


def test_a_fast_clock_brings_the_samples_as_much_faster() -> None:
    clock = RatedClock(200.0)
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(1), 1000.0, 1000)
    board.start()
    got = chunks(board, 10)
    assert got[-1].first_sample == 9000
    assert clock.now_s() >= 10.0


def test_on_a_fast_clock_whoever_waits_for_samples_gets_a_shorter_piece() -> None:
    clock = RatedClock(20.0)
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(1), 1000.0, 2000)
    board.start()
    wanted_s = clock.now_s() + 0.2
    clock.expect(wanted_s)
    first = chunks(board, 1)[0]
    end_s = first.time_s + first.volts.shape[1] / 1000.0
    assert wanted_s < end_s <= wanted_s + 0.0021
    assert clock.now_s() < wanted_s + 1.0, "and not at the end of a whole piece"
    after = chunks(board, 1)[0]
    assert after.first_sample == first.volts.shape[1], "nothing is lost or twice"
    assert after.volts.shape == (1, 2000)


def test_a_fast_clock_waits_for_who_fetches_what_somebody_waits_for() -> None:
    clock = RatedClock(100.0, waits=True)
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(1), 1000.0, 2000)
    board.start()
    chunks(board, 1)
    wanted_s = clock.now_s() + 0.02
    clock.expect(wanted_s)
    WALL.sleep(0.1)  # ten seconds of the platform: whoever fetches samples has not come yet
    assert clock.now_s() < wanted_s + 0.05
    first = chunks(board, 1)[0]
    assert clock.now_s() < wanted_s + 0.5, "it hurries on once they are fetched, and not before"
    assert first.volts.shape[1] < 2000
    board.close()


def test_whoever_waits_for_a_board_that_waits_for_its_trigger_holds_up_nobody(
    caplog: pytest.LogCaptureFixture,
) -> None:
    clock = RatedClock(100.0, waits=True)
    triggers = {"Dev2": "/Dev1/ai/StartTrigger"}
    library = SimulatedLibrary(clock, start_triggers=triggers)
    first, second = (library.open(name) for name in ("Dev1", "Dev2"))
    for board in (second, first):
        board.configure(inputs(1), 1000.0, 200)
    second.start()
    began_s = clock.now_s()
    clock.expect(began_s + 0.02)
    WALL.sleep(0.05)
    assert clock.now_s() > began_s + 2.0, "nothing is sampled yet that could be late"
    assert not caplog.records
    first.start()
    assert [chunks(board, 1)[0].first_sample for board in (first, second)] == [0, 0]
    for board in (first, second):
        board.close()


def test_whoever_begins_to_wait_in_the_midst_of_a_piece_shortens_it() -> None:
    clock = RatedClock(20.0)
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(1), 1000.0, 20_000)
    board.start()
    soon = threading.Timer(0.05, lambda: clock.expect(clock.now_s() + 0.1))
    soon.start()
    began_s = clock.wall_s()
    piece = board.receive(2.0)
    soon.join()
    assert piece is not None
    assert clock.wall_s() - began_s < 0.5, "20 s of the platform are one of the wall"
    board.close()


def test_the_pieces_of_boards_that_are_waited_for_end_at_the_same_samples() -> None:
    clock = RatedClock(20.0)
    library = SimulatedLibrary(clock)
    boards = [library.open(name) for name in ("Dev1", "Dev2")]
    for board in boards:
        board.configure(inputs(1), 1000.0, 100)
    for board in boards:
        board.start()
        clock.sleep(0.004)  # each begins a little later
    for _ in range(30):
        clock.expect(clock.now_s() + 0.031)
        one, two = (chunks(board, 1)[0] for board in boards)
        assert one.first_sample == two.first_sample
        assert one.volts.shape == two.volts.shape
    for board in boards:
        board.close()


def test_a_clock_that_hurries_nobody_leaves_all_pieces_whole() -> None:
    assert RatedClock(1.0).expectations is None
    clock = stepping()
    board = SimulatedLibrary(clock).open("Dev1")
    for chunk in (100, 500):
        board.configure(inputs(1), 1000.0, chunk)
        board.start()
        clock.expect(clock.now_s() + 0.02)
        assert [each.volts.shape[1] for each in chunks(board, 3)] == [chunk] * 3
        board.stop()


def test_boards_of_two_drivers_are_waited_for_without_losing_step() -> None:
    clock = RatedClock(20.0)
    make = replace(PCI_6229, name="T", product="T7")
    libraries = [SimulatedLibrary(clock), SimulatedLibrary(clock, info=make)]
    group = BoardGroup([libraries[0].open("Dev1"), libraries[1].open("T1")])
    group.configure({"Dev1": inputs(1), "T1": inputs(1)}, 1000.0, 100)
    group.start()
    after, short = 0, 0
    for _ in range(60):
        clock.expect(clock.now_s() + 0.031)
        joined = group.receive(2.0)
        assert joined is not None
        assert joined.first_sample == after, "nothing is lost or twice"
        after += joined.volts.shape[1]
        short += joined.volts.shape[1] < 100
    assert short > 10
    group.stop()


# --- trouble ----------------------------------------------------------------------------------


def test_an_accelerated_clock_is_not_held_up_by_boards_that_begin_one_after_the_other() -> None:
    clock = RatedClock(20.0)
    library = SimulatedLibrary(clock)
    boards = [library.open(name) for name in ("Dev1", "Dev2")]
    procedure = clock.worker(leads=True)
    try:
        for board in boards:
            board.configure(inputs(1), 1000.0, 200)
            board.start()
            clock.sleep(0.1)  # half a chunk
        began_s = clock.wall_s()
        for _ in range(10):
            for board in boards:
                assert board.receive(5.0) is not None
        assert clock.wall_s() - began_s < 1.0  # 2 s of the platform
    finally:
        procedure.close()
        for board in boards:
            board.close()


def test_a_receiver_that_is_too_late_hears_how_much_was_lost() -> None:
    clock = ManualClock()
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(16), 1000.0, 10)
    board.start()
    clock.advance(10.2)  # ten seconds of buffer and 255 samples of FIFO
    chunks(board, 1)
    clock.advance(0.5)
    with pytest.raises(DeviceError, match=r"\b435 samples of each channel were lost") as caught:
        board.receive(0.0)
    assert caught.value.fault is DeviceFault.OVERRUN
    assert board.receive(0.0) is None
    board.start()
    clock.advance(0.01)
    assert chunks(board, 1)[0].first_sample == 0


def test_on_a_fast_clock_the_buffer_lasts_as_long_by_the_wall() -> None:
    clock = RatedClock(1000.0)
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(1), 100.0, 10)
    board.start()
    clock.sleep(100.0)
    assert chunks(board, 1)[0].first_sample == 0


def test_an_injected_overrun_happens_once() -> None:
    library = SimulatedLibrary(stepping())
    board = library.open("Dev1")
    board.configure(inputs(1), 1000.0, 10)
    library.faults.inject("overrun", board="Dev1")
    board.start()
    with pytest.raises(DeviceError, match="10 samples"):
        board.receive(1.0)
    board.start()
    chunks(board, 3)


def test_an_unplugged_board_fails_alone_and_works_again_when_it_is_back() -> None:
    library = SimulatedLibrary(stepping())
    board, other = library.open("Dev1"), library.open("Dev2")
    for each in (board, other):
        each.configure(inputs(1), 1000.0, 10)
        each.start()
    library.faults.inject("unplugged", board="Dev1")
    for attempt in (lambda: board.receive(1.0), board.start, lambda: library.open("Dev1")):
        with pytest.raises(NotConnectedError, match="Dev1"):
            attempt()
    assert [each.name for each in library.list_boards()] == ["Dev2"]
    chunks(other, 2)
    board.close()
    library.faults.clear()
    again = library.open("Dev1")
    again.configure(inputs(1), 1000.0, 10)
    again.start()
    chunks(again, 2)


def waiting_board(library: SimulatedLibrary) -> SimulatedBoard:
    """Return a board in real time whose first chunk comes in a minute."""
    board = library.open("Dev1")
    board.configure(inputs(1), 10.0, 600)
    board.start()
    return board


def outcome_of_waiting(board: SimulatedBoard, meanwhile: Callable[[], None]) -> object:
    """Return what a `receive` of another thread comes to when something happens meanwhile."""
    outcome: list[object] = []

    def receive() -> None:
        try:
            outcome.append(board.receive(60.0))
        except DeviceError as exc:
            outcome.append(exc)

    waiting = threading.Thread(target=receive)
    waiting.start()
    meanwhile()
    waiting.join(10.0)
    assert outcome, "it still waits"
    return outcome[0]


def test_a_board_that_is_unplugged_while_somebody_waits_is_reported_at_once() -> None:
    library = SimulatedLibrary(RatedClock(1.0))
    board = waiting_board(library)
    raised = outcome_of_waiting(board, lambda: library.faults.inject("unplugged"))
    assert isinstance(raised, NotConnectedError)


def test_a_stop_ends_a_wait_in_real_time_at_once() -> None:
    board = waiting_board(SimulatedLibrary(RatedClock(1.0)))
    assert outcome_of_waiting(board, board.stop) is None


@pytest.mark.timeout(20)
def test_receiving_waits_no_longer_than_its_timeout_though_the_chunk_comes_later() -> None:
    assert waiting_board(SimulatedLibrary(RatedClock(1.0))).receive(0.01) is None


def test_a_chunk_that_is_being_made_when_the_board_is_stopped_is_not_handed_out() -> None:
    class Stopper(Level):
        @override
        def volts(self, times_s: Array) -> Array:
            board.stop()
            return super().volts(times_s)

    board = SimulatedLibrary(stepping(), {("Dev1", "ai0"): Stopper(0.0)}).open("Dev1")
    board.configure(inputs(1), 1000.0, 10)
    board.start()
    assert board.receive(1.0) is None


def test_a_stalled_board_is_silent_until_it_is_cleared() -> None:
    clock = ManualClock()
    library = SimulatedLibrary(clock)
    board = library.open("Dev1")
    board.configure(inputs(1), 1000.0, 10)
    board.start()
    library.faults.inject("stalled")
    clock.advance(1.0)
    assert board.receive(0.0) is None
    library.faults.clear("stalled")
    assert [each.first_sample for each in chunks(board, 3)] == [0, 10, 20]


def test_without_the_driver_nothing_is_listed_and_nothing_opens() -> None:
    library = SimulatedLibrary(stepping())
    library.faults.inject("no_driver")
    for attempt in (library.list_boards, lambda: library.open("Dev1")):
        with pytest.raises(NotConnectedError, match="not installed"):
            attempt()


@pytest.mark.parametrize("call", ["inject", "clear"])
def test_an_unknown_fault_is_refused(call: str) -> None:
    with pytest.raises(ValueError, match="stalled"):
        getattr(SimulatedLibrary(stepping()).faults, call)("on_fire")


@pytest.mark.parametrize("where", [("Dev3", "ai0"), ("Dev1", "ai32")])
def test_a_source_where_there_is_no_input_is_a_mistake_of_the_configuration(
    where: tuple[str, str],
) -> None:
    with pytest.raises(ConfigError, match="/".join(where)):
        SimulatedLibrary(stepping(), {where: Ramp()})


# --- the fast source --------------------------------------------------------------------------


@pytest.mark.parametrize("paced", [True, False])
def test_the_fast_source_counts_its_samples_without_a_gap(paced: bool) -> None:
    board = FastLibrary(stepping(), paced=paced).open("Fast1")
    assert board.configure(inputs(32), 600_000.0, 7000) == 600_000.0
    board.start()
    row = np.concatenate([each.volts[0] for each in chunks(board, 20)])
    assert np.array_equal(np.rint(row * 1e4), np.arange(row.size) % 65_536)


def test_the_fast_source_gives_a_fresh_array_each_time() -> None:
    board = FastLibrary(stepping()).open("Fast1")
    board.configure(inputs(2), 1e6, 65_536)
    board.start()
    first, second = chunks(board, 2)
    first.volts[:] = 0.0
    assert second.volts.any()
    assert np.array_equal(second.volts, chunks(board, 1)[0].volts)


class Wall:
    """Stands in for the module `time`: a wall that a test moves."""

    def __init__(self) -> None:
        self.now_s = 50.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.mark.parametrize("rate", [1.0, 20.0])
def test_no_sample_is_lost_however_late_the_receiver_is(
    rate: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall = Wall()
    monkeypatch.setattr("cosmic.frame.clock.time", wall)
    clock = RatedClock(rate, waits=True)
    scene = Scene.from_settings(shipped_settings(), clock)
    stage = scene.stages["left.x"]
    route = stage.route(0.0)
    route.go(4000.0, 100.0)
    stage.follow(route, held_until_s=0.0)
    board = SimulatedLibrary(clock, {("Dev1", "ai0"): Ramp(0.01)}).open("Dev1")
    board.configure(inputs(1), 1000.0, 10)
    board.start()
    next_sample = 0
    for late_s in (0.01, 2.0, 0.01, 4.0, 0.01):
        wall.now_s += late_s  # what a busy computer does to the thread that receives
        while (chunk := board.receive(0.0)) is not None:
            assert chunk.first_sample == next_sample
            next_sample += 10
            # Stages, what cameras are asked for, and samples are all at the same time.
            assert clock.now_s() - chunk.time_s <= 0.02 + 0.04 * rate
            assert stage.position(clock.now_s()) == pytest.approx(100.0 * clock.now_s(), abs=0.01)
    assert next_sample >= 20
    assert clock.now_s() < rate * 0.3  # and what was waited for is not made up for
    board.close()
    before_s = clock.now_s()
    wall.now_s += 2.0
    assert clock.now_s() == pytest.approx(before_s + 2.0 * rate)


@pytest.mark.parametrize("fault", ["stalled", "unplugged"])
def test_a_board_that_is_silent_by_a_fault_does_not_stop_the_time(
    fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall = Wall()
    monkeypatch.setattr("cosmic.frame.clock.time", wall)
    clock = RatedClock(1.0, waits=True)
    library = SimulatedLibrary(clock)
    board = library.open("Dev1")
    board.configure(inputs(1), 1000.0, 10)
    board.start()
    library.faults.inject(fault)
    if fault == "stalled":
        assert board.receive(0.0) is None
    else:
        with pytest.raises(NotConnectedError):
            board.receive(0.0)
    wall.now_s += 3.0
    assert clock.now_s() == pytest.approx(3.0)


def test_a_receiver_that_hangs_is_dropped_and_hears_what_it_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wall = Wall()
    monkeypatch.setattr("cosmic.frame.clock.time", wall)
    clock = RatedClock(1.0, waits=True)
    board = SimulatedLibrary(clock).open("Dev1")
    board.configure(inputs(1), 1000.0, 10)
    board.start()
    for _ in range(60):  # somebody else looks at the clock
        wall.now_s += 0.5
        clock.now_s()
    assert clock.now_s() > 20.0
    with pytest.raises(DeviceError, match="samples of each channel were lost"):
        board.receive(0.0)
