"""What is true of NI's boards alone: the driver's ways, and its many errors."""

import inspect
import threading
from collections.abc import Iterator

import nidaqmx
import nidaqmx.stream_readers
import numpy as np
import pytest
from nidaqmx.constants import TerminalConfiguration
from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError, DaqNotSupportedError, Error
from nidaqmx.task.collections import AIChannelCollection

from contract import fake_nidaqmx
from contract.board_rig import NidaqmxRig, failure_of, one_input, received, some_inputs
from cosmic.daqco.hw import nidaqmx_board
from cosmic.daqco.hw.interface import BoardChunk, InputMode, OverrunError
from cosmic.daqco.hw.nidaqmx_errors import STATUS, TABLE, board_error
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    LimitError,
    NotConnectedError,
)


@pytest.fixture
def rig() -> Iterator[NidaqmxRig]:
    made = NidaqmxRig()
    yield made
    made.close()


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> ManualClock:
    """The wall clock as the board sees it, in the hand of the test."""
    clock = ManualClock()
    monkeypatch.setattr(nidaqmx_board, "WALL", clock)
    return clock


def task_of(rig: NidaqmxRig) -> fake_nidaqmx.FakeTask:
    (task,) = rig.driver.tasks
    return task


# --- the fake is like the real package --------------------------------------------------------


@pytest.mark.parametrize(
    ("fake", "real"),
    [
        (fake_nidaqmx.FakeTask, nidaqmx.Task),
        (fake_nidaqmx.FakeChannels, AIChannelCollection),
        (fake_nidaqmx.FakeReader, nidaqmx.stream_readers.AnalogMultiChannelReader),
    ],
)
def test_what_the_program_calls_exists_in_the_real_package_with_the_same_arguments(
    fake: type, real: type
) -> None:
    for name in (
        "add_ai_voltage_chan",
        "close",
        "control",
        "is_task_done",
        "read_many_sample",
        "register_done_event",
        "register_every_n_samples_acquired_into_buffer_event",
        "start",
        "stop",
    ):
        if hasattr(fake, name):
            ours = inspect.signature(getattr(fake, name)).parameters
            theirs = inspect.signature(getattr(real, name)).parameters
            assert list(ours) == list(theirs), name


def test_what_the_program_reads_exists_in_the_real_package() -> None:
    device = nidaqmx.system.Device
    timing = inspect.getattr_static(nidaqmx.Task, "timing").fget.__annotations__["return"]
    assert "Timing" in str(timing)
    for name in (
        "ai_physical_chans",
        "ai_voltage_rngs",
        "product_type",
        "is_simulated",
        "serial_num",
        "ai_max_single_chan_rate",
        "ai_max_multi_chan_rate",
    ):
        assert hasattr(device, name), name
    for name in ("input_buf_size", "avail_samp_per_chan", "total_samp_per_chan_acquired"):
        assert hasattr(nidaqmx.task.InStream, name), name
    assert hasattr(nidaqmx.system.PhysicalChannel, "ai_term_cfgs")


def test_without_the_driver_the_real_package_leads_to_a_text_that_says_what_to_install() -> None:
    try:
        nidaqmx.system.System.local()
    except nidaqmx.errors.DaqNotFoundError:
        pass
    else:
        pytest.skip("NI-DAQmx is installed here")
    library = NidaqmxLibrary()
    with pytest.raises(NotConnectedError, match=r"Install NI-DAQmx from ni\.com"):
        library.list_boards()
    assert library.name == "NI-DAQmx (not installed)"


# --- listing ----------------------------------------------------------------------------------


def test_devices_without_analogue_inputs_or_answers_are_left_out(rig: NidaqmxRig) -> None:
    one, other = rig.driver.all_devices
    one.count = 0
    other.unreadable = True
    rig.driver.all_devices.append(fake_nidaqmx.FakeDevice(rig.driver, name="Dev3"))
    assert [each.name for each in rig.library.list_boards()] == ["Dev3"]
    with pytest.raises(NotConnectedError, match=r"'Dev1'.*Dev3"):
        rig.library.open("Dev1")


