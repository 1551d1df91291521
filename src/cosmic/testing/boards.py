"""The contract of a `Board`, as a suite for pytest.

A package that brings one derives from `BoardContract` and says how its library is made over a fake,
and how time goes on for it::

    class TestMyBoard(BoardContract):
        def make_library(self) -> tuple[BoardLibrary, Callable[[float], None]]:
            clock = ManualClock()
            return MyLibrary(FakeDevice(clock), clock), clock.advance
"""

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import pytest

from cosmic.daqco.hw.interface import Board, BoardChunk, BoardLibrary, InputSettings
from cosmic.frame.errors import DeviceError, DeviceFault, LimitError, NotConnectedError

RATE_HZ = 1000.0
_JOIN_S = 10.0


@dataclass
class OpenBoard:
    """A library, its first board, and what lets time go on."""

    library: BoardLibrary
    board: Board
    go_on: Callable[[float], None]

    def inputs(self, count: int) -> list[InputSettings]:
        """Return settings of the first inputs, in the widest range."""
        info = self.board.info
        low_v, high_v = info.ranges_v[0]
        return [InputSettings(each, info.modes[0], low_v, high_v) for each in info.inputs[:count]]

    def begin(self, count: int = 2, chunk: int = 10) -> None:
        """Configure and start."""
        self.board.configure(self.inputs(count), RATE_HZ, chunk)
        self.board.start()

    def samples(self, count: int) -> None:
        """Let the time of so many samples pass, and a little more."""
        self.go_on((count + 0.01) / RATE_HZ)

    def received(self, count: int) -> list[BoardChunk]:
        """Return the next chunks, which are there already."""
        found = [self.board.receive(1.0) for _ in range(count)]
        chunks = [each for each in found if each is not None]
        assert len(chunks) == count, f"{count - len(chunks)} of {count} chunks did not come"
        return chunks


