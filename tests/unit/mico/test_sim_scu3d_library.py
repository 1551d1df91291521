"""Section I, modes, indices, values, null pointers: what the library checks before it acts."""

import ctypes
import logging
from ctypes import byref, c_uint32

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosmic.frame.clock import ManualClock
from cosmic.mico.hw.scu3d_ctypes import FUNCTIONS_V12, PROTOTYPES, SA_PACKET
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from unit.mico.sim_client import ASYNC, ERROR, OK, RESET, SYNC, Client

POINTERS = (ctypes.POINTER(c_uint32), ctypes.POINTER(ctypes.c_int32), ctypes.POINTER(SA_PACKET))
SECTION_ONE = {name for name in PROTOTYPES if not name.endswith(("_S", "_A"))}
# Arguments that every function takes without complaint, after device and channel.
GOOD = {
    "SetClosedLoopMaxFrequency": (1000,),
    "SetSensorType": (1,),
    "SetPositionerAlignment": (0, 1000, 1000),
    "SetSafeDirection": (0,),
    "SetScale": (0, 0),
    "SetReportOnComplete": (1,),
    "MoveStep": (1, 1000, 1000),
    "SetAmplitude": (1000,),
    "MovePositionAbsolute": (0, 0),
    "MovePositionRelative": (0, 0),
    "MoveAngleAbsolute": (0, 0, 0),
    "MoveAngleRelative": (0, 0, 0),
    "MoveToReference": (0, 0),
    "MoveToEndStop": (0, 0, 0),
    "SetChannelProperty": (5, 10),
    "GetChannelProperty": (5,),
    "SetSystemProperty": (1, 1),
    "GetSystemProperty": (1,),
    "SetReceiveNotification": (1,),
    "ReceiveNextPacket": (0,),
    "ReceiveNextPacketIfChannel": (0,),
    "LookAtNextPacket": (0,),
}
NO_CHANNEL = (
    "SetSystemProperty", "GetSystemProperty", "SetReceiveNotification", "ReceiveNextPacket",
    "LookAtNextPacket", "DiscardPacket",
)  # fmt: skip


def arguments(name: str, *, device: int = 0, channel: int = 0, null: bool = False) -> list[object]:
    """Return a full argument list for the C function `name`, good but for what is asked."""
    base = name[3:-2]
    given: list[object] = [device, *([] if base in NO_CHANNEL else [channel]), *GOOD.get(base, ())]
    for kind in PROTOTYPES[name]:
        if kind in POINTERS:
            given.append(None if null else byref(kind._type_()))  # type: ignore[attr-defined]
    assert len(given) == len(PROTOTYPES[name]), name
    return given


section_two = pytest.mark.parametrize("name", sorted(set(PROTOTYPES) - SECTION_ONE))


def test_the_library_has_all_functions_of_the_header_as_c_function_pointers() -> None:
    library = load_simulated_library()
    for name, prototype in PROTOTYPES.items():
        function = getattr(library, name)
        assert ctypes.cast(function, ctypes.c_void_p).value, name
        assert function._argtypes_ == prototype, name
        assert function._restype_ is c_uint32, name


def test_the_library_of_2010_lacks_the_functions_of_later_versions() -> None:
    library = load_simulated_library(version="1.2.0")
    have = {name for name in PROTOTYPES if hasattr(library, name)}
    assert have == FUNCTIONS_V12 and len(have) == 63
    version = c_uint32()
    assert library.SA_GetDLLVersion(byref(version)) == OK and version.value == 0x01020000


def test_the_library_of_2010_has_no_words_for_later_errors() -> None:
    for mode in (ASYNC, SYNC):
        clock = ManualClock(auto_advance=True)
        client = Client(load_simulated_library(clock=clock, version="1.2.0"), mode=mode)
        client.library.faults.inject("overheated")
        if mode == SYNC:
            assert client.call("MoveStep_S", 0, 0, 1, 1000, 1000) == 255
            assert client.call("MovePositionAbsolute_S", 3, 0, 0, 0) == 131
        else:
            client.ok("MoveStep_A", 0, 0, 1, 1000, 1000)
            assert client.receive().data1 == 255


@section_two
def test_section_two_answers_2_before_initialisation_and_after_release(name: str) -> None:
    client = Client(mode=None)
    assert client.call(name[3:], *arguments(name)) == 2
    client.ok("InitDevices", ASYNC if name.endswith("_A") else SYNC)
    client.ok("ReleaseDevices")
    assert client.call(name[3:], *arguments(name)) == 2


@section_two
def test_the_other_modes_functions_answer_13(name: str) -> None:
    client = Client(mode=SYNC if name.endswith("_A") else ASYNC)
    assert client.call(name[3:], *arguments(name)) == 13