def test_a_device_whose_inputs_take_no_voltages_is_left_out(rig: NidaqmxRig) -> None:
    rig.driver.device("Dev2").ai_voltage_rngs = ()
    assert [info.name for info in rig.library.list_boards()] == ["Dev1"]
    with pytest.raises(NotConnectedError, match="Dev2"):
        rig.library.open("Dev2")


def test_the_library_reports_the_version_of_its_driver(rig: NidaqmxRig) -> None:
    assert rig.library.name == "NI-DAQmx 26.8"


def test_a_board_with_differential_inputs_only_is_used_as_it_is(rig: NidaqmxRig) -> None:
    device = rig.driver.device("Dev1")
    device.count, device.paired, device.ai_voltage_rngs = 4, False, (-10.0, 10.0)
    board = rig.open()
    board.configure(some_inputs(4, mode=InputMode.DIFFERENTIAL), 1000.0, 10)
    with pytest.raises(DeviceError, match=r"Dev1.*ai0.*rse.*differential"):
        board.configure(some_inputs(1), 1000.0, 10)


def test_a_slow_board_of_many_inputs_is_no_faster_with_one(rig: NidaqmxRig) -> None:
    device = rig.driver.device("Dev1")
    device.ai_max_single_chan_rate, device.ai_max_multi_chan_rate = 51_200.0, 409_600.0
    board = rig.open()
    board.configure(some_inputs(8), 50_000.0, 10)
    with pytest.raises(LimitError, match="51200 Hz"):
        board.configure(some_inputs(2), 60_000.0, 10)


# --- the task ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("rate_hz", "chunk"), [(300.0, 7), (15_000.0, 150), (10.0, 1), (20.0, 2)])
def test_the_buffer_holds_ten_seconds_in_whole_chunks(
    rig: NidaqmxRig, rate_hz: float, chunk: int
) -> None:
    board = rig.open()
    board.configure(some_inputs(2), rate_hz, chunk)
    assert task_of(rig).buffer % chunk == 0
    assert task_of(rig).buffer >= 10.0 * rate_hz


def test_the_rate_is_what_the_driver_makes_of_it(rig: NidaqmxRig) -> None:
    board = rig.open()
    made_hz = board.configure(some_inputs(1), 14_999.0, 10)
    assert made_hz == task_of(rig).rate_hz
    assert made_hz > 14_999.0
    board.start()
    rig.go_on(20)
    assert received(board, 2)[1].time_s == pytest.approx(10 / made_hz)


def test_inputs_go_to_the_driver_in_volts_with_their_wiring_and_range(rig: NidaqmxRig) -> None:
    asked = [
        one_input("ai5", InputMode.DIFFERENTIAL, -0.2, 0.1),
        one_input("ai9", InputMode.NRSE, 0.0, 5.0),
        one_input("ai2", InputMode.RSE),
    ]
    rig.open("Dev2").configure(asked, 1000.0, 10)
    assert task_of(rig).channels == [
        ("Dev2/ai5", TerminalConfiguration.DIFF, -0.2, 0.1),
        ("Dev2/ai9", TerminalConfiguration.NRSE, 0.0, 5.0),
        ("Dev2/ai2", TerminalConfiguration.RSE, -10.0, 10.0),
    ]


def test_a_board_takes_its_sample_clock_from_another_when_configured(rig: NidaqmxRig) -> None:
    terminal = "/Dev1/ai/SampleClock"
    library = NidaqmxLibrary(rig.clock, api=rig.driver, clock_sources={"Dev2": terminal})
    boards = [library.open(name) for name in ("Dev1", "Dev2")]
    for board in boards:
        board.configure(some_inputs(1), 1000.0, 10)
    assert [(task.board, task.source) for task in rig.driver.tasks] == [
        ("Dev1", ""),
        ("Dev2", terminal),
    ]
    for board in boards:
        board.close()


def test_a_board_on_another_s_clock_dates_its_samples_from_when_that_clock_began(
    rig: NidaqmxRig,
) -> None:
    library = NidaqmxLibrary(
        rig.clock, api=rig.driver, clock_sources={"Dev1": "/Dev2/ai/SampleClock"}
    )
    board = library.open("Dev1")
    rate_hz = board.configure(some_inputs(1), 1000.0, 10)
    board.start()
    rig.clock.advance(5.0)
    rig.go_on(10)
    rig.go_on(10)
    times_s = [each.time_s for each in received(board, 2)]
    assert times_s == pytest.approx([5.0, 5.0 + 10 / rate_hz])
    board.close()


