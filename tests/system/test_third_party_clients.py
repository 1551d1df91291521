"""Programs that other people would write from the header alone, against the simulated library.

Nothing here knows CoSMic's own binding: each client declares what it needs of SCU3DControl.h
itself and gets nothing but the addresses of the C functions.
"""

import ctypes as ct
import queue
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from cosmic.frame.clock import ManualClock, RatedClock
from cosmic.mico.hw.sim_scu3d import load_simulated_library

Addresses = Callable[[str], int]

u32, i32 = ct.c_uint, ct.c_int


def addresses(library: object) -> Addresses:
    """Return how to find a function's address, as dlsym would."""

    def find(name: str) -> int:
        return int(ct.cast(getattr(library, name), ct.c_void_p).value or 0)

    return find


class ScuError(Exception):
    def __init__(self, function: str, code: int) -> None:
        super().__init__(f"{function}: {code}")
        self.code = code


# --------------------------------------------------------------------- a synchronous wrapper


class SyncController:
    """In the manner of the laboratory libraries: one object, micrometres, exceptions."""

    def __init__(self, find: Addresses) -> None:
        self._find = find
        ids, size = (u32 * 32)(), u32(32)
        self._call("SA_GetAvailableDevices", ids, ct.byref(size))
        self.serials = list(ids[: size.value])
        self._call("SA_ClearInitDevicesList")
        for serial in self.serials:
            self._call("SA_AddDeviceToInitDevicesList", u32(serial))
        self._call("SA_InitDevices", u32(0))

    def _call(self, name: str, *args: Any) -> None:
        function = ct.CFUNCTYPE(u32, *(ct.c_void_p if _is_pointer(a) else type(a) for a in args))(
            self._find(name)
        )
        code = function(*(ct.cast(a, ct.c_void_p) if _is_pointer(a) else a for a in args))
        if code:
            raise ScuError(name, code)

    def close(self) -> None:
        self._call("SA_ReleaseDevices")

    def position_um(self, device: int, channel: int) -> float:
        value = i32()
        self._call("SA_GetPosition_S", u32(device), u32(channel), ct.pointer(value))
        return value.value / 10

    def is_rotary(self, device: int, channel: int) -> bool:
        try:
            self.position_um(device, channel)
        except ScuError as error:
            return error.code == 131
        return False

    def angle_deg(self, device: int, channel: int) -> float:
        angle, revolution = i32(), i32()
        self._call(
            "SA_GetAngle_S", u32(device), u32(channel), ct.pointer(angle), ct.pointer(revolution)
        )
        return angle.value / 1e4

    def status(self, device: int, channel: int) -> int:
        value = u32()
        self._call("SA_GetStatus_S", u32(device), u32(channel), ct.pointer(value))
        return value.value

    def wait(self, device: int, channel: int) -> None:
        for _ in range(20_000):
            if self.status(device, channel) in (0, 4):
                return
        raise TimeoutError

    def move_um(self, device: int, channel: int, um: float) -> None:
        self._call(
            "SA_MovePositionAbsolute_S", u32(device), u32(channel), i32(round(um * 10)), u32(1000)
        )
        self.wait(device, channel)

    def home(self, device: int, channel: int) -> None:
        self._call("SA_MoveToReference_S", u32(device), u32(channel), u32(0), u32(1))
        self.wait(device, channel)

    def jog(self, device: int, channel: int, steps: int) -> None:
        self._call("SA_MoveStep_S", u32(device), u32(channel), i32(steps), u32(1000), u32(5000))
        self.wait(device, channel)


def _is_pointer(value: object) -> bool:
    return isinstance(value, ct.Array | ct._Pointer) or type(value).__name__ == "CArgObject"


@pytest.fixture
def stand() -> Iterator[SyncController]:
    library = load_simulated_library(clock=ManualClock(auto_advance=True))
    controller = SyncController(addresses(library))
    yield controller
    controller.close()


