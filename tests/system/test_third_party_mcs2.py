"""Programs that others would write from SmarActControl.h alone, against the simulated library.

Nothing here knows CoSMic's own binding. The habits are those of public programs: of Odemis,
pylablib, pylabnet, PyMoDAQ and two laboratories' own.
"""

import ctypes as ct
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from cosmic.frame.clock import ManualClock, RatedClock
from cosmic.mico.hw.sim_smaractctl import load_simulated_library

POSITION, STATE, TARGET = 0x0305001D, 0x0305000F, 0x0305001E
MODE, VELOCITY, ACCELERATION, HOLD = 0x03050087, 0x03050029, 0x0305002B, 0x03050028
REFERENCING, UNIT, CHANNELS, TYPE_NAME = 0x0307005D, 0x03090042, 0x020F0017, 0x0302003D
STEP_HZ, STEP_AMPLITUDE, SCAN, SCAN_VELOCITY = 0x0305002E, 0x03050030, 0x0305001F, 0x0305002A
MOVING, REFERENCED, END_STOP = 0x1, 0x80, 0x100


def addresses(library: object) -> Callable[[str], int]:
    """Return how to find a function's address, as dlsym would."""
    return lambda name: int(ct.cast(getattr(library, name), ct.c_void_p).value or 0)


# ------------------------------------------------------- an actuator with exceptions and futures


class Stage:
    """In the manner of a microscope's control software: SI units, OSError, waits for the state."""

    def __init__(self, find: Callable[[str], int], locator: bytes, channel: int) -> None:
        self._find, self._channel = find, channel
        self._handle = ct.c_uint32()
        self._call("Open", ct.byref(self._handle), ct.c_char_p(locator), ct.c_char_p(b""))

    def _call(self, name: str, *args: Any) -> None:
        kinds = [ct.c_void_p if type(a).__name__ == "CArgObject" else type(a) for a in args]
        code = ct.CFUNCTYPE(ct.c_uint32, *kinds)(self._find(f"SA_CTL_{name}"))(
            *(ct.cast(a, ct.c_void_p) if type(a).__name__ == "CArgObject" else a for a in args)
        )
        if code:
            raise OSError(code, name)

    def get(self, key: int, kind: Any = ct.c_int64) -> int:
        value, size = kind(), ct.c_size_t(1)
        suffix = "i64" if kind is ct.c_int64 else "i32"
        at = self._handle, ct.c_int8(self._channel), ct.c_uint32(key)
        self._call(f"GetProperty_{suffix}", *at, ct.byref(value), ct.byref(size))
        return int(value.value)

    def set(self, key: int, value: int, kind: Any = ct.c_int64) -> None:
        suffix = "i64" if kind is ct.c_int64 else "i32"
        at = self._handle, ct.c_int8(self._channel), ct.c_uint32(key)
        self._call(f"SetProperty_{suffix}", *at, kind(value))

    def wait(self) -> None:
        for _ in range(5000):
            state = self.get(STATE, ct.c_int32)
            if not state & MOVING:
                if state & END_STOP:
                    raise OSError(0x200, "end stop")
                return
        raise TimeoutError

    def reference(self) -> None:
        self.set(REFERENCING, 0, ct.c_int32)
        self._call("Reference", self._handle, ct.c_int8(self._channel), ct.c_uint32(0))
        self.wait()

    def move_m(self, target_m: float, mode: int = 0) -> float:
        self.set(MODE, mode, ct.c_int32)
        value = ct.c_int64(round(target_m * 1e12))
        self._call("Move", self._handle, ct.c_int8(self._channel), value, ct.c_uint32(0))
        self.wait()
        return self.get(POSITION) * 1e-12

    def close(self) -> None:
        self._call("Close", self._handle)


@pytest.fixture
def stage() -> Iterator[Stage]:
    library = load_simulated_library("LLL", clock=ManualClock(auto_advance=True))
    made = Stage(addresses(library), b"usb:sn:MCS2-00000412", 0)
    yield made
    made.close()


