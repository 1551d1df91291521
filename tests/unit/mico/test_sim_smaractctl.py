"""The simulated SmarActCTL against what the MCS2 Programmer's Guide says, called as C calls it."""

import ctypes as ct
import threading
from typing import Any

import pytest

from cosmic.frame.clock import ManualClock
from cosmic.mico.hw.sim_smaractctl import SimulatedLibrary, load_simulated_library

STATE, POSITION, TARGET = 0x0305000F, 0x0305001D, 0x0305001E
SCALE_OFFSET, SCALE_INVERSION = 0x02040024, 0x02040025
MODE, VELOCITY, CL_HERTZ, STEP_HERTZ = 0x03050087, 0x03050029, 0x0305002F, 0x0305002E
LOW, HIGH, AMPLIFIER, SENSOR_POWER = 0x02040020, 0x02040021, 0x0302000D, 0x03080019
DEVICE_NAME, AUTO_RECONNECT, OPTIONS, ERROR = 0x020F003D, 0xF01000A1, 0x0307005D, 0x0502007A
OK, PARAMETER, AMPLIFIER_OFF, RANGE = 0, 0x13, 0x106, 0x202
SENSOR_OFF, BAD_TRANSMISSION, LOST, CANCELED, BUSY_WAITING = 0x104, 0xF008, 0xF004, 0xF010, 0xF01B
TIMEOUT = 0x0004
FINISHED, CONNECTION_LOST = 0x0001, 0xF001
ABSOLUTE, RELATIVE, STEP = 0, 1, 4
MOVING, REFERENCED, AT_LIMIT, AMPLIFIER_ON = 0x1, 0x80, 0x200, 0x40000
LONG = (POSITION, TARGET, SCALE_OFFSET, VELOCITY, LOW, HIGH)
UM = 10**6


class Event(ct.Structure):
    _fields_ = (
        ("idx", ct.c_uint32),
        ("type", ct.c_uint32),
        ("value", ct.c_int32),
        ("rest", ct.c_uint8 * 20),
    )


class Client:
    """One open controller, every function by its raw address."""

    def __init__(self, layout: str = "LLN", library: SimulatedLibrary | None = None) -> None:
        clock = ManualClock(auto_advance=True)
        self.library = library or load_simulated_library(layout, clock=clock)
        self.handle = 0
        self.open()

    def call(self, name: str, *args: Any) -> int:
        address = ct.cast(getattr(self.library, f"SA_CTL_{name}"), ct.c_void_p).value
        kinds = [type(each) for each in args]
        made = [ct.c_void_p if each.__name__ == "CArgObject" else each for each in kinds]
        given = [
            ct.cast(each, ct.c_void_p) if type(each).__name__ == "CArgObject" else each
            for each in args
        ]
        return int(ct.CFUNCTYPE(ct.c_uint32, *made)(address)(*given))

    def open(self) -> None:
        handle = ct.c_uint32()
        assert self.call("Open", ct.byref(handle), ct.c_char_p(b"usb:ix:0"), ct.c_char_p(b"")) == OK
        self.handle = handle.value

    def close(self) -> int:
        return self.call("Close", ct.c_uint32(self.handle))

    def at(self, channel: int, key: int) -> tuple[Any, ...]:
        return ct.c_uint32(self.handle), ct.c_int8(channel), ct.c_uint32(key)

    def put(self, key: int, value: int, channel: int = 0) -> int:
        kind, letter = (ct.c_int64, "i64") if key in LONG else (ct.c_int32, "i32")
        return self.call(f"SetProperty_{letter}", *self.at(channel, key), kind(value))

    def get(self, key: int, channel: int = 0) -> int:
        value, letter = (ct.c_int64(), "i64") if key in LONG else (ct.c_int32(), "i32")
        at = self.at(channel, key)
        assert self.call(f"GetProperty_{letter}", *at, ct.byref(value), ct.c_void_p()) == OK
        return int(value.value)

    def ask(self, key: int, transmission: int = 0) -> tuple[int, int]:
        number = ct.c_uint8()
        args = *self.at(0, key), ct.byref(number), ct.c_uint32(transmission)
        return self.call("RequestReadProperty", *args), number.value

    def read(self, number: int) -> int:
        value, handle = ct.c_int32(), ct.c_uint32(self.handle)
        at = handle, ct.c_uint8(number)
        return self.call("ReadProperty_i32", *at, ct.byref(value), ct.c_void_p())

    def event(self, timeout_ms: int = 60_000) -> tuple[int, Event]:
        event = Event()
        at = ct.c_uint32(self.handle), ct.byref(event), ct.c_uint32(timeout_ms)
        return self.call("WaitForEvent", *at), event

    def finished(self) -> int:
        """Return the result of the movement that ends next."""
        while True:
            code, event = self.event()
            assert code == OK
            if event.type == FINISHED:
                return int(event.value)

    def move(self, value: int, mode: int = ABSOLUTE, channel: int = 0) -> int:
        """Make a movement to its end and return its result."""
        assert self.put(MODE, mode, channel) == OK
        assert self.begin(value, channel) == OK
        return self.finished()

    def begin(self, value: int, channel: int = 0) -> int:
        at = ct.c_uint32(self.handle), ct.c_int8(channel)
        return self.call("Move", *at, ct.c_int64(value), ct.c_uint32(0))

    def reference(self) -> int:
        assert self.call("Reference", ct.c_uint32(self.handle), ct.c_int8(0), ct.c_uint32(0)) == OK
        return self.finished()