def test_a_synchronous_library_finds_homes_moves_and_reads(stand: SyncController) -> None:
    assert len(stand.serials) == 4
    assert stand.position_um(0, 0) == 0.0
    stand.home(0, 0)
    assert stand.position_um(0, 0) == 0.0
    for target_um in (100.0, 2500.0, 0.3):
        stand.move_um(0, 0, target_um)
        assert stand.position_um(0, 0) == pytest.approx(target_um, abs=0.25)
    assert stand.status(0, 0) == 4


def test_a_synchronous_library_finds_kinds_by_asking_for_positions(stand: SyncController) -> None:
    assert stand.is_rotary(3, 0)
    assert not stand.is_rotary(0, 0)
    stand.home(3, 0)
    assert stand.angle_deg(3, 0) == 0.0
    with pytest.raises(ScuError, match="130"):
        stand.position_um(3, 1)
    stand.jog(3, 1, 100)
    stand.jog(3, 1, -100)


def test_a_synchronous_library_gets_codes_for_its_mistakes(stand: SyncController) -> None:
    for call, code in (
        (lambda: stand.position_um(9, 0), 5),
        (lambda: stand.position_um(0, 9), 6),
        (lambda: stand.jog(0, 0, 40_000), 9),
    ):
        with pytest.raises(ScuError) as caught:
            call()
        assert caught.value.code == code
    stand.close()
    with pytest.raises(ScuError) as caught:
        stand.position_um(0, 0)
    assert caught.value.code == 2
    SyncController(stand._find)


# --------------------------------------------------------------------- an asynchronous listener


class Packet(ct.Structure):
    _fields_ = (
        ("type", ct.c_uint32),
        ("channel", ct.c_uint32),
        ("d1", ct.c_uint32),
        ("d2", ct.c_int32),
        ("d3", ct.c_int32),
    )


class AsyncStation:
    """One listener thread a device, which puts what comes on a queue."""

    def __init__(self, find: Addresses) -> None:
        def bind(name: str, *kinds: Any) -> Callable[..., int]:
            function: Callable[..., int] = ct.CFUNCTYPE(ct.c_uint32, *kinds)(find(name))
            return function

        u = ct.c_uint32
        self.init = bind("SA_InitDevices", u)
        self.release = bind("SA_ReleaseDevices")
        self.count = bind("SA_GetNumberOfDevices", ct.POINTER(u))
        self.report = bind("SA_SetReportOnComplete_A", u, u, u)
        self.move = bind("SA_MovePositionRelative_A", u, u, ct.c_int32, u)
        self.step = bind("SA_MoveStep_A", u, u, ct.c_int32, u, u)
        self.stop = bind("SA_Stop_A", u, u)
        self.ask = bind("SA_GetPosition_A", u, u)
        self.receive = bind("SA_ReceiveNextPacket_A", u, u, ct.POINTER(Packet))
        assert self.init(1) == 0
        number = u()
        assert self.count(ct.byref(number)) == 0
        self.inboxes = [queue.Queue[tuple[int, int, int]]() for _ in range(number.value)]
        self._ending = threading.Event()
        self._threads = [
            threading.Thread(target=self._listen, args=(device,)) for device in range(number.value)
        ]
        for thread in self._threads:
            thread.start()

    def _listen(self, device: int) -> None:
        packet = Packet()
        while not self._ending.is_set():
            if self.receive(device, 20, ct.byref(packet)) != 0:
                return
            if packet.type:
                self.inboxes[device].put((packet.type, packet.channel, packet.d2))

    def expect(self, device: int, kind: int) -> tuple[int, int, int]:
        while True:
            got = self.inboxes[device].get(timeout=10.0)
            if got[0] == kind:
                return got

    def close(self) -> None:
        self._ending.set()
        for thread in self._threads:
            thread.join(5.0)
        assert self.release() == 0


@pytest.fixture
def station() -> Iterator[AsyncStation]:
    # The library object must outlive its addresses, as a loaded DLL does.
    library = load_simulated_library(clock=RatedClock(50.0))
    station = AsyncStation(addresses(library))
    yield station
    station.close()


