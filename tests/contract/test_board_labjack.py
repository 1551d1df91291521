"""What is true of LabJack's boards alone: LJM's ways, and its errors by number."""

import inspect
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

from contract import fake_ljm
from contract.board_rig import LabjackRig, failure_of, one_input, received, some_inputs
from contract.fake_ljm import FakeBoard, FakeLjm, LJMError
from cosmic.daqco.hw import labjack_board
from cosmic.daqco.hw.factory import make_library
from cosmic.daqco.hw.interface import InputMode, OverrunError
from cosmic.daqco.hw.labjack_errors import STATUS, board_error
from cosmic.daqco.hw.labjack_library import LabjackLibrary, LabjackOptions
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceError,
    DeviceFault,
    LimitError,
    NotAvailable,
    NotConnectedError,
)

DIFFERENTIAL = InputMode.DIFFERENTIAL
CALLED = (
    "close",
    "eReadName",
    "eStreamRead",
    "eStreamStart",
    "eStreamStop",
    "eWriteName",
    "eWriteNames",
    "listAllS",
    "openS",
    "readLibraryConfigS",
    "setStreamCallback",
)


@pytest.fixture
def rig() -> Iterator[LabjackRig]:
    made = LabjackRig()
    yield made
    made.close()


def of_kind(kind: str) -> tuple[FakeLjm, LabjackLibrary]:
    ljm = FakeLjm([FakeBoard(480010001, kind)])
    return ljm, LabjackLibrary(ManualClock(), api=ljm)


# --- the fake is like the real package --------------------------------------------------------


def test_what_the_program_calls_exists_in_the_real_package_with_the_same_arguments() -> None:
    ljm = pytest.importorskip("labjack.ljm")
    for name in CALLED:
        _, *ours = inspect.signature(getattr(FakeLjm, name)).parameters
        theirs = inspect.signature(getattr(ljm, name)).parameters
        assert [each.replace("_", "") for each in ours] == [each.lower() for each in theirs], name
    codes = ljm.errorcodes
    assert codes.LJM_BUFFER_FULL == fake_ljm.BUFFER_FULL
    assert codes.DEVICE_CURRENTLY_CLAIMED_BY_ANOTHER_PROCESS == fake_ljm.TAKEN
    assert codes.RECONNECT_FAILED == fake_ljm.RECONNECT_FAILED
    assert ljm.constants.DUMMY_VALUE == labjack_board.SKIPPED_V == fake_ljm.DUMMY


def test_without_the_library_the_real_package_leads_to_a_text_that_says_what_to_install(
    capfd: pytest.CaptureFixture[str],
) -> None:
    ljm = pytest.importorskip("labjack.ljm")
    if ljm.ljm._staticLib is not None:
        pytest.skip("LJM is installed here")
    library = make_library("labjack")
    with pytest.raises(NotConnectedError, match=r"Install LJM from labjack\.com"):
        library.list_boards()
    assert library.name == "LabJack LJM (not installed)"
    assert not capfd.readouterr().out


