"""An acquisition that waits for a trigger, and a waveform that begins with an acquisition."""

from collections.abc import Iterator

import numpy as np
import pytest

from contract.board_rig import received, some_inputs
from contract.fake_nidaqmx_outputs import FakeOutputNidaqmx
from contract.test_board_outputs import PIEZO
from cosmic.daqco.hw.factory import make_library
from cosmic.daqco.hw.interface import Board
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.daqco.hw.outputs import Waveform, open_outputs
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import NotAvailable

TRIGGERS = {"Dev1": "/Dev1/PFI0"}


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def simulated(clock: ManualClock) -> SimulatedLibrary:
    return SimulatedLibrary(clock, wires={"Dev1/ao0": "Dev1/ai1"}, start_triggers=TRIGGERS)


@pytest.fixture
def board(simulated: SimulatedLibrary) -> Iterator[Board]:
    opened = simulated.open("Dev1")
    opened.configure(some_inputs(2), 1000.0, 10)
    yield opened
    opened.close()


def test_a_board_takes_its_first_sample_when_its_terminal_rises(
    board: Board, simulated: SimulatedLibrary, clock: ManualClock
) -> None:
    board.start()
    clock.advance(5.0)
    assert board.receive(0.0) is None
    simulated.terminals.rise("/Dev1/PFI1", clock.now_s())
    assert board.receive(0.0) is None
    simulated.terminals.rise("/Dev1/PFI0", clock.now_s())
    clock.advance(0.0101)
    (chunk,) = received(board, 1)
    assert (chunk.first_sample, chunk.time_s) == (0, 5.0)


def test_a_trigger_after_the_stop_starts_nothing(
    board: Board, simulated: SimulatedLibrary, clock: ManualClock
) -> None:
    board.start()
    board.stop()
    simulated.terminals.rise("/Dev1/PFI0", clock.now_s())
    clock.advance(1.0)
    assert board.receive(0.0) is None


def test_a_waveform_that_begins_with_the_acquisition_lies_on_its_samples(
    simulated: SimulatedLibrary, clock: ManualClock
) -> None:
    # Dev2 starts when it is told to; what Dev1 gives is read by Dev1's own input elsewhere.
    library = SimulatedLibrary(clock, wires={"Dev1/ao0": "Dev1/ai1"})
    board, outputs = library.open("Dev1"), open_outputs(library, "Dev1")
    board.configure(some_inputs(2), 1000.0, 10)
    ramp_v = np.linspace(0.0, 0.9, 10)
    outputs.play(PIEZO, Waveform(ramp_v, 1000.0, trigger="/Dev1/ai/StartTrigger"))
    clock.advance(3.0)
    assert library.output_level("Dev1", "ao0").at(clock.now_s()) == 0.0
    board.start()
    clock.advance(0.0101)
    (chunk,) = received(board, 1)
    assert chunk.volts[1] == pytest.approx(ramp_v, abs=2e-3)
    board.close()
    outputs.close()


def test_the_driver_is_reported_the_trigger_and_the_first_chunk_dates_the_start(
    clock: ManualClock,
) -> None:
    driver = FakeOutputNidaqmx()
    board = NidaqmxLibrary(clock, start_triggers=TRIGGERS, api=driver).open("Dev1")
    board.configure(some_inputs(1), 1000.0, 10)
    assert [each.trigger for each in driver.tasks] == ["/Dev1/PFI0"]
    board.start()
    clock.advance(7.01)
    driver.take(10)
    (chunk,) = received(board, 1)
    assert chunk.time_s == pytest.approx(7.0)
    board.close()


def test_a_labjack_refuses_a_trigger() -> None:
    with pytest.raises(NotAvailable, match="T7_1: a LabJack board starts on command only"):
        make_library("labjack", start_triggers={"T7_1": "/T7_1/FIO0"})