def test_a_referenced_stage_goes_to_both_sides_of_its_mark(stage: Stage) -> None:
    """What programs expect of the usual positioner: its mark lies within the travel."""
    stage.set(VELOCITY, 2_000_000_000)
    stage.set(ACCELERATION, 100_000_000_000)
    stage.reference()
    assert stage.get(STATE, ct.c_int32) & REFERENCED
    for target_m in (1e-3, -5e-4, 0.0):
        assert stage.move_m(target_m) == pytest.approx(target_m, abs=3e-7)
    assert stage.move_m(-2e-4, mode=1) == pytest.approx(-2e-4, abs=2e-7)


def test_a_target_behind_the_end_ends_in_an_error_and_a_way_back(stage: Stage) -> None:
    stage.reference()
    with pytest.raises(OSError, match="end stop"):
        stage.move_m(50e-3)
    assert stage.move_m(0.0) == pytest.approx(0.0, abs=3e-7)


def test_a_locator_that_is_open_is_not_opened_again(stage: Stage) -> None:
    with pytest.raises(OSError, match="Open"):
        Stage(stage._find, b"usb:sn:MCS2-00000412", 0)
    with pytest.raises(OSError, match="Open"):
        Stage(stage._find, b"usb:sn:MCS2-99999999", 0)


# --------------------------------------------- plain ctypes: no prototypes, pointers by themselves


def test_a_program_that_sets_prototypes_of_its_own_steps_and_scans() -> None:
    """In the manner of an open-loop positioner's driver that knows no sensor."""
    lib: Any = load_simulated_library("NNL", clock=RatedClock(50.0))
    lib.SA_CTL_GetFullVersionString.restype = ct.c_char_p
    assert lib.SA_CTL_GetFullVersionString().decode().split(".")[0] == "1"
    lib.SA_CTL_FindDevices.argtypes = [
        ct.c_char_p,
        ct.POINTER(ct.c_char),
        ct.POINTER(ct.c_ulonglong),
    ]
    lib.SA_CTL_FindDevices.restype = ct.c_uint32
    names, size = ct.create_string_buffer(4096), ct.c_ulonglong(4096)
    assert lib.SA_CTL_FindDevices(None, names, size) == 0
    handle = ct.c_uint32()
    assert lib.SA_CTL_Open(handle, names.value, None) == 0
    count, bytes_ = ct.c_int32(), ct.c_size_t(ct.sizeof(ct.c_int32))
    assert lib.SA_CTL_GetProperty_i32(handle.value, 0, CHANNELS, count, bytes_) == 0
    assert count.value == 3

    def put(key: int, value: int) -> int:
        return int(lib.SA_CTL_SetProperty_i32(handle.value, 0, key, value))

    state = ct.c_int32()

    def moving() -> bool:
        assert lib.SA_CTL_GetProperty_i32(handle.value, 0, STATE, state, None) == 0
        return bool(state.value & MOVING)

    assert (put(MODE, 4), put(STEP_HZ, 20_000), put(STEP_AMPLITUDE, 65_535)) == (0, 0, 0)
    assert put(STEP_HZ, 20_001) == 0x13
    assert lib.SA_CTL_Move(handle.value, 0, 100_000, 0) == 0
    assert any(moving() for _ in range(50))
    assert lib.SA_CTL_Stop(handle.value, 0, 0) == 0
    assert any(not moving() for _ in range(200))
    assert put(MODE, 2) == 0
    assert lib.SA_CTL_SetProperty_i64(handle.value, 0, SCAN_VELOCITY, 65_535_000) == 0
    assert lib.SA_CTL_Move(handle.value, 0, 20_000, 0) == 0
    assert any(not moving() for _ in range(200))
    value = ct.c_int64()
    assert lib.SA_CTL_GetProperty_i64(handle.value, 0, SCAN, value, None) == 0
    assert value.value == 20_000
    assert lib.SA_CTL_GetProperty_i64(handle.value, 0, POSITION, value, None) == 0x103
    assert lib.SA_CTL_Close(handle.value) == 0
    assert lib.SA_CTL_Close(handle.value) == 0xF007


