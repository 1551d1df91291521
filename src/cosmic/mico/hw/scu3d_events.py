"""SCU3DControl's packets as CoSMic events."""

from typing import Final

from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Channel,
    Completed,
    Direction,
    Event,
    Failed,
    OtherAnswer,
    PositionKnownRead,
    PositionRead,
    SafeDirectionRead,
    SensorPresentRead,
    Serial,
    TypeRead,
)
from cosmic.mico.hw.scu3d_convert import angle_deg, position_from_counts
from cosmic.mico.hw.scu3d_errors import status_error
from cosmic.mico.hw.scu3d_types import positioner_type

_ACTIVITIES: Final[dict[int, Activity]] = {
    sa.SA_STOPPED_STATUS: Activity.STOPPED,
    sa.SA_SETTING_AMPLITUDE_STATUS: Activity.SETTING_AMPLITUDE,
    sa.SA_MOVING_STATUS: Activity.STEPPING,
    sa.SA_TARGETING_STATUS: Activity.TARGETING,
    sa.SA_HOLDING_STATUS: Activity.HOLDING,
    sa.SA_CALIBRATING_STATUS: Activity.CALIBRATING,
    sa.SA_MOVING_TO_REFERENCE_STATUS: Activity.REFERENCING,
}
_DIRECTIONS: Final = {
    sa.SA_BACKWARD_DIRECTION: Direction.BACKWARD,
    sa.SA_FORWARD_DIRECTION: Direction.FORWARD,
}
_OTHERS: Final[dict[int, str]] = {
    sa.SA_CLOSED_LOOP_FREQUENCY_PACKET_TYPE: "closed-loop frequency limit in Hz",
    sa.SA_AMPLITUDE_PACKET_TYPE: "amplitude in 0.1 V",
    sa.SA_POSITIONER_ALIGNMENT_PACKET_TYPE: "alignment",
    sa.SA_SAFE_DIRECTION_PACKET_TYPE: "safe direction",
    sa.SA_SCALE_PACKET_TYPE: "scale",
    sa.SA_CHANNEL_PROPERTY_PACKET_TYPE: "channel property",
    sa.SA_SYSTEM_PROPERTY_PACKET_TYPE: "system property",
    sa.SA_INVALID_PACKET_TYPE: "invalid packet",
}
# An answer about a whole device carries no channel. 255 is a guess from the sister product; no
# SCU has more than a handful of channels, so nothing real is lost by it.
_NO_CHANNEL: Final = 255


def event_from_packet(
    device: int, packet: sa.SA_PACKET, *, serial: Serial | None = None
) -> Event | None:
    """Return what `packet`, received from `device`, says; None for the empty one of a timeout."""
    kind, at, value = packet.packetType, Channel(device, packet.channelIndex), packet.data1
    match kind:
        case sa.SA_NO_PACKET_TYPE:
            return None
        case sa.SA_ERROR_PACKET_TYPE:
            return _failed(at, value, serial)
        case sa.SA_POSITION_PACKET_TYPE:
            return PositionRead(at, position_from_counts(packet.data2, "um"), "um")
        case sa.SA_ANGLE_PACKET_TYPE:
            return PositionRead(at, angle_deg(value, packet.data2), "deg")
        case sa.SA_COMPLETED_PACKET_TYPE:
            return Completed(at)
        case sa.SA_STATUS_PACKET_TYPE if value in _ACTIVITIES:
            return ActivityRead(at, _ACTIVITIES[value])
        case sa.SA_SENSOR_TYPE_PACKET_TYPE:
            return TypeRead(at, positioner_type(value))
        case sa.SA_SENSOR_PRESENT_PACKET_TYPE:
            return SensorPresentRead(at, present=value != sa.SA_NO_SENSOR_PRESENT)
        case sa.SA_PHYSICAL_POSITION_KNOWN_PACKET_TYPE:
            # Only the documented 1 counts: a doubtful position must not pass as known.
            return PositionKnownRead(at, known=value == sa.SA_PHYSICAL_POSITION_KNOWN)
        case _:
            return _seldom(at, packet)


def _failed(at: Channel, code: int, serial: Serial | None) -> Event:
    channel = None if at.channel >= _NO_CHANNEL else at.channel
    if code == sa.SA_OK:
        # Not documented for the SCU; no error is no reason to end a movement.
        return OtherAnswer(at if channel is not None else None, "error packet without an error")
    error = status_error(
        code, "an earlier command", device=at.device, channel=channel, serial=serial
    )
    return Failed(at if channel is not None else None, error)


def _seldom(at: Channel, packet: sa.SA_PACKET) -> SafeDirectionRead | OtherAnswer:
    if packet.packetType == sa.SA_SAFE_DIRECTION_PACKET_TYPE and packet.data1 in _DIRECTIONS:
        return SafeDirectionRead(at, _DIRECTIONS[packet.data1])
    what = _OTHERS.get(packet.packetType, f"packet of type {packet.packetType}")
    text = f"{what}: {packet.data1}, {packet.data2}, {packet.data3}"
    return OtherAnswer(at if at.channel < _NO_CHANNEL else None, text)