@pytest.fixture
def client() -> Client:
    return Client()


# --------------------------------------------------------------------------- range limits


@pytest.mark.parametrize("inverted", [0, 1])
def test_steps_end_at_the_range_limit_as_closed_loop_movements_do(
    client: Client, inverted: int
) -> None:
    assert client.put(SCALE_INVERSION, inverted) == OK
    assert client.reference() == OK
    assert client.move(0) == OK
    assert (client.put(LOW, -100 * UM), client.put(HIGH, 100 * UM)) == (OK, OK)
    for steps in (3000, -3000):
        assert client.move(steps, STEP) == RANGE
        assert abs(client.get(POSITION)) == pytest.approx(100 * UM, abs=5 * UM)
        assert client.get(STATE) & AT_LIMIT
    # Outwards nothing moves any more, inwards all does.
    before = client.get(POSITION)
    assert client.move(-300, STEP) == RANGE
    assert client.get(POSITION) == pytest.approx(before, abs=UM)
    assert client.move(10, STEP) == OK
    assert not client.get(STATE) & AT_LIMIT
    assert client.move(0) == OK


def test_steps_without_a_sensor_know_no_range(client: Client) -> None:
    assert (client.put(LOW, -1, 2), client.put(HIGH, 1, 2)) == (OK, OK)
    assert client.move(100, STEP, channel=2) == OK


def test_a_reference_behind_the_range_limit_is_not_found(client: Client) -> None:
    """A search turns round at a range limit as at an end stop."""
    assert client.reference() == OK
    assert client.move(2000 * UM) == OK
    assert (client.put(LOW, 1500 * UM), client.put(HIGH, 2500 * UM)) == (OK, OK)
    assert client.reference() != OK
    assert 1490 * UM <= client.get(POSITION) <= 2510 * UM
    assert client.put(HIGH, 1500 * UM) == OK, "no range is in force any more"
    assert client.reference() == OK


# --------------------------------------------------------------------------- refusals


@pytest.mark.parametrize("value", [10**14 + 1, -(10**14) - 1, 2**63 - 1, -(2**63)])
def test_a_target_beyond_the_range_of_the_mode_is_refused_by_its_end(
    client: Client, value: int
) -> None:
    for mode in (ABSOLUTE, RELATIVE):
        before = client.get(POSITION)
        assert client.move(value, mode) == PARAMETER
        assert client.get(ERROR) == PARAMETER
        assert client.get(POSITION) == pytest.approx(before, abs=UM)


def test_nothing_moves_while_the_amplifier_is_off(client: Client) -> None:
    assert client.get(STATE) & AMPLIFIER_ON
    assert client.put(CL_HERTZ, 50) == OK
    assert client.begin(1000 * UM) == OK
    assert client.put(AMPLIFIER, 0) == OK
    assert client.finished() == AMPLIFIER_OFF
    assert not client.get(STATE) & (AMPLIFIER_ON | MOVING)
    for mode in (ABSOLUTE, STEP):
        assert client.move(1, mode) == AMPLIFIER_OFF
    assert client.put(AMPLIFIER, 1) == OK
    assert client.move(1, STEP) == OK


