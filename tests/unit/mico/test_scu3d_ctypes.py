"""The binding against what the header says, written down here a second time."""

import ctypes
import sys
import threading
import time
from collections.abc import Iterator
from ctypes import c_int32, c_uint32

import pytest

from cosmic.frame.clock import ManualClock
from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw.sim_scu3d import load_simulated_library

UINTS = ctypes.POINTER(c_uint32)
LATER = {"Scale", "PhysicalPositionKnown", "ChannelProperty", "SystemProperty"}


def test_the_packet_lies_in_memory_as_in_c() -> None:
    offsets = [getattr(sa.SA_PACKET, name).offset for name, _ in sa.SA_PACKET._fields_]
    assert offsets == [0, 4, 8, 12, 16]
    assert ctypes.sizeof(sa.SA_PACKET) == 20


def test_data1_is_unsigned_and_data2_and_data3_are_signed() -> None:
    packet = sa.SA_PACKET(2**32 - 1, 2**32 - 1, 2**32 - 1, -1, -1)
    assert (packet.data1, packet.data2, packet.data3) == (2**32 - 1, -1, -1)
    assert (packet.packetType, packet.channelIndex) == (2**32 - 1, 2**32 - 1)


def test_the_header_has_77_functions_and_had_63() -> None:
    assert len(sa.PROTOTYPES) == 77
    assert len(sa.FUNCTIONS_V12) == 63
    added = set(sa.PROTOTYPES) - sa.FUNCTIONS_V12
    assert {name[6:-2] for name in added} == LATER


def test_each_command_has_two_forms_but_six() -> None:
    bases = {name[:-2] for name in sa.PROTOTYPES if name.endswith("_S")}
    only_async = {name for name in sa.PROTOTYPES if name.endswith("_A") and name[:-2] not in bases}
    assert all(f"{base}_A" in sa.PROTOTYPES for base in bases)
    assert len(bases) == 31
    assert only_async == {
        "SA_SetReportOnComplete_A",
        "SA_SetReceiveNotification_A",
        "SA_ReceiveNextPacket_A",
        "SA_ReceiveNextPacketIfChannel_A",
        "SA_LookAtNextPacket_A",
        "SA_DiscardPacket_A",
    }


@pytest.mark.parametrize(
    ("name", "types"),
    [
        ("SA_GetAvailableDevices", (UINTS, UINTS)),
        ("SA_InitDevices", (c_uint32,)),
        ("SA_ReleaseDevices", ()),
        ("SA_MoveStep_A", (c_uint32, c_uint32, c_int32, c_uint32, c_uint32)),
        ("SA_MovePositionAbsolute_A", (c_uint32, c_uint32, c_int32, c_uint32)),
        ("SA_MoveAngleRelative_S", (c_uint32, c_uint32, c_int32, c_int32, c_uint32)),
        ("SA_MoveToEndStop_A", (c_uint32,) * 5),
        ("SA_GetPosition_S", (c_uint32, c_uint32, ctypes.POINTER(c_int32))),
        ("SA_GetPosition_A", (c_uint32, c_uint32)),
        ("SA_SetSystemProperty_A", (c_uint32, c_int32, c_int32)),
        ("SA_GetSystemProperty_A", (c_uint32, c_int32)),
        ("SA_GetSystemProperty_S", (c_uint32, c_int32, ctypes.POINTER(c_int32))),
        ("SA_GetChannelProperty_A", (c_uint32, c_uint32, c_int32)),
        ("SA_SetReceiveNotification_A", (c_uint32, ctypes.c_void_p)),
        ("SA_DiscardPacket_A", (c_uint32,)),
    ],
)
def test_a_prototype_is_that_of_the_header(name: str, types: tuple[type, ...]) -> None:
    assert sa.PROTOTYPES[name] == types


def test_every_function_returns_an_unsigned_status() -> None:
    for name, types in sa.PROTOTYPES.items():
        kind = sa.function_type(name)
        assert kind._restype_ is c_uint32
        assert kind._argtypes_ == types
        assert sa.function_type(name) is kind


def test_the_convention_is_cdecl() -> None:
    assert sa.function_type("SA_Stop_A")._flags_ & 1  # FUNCFLAG_CDECL of ctypes


def test_a_constant_stands_for_one_number_in_its_group() -> None:
    for ending, count in [("_ERROR", 30), ("_PACKET_TYPE", 17), ("_STATUS", 7)]:
        group = [value for name, value in vars(sa).items() if name.endswith(ending)]
        assert len(group) == len(set(group)) == count, ending


class OneFunction:
    """A library with one function, and a NULL in the place of another."""

    def __init__(self) -> None:
        self.stopped: list[tuple[int, int]] = []
        self.SA_Stop_A = sa.function_type("SA_Stop_A")(self.stop)
        self.SA_SetZero_A = sa.function_type("SA_SetZero_A")()

    def stop(self, device: int, channel: int) -> int:
        self.stopped.append((device, channel))
        return 5


def test_a_call_reaches_the_function_and_brings_its_status_back() -> None:
    library = OneFunction()
    assert sa.Scu3dLibrary(library).call("SA_Stop_A", 3, 2) == 5
    assert library.stopped == [(3, 2)]


@pytest.mark.parametrize("missing", ["SA_GetPhysicalPositionKnown_A", "SA_SetZero_A"])
def test_a_missing_or_null_function_answers_that_it_is_not_supported(missing: str) -> None:
    library = sa.Scu3dLibrary(OneFunction())
    assert library.has("SA_Stop_A")
    assert not library.has(missing)
    assert library.call(missing, 0, 0) == sa.SA_COMMAND_NOT_SUPPORTED_ERROR == 129


def test_a_function_that_no_header_declares_is_a_programming_error() -> None:
    with pytest.raises(KeyError):
        sa.Scu3dLibrary(OneFunction()).call("SA_FlushOutput_A", 0)


class Waiting(threading.Thread):
    """A thread that counts how often it got hold of the interpreter."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.count = 0
        self.ended = False

    def run(self) -> None:
        while not self.ended:
            self.count += 1
            time.sleep(0.0)  # lets go at once


@pytest.fixture
def waiting() -> Iterator[Waiting]:
    before_s = sys.getswitchinterval()
    thread = Waiting()
    thread.start()
    sys.setswitchinterval(100.0)  # from now on nobody who keeps the interpreter loses it
    yield thread
    thread.ended = True
    sys.setswitchinterval(before_s)
    thread.join()


def test_a_library_in_python_is_called_without_letting_go_of_the_interpreter(
    waiting: Waiting,
) -> None:
    library = load_simulated_library(clock=ManualClock(auto_advance=True))
    calls = sa.Scu3dLibrary(library)
    assert calls.call("SA_InitDevices", sa.SA_ASYNCHRONOUS_COMMUNICATION) == sa.SA_OK
    calls.call("SA_Stop_A", 0, 0)
    before = waiting.count
    for _ in range(3000):
        calls.call("SA_Stop_A", 0, 0)
    assert waiting.count == before


def test_a_client_in_c_gets_the_pointers_as_they_are() -> None:
    library = load_simulated_library(clock=ManualClock(auto_advance=True))
    for name in sa.PROTOTYPES:
        assert isinstance(getattr(library, name), sa.function_type(name))