@section_two
def test_a_device_that_is_not_there_answers_5(name: str) -> None:
    client = Client(mode=ASYNC if name.endswith("_A") else SYNC)
    for device in (4, 2**32 - 1):
        assert client.call(name[3:], *arguments(name, device=device)) == 5


@pytest.mark.parametrize(
    "name", sorted(n for n in set(PROTOTYPES) - SECTION_ONE if n[3:-2] not in NO_CHANNEL)
)
def test_a_channel_that_is_not_there_answers_6(name: str) -> None:
    client = Client(mode=ASYNC if name.endswith("_A") else SYNC)
    for channel in (3, 2**32 - 1):
        assert client.call(name[3:], *arguments(name, channel=channel)) == 6


@pytest.mark.parametrize(
    "name", sorted(n for n, types in PROTOTYPES.items() if any(t in POINTERS for t in types))
)
def test_null_pointers_answer_9_and_never_crash(name: str) -> None:
    client = Client(mode=ASYNC if name.endswith("_A") else SYNC)
    given: list[object] = [None for _ in PROTOTYPES[name]]
    if name in SECTION_ONE:
        if name.startswith("SA_GetDevice"):
            given[0] = 0
    else:
        given = arguments(name, null=True)
    assert client.call(name[3:], *given) == 9


@section_two
def test_every_function_takes_good_arguments(name: str) -> None:
    client = Client(mode=ASYNC if name.endswith("_A") else SYNC)
    device = 3 if "Angle" in name else 0
    expected = 9 if "SetSystemProperty" in name else OK
    assert client.call(name[3:], *arguments(name, device=device)) == expected
    assert all(packet.type != ERROR for packet in client.settle()) if "_A" in name else True


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("SetClosedLoopMaxFrequency", (0,)),
        ("SetClosedLoopMaxFrequency", (18501,)),
        ("SetSensorType", (42,)),
        ("SetPositionerAlignment", (2, 1000, 1000)),
        ("SetPositionerAlignment", (1, 149, 1000)),
        ("SetPositionerAlignment", (1, 1000, 1001)),
        ("SetSafeDirection", (2,)),
        ("SetScale", (0, 2)),
        ("SetChannelProperty", (4, 1)),
        ("SetChannelProperty", (5, 0)),
        ("SetChannelProperty", (6, 11)),
        ("SetChannelProperty", (25, 1)),
        ("MoveStep", (30001, 1000, 1000)),
        ("MoveStep", (-30001, 1000, 1000)),
        ("MoveStep", (1, 149, 1000)),
        ("MoveStep", (1, 1001, 1000)),
        ("MoveStep", (1, 1000, 0)),
        ("MoveStep", (1, 1000, 18501)),
        ("SetAmplitude", (149,)),
        ("SetAmplitude", (1001,)),
        ("MovePositionAbsolute", (0, 60001)),
        ("MovePositionRelative", (0, 2**32 - 1)),
        ("MoveAngleAbsolute", (3_600_000, 0, 0)),
        ("MoveAngleAbsolute", (0, 1, 0)),
        ("MoveAngleRelative", (-3_600_000, 0, 0)),
        ("MoveToReference", (60001, 0)),
        ("MoveToReference", (0, 2)),
        ("MoveToEndStop", (2, 0, 0)),
    ],
)
def test_values_out_of_range_answer_9_in_both_modes(name: str, bad: tuple[int, ...]) -> None:
    for mode, letter in ((ASYNC, "A"), (SYNC, "S")):
        assert Client(mode=mode).call(f"{name}_{letter}", 0, 0, *bad) == 9


@pytest.mark.parametrize(
    ("name", "good"),
    [
        ("MoveStep", (30000, 150, 1)),
        ("MoveStep", (-30000, 1000, 18500)),
        ("SetAmplitude", (150,)),
        ("SetClosedLoopMaxFrequency", (18500,)),
        ("MovePositionAbsolute", (2**31 - 1, 60000)),
        ("SetSensorType", (41,)),
    ],
)
def test_the_ends_of_the_ranges_are_taken(name: str, good: tuple[int, ...]) -> None:
    assert Client().call(f"{name}_A", 0, 0, *good) == OK


def test_version_identity_and_number_of_devices() -> None:
    client = Client(mode=None)
    assert client.read("GetDLLVersion") == 0x01050010
    assert client.call("GetNumberOfDevices", byref(c_uint32())) == 2
    client.ok("InitDevices", ASYNC)
    assert client.read("GetNumberOfDevices") == 4
    ids = {client.read("GetDeviceID", device) for device in range(4)}
    assert len(ids) == 4
    assert client.read("GetDeviceFirmwareVersion", 0) == 0x02020005
    assert client.call("GetDeviceID", 4, byref(c_uint32())) == 5