@pytest.mark.parametrize(
    "call",
    [
        "add_ai_voltage_chan",
        "cfg_samp_clk_timing",
        "input_buf_size",
        "register_every_n_samples_acquired_into_buffer_event",
        "register_done_event",
        "control",
        "samp_clk_rate",
        "start",
    ],
)
def test_whatever_call_fails_the_board_is_given_back(rig: NidaqmxRig, call: str) -> None:
    board = rig.open()
    rig.driver.fail_in[call] = -200452

    def run() -> None:
        board.configure(some_inputs(2), 1000.0, 10)
        board.start()

    with pytest.raises(DeviceError, match="-200452"):
        run()
    assert not rig.driver.tasks
    rig.driver.fail_in.clear()
    run()
    rig.go_on(10)
    received(board, 1)


@pytest.mark.parametrize("call", ["stop", "close"])
def test_a_driver_that_fails_at_the_end_is_logged_and_the_board_works_again(
    rig: NidaqmxRig, call: str, caplog: pytest.LogCaptureFixture
) -> None:
    board = rig.running()
    rig.driver.fail_in[call] = -200452
    board.stop()
    board.close()
    assert f"Dev1: {call}" in caplog.text
    assert not rig.driver.tasks
    rig.driver.fail_in.clear()
    rig.running()


def test_a_stop_keeps_the_board_for_the_next_start(rig: NidaqmxRig) -> None:
    board = rig.running()
    task = task_of(rig)
    board.stop()
    board.start()
    assert task_of(rig) is task


def test_after_a_stop_that_failed_the_next_start_begins_anew(rig: NidaqmxRig) -> None:
    board = rig.running()
    task = task_of(rig)
    rig.driver.fail_in["stop"] = -200452
    board.stop()
    assert not rig.driver.tasks
    rig.driver.fail_in.clear()
    board.start()
    assert task_of(rig) is not task


# --- callbacks --------------------------------------------------------------------------------


def values(chunks: list[BoardChunk], row: int = 0) -> list[int]:
    """Return the sample numbers that the fake wrote into a row."""
    level_v = 0.1 * row
    volts = np.concatenate([each.volts[row] for each in chunks])
    return np.rint((volts - level_v) / fake_nidaqmx.MICROVOLT).astype(int).tolist()


def test_events_that_became_one_bring_all_their_chunks(rig: NidaqmxRig) -> None:
    board = rig.running()
    rig.driver.take(47, events=False)
    assert values(received(board, 4)) == list(range(40))
    rig.driver.take(3)
    assert values(received(board, 1)) == list(range(40, 50))
    assert board.receive(0.0) is None


@pytest.mark.parametrize("parts", [[4], [1, 2, 3], [9]])
def test_a_short_read_is_completed_and_its_rows_are_not_mixed(
    rig: NidaqmxRig, parts: list[int]
) -> None:
    board = rig.running(inputs=3)
    task_of(rig).short = list(parts)
    rig.go_on(20)
    chunks = received(board, 2)
    assert all(each.volts.shape == (3, 10) for each in chunks)
    for row in range(3):
        assert values(chunks, row) == list(range(20))


def test_reads_that_bring_nothing_end_the_acquisition(rig: NidaqmxRig) -> None:
    board = rig.running()
    task_of(rig).short = [3, 0]
    rig.go_on(10)
    error = failure_of(board)
    assert isinstance(error, DeviceTimeout)
    assert "3 of 10 samples" in str(error)


def test_a_buffer_that_was_overwritten_reports_how_much_is_lost(rig: NidaqmxRig) -> None:
    board = rig.running()
    rig.driver.take(10)
    rig.driver.take(10_123, events=False)
    error = failure_of(board)
    assert error.code == -200279
    assert "123 samples of each channel were lost" in str(error)


