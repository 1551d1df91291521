"""What SmarActCTL answers and tells, as CoSMic events."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.addresses import where
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Channel,
    Completed,
    Direction,
    Event,
    Failed,
    OtherAnswer,
    PositionerKind,
    PositionerType,
    PositionKnownRead,
    PositionRead,
    ReferenceKind,
    SafeDirectionRead,
    SensorPresentRead,
    Serial,
    TypeRead,
)
from cosmic.mico.hw.smaractctl_convert import from_counts
from cosmic.mico.hw.smaractctl_errors import result_error

Answers = Mapping[int, int | str]
_UNITS: Final[dict[int, tuple[AxisUnit, PositionerKind]]] = {
    sa.SA_CTL_UNIT_METER: ("um", PositionerKind.LINEAR),
    sa.SA_CTL_UNIT_DEGREE: ("deg", PositionerKind.ROTARY),
}
# A reference that no document names counts as none.
_REFERENCES: Final = {
    sa.SA_CTL_REF_TYPE_END_STOP: ReferenceKind.END_STOP,
    sa.SA_CTL_REF_TYPE_SINGLE_CODED: ReferenceKind.MARK,
    sa.SA_CTL_REF_TYPE_DISTANCE_CODED: ReferenceKind.MARK,
}
_MOVING: Final = sa.SA_CTL_CH_STATE_BIT_ACTIVELY_MOVING | sa.SA_CTL_CH_STATE_BIT_MOVE_DELAYED
_FIRST_MODULE_EVENT: Final = 0x4000


@dataclass(slots=True)
class Question:
    """What was asked of one channel: one answer of the library for each property."""

    at: Channel
    keys: tuple[int, ...]
    make: Callable[[Channel, Answers], Event]
    answers: dict[int, int | str] = field(default_factory=dict)


def activity(state: int) -> Activity:
    """Return what a channel is doing by the bits of its state."""
    if state & sa.SA_CTL_CH_STATE_BIT_CALIBRATING:
        return Activity.CALIBRATING
    if state & sa.SA_CTL_CH_STATE_BIT_REFERENCING:
        return Activity.REFERENCING
    closed = state & sa.SA_CTL_CH_STATE_BIT_CLOSED_LOOP_ACTIVE
    if state & _MOVING:
        return Activity.TARGETING if closed else Activity.STEPPING
    return Activity.HOLDING if closed else Activity.STOPPED


def activity_read(at: Channel, answers: Answers) -> Event:
    """Answer `ask_activity`."""
    return ActivityRead(at, activity(int(answers[sa.SA_CTL_PKEY_CHANNEL_STATE])))


def sensor_present(at: Channel, answers: Answers) -> Event:
    """Answer `ask_sensor_present`."""
    state = int(answers[sa.SA_CTL_PKEY_CHANNEL_STATE])
    return SensorPresentRead(at, present=bool(state & sa.SA_CTL_CH_STATE_BIT_SENSOR_PRESENT))


def position_known(at: Channel, answers: Answers) -> Event:
    """Answer `ask_position_known`."""
    state = int(answers[sa.SA_CTL_PKEY_CHANNEL_STATE])
    return PositionKnownRead(at, known=bool(state & sa.SA_CTL_CH_STATE_BIT_IS_REFERENCED))


def safe_direction(at: Channel, answers: Answers) -> Event:
    """Answer `ask_safe_direction`."""
    backward = answers[sa.SA_CTL_PKEY_SAFE_DIRECTION] == sa.SA_CTL_BACKWARD_DIRECTION
    return SafeDirectionRead(at, Direction.BACKWARD if backward else Direction.FORWARD)


def positioner_type(at: Channel, answers: Answers) -> Event:
    """Answer `ask_type`."""
    unit = _UNITS.get(int(answers[sa.SA_CTL_PKEY_POS_BASE_UNIT]))
    reference = int(answers[sa.SA_CTL_PKEY_POS_REFERENCE_TYPE])
    found = PositionerType(
        code=int(answers[sa.SA_CTL_PKEY_POSITIONER_TYPE]),
        name=str(answers[sa.SA_CTL_PKEY_POSITIONER_TYPE_NAME]),
        kind=None if unit is None else unit[1],
        reference=_REFERENCES.get(reference, ReferenceKind.NONE),
    )
    inverted = answers[sa.SA_CTL_PKEY_LOGICAL_SCALE_INVERSION] != sa.SA_CTL_NON_INVERTED
    return TypeRead(at, found.counted_backwards() if inverted else found)


def position_in(wanted: AxisUnit) -> Callable[[Channel, Answers], Event]:
    """Return what answers `ask_position`: the position, or that it is in another unit."""

    def make(at: Channel, answers: Answers) -> Event:
        base = int(answers[sa.SA_CTL_PKEY_POS_BASE_UNIT])
        unit, _ = _UNITS.get(base, (None, None))
        if unit != wanted:
            text = f"{where(at.device, at.channel)}: its position is not in {wanted}"
            fault = DeviceFault.WRONG_KIND
            error = DeviceError(text, fault=fault, device=at.device, channel=at.channel)
            return Failed(at, error)
        return PositionRead(at, from_counts(int(answers[sa.SA_CTL_PKEY_POSITION]), wanted), wanted)

    return make


def event_of(
    device: int, event: sa.SA_CTL_Event, *, serial: Serial | None, seeks_end: bool
) -> Event:
    """Return what an event that nobody asked for says; raises `DeviceError` when all is lost.

    Parameters
    ----------
    seeks_end : bool
        The channel drives to its end stop, so that reaching it is no failure.
    """
    if event.type == sa.SA_CTL_EVENT_CONNECTION_LOST:
        code = sa.SA_CTL_ERROR_COMMUNICATION_FAILED
        raise result_error(code, "SA_CTL_WaitForEvent()", device=device, serial=serial)
    if event.type >= _FIRST_MODULE_EVENT:
        if event.type == sa.SA_CTL_EVENT_EMERGENCY_STOP_TRIGGERED:
            code = sa.SA_CTL_ERROR_MOVEMENT_LOCKED
            return Failed(None, result_error(code, "emergency stop", device=device, serial=serial))
        return OtherAnswer(None, f"event {event.type:#06x}: {event.i32}")
    at = Channel(device, event.idx)
    match event.type:
        case sa.SA_CTL_EVENT_MOVEMENT_FINISHED:
            return _finished(at, event.i32, serial, seeks_end=seeks_end)
        case sa.SA_CTL_EVENT_HOLDING_ABORTED:
            return _failed(at, event.i32, "holding", serial)
        case sa.SA_CTL_EVENT_FOLLOWING_ERR_LIMIT:
            return _failed(at, sa.SA_CTL_ERROR_FOLLOWING_ERR_LIMIT, "a movement", serial)
        case sa.SA_CTL_EVENT_SENSOR_STATE_CHANGED if event.i32 == 0:
            return _failed(at, sa.SA_CTL_ERROR_NO_SENSOR_PRESENT, "the sensor", serial)
        case _:
            return OtherAnswer(at, f"event {event.type:#06x}: {event.i32}")


def _finished(at: Channel, code: int, serial: Serial | None, *, seeks_end: bool) -> Event:
    well = code in (sa.SA_CTL_ERROR_NONE, sa.SA_CTL_ERROR_ABORTED)
    if well or (seeks_end and code == sa.SA_CTL_ERROR_END_STOP_REACHED):
        return Completed(at)
    return _failed(at, code, "a movement", serial)


def _failed(at: Channel, code: int, what: str, serial: Serial | None) -> Failed:
    error = result_error(code, what, device=at.device, channel=at.channel, serial=serial)
    return Failed(at, error)