class BoardContract:
    """What DAQCo relies on in any board."""

    @abstractmethod
    def make_library(self) -> tuple[BoardLibrary, Callable[[float], None]]:
        """Return the library over its fake, and what lets platform time go on by seconds."""

    @pytest.fixture
    def it(self) -> Iterator[OpenBoard]:
        """The first board, open; closed afterwards."""
        library, go_on = self.make_library()
        board = library.open(library.list_boards()[0].name)
        yield OpenBoard(library, board, go_on)
        board.close()

    def test_the_library_lists_its_boards_with_what_they_can(self, it: OpenBoard) -> None:
        boards = it.library.list_boards()
        assert it.library.name
        assert it.board.info == boards[0]
        assert len({each.name for each in boards}) == len(boards)
        for each in boards:
            assert each.inputs
            assert each.ranges_v
            assert each.modes
            assert each.highest_rate_hz(len(each.inputs)) > 0.0

    def test_a_board_that_is_not_there_is_named_with_those_that_are(self, it: OpenBoard) -> None:
        with pytest.raises(NotConnectedError) as caught:
            it.library.open("no such board")
        assert "no such board" in str(caught.value)
        assert it.board.info.name in str(caught.value)

    def test_chunks_follow_each_other_without_a_gap(self, it: OpenBoard) -> None:
        it.begin()
        it.samples(50)
        chunks = it.received(4)
        assert [each.first_sample for each in chunks] == [0, 10, 20, 30]
        steps_s = np.diff([each.time_s for each in chunks])
        assert steps_s == pytest.approx([10 / RATE_HZ] * 3, rel=1e-6)

    @pytest.mark.parametrize("count", [1, 2, None])
    def test_a_chunk_has_a_row_for_each_input(self, it: OpenBoard, count: int | None) -> None:
        count = count or len(it.board.info.inputs)
        it.begin(count)
        it.samples(20)
        volts = it.received(1)[0].volts
        assert volts.shape == (count, 10)
        assert volts.dtype == np.float64

    def test_each_chunk_is_a_fresh_array_of_the_receiver(self, it: OpenBoard) -> None:
        it.begin()
        it.samples(30)
        one, other = it.received(2)
        assert one.volts.flags.c_contiguous
        assert one.volts.flags.writeable
        assert not np.shares_memory(one.volts, other.volts)
        low_v, high_v = it.board.info.ranges_v[0]
        one.volts[:] = 10.0 * high_v
        one.volts.flags.writeable = False
        it.samples(10)
        assert np.all(np.abs(it.received(1)[0].volts) <= max(-low_v, high_v))

    def test_receiving_in_vain_gives_none_after_the_time_given(self, it: OpenBoard) -> None:
        it.begin(chunk=1000)
        assert it.board.receive(0.0) is None
        assert it.board.receive(0.01) is None

    def test_what_is_not_started_gives_nothing(self, it: OpenBoard) -> None:
        assert it.board.receive(0.0) is None
        it.board.configure(it.inputs(1), RATE_HZ, 10)
        assert it.board.receive(0.0) is None

    def test_starting_needs_a_configuration(self, it: OpenBoard) -> None:
        with pytest.raises(DeviceError) as caught:
            it.board.start()
        assert caught.value.fault is DeviceFault.STATE
        assert it.board.info.name in str(caught.value)

    def test_a_running_board_is_neither_configured_nor_started(self, it: OpenBoard) -> None:
        it.begin()
        for attempt in (it.board.start, lambda: it.board.configure(it.inputs(1), RATE_HZ, 10)):
            with pytest.raises(DeviceError) as caught:
                attempt()
            assert caught.value.fault is DeviceFault.STATE

    def test_after_a_stop_nothing_comes_and_a_start_begins_at_zero(self, it: OpenBoard) -> None:
        it.begin()
        it.samples(30)
        it.received(1)
        it.board.stop()
        it.board.stop()
        assert it.board.receive(0.0) is None
        it.board.start()
        it.samples(20)
        assert it.received(1)[0].first_sample == 0

    def test_it_can_be_configured_anew_between_runs(self, it: OpenBoard) -> None:
        it.begin(2)
        it.board.stop()
        it.board.configure(it.inputs(2), RATE_HZ, 5)
        it.board.configure(it.inputs(1), RATE_HZ, 5)
        it.board.start()
        it.samples(10)
        assert it.received(1)[0].volts.shape == (1, 5)

    def test_a_stop_wakes_whoever_waits(self, it: OpenBoard) -> None:
        it.begin(chunk=10)
        for _ in range(3):
            it.board.receive(0.0)
        with ThreadPoolExecutor(1) as pool:
            waiting = pool.submit(it.board.receive, 30.0)
            it.board.stop()
            waiting.result(_JOIN_S)  # it has ended, with or without a last chunk

    def test_what_is_beyond_the_board_is_refused_and_it_stays_usable(self, it: OpenBoard) -> None:
        info, (first,) = it.board.info, it.inputs(1)
        every = it.inputs(len(info.inputs))
        wrong = [(it.inputs(1), rate_hz) for rate_hz in (0.0, -1.0, math.nan, math.inf)]
        wrong += [(it.inputs(1), 2.0 * info.max_single_rate_hz), ([], RATE_HZ)]
        wrong += [(every, 1.001 * info.highest_rate_hz(len(every)))]
        for low_v, high_v in (
            (-1000.0, 1000.0),
            (first.high_v, first.high_v),
            (first.high_v, first.low_v),
            (math.nan, first.high_v),
            (first.low_v, math.inf),
        ):
            wrong += [([replace(first, low_v=low_v, high_v=high_v)], RATE_HZ)]
        for inputs, rate_hz in wrong:
            with pytest.raises(LimitError, match=info.name):
                it.board.configure(inputs, rate_hz, 10)
        it.begin()
        it.samples(20)
        it.received(1)

    def test_a_chunk_without_samples_is_refused(self, it: OpenBoard) -> None:
        with pytest.raises(DeviceError, match=it.board.info.name):
            it.board.configure(it.inputs(1), RATE_HZ, 0)

    def test_what_was_configured_before_a_refusal_is_not_started_in_its_place(
        self, it: OpenBoard
    ) -> None:
        it.board.configure(it.inputs(1), RATE_HZ, 10)
        with pytest.raises(LimitError):
            it.board.configure(it.inputs(1), -1.0, 10)
        with pytest.raises(DeviceError) as caught:
            it.board.start()
        assert caught.value.fault is DeviceFault.STATE

    def test_an_input_that_is_not_there_or_named_twice_is_refused(self, it: OpenBoard) -> None:
        (first,) = it.inputs(1)
        absent = InputSettings("ai999", first.mode, first.low_v, first.high_v)
        for inputs in ([absent], [first, first]):
            with pytest.raises(DeviceError) as caught:
                it.board.configure(inputs, RATE_HZ, 10)
            assert it.board.info.name in str(caught.value)

    def test_a_closed_board_stays_closed_and_can_be_opened_again(self, it: OpenBoard) -> None:
        it.begin()
        it.board.close()
        it.board.close()
        assert it.board.receive(0.0) is None
        with pytest.raises(DeviceError):
            it.board.start()
        again = it.library.open(it.board.info.name)
        again.configure(it.inputs(1), RATE_HZ, 10)
        again.start()
        again.close()