def test_without_the_package_the_extra_is_named() -> None:
    code = """
import sys
sys.modules["labjack"] = None
from cosmic.daqco.hw.factory import make_library
from cosmic.frame.errors import NotAvailable
library = make_library("labjack")
print(library.name)
try:
    library.list_boards()
except NotAvailable as exc:
    print(exc)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )
    assert "needs the extra 'labjack': pip install cosmic[labjack]" in done.stdout
    assert "LabJack LJM (not installed)" in done.stdout


# --- listing and opening ----------------------------------------------------------------------


def test_a_board_that_is_connected_twice_is_listed_once() -> None:
    ljm = FakeLjm([FakeBoard(470010001, ways=(3, 1)), FakeBoard(9, "Digit")])
    library = LabjackLibrary(ManualClock(), api=ljm)
    assert [each.name for each in library.list_boards()] == ["T7_470010001"]
    assert library.name == "LabJack LJM 1.2301"


def test_only_the_way_that_the_options_name_is_looked_at() -> None:
    ljm = FakeLjm([FakeBoard(470010001), FakeBoard(470010002, ways=(3,))])
    library = LabjackLibrary(ManualClock(), LabjackOptions(connection="ethernet"), api=ljm)
    assert [each.serial for each in library.list_boards()] == [470010002]


def test_options_and_clocks_that_no_labjack_has_are_refused() -> None:
    with pytest.raises(ConfigError, match="connection"):
        make_library("labjack", options={"connection": "carrier pigeon"})
    with pytest.raises(NotAvailable, match="T7_1: a LabJack board keeps to its own clock"):
        make_library("labjack", clock_sources={"T7_1": "/Dev1/ai/SampleClock"})


def test_a_handle_is_opened_once_and_given_back(rig: LabjackRig) -> None:
    board = rig.running()
    board.stop()
    board.start()
    assert rig.ljm.opened == 1
    board.close()
    assert not rig.ljm.handles


# --- what is written to the board -------------------------------------------------------------


def test_a_t7_is_given_range_and_negative_input_of_each(rig: LabjackRig) -> None:
    board = rig.open()
    inputs = [one_input("ai2", DIFFERENTIAL, -0.05, 0.05), one_input("ai5", low_v=0.0, high_v=5.0)]
    board.configure(inputs, 1000.0, 10)
    written = rig.ljm.device(rig.one).written
    assert written["AIN2_RANGE"] == 0.1 and written["AIN2_NEGATIVE_CH"] == 3
    assert written["AIN5_RANGE"] == 10.0 and written["AIN5_NEGATIVE_CH"] == 199


def test_a_t8_has_differential_inputs_with_two_terminals_each() -> None:
    ljm, library = of_kind("T8")
    board = library.open("T8_480010001")
    board.configure(some_inputs(8, mode=DIFFERENTIAL), 1000.0, 10)
    assert ljm.boards[0].written["AIN7_RANGE"] == 11.0
    with pytest.raises(DeviceError, match=r"ai0 cannot be wired rse; a T8 can: differential"):
        board.configure(some_inputs(1), 1000.0, 10)
    board.close()


def test_a_t4_has_four_inputs_for_10_v_and_others_for_2_5_v() -> None:
    _, library = of_kind("T4")
    board = library.open("T4_480010001")
    board.configure([one_input("ai3"), one_input("ai4", low_v=0.0, high_v=2.5)], 1000.0, 10)
    with pytest.raises(LimitError, match=r"ai4: 0 to 5 V asked.*0 to 2\.5 V"):
        board.configure([one_input("ai4", low_v=0.0, high_v=5.0)], 1000.0, 10)
    with pytest.raises(DeviceError, match="T4 can: rse"):
        board.configure(some_inputs(1, mode=DIFFERENTIAL), 1000.0, 10)
    board.close()


def test_the_rate_reported_is_the_one_that_the_board_makes(rig: LabjackRig) -> None:
    board = rig.open()
    made_hz = board.configure(some_inputs(2), 3333.0, 10)
    assert made_hz == 80e6 / 24002 != 3333.0
    board.start()
    rig.go_on(20, rate_hz=made_hz)
    one, other = received(board, 2)
    assert other.time_s - one.time_s == pytest.approx(10 / made_hz, rel=1e-9)


# --- streaming --------------------------------------------------------------------------------


def test_a_stream_that_a_killed_program_left_running_is_ended_first(rig: LabjackRig) -> None:
    rig.ljm.device(rig.one).stream_left_on = True
    board = rig.running()
    rig.go_on(10)
    received(board, 1)


def test_a_chunk_that_came_late_dates_the_start_no_later_than_it_can_have_been(
    rig: LabjackRig,
) -> None:
    board = rig.running()
    rig.ljm.device(rig.one).stream.taken = 4  # it had begun before the call returned
    rig.go_on(6)
    (chunk,) = received(board, 1)
    assert chunk.time_s == pytest.approx(0.006 - 0.009)


def test_samples_that_the_board_skipped_end_the_acquisition_and_are_counted(
    rig: LabjackRig,
) -> None:
    board = rig.running()
    rig.ljm.device(rig.one).stream.skipped = {13, 14, 15}
    rig.go_on(30)
    assert np.all(received(board, 1)[0].volts > -1.0)
    error = failure_of(board)
    assert isinstance(error, OverrunError)
    assert error.lost == 3
    assert "3 samples of each channel were skipped" in str(error)
    board.start()
    rig.go_on(10)
    assert received(board, 1)[0].first_sample == 0


def test_a_full_buffer_of_the_library_is_an_overrun(rig: LabjackRig) -> None:
    board = rig.running()
    rig.ljm.device(rig.one).stream.failure = fake_ljm.BUFFER_FULL
    fake_ljm.tell(rig.ljm.device(rig.one).stream, 470010001)
    error = failure_of(board)
    assert isinstance(error, OverrunError) and error.code == 1301 and error.lost is None


def test_a_board_that_fell_silent_is_asked_whether_it_still_streams(
    rig: LabjackRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall = ManualClock()
    monkeypatch.setattr(labjack_board, "WALL", wall)
    board = rig.running()
    assert board.receive(0.0) is None
    wall.advance(1.5)
    assert board.receive(0.0) is None, "it streams, and may wait for a trigger"
    rig.ljm.device(rig.one).stream = None
    wall.advance(1.5)
    with pytest.raises(DeviceError, match="ended by itself"):
        board.receive(0.0)


def test_an_error_in_the_callback_reaches_the_receiver(rig: LabjackRig) -> None:
    board = rig.running()
    rig.ljm.fail_in["eStreamRead"] = 4711
    rig.go_on(10)
    with pytest.raises(DeviceError, match=r"T7_470010001: read answered 4711, which CoSMic does"):
        board.receive(0.0)
    rig.ljm.fail_in.clear()
    board.start()


def test_a_board_that_cannot_stop_is_opened_anew(rig: LabjackRig) -> None:
    board = rig.running()
    rig.ljm.fail_in["eStreamStop"] = 1304
    board.stop()
    rig.ljm.fail_in.clear()
    board.start()
    assert rig.ljm.opened == 2


# --- errors by number -------------------------------------------------------------------------


@pytest.mark.parametrize("code", [*STATUS, 2608, 2942, 4711])
def test_every_error_names_board_call_and_number(code: int) -> None:
    error = board_error(LJMError(code), "start", "T7_1")
    assert isinstance(error, CosmicError)
    assert f"T7_1: start answered {code}" in str(error)
    assert "in LJM's words" in str(error)


def test_the_numbers_are_those_of_the_real_package() -> None:
    ljm = pytest.importorskip("labjack.ljm")
    ours = {number for number in STATUS if number < 2000}
    assert ours <= {each for each in vars(ljm.errorcodes).values() if isinstance(each, int)}


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        (1227, DeviceFault.COMMUNICATION),
        (1230, DeviceFault.STATE),
        (1306, DeviceFault.TIMEOUT),
        (1301, DeviceFault.OVERRUN),
        (1307, DeviceFault.UNSUPPORTED),
    ],
)
def test_errors_are_sorted(code: int, fault: DeviceFault) -> None:
    error = board_error(LJMError(code), "start", "T7_1")
    assert isinstance(error, DeviceError) and error.fault is fault


def test_a_rate_that_the_board_refuses_is_a_limit(rig: LabjackRig) -> None:
    rig.ljm.fail_in["eStreamStart"] = 2942
    with pytest.raises(LimitError, match="cannot make this rate"):
        rig.open().configure(some_inputs(1), 1000.0, 10)