def test_an_overflow_on_the_board_reports_how_much_is_lost(rig: NidaqmxRig) -> None:
    board = rig.running()
    rig.driver.take(10)
    task_of(rig).taken += 44
    rig.driver.device("Dev1").broken = -200361
    task = task_of(rig)
    rig.driver.in_driver(lambda: rig.driver.answers.append(task.on_samples(None, 1, 10, None)))
    error = failure_of(board)
    assert error.fault is DeviceFault.OVERRUN
    assert "-200361" in str(error) and "44 samples of each channel were lost" in str(error)
    assert not rig.driver.tasks


def test_chunks_that_came_before_an_error_are_still_handed_out(rig: NidaqmxRig) -> None:
    board = rig.running()
    rig.go_on(30)
    rig.driver.break_down("Dev1", -200361)
    assert len(received(board, 3)) == 3
    assert failure_of(board).fault is DeviceFault.OVERRUN


def test_a_receiver_that_sleeps_costs_no_more_memory_than_ten_seconds(rig: NidaqmxRig) -> None:
    board = rig.running(rate_hz=1000.0, chunk=10)
    rig.go_on(30_000)
    read = task_of(rig).read
    assert 10_000 <= read <= 10_100
    assert values([board.receive(0.0)])[0] == 0  # type: ignore[list-item]
    assert f"after sample {read}" in str(failure_of(board))


def test_an_event_after_the_stop_does_nothing(rig: NidaqmxRig) -> None:
    board = rig.running()
    task = task_of(rig)
    board.stop()
    for call in (lambda: task.on_samples(None, 1, 10, None), lambda: task.on_done(None, -1, None)):
        rig.driver.in_driver(lambda call=call: rig.driver.answers.append(call()))
    assert board.receive(0.0) is None
    board.close()
    rig.driver.in_driver(lambda: rig.driver.answers.append(task.on_samples(None, 1, 10, None)))
    assert set(rig.driver.answers) == {0}