def test_an_asynchronous_listener_hears_of_all_axes_moved_together(station: AsyncStation) -> None:
    axes = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (2, 0), (2, 1)]
    for axis in axes:
        assert station.report(*axis, 1) == 0
        assert station.move(*axis, -2000, 60_000) == 0
    done = [(device, station.expect(device, 4)[1]) for device, _ in axes]
    assert sorted(done) == axes
    for axis in axes:
        assert station.ask(*axis) == 0
    for device, _ in axes:
        assert station.expect(device, 2)[2] == pytest.approx(-2000, abs=2)


def test_an_asynchronous_listener_sees_a_stop_from_another_thread(station: AsyncStation) -> None:
    assert station.report(2, 2, 1) == 0
    assert station.step(2, 2, -30_000, 1000, 100) == 0
    stopper = threading.Thread(target=lambda: station.stop(2, 2))
    stopper.start()
    assert station.expect(2, 4) == (4, 2, 0)
    stopper.join()


# --------------------------------------------------------------------- a polling mover


def test_a_polling_program_in_one_thread_runs_as_fast_as_it_can() -> None:
    """Looks at position and status by turns until it is there; never waits for COMPLETED."""
    library: Any = load_simulated_library("LLL", clock=ManualClock(auto_advance=True))
    packet = Packet()
    # ctypes functions taken as they are, with another program's packet behind a cast.
    receive = ct.CFUNCTYPE(u32, u32, u32, ct.c_void_p)(addresses(library)("SA_ReceiveNextPacket_A"))

    def answer(kind: int) -> Packet:
        for _ in range(1000):
            assert receive(0, 1000, ct.addressof(packet)) == 0
            if packet.type == kind:
                return packet
        raise TimeoutError

    assert library.SA_InitDevices(1) == 0
    for target in (3000, -3000, 0):
        assert library.SA_MovePositionAbsolute_A(0, 1, target, 0) == 0
        polls = 0
        while True:
            polls += 1
            assert polls < 5000
            assert library.SA_GetStatus_A(0, 1) == 0
            if answer(5).d1 == 0:
                break
        assert polls > 5
        assert library.SA_GetPosition_A(0, 1) == 0
        assert answer(2).d2 == pytest.approx(target, abs=2)
    assert library.SA_ReleaseDevices() == 0


# --------------------------------------------------------------------- a table of raw addresses


def test_a_table_of_raw_addresses_is_all_a_c_program_needs() -> None:
    """Passes every number as a plain machine word, as a C program without prototypes would."""
    library = load_simulated_library("LLL,RNN", clock=ManualClock(auto_advance=True))
    find = addresses(library)
    word = ct.c_size_t

    def call(name: str, *args: int) -> int:
        return int(ct.CFUNCTYPE(u32, *(word for _ in args))(find(name))(*args))

    buffer = (ct.c_uint32 * 8)()
    where = ct.addressof(buffer)
    assert call("SA_GetDLLVersion", where) == 0 and buffer[0] >> 24 == 1
    assert call("SA_InitDevices", 1) == 0
    assert call("SA_GetNumberOfDevices", where) == 0 and buffer[0] == 2
    assert call("SA_MoveAngleRelative_A", 1, 0, 2**32 - 100_000, 0, 60_000) == 0
    assert call("SA_ReceiveNextPacket_A", 1, 4000, where) == 0
    assert list(buffer[:5]) == [0] * 5, "nobody asked for reports"
    assert call("SA_GetAngle_A", 1, 0) == 0
    assert call("SA_ReceiveNextPacket_A", 1, 200, where) == 0
    assert buffer[0] == 3
    assert ct.c_int32(buffer[2]).value == pytest.approx(-100_000, abs=6)
    assert list(buffer[5:]) == [0, 0, 0], "20 bytes and not one more"
    assert call("SA_ReceiveNextPacket_A", 1, 0, 0) == 9
    assert call("SA_ReleaseDevices") == 0
    assert call("SA_Stop_A", 0, 0) == 2