# ------------------------------------------------------------ events in a thread of their own


class Event(ct.Structure):
    _fields_ = (("idx", ct.c_uint32), ("type", ct.c_uint32), ("rest", ct.c_uint8 * 24))


def test_a_listener_hears_of_a_group_and_is_released_by_cancel() -> None:
    lib: Any = load_simulated_library("LLL", clock=RatedClock(20.0))
    handle, group = ct.c_uint32(), ct.c_uint32()
    assert lib.SA_CTL_Open(ct.byref(handle), b"usb:ix:0", b"") == 0
    wait = ct.CFUNCTYPE(ct.c_uint32, ct.c_uint32, ct.POINTER(Event), ct.c_uint32)(
        addresses(lib)("SA_CTL_WaitForEvent")
    )
    heard: list[tuple[int, int]] = []
    ended: list[int] = []
    all_done = threading.Event()

    def listen() -> None:
        event = Event()
        while not (code := wait(handle.value, ct.byref(event), 0xFFFFFFFF)):
            heard.append((event.type, event.idx))
            if len([each for each, _ in heard if each == 1]) == 2:
                all_done.set()
        ended.append(code)

    listener = threading.Thread(target=listen)
    listener.start()
    assert lib.SA_CTL_OpenCommandGroup(handle.value, ct.byref(group), 0) == 0
    for channel, target in ((0, 200_000_000), (2, -300_000_000)):
        assert lib.SA_CTL_Move(handle.value, channel, target, group.value) == 0
    assert not heard
    assert lib.SA_CTL_CloseCommandGroup(handle.value, group.value) == 0
    assert all_done.wait(10.0)
    assert lib.SA_CTL_Cancel(handle.value) == 0
    listener.join(5.0)
    assert ended == [0xF010]
    assert sorted(channel for kind, channel in heard if kind == 1) == [0, 2]
    assert 0x8010 in [kind for kind, _ in heard]
    assert lib.SA_CTL_Close(handle.value) == 0


# ------------------------------------------------------------ requests without waiting


def test_a_program_that_asks_first_and_reads_later_gets_each_answer() -> None:
    lib: Any = load_simulated_library("LLR", clock=ManualClock(auto_advance=True))
    handle, requests = ct.c_uint32(), [ct.c_uint8() for _ in range(3)]
    assert lib.SA_CTL_Open(ct.byref(handle), b"usb:ix:0", None) == 0
    for channel, request in enumerate(requests):
        assert lib.SA_CTL_RequestReadProperty(handle, channel, UNIT, ct.byref(request), 0) == 0
    units = []
    for request in requests:
        value, size = ct.c_int32(), ct.c_size_t(1)
        assert lib.SA_CTL_ReadProperty_i32(handle, request, ct.byref(value), ct.byref(size)) == 0
        units.append(value.value)
    assert units == [2, 2, 3], "metre, metre, degree"
    written = ct.c_uint8()
    assert (
        lib.SA_CTL_RequestWriteProperty_i64(handle, 0, POSITION, 10**8, ct.byref(written), 0) == 0
    )
    assert lib.SA_CTL_WaitForWrite(handle, written) == 0
    assert lib.SA_CTL_RequestWriteProperty_i32(handle, 0, HOLD, -1, None, 0) == 0
    text, size = ct.create_string_buffer(64), ct.c_size_t(64)
    assert lib.SA_CTL_GetProperty_s(handle, 0, TYPE_NAME, text, ct.byref(size)) == 0
    assert text.value == b"SL...S1SS" and size.value == 9
    assert lib.SA_CTL_Close(handle) == 0
