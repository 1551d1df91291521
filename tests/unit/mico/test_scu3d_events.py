import pytest

from cosmic.frame.errors import DeviceFault
from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Channel,
    Completed,
    Event,
    Failed,
    OtherAnswer,
    PositionerKind,
    PositionKnownRead,
    PositionRead,
    ReferenceKind,
    SensorPresentRead,
)
from cosmic.mico.hw.scu3d_events import event_from_packet
from cosmic.mico.hw.scu3d_types import positioner_type

AT = Channel(3, 2)


def read(kind: int, data1: int = 0, data2: int = 0, *, channel: int = 2) -> Event | None:
    return event_from_packet(3, sa.SA_PACKET(kind, channel, data1, data2, 0), serial=4711)


def test_the_empty_packet_of_a_timeout_is_no_event() -> None:
    assert read(0, 132) is None


@pytest.mark.parametrize(
    ("kind", "data1", "data2", "event"),
    [
        (2, 77, -1234, PositionRead(AT, -123.4, "um")),
        (3, 2**32 - 15_000, 0, PositionRead(AT, -1.5, "deg")),
        (3, 15_000, 1, PositionRead(AT, 361.5, "deg")),
        (4, 0, 0, Completed(AT)),
        (5, 0, 0, ActivityRead(AT, Activity.STOPPED)),
        (5, 1, 0, ActivityRead(AT, Activity.SETTING_AMPLITUDE)),
        (5, 2, 0, ActivityRead(AT, Activity.STEPPING)),
        (5, 3, 0, ActivityRead(AT, Activity.TARGETING)),
        (5, 4, 0, ActivityRead(AT, Activity.HOLDING)),
        (5, 5, 0, ActivityRead(AT, Activity.CALIBRATING)),
        (5, 6, 0, ActivityRead(AT, Activity.REFERENCING)),
        (8, 0, 0, SensorPresentRead(AT, present=False)),
        (8, 1, 0, SensorPresentRead(AT, present=True)),
        (13, 0, 0, PositionKnownRead(AT, known=False)),
        (13, 1, 0, PositionKnownRead(AT, known=True)),
        (13, 2, 0, PositionKnownRead(AT, known=False)),
    ],
)
def test_a_packet_becomes_the_event_it_says(
    kind: int, data1: int, data2: int, event: Event
) -> None:
    assert read(kind, data1, data2) == event


@pytest.mark.parametrize("code", [132, 133, 134, 7])
def test_an_error_packet_is_a_failure_with_the_mapped_error(code: int) -> None:
    event = read(1, code)
    assert isinstance(event, Failed)
    assert event.channel == AT
    assert event.error.code == code
    assert event.error.fault is not DeviceFault.OTHER
    assert "device 3 (serial 4711), channel 2" in str(event.error)


def test_an_error_that_nobody_documented_is_a_failure_too() -> None:
    event = read(1, 201)
    assert isinstance(event, Failed)
    assert event.error.fault is DeviceFault.OTHER


def test_an_error_of_a_whole_device_has_no_channel() -> None:
    event = read(1, 134, channel=255)
    assert isinstance(event, Failed)
    assert event.channel is None
    assert event.error.channel is None
    assert event.error.device == 3


def test_an_error_packet_without_an_error_fails_nothing() -> None:
    assert isinstance(read(1, 0), OtherAnswer)


@pytest.mark.parametrize("kind", [6, 9, 10, 11, 12, 14, 15, 16, 200, 255, 2**32 - 1])
def test_a_packet_that_nobody_asked_for_is_kept_for_the_log(kind: int) -> None:
    event = read(kind, 17, -3)
    assert isinstance(event, OtherAnswer)
    assert event.channel == AT
    assert "17, -3, 0" in event.text


def test_a_status_that_nobody_documented_is_not_taken_for_rest() -> None:
    event = read(5, 9)
    assert isinstance(event, OtherAnswer)


@pytest.mark.parametrize(
    ("code", "kind", "reference"),
    [
        (0, PositionerKind.OPEN_LOOP, ReferenceKind.NONE),
        (1, PositionerKind.LINEAR, ReferenceKind.END_STOP),
        (8, PositionerKind.ROTARY, ReferenceKind.END_STOP),
        (9, PositionerKind.ROTARY, ReferenceKind.NONE),
        (18, PositionerKind.LINEAR, ReferenceKind.MARK),
        (19, PositionerKind.ROTARY, ReferenceKind.MARK),
        (21, PositionerKind.LINEAR, ReferenceKind.MARK),
        (28, PositionerKind.LINEAR, ReferenceKind.END_STOP),
        (36, None, ReferenceKind.MARK),
        (42, None, ReferenceKind.NONE),
        (2**32 - 1, None, ReferenceKind.NONE),
    ],
)
def test_a_type_code_says_how_to_move_and_to_reference(
    code: int, kind: PositionerKind | None, reference: ReferenceKind
) -> None:
    found = positioner_type(code)
    assert (found.code, found.kind, found.reference) == (code, kind, reference)
    assert str(code) in found.name or code < 42


def test_every_documented_type_has_its_own_name() -> None:
    names = {positioner_type(code).name for code in range(42)}
    assert len(names) == 42
    assert not any("unknown" in name for name in names)
