"""Pulses on the sample clock: from the counter of any board, to the trigger input of a camera."""

from collections.abc import Iterator
from math import inf
from pathlib import Path

import h5py
import pytest

import cosmic
from contract.board_rig import BoardRig, LabjackRig, SimulatedRig, received, some_inputs
from contract.fake_nidaqmx_outputs import FakeOutputNidaqmx
from cosmic.daqco.core.plan import make_plan
from cosmic.daqco.core.scale import VOLTS
from cosmic.daqco.core.settings import CameraTriggerSettings, ChannelSettings
from cosmic.daqco.core.udaq_core import UDaqCore
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.daqco.hw.pulses import PulseTrain, PulsingBoard
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import DeviceError, LimitError
from cosmic.frame.failure import FailurePolicy
from cosmic.twin.trigger_line import TriggerLine

TRAIN = PulseTrain("Dev1", "ctr0", first_sample=100, every_samples=50)
TRIGGER = CameraTriggerSettings(camera="microscope", board="Dev1", rate_hz=20.0)
CHANNEL = ChannelSettings(name="force", board="Dev1", input="ai0")


# --- which samples ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "count", "samples"),
    [
        (0, 100, []),
        (0, 101, [100]),
        (100, 1, [100]),
        (101, 49, []),
        (101, 50, [150]),
        (90, 200, [100, 150, 200, 250]),
    ],
)
def test_the_pulses_of_a_chunk_are_found(first: int, count: int, samples: list[int]) -> None:
    assert list(TRAIN.samples_in(first, count)) == samples
    assert [TRAIN.number_of(each) for each in samples] == [(each - 100) // 50 for each in samples]


def test_chunks_of_any_length_leave_no_pulse_out_and_have_none_twice() -> None:
    found = [each for first in range(0, 2000, 7) for each in TRAIN.samples_in(first, 7)]
    assert found == list(range(100, 2002, 50))


# --- the wire ---------------------------------------------------------------------------------


def test_a_line_rises_only_while_it_is_driven() -> None:
    line = TriggerLine()
    assert line.next_edge_s(0.0) == inf
    line.drive(10.0, 0.5)
    assert [line.next_edge_s(each) for each in (0.0, 10.0, 10.1, 10.5)] == [10.0, 10.0, 10.5, 10.5]
    line.rest(11.2)
    assert line.next_edge_s(10.6) == 11.0 and line.next_edge_s(11.1) == inf
    line.drive(20.0, 1.0)
    assert line.next_edge_s(10.6) == 11.0, "what rose before is still to be seen"
    assert line.next_edge_s(11.1) == 20.0


# --- simulated --------------------------------------------------------------------------------


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


def test_a_simulated_counter_drives_its_line_on_the_samples(clock: ManualClock) -> None:
    line = TriggerLine()
    library = SimulatedLibrary(clock, trigger_lines={"Dev1/ctr0": line})
    board = library.open("Dev1")
    assert isinstance(board, PulsingBoard)
    board.pulse(TRAIN)
    board.configure(some_inputs(1), 1000.0, 10)
    clock.advance(2.0)
    assert line.next_edge_s(0.0) == inf, "not before the start"
    board.start()
    assert [line.next_edge_s(each) for each in (0.0, 2.11)] == pytest.approx([2.1, 2.15])
    clock.advance(0.2)
    assert received(board, 1)[0].time_s == 2.0
    board.stop()
    assert line.next_edge_s(2.21) == inf
    board.pulse(None)
    board.start()
    assert line.next_edge_s(2.21) == inf
    board.close()


# --- NI ---------------------------------------------------------------------------------------


@pytest.fixture
def driver() -> Iterator[FakeOutputNidaqmx]:
    made = FakeOutputNidaqmx()
    yield made
    assert not made.tasks, "a task was left open"


def test_the_counter_of_a_real_board_counts_the_sample_clock_and_is_started_first(
    driver: FakeOutputNidaqmx, clock: ManualClock
) -> None:
    board = NidaqmxLibrary(clock, api=driver).open("Dev1")
    board.pulse(TRAIN)
    board.configure(some_inputs(1), 1000.0, 10)
    assert not driver.started
    board.start()
    assert driver.started == ["co", "ai"]
    (counter,) = [each for each in driver.tasks if each.kind == "co"]
    assert counter.place == "Dev1/ctr0" and counter.running
    assert counter.ticks == {"source": "/Dev1/ai/SampleClock", "delay": 100, "low": 25, "high": 25}
    board.stop()
    assert [each.kind for each in driver.tasks] == [""], "the counter is given back"
    board.start()
    assert driver.started == ["co", "ai"] * 2
    board.close()


def test_a_counter_that_is_taken_keeps_the_acquisition_from_starting(
    driver: FakeOutputNidaqmx, clock: ManualClock
) -> None:
    board = NidaqmxLibrary(clock, api=driver).open("Dev1")
    board.pulse(TRAIN)
    board.configure(some_inputs(1), 1000.0, 10)
    driver.fail_in["add_co"] = -50103
    with pytest.raises(DeviceError, match=r"Dev1: start ctr0 answered -50103"):
        board.start()
    driver.fail_in.clear()
    board.start()
    board.close()


# --- the plan ---------------------------------------------------------------------------------


def test_the_plan_counts_whole_samples_and_says_what_is_possible() -> None:
    infos = {each.name: each for each in SimulatedLibrary(ManualClock()).list_boards()}
    plan = make_plan([CHANNEL], 1000.0, 0.01, infos, TRIGGER)
    assert plan.pulses == PulseTrain("Dev1", "ctr0", 50, 50)
    with pytest.raises(LimitError, match=r"300 Hz asked; at 1000 samples a second up to 250 Hz"):
        make_plan([CHANNEL], 1000.0, 0.01, infos, TRIGGER.model_copy(update={"rate_hz": 300.0}))
    with pytest.raises(LimitError, match="no channel of Dev2 is active"):
        make_plan([CHANNEL], 1000.0, 0.01, infos, TRIGGER.model_copy(update={"board": "Dev2"}))


@pytest.mark.parametrize("rig_class", [SimulatedRig, LabjackRig])
def test_a_board_without_counters_says_so(rig_class: type[BoardRig]) -> None:
    rig = rig_class()
    infos = {each.name: each for each in rig.library.list_boards()}
    channel = CHANNEL.model_copy(update={"board": rig.one})
    trigger = TRIGGER.model_copy(update={"board": rig.one})
    plan = make_plan([channel], 1000.0, 0.01, infos, trigger)
    core = UDaqCore(
        plan, {rig.one: rig.open()}, {"force": VOLTS}, lambda _chunk: None, FailurePolicy()
    )
    if rig_class is LabjackRig:
        with pytest.raises(DeviceError, match="a T7 triggers no camera"):
            core.open()
    else:
        core.open()
        core.request_end()
        assert core.join()
    rig.close()


# --- files ------------------------------------------------------------------------------------


def test_a_recording_from_before_has_no_exposures(tmp_path: Path) -> None:
    with (
        cosmic.connect(applications=("daqco",), rate=10.0) as rig,
        rig.daqco.record(tmp_path / "run.h5"),
    ):
        rig.daqco.mark("here")
    with h5py.File(tmp_path / "run.h5", "r+") as file:
        del file["exposures"]
    with cosmic.open_recording(tmp_path / "run.h5") as recording:
        assert recording.exposures == ()
        assert recording.complete