def test_the_list_of_devices_needs_room_for_all() -> None:
    client = Client(mode=None)
    ids, size = (c_uint32 * 4)(), c_uint32(3)
    assert client.call("GetAvailableDevices", ids, byref(size)) == 17
    size.value = 4
    client.ok("GetAvailableDevices", ids, byref(size))
    assert size.value == 4 and len(set(ids)) == 4


def test_only_listed_devices_are_opened_in_that_order() -> None:
    client = Client(mode=None)
    ids, size = (c_uint32 * 9)(), c_uint32(9)
    client.ok("GetAvailableDevices", ids, byref(size))
    client.ok("AddDeviceToInitDevicesList", ids[2])
    client.ok("AddDeviceToInitDevicesList", ids[0])
    assert client.call("AddDeviceToInitDevicesList", ids[2]) == 18
    client.ok("InitDevices", ASYNC)
    assert client.read("GetNumberOfDevices") == 2
    assert client.read("GetDeviceID", 0) == ids[2]
    client.ok("ClearInitDevicesList")
    client.ok("InitDevices", ASYNC)
    assert client.read("GetNumberOfDevices") == 4


def test_an_unknown_device_in_the_list_fails_the_initialisation() -> None:
    client = Client(mode=None)
    client.ok("AddDeviceToInitDevicesList", 4711)
    assert client.call("InitDevices", ASYNC) == 19
    assert client.call("ReleaseDevices") == 2


def test_a_failed_initialisation_leaves_the_library_released() -> None:
    client = Client()
    client.ok("AddDeviceToInitDevicesList", 4711)
    assert client.call("InitDevices", ASYNC) == 19
    assert client.call("GetStatus_A", 0, 0) == 2


def test_no_device_plugged_in_answers_3() -> None:
    client = Client(mode=None)
    client.library.faults.inject("unplugged")
    assert client.call("InitDevices", ASYNC) == 3


def test_initialising_twice_releases_first_and_changes_the_mode() -> None:
    client = Client()
    client.ok("GetPosition_A", 0, 0)
    client.ok("InitDevices", SYNC)
    assert client.call("GetPosition_A", 0, 0) == 13
    client.ok("InitDevices", ASYNC)
    assert client.drain(timeout_ms=50) == [], "answers of the first session are gone"
    client.ok("ReleaseDevices")
    assert client.call("ReleaseDevices") == 2


def test_an_unknown_configuration_is_a_bad_parameter() -> None:
    assert Client(mode=None).call("InitDevices", 4) == 9
    assert Client(mode=None).call("InitDevices", RESET | ASYNC) == OK


@pytest.mark.parametrize("layout", ["", "LL", "LLLL", "LLX", "LLL,,LLL", "lll", "LLL;LLL", ","])
def test_a_bad_layout_says_what_is_wrong(layout: str) -> None:
    with pytest.raises(ValueError, match="three letters a device"):
        load_simulated_library(layout)


def test_sixteen_devices_work() -> None:
    client = Client(load_simulated_library("LLL," * 16, clock=ManualClock(auto_advance=True)))
    assert client.read("GetNumberOfDevices") == 16
    assert client.position(15, 2) == 0


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_a_clock_that_does_not_run_is_refused(rate: float) -> None:
    with pytest.raises(ValueError):
        load_simulated_library(rate=rate)


KNOWN_CODES = {*range(11), *range(12, 20), *range(128, 139)}
_numbers = st.one_of(
    st.integers(0, 3), st.integers(-(2**31), 2**32 - 1), st.sampled_from([150, 1000, 60_000])
)


@settings(max_examples=60)
@given(
    st.sampled_from([ASYNC, SYNC]),
    st.lists(
        st.tuples(st.sampled_from(sorted(PROTOTYPES)), st.lists(_numbers, min_size=5, max_size=5)),
        max_size=25,
    ),
)
def test_no_sequence_of_calls_is_answered_with_an_unknown_code_or_a_defect(
    mode: int, calls: list[tuple[str, list[int]]]
) -> None:
    client = Client(mode=mode)
    for name, numbers in calls:
        room = (c_uint32 * 16)(*([16] * 16))
        args: list[object] = []
        for kind, number in zip(PROTOTYPES[name], numbers, strict=False):
            pointer = ctypes.cast(room, kind) if kind in POINTERS else number
            args.append(None if kind in POINTERS and number % 7 == 0 else pointer)
        # A wait of weeks is a fair wish, but not in a test.
        if "Packet" in name and len(args) > 1:
            args[-2] = int(numbers[0]) % 100
        assert client.call(name[3:], *args) in KNOWN_CODES, name


def test_a_defect_inside_answers_255_and_is_logged(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    client = Client()

    def broken(*args: object) -> None:
        raise RuntimeError("defect")

    monkeypatch.setattr(client.library, "device", broken)
    with caplog.at_level(logging.ERROR):
        assert client.call("GetPosition_A", 0, 0) == 255
    assert "SA_GetPosition_A" in caplog.text and "defect" in caplog.text