def test_steps_go_on_when_the_sensor_is_switched_off(client: Client) -> None:
    assert (client.put(MODE, STEP), client.put(STEP_HERTZ, 1000)) == (OK, OK)
    assert client.begin(1000) == OK
    assert client.put(SENSOR_POWER, 0) == OK
    assert client.finished() == OK
    assert client.put(MODE, ABSOLUTE) == OK
    assert client.begin(0) == OK
    assert client.finished() == SENSOR_OFF


def test_a_null_text_is_refused_and_never_harms(
    client: Client, caplog: pytest.LogCaptureFixture
) -> None:
    at = client.at(0, DEVICE_NAME)
    assert client.call("SetProperty_s", *at, ct.c_char_p()) == PARAMETER
    assert not caplog.records


# --------------------------------------------------------------------------- the scale


@pytest.mark.parametrize(("key", "value"), [(SCALE_OFFSET, 1000 * UM), (SCALE_INVERSION, 1)])
def test_a_relative_movement_after_a_new_scale_goes_on_from_where_the_stage_stands(
    client: Client, key: int, value: int
) -> None:
    assert client.reference() == OK
    assert client.move(300 * UM) == OK
    assert client.put(key, value) == OK
    before = client.get(POSITION)
    assert client.get(TARGET) == pytest.approx(before, abs=UM)
    assert client.move(5 * UM, RELATIVE) == OK
    assert client.get(POSITION) == pytest.approx(before + 5 * UM, abs=UM)


# --------------------------------------------------------------------------- requests


def test_refused_and_cancelled_requests_leave_no_number_taken(client: Client) -> None:
    for _ in range(300):
        assert client.ask(STATE, transmission=77)[0] == BAD_TRANSMISSION
    buffer = ct.c_uint32()
    for _ in range(300):
        assert client.call("CreateOutputBuffer", ct.c_uint32(client.handle), ct.byref(buffer)) == OK
        code, number = client.ask(STATE, transmission=buffer.value)
        assert code == OK
        assert client.call("CancelOutputBuffer", ct.c_uint32(client.handle), buffer) == OK
    assert client.read(number) == PARAMETER
    code, number = client.ask(STATE)
    assert (code, client.read(number)) == (OK, OK)


def test_what_is_asked_in_a_buffer_is_answered_once_it_is_flushed(client: Client) -> None:
    buffers = []
    for _ in range(2):
        buffer = ct.c_uint32()
        assert client.call("CreateOutputBuffer", ct.c_uint32(client.handle), ct.byref(buffer)) == OK
        buffers.append(buffer)
    (_, first), (_, second) = (client.ask(STATE, transmission=each.value) for each in buffers)
    assert client.call("FlushOutputBuffer", ct.c_uint32(client.handle), buffers[0]) == OK
    assert client.call("CancelOutputBuffer", ct.c_uint32(client.handle), buffers[1]) == OK
    assert (client.read(first), client.read(second)) == (OK, PARAMETER)


# --------------------------------------------------------------------------- a lost connection


def test_after_an_unplugged_cable_the_handle_is_of_no_use_until_it_is_closed(
    client: Client,
) -> None:
    client.library.faults.inject("unplugged", device=0)
    code, event = client.event()
    assert (code, event.type) == (OK, CONNECTION_LOST)
    client.library.faults.clear("unplugged")
    assert client.put(MODE, STEP) == LOST
    assert client.begin(1) == LOST
    assert client.event(0)[0] == LOST
    assert client.close() == OK
    client.open()
    assert client.move(1, STEP) == OK


def test_with_auto_reconnect_the_handle_serves_again(client: Client) -> None:
    assert client.put(AUTO_RECONNECT, 1) == OK
    client.library.faults.inject("unplugged", device=0)
    assert client.put(MODE, STEP) == LOST
    client.library.faults.clear("unplugged")
    assert client.move(1, STEP) == OK
    assert client.close() == OK
    client.open()
    assert client.get(AUTO_RECONNECT) == 0


def test_a_new_handle_can_be_waited_on_while_the_wait_on_the_old_one_returns() -> None:
    client = Client(library=load_simulated_library("LLL", rate=1.0))
    for _ in range(20):
        codes: list[int] = []
        waiter = threading.Thread(target=lambda said=codes: said.append(client.event()[0]))
        waiter.start()
        while client.event(0)[0] != BUSY_WAITING:
            pass
        assert client.close() == OK
        client.open()
        assert client.event(1)[0] == TIMEOUT
        waiter.join(5.0)
        assert codes == [CANCELED]