def test_a_stop_during_a_read_is_no_error(rig: NidaqmxRig, monkeypatch: pytest.MonkeyPatch) -> None:
    board = rig.running()
    real = fake_nidaqmx.FakeReader.read_many_sample

    def stopped_meanwhile(reader: object, *args: object) -> int:
        board.stop()
        return real(reader, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(fake_nidaqmx.FakeReader, "read_many_sample", stopped_meanwhile)
    rig.driver.take(10)
    assert board.receive(0.0) is None
    monkeypatch.undo()
    board.start()
    rig.go_on(10)
    received(board, 1)


def test_a_mistake_in_a_callback_reaches_the_receiver(
    rig: NidaqmxRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    board = rig.running()

    def broken(*_: object) -> int:
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr(fake_nidaqmx.FakeReader, "read_many_sample", broken)
    rig.driver.take(10)
    with pytest.raises(ZeroDivisionError, match="a defect"):
        board.receive(0.0)
    assert not rig.driver.tasks


def test_receiving_waits_for_the_thread_of_the_driver(rig: NidaqmxRig) -> None:
    board = rig.running()
    got: list[BoardChunk | None] = []
    waiting = threading.Thread(target=lambda: got.append(board.receive(20.0)))
    waiting.start()
    rig.driver.take(10)
    waiting.join(10.0)
    assert got[0] is not None


# --- boards that fall silent ------------------------------------------------------------------


def test_a_board_that_dies_without_a_word_is_found_out_within_a_second(
    rig: NidaqmxRig, wall: ManualClock
) -> None:
    board = rig.running()
    rig.unplug_silently("Dev1")
    assert board.receive(0.0) is None
    wall.advance(1.1)
    with pytest.raises(NotConnectedError, match=r"Dev1.*cable"):
        board.receive(0.0)
    assert not rig.driver.tasks


def test_a_task_that_ended_by_itself_is_reported(rig: NidaqmxRig, wall: ManualClock) -> None:
    board = rig.running()
    task_of(rig).running = False
    wall.advance(1.1)
    with pytest.raises(DeviceError, match="ended by itself"):
        board.receive(0.0)


def test_a_slow_board_that_is_merely_between_chunks_is_left_alone(
    rig: NidaqmxRig, wall: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    board = rig.running(rate_hz=10.0, chunk=10)
    asked: list[int] = []
    monkeypatch.setattr(fake_nidaqmx.FakeTask, "is_task_done", lambda task: asked.append(1))
    for _ in range(3):
        wall.advance(1.3)
        assert board.receive(0.0) is None
    assert not asked


def test_a_living_board_without_samples_is_warned_of_but_goes_on(
    rig: NidaqmxRig, wall: ManualClock, caplog: pytest.LogCaptureFixture
) -> None:
    board = rig.running()
    wall.advance(1.1)
    assert board.receive(0.0) is None
    assert "Dev1: no samples for 1 s" in caplog.text
    rig.go_on(10)
    received(board, 1)


# --- errors -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "kind", "fault", "advice"),
    [
        (-200279, OverrunError, DeviceFault.OVERRUN, "lower the rate"),
        (-200361, OverrunError, DeviceFault.OVERRUN, "memory on the board"),
        (-200284, DeviceTimeout, DeviceFault.TIMEOUT, "clock"),
        (-50103, DeviceError, DeviceFault.STATE, "close it"),
        (-200220, NotConnectedError, DeviceFault.COMMUNICATION, "cable"),
        (-200324, NotConnectedError, DeviceFault.COMMUNICATION, "cable"),
        (-88705, NotConnectedError, DeviceFault.COMMUNICATION, "cable"),
        (-50405, NotConnectedError, DeviceFault.COMMUNICATION, "cable"),
        (-200077, DeviceError, DeviceFault.PARAMETER, "setting"),
        (-200981, DeviceError, DeviceFault.UNSUPPORTED, "cannot use it"),
        (-12345, DeviceError, DeviceFault.OTHER, "does not know"),
    ],
)
def test_an_error_of_the_driver_is_reported_with_board_code_and_advice(
    code: int, kind: type[DeviceError], fault: DeviceFault, advice: str
) -> None:
    error = board_error(DaqError("The driver's words.\nMore of them.", code), "read", "Dev1")
    assert type(error) is kind
    assert isinstance(error, DeviceError)
    assert (error.fault, error.code) == (fault, code)
    for word in ("Dev1", "read", str(code), advice, "The driver's words."):
        assert word in str(error)
    assert "More of them" not in str(error)


@pytest.mark.parametrize("code", [-200332, -200335, -200331, -200081, -200579, -200580])
def test_a_rate_or_range_that_the_driver_refuses_is_a_limit(code: int) -> None:
    error = TABLE.error(code, "configure", "Dev1")
    assert isinstance(error, LimitError)
    assert "Dev1" in str(error) and str(code) in str(error)


@pytest.mark.parametrize(
    ("raised", "kind", "word"),
    [
        (DaqNotSupportedError("no"), NotConnectedError, "operating system"),
        (DaqFunctionNotSupportedError("DAQmxFoo"), DeviceError, "update"),
        (Error(""), DeviceError, "failed"),
    ],
)
def test_errors_without_a_code_are_reported_too(
    raised: Error, kind: type[CosmicError], word: str
) -> None:
    error = board_error(raised, "list the boards", "NI-DAQmx")
    assert type(error) is kind
    assert word in str(error) and "NI-DAQmx" in str(error)


def test_the_codes_are_the_driver_s() -> None:
    known = {each.value for each in nidaqmx.error_codes.DAQmxErrors}
    assert set(STATUS) <= known


def test_a_rate_that_only_the_driver_knows_to_be_too_high_is_a_limit(rig: NidaqmxRig) -> None:
    board = rig.open()
    rig.driver.device("Dev1").ai_max_multi_chan_rate = 30_000.0
    with pytest.raises(LimitError, match="-200332"):
        board.configure(some_inputs(4), 10_000.0, 10)


def test_a_start_that_the_driver_refuses_is_an_error_of_the_board(rig: NidaqmxRig) -> None:
    board = rig.open()
    board.configure(some_inputs(4), 10_000.0, 10)
    rig.driver.fail_in["start"] = -200332
    with pytest.raises(DeviceError, match="-200332") as caught:
        board.start()
    assert caught.value.fault is DeviceFault.PARAMETER
