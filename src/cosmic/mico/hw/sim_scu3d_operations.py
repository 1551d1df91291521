"""What each command of section II does to a simulated channel, and which packet answers it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from cosmic.mico.hw import sim_scu3d_commands as commands
from cosmic.mico.hw import sim_scu3d_moves as moves
from cosmic.mico.hw.scu3d_ctypes import SA_AMPLITUDE_PACKET_TYPE as SA_AMPLITUDE
from cosmic.mico.hw.scu3d_ctypes import (
    SA_ANGLE_PACKET_TYPE,
    SA_CHANNEL_PROPERTY_PACKET_TYPE,
    SA_CLOSED_LOOP_FREQUENCY_PACKET_TYPE,
    SA_PHYSICAL_POSITION_KNOWN_PACKET_TYPE,
    SA_POSITION_PACKET_TYPE,
    SA_POSITIONER_ALIGNMENT_PACKET_TYPE,
    SA_SAFE_DIRECTION_PACKET_TYPE,
    SA_SCALE_PACKET_TYPE,
    SA_SENSOR_PRESENT_PACKET_TYPE,
    SA_SENSOR_TYPE_PACKET_TYPE,
    SA_STATUS_PACKET_TYPE,
)
from cosmic.mico.hw.sim_scu3d_channel import Channel
from cosmic.mico.hw.sim_scu3d_commands import Values
from cosmic.mico.hw.sim_scu3d_properties import get_property, property_fits, set_property
from cosmic.mico.hw.sim_scu3d_types import TYPES

Data = tuple[int, int, int]

_MAX_ANGLE: Final = 3_599_999


def _always(*_args: int) -> bool:
    return True


def _data1(_args: Values, values: Values) -> Data:
    return (values[0], 0, 0)


def _no_data(_args: Values, _values: Values) -> Data:
    return (0, 0, 0)


@dataclass(frozen=True, slots=True)
class Operation:
    """One command.

    Attributes
    ----------
    run : callable
        Takes the channel, the time and the arguments; returns the answers, in the order of the
        synchronous form's out arguments. Raises `Refusal` as the hardware would.
    arguments : int
        How many arguments follow the address.
    fits : callable
        Says whether the library itself would accept the arguments (otherwise 9).
    packet : int
        Type of the packet that answers; 0 for commands without an answer.
    data : callable
        Takes arguments and answers, returns data1 to data3 of that packet.
    moves : bool
        Whether it starts a movement.
    """

    run: Callable[..., Values]
    arguments: int = 0
    fits: Callable[..., bool] = _always
    packet: int = 0
    data: Callable[[Values, Values], Data] = _no_data
    moves: bool = False


def _ask(
    packet: int,
    run: Callable[..., Values],
    data: Callable[[Values, Values], Data] = _data1,
    **more: Any,
) -> Operation:
    return Operation(run, packet=packet, data=data, **more)


def _attribute(name: str) -> Callable[..., Values]:
    def read(channel: Channel, _now_s: float) -> Values:
        return (getattr(channel, name),)

    return read


def _store(name: str) -> Callable[..., Values]:
    def write(channel: Channel, _now_s: float, value: int) -> Values:
        setattr(channel, name, value)
        return ()

    return write


def _start(move: Callable[..., None], *keywords: str) -> Callable[..., Values]:
    def run(channel: Channel, now_s: float, *args: int) -> Values:
        if keywords:
            move(channel, now_s, **dict(zip(keywords, args, strict=True)))
        else:
            move(channel, now_s, *args)
        return ()

    return run


def _is_bit(value: int) -> bool:
    return value in (0, 1)


def _is_frequency(value: int) -> bool:
    return 1 <= value <= 18_500


def _is_amplitude(value: int) -> bool:
    return 150 <= value <= 1000


def _is_hold(value: int) -> bool:
    return 0 <= value <= moves.HOLD_FOR_EVER_MS


_FREQUENCY = SA_CLOSED_LOOP_FREQUENCY_PACKET_TYPE
_KNOWN = SA_PHYSICAL_POSITION_KNOWN_PACKET_TYPE


def _fits_angle(angle: int, revolution: int, hold: int) -> bool:
    return abs(angle) <= _MAX_ANGLE and revolution == 0 and _is_hold(hold)


def _fits_step(steps: int, amplitude: int, frequency: int) -> bool:
    in_range = abs(steps) <= moves.ENDLESS_STEPS
    return in_range and _is_amplitude(amplitude) and _is_frequency(frequency)


def _movement(run: Callable[..., Values], arguments: int, fits: Callable[..., bool]) -> Operation:
    return Operation(run, arguments, fits, moves=True)


_ANSWERED: Final[dict[str, Operation]] = {
    "GetClosedLoopMaxFrequency": _ask(_FREQUENCY, _attribute("frequency_hz")),
    "GetSensorPresent": _ask(SA_SENSOR_PRESENT_PACKET_TYPE, commands.sensor_present),
    "GetSensorType": _ask(SA_SENSOR_TYPE_PACKET_TYPE, _attribute("positioner_type")),
    "GetPositionerAlignment": _ask(
        SA_POSITIONER_ALIGNMENT_PACKET_TYPE,
        lambda channel, _now_s: channel.alignment,
        lambda _args, values: (values[0], values[1], values[2]),
    ),
    "GetSafeDirection": _ask(SA_SAFE_DIRECTION_PACKET_TYPE, _attribute("safe_direction")),
    "GetScale": _ask(SA_SCALE_PACKET_TYPE, commands.get_scale, lambda _args, v: (v[1], v[0], 0)),
    "GetChannelProperty": _ask(
        SA_CHANNEL_PROPERTY_PACKET_TYPE,
        get_property,
        lambda args, values: (args[0], values[0], 0),
        arguments=1,
        fits=property_fits,
    ),
    "GetAmplitude": _ask(SA_AMPLITUDE, _attribute("amplitude_dv")),
    "GetStatus": _ask(SA_STATUS_PACKET_TYPE, _attribute("status")),
    "GetPosition": _ask(
        SA_POSITION_PACKET_TYPE, commands.get_position, lambda _args, v: (0, v[0], 0)
    ),
    "GetAngle": _ask(
        SA_ANGLE_PACKET_TYPE, commands.get_angle, lambda _args, v: (v[0] & 0xFFFF_FFFF, v[1], 0)
    ),
    "GetPhysicalPositionKnown": _ask(_KNOWN, commands.known),
}
_SETTINGS: Final[dict[str, Operation]] = {
    "SetClosedLoopMaxFrequency": Operation(_store("frequency_hz"), 1, _is_frequency),
    "SetZero": Operation(commands.set_zero),
    "SetSensorType": Operation(commands.set_sensor_type, 1, lambda code: code in TYPES),
    "SetPositionerAlignment": Operation(
        commands.set_alignment,
        3,
        lambda alignment, forward, back: (
            _is_bit(alignment) and _is_amplitude(forward) and _is_amplitude(back)
        ),
    ),
    "SetSafeDirection": Operation(commands.set_safe_direction, 1, _is_bit),
    "SetScale": Operation(commands.set_scale, 2, lambda _scale, inverted: _is_bit(inverted)),
    "SetChannelProperty": Operation(set_property, 2, property_fits),
    "SetReportOnComplete": Operation(_store("report"), 1, _is_bit),
    "SetAmplitude": Operation(_start(moves.set_amplitude), 1, _is_amplitude),
    "Stop": Operation(commands.stop),
}
_MOVEMENTS: Final[dict[str, Operation]] = {
    "MoveStep": _movement(commands.move_step, 3, _fits_step),
    "MovePositionAbsolute": _movement(
        commands.position_absolute, 2, lambda _x, hold: _is_hold(hold)
    ),
    "MovePositionRelative": _movement(
        commands.position_relative, 2, lambda _x, hold: _is_hold(hold)
    ),
    "MoveAngleAbsolute": _movement(commands.angle_absolute, 3, _fits_angle),
    "MoveAngleRelative": _movement(commands.angle_relative, 3, _fits_angle),
    "CalibrateSensor": _movement(_start(moves.calibrate), 0, _always),
    "MoveToReference": _movement(
        _start(moves.reference, "hold_ms", "auto_zero"),
        2,
        lambda hold, auto_zero: _is_hold(hold) and _is_bit(auto_zero),
    ),
    "MoveToEndStop": _movement(
        _start(moves.to_end_stop, "direction", "hold_ms", "auto_zero"),
        3,
        lambda direction, hold, zero: _is_bit(direction) and _is_hold(hold) and _is_bit(zero),
    ),
}

OPERATIONS: Final[dict[str, Operation]] = _ANSWERED | _SETTINGS | _MOVEMENTS
"""Every command to a channel, by its name without "SA_" and "_S" or "_A"."""
