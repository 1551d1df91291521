"""The whole way down: CoSMic over the real package `nidaqmx` over a fake C library."""

from collections.abc import Iterator

import numpy as np
import pytest
from nidaqmx import _lib

from contract.board_rig import failure_of, one_input, received
from contract.fake_nicai import FakeLibrary
from cosmic.daqco.hw.interface import InputMode
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import DeviceError, DeviceFault

INPUTS = [one_input("ai2"), one_input("ai0", InputMode.NRSE, -0.5, 0.7)]


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeLibrary]:
    library = FakeLibrary()
    importer = _lib.DaqFunctionImporter(library)
    for name, value in (("_windll", importer), ("_cdll", importer), ("_encoding", "utf-8")):
        monkeypatch.setattr(_lib.lib_importer, name, value)
    yield library
    assert library.tasks == 0, "a task was left open"
    assert set(library.answers) <= {0}


def test_a_board_is_listed_with_what_its_driver_says(driver: FakeLibrary) -> None:
    library = NidaqmxLibrary(ManualClock())
    assert library.name == "NI-DAQmx 26.8"
    (info,) = library.list_boards()
    assert (info.name, info.product, info.simulated, info.serial) == (
        "Dev1",
        "PCI-6229",
        False,
        4711,
    )
    assert info.inputs == ("ai0", "ai1", "ai2", "ai3")
    assert info.ranges_v == ((-10.0, 10.0), (-1.0, 1.0))
    assert info.highest_rate_hz(4) == 62_500.0


def test_chunks_come_from_the_callback_of_the_driver(driver: FakeLibrary) -> None:
    board = NidaqmxLibrary(ManualClock()).open("Dev1")
    assert board.configure(INPUTS, 1000.0, 10) == 1000.5
    assert driver.buffer == 10_000
    board.start()
    driver.take(10)
    driver.take(25)
    chunks = received(board, 3)
    assert [each.first_sample for each in chunks] == [0, 10, 20]
    for chunk in chunks:
        assert np.array_equal(chunk.volts, np.array([[0.2], [0.0]]) + np.zeros(10))
    board.stop()
    board.close()
    channels = [call for call in driver.calls if call[0] == "DAQmxCreateAIVoltageChan"]
    rse, nrse, volts = 10083, 10078, 10348
    assert [call[2:] for call in channels] == [
        (b"Dev1/ai2", b"", rse, -10.0, 10.0, volts, b""),
        (b"Dev1/ai0", b"", nrse, -0.5, 0.7, volts, b""),
    ]


@pytest.mark.parametrize(
    ("function", "code", "fault"),
    [
        ("DAQmxReadAnalogF64", -200279, DeviceFault.OVERRUN),
        ("DAQmxGetReadAttribute", -200361, DeviceFault.OVERRUN),
        ("DAQmxReadAnalogF64", -201003, DeviceFault.COMMUNICATION),
    ],
)
def test_a_status_of_the_driver_becomes_an_error_in_the_receiver(
    driver: FakeLibrary, function: str, code: int, fault: DeviceFault
) -> None:
    board = NidaqmxLibrary(ManualClock()).open("Dev1")
    board.configure(INPUTS, 1000.0, 10)
    board.start()
    driver.statuses[function] = code
    driver.take(10)
    error = failure_of(board)
    assert (error.fault, error.code) == (fault, code)
    assert "driver: In words." in str(error)
    assert "DAQmxClearTask" in driver.names()


@pytest.mark.parametrize(
    "function",
    ["DAQmxCreateAIVoltageChan", "DAQmxCfgSampClkTiming", "DAQmxTaskControl", "DAQmxStartTask"],
)
def test_a_task_that_cannot_be_made_is_cleared(driver: FakeLibrary, function: str) -> None:
    board = NidaqmxLibrary(ManualClock()).open("Dev1")
    driver.statuses[function] = -50103

    def run() -> None:
        board.configure(INPUTS, 1000.0, 10)
        board.start()

    with pytest.raises(DeviceError, match="another program"):
        run()
    assert driver.tasks == 0
    driver.statuses.clear()
    run()
    driver.take(10)
    received(board, 1)
    board.close()


def test_an_old_driver_without_a_function_is_refused_with_the_advice_to_update(
    driver: FakeLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    board = NidaqmxLibrary(ManualClock()).open("Dev1")
    monkeypatch.delattr(driver, "DAQmxRegisterDoneEvent")
    with pytest.raises(DeviceError, match="update it") as caught:
        board.configure(INPUTS, 1000.0, 10)
    assert caught.value.fault is DeviceFault.UNSUPPORTED
