"""The commands of simulated SCUs with RS-232 firmware: what each does, and what answers it."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from cosmic.mico.hw import sim_scu3d_commands as commands
from cosmic.mico.hw import sim_scu3d_moves as moves
from cosmic.mico.hw.sim_scu3d_channel import Channel
from cosmic.mico.hw.sim_scu3d_device import Device
from cosmic.mico.hw.sim_scu3d_properties import get_property, property_fits, set_property
from cosmic.mico.hw.sim_scu3d_types import TYPES

ALL: Final = 99
"""A channel number that means every channel, in some commands."""
_ENDLESS: Final = 30_000
_PARSE, _UNKNOWN, _NO_CHANNEL, _MODE = 1, 2, 3, 4
_SYNTAX, _OVERFLOW, _PARAMETER, _MISSING = 13, 15, 17, 18
_STATUS: Final = "SAMTHCR"
_COMMAND: Final = re.compile(r"([A-Z]+)(\d*)((?:[A-Z](?:-?\d+(?:\.\d+)?|[UD]))*)")
_PARAMETER_TEXT: Final = re.compile(r"([A-Z])(-?\d+(?:\.\d+)?|[UD])")
Given = Mapping[str, str]
Answers = list[str]


class AnsweredError(Exception):
    """The command is answered with an error code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"error {code}")
        self.code = code


@dataclass(slots=True)
class Settings:
    """What a unit was told, and forgets without power.

    Attributes
    ----------
    automatic : bool
        Every command is answered.
    steps : dict of tuple of int
        Frequency, amplitude and number of steps that each channel was last told.
    reports : set of tuple of int
        Channels and error codes that are reported by themselves.
    """

    device: Device
    automatic: bool = False
    last_error: int = 0
    keep_alive_s: float = 0.0
    steps: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    reports: set[tuple[int, int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.automatic, self.last_error, self.keep_alive_s = False, 0, 0.0
        self.reports.clear()
        self.steps = {each.index: (1000, 1000, _ENDLESS) for each in self.device.channels}


def _number(given: Given, letter: str, low: float, high: float, default: float | None) -> float:
    text = given.get(letter)
    if text is None:
        if default is None:
            raise AnsweredError(_MISSING)
        return default
    if text in ("U", "D"):
        raise AnsweredError(_SYNTAX)
    value = float(text)
    if abs(value) >= 2**31:
        raise AnsweredError(_OVERFLOW)
    if not low <= value <= high:
        raise AnsweredError(_PARAMETER)
    return value


def _integer(given: Given, letter: str, low: int, high: int, default: int | None = None) -> int:
    return int(_number(given, letter, low, high, default))


def _identify(_unit: Settings, _index: str) -> Answers:
    return ["ISmarAct SCU-3D"]


def _answer_number(unit: Settings, _index: str) -> Answers:
    return [f"ID{unit.device.serial}"]


def _answer_version(unit: Settings, _index: str) -> Answers:
    return [f"V{unit.device.settings.firmware_version}"]


def _restart(unit: Settings, _index: str) -> Answers:
    now_s = unit.device.clock.now_s()
    for channel in unit.device.channels:
        channel.power_cycle(now_s)
    unit.device.queue.clear()
    unit.reset()
    return []


def _stay_alive(unit: Settings, index: str) -> Answers:
    if index and int(index) and not 100 <= int(index) <= 60_000:
        raise AnsweredError(_PARAMETER)
    if index:
        unit.keep_alive_s = int(index) / 1e3
    return []


def _answer_error(unit: Settings, index: str) -> Answers:
    if index == "":
        code, unit.last_error = unit.last_error, 0
        return [f"E{code}"]
    if index not in ("0", "1"):
        raise AnsweredError(_MODE)
    unit.automatic, unit.last_error = index == "1", 0
    return ["E0"]


def _set_baud(_unit: Settings, index: str) -> Answers:
    if not index or not 9600 <= int(index) <= 500_000:
        raise AnsweredError(_PARAMETER if index else _MISSING)
    return [f"CB{index}"]


def _answer_system(unit: Settings, index: str) -> Answers:
    settings = unit.device.settings
    values = {
        "1": settings.temperature_deg_c,
        "2": settings.rail_dv,
        "3": settings.hardware_version,
    }
    if index not in values:
        raise AnsweredError(_PARAMETER)
    return [f"SPR{index}V{values[index]}"]


def _step(unit: Settings, channel: Channel, given: Given, now_s: float, sign: int) -> Answers:
    hertz, decivolts, steps = unit.steps[channel.index]
    hertz = _integer(given, "F", 1, 18_500, hertz)
    decivolts = _integer(given, "A", 150, 1000, decivolts)
    steps = _integer(given, "S", 1, _ENDLESS, steps)
    unit.steps[channel.index] = hertz, decivolts, steps
    moves.step(channel, now_s, sign * steps, amplitude_dv=decivolts, frequency_hz=hertz)
    return []


def _up(unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    return _step(unit, channel, given, now_s, 1)


def _down(unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    return _step(unit, channel, given, now_s, -1)


def _set_steps(unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    hertz, decivolts, steps = unit.steps[channel.index]
    unit.steps[channel.index] = (
        _integer(given, "F", 1, 18_500, hertz),
        _integer(given, "A", 150, 1000, decivolts),
        _integer(given, "S", 1, _ENDLESS, steps),
    )
    channel.stop(now_s)
    return []


def _set_amplitude(unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    decivolts = _integer(given, "A", 150, 1000)
    moves.set_amplitude(channel, now_s, decivolts)
    hertz, _, steps = unit.steps[channel.index]
    unit.steps[channel.index] = hertz, decivolts, steps
    return []


def _move(
    __unit: Settings, channel: Channel, given: Given, now_s: float, letter: str, *, relative: bool
) -> Answers:
    # Linear in um with 0.1 um, rotary in millidegrees with 0.1: ten counts for each.
    counts = round(10.0 * _number(given, letter, -2e8, 2e8, 0.0))
    hold = _integer(given, "H", 0, moves.HOLD_FOR_EVER_MS, 0)
    if letter == "P":
        run = commands.position_relative if relative else commands.position_absolute
        run(channel, now_s, counts, hold)
    else:
        turn = commands.angle_relative if relative else commands.angle_absolute
        turn(channel, now_s, counts, 0, hold)
    return []


def _reference(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    hold = _integer(given, "H", 0, moves.HOLD_FOR_EVER_MS, 0)
    moves.reference(channel, now_s, hold_ms=hold, auto_zero=_integer(given, "Z", 0, 1, 0))
    return []


def _end_stop(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    if given.get("D") not in ("U", "D"):
        raise AnsweredError(_PARAMETER if "D" in given else _MISSING)
    direction = int(given["D"] == "U")
    moves.to_end_stop(channel, now_s, direction=direction, hold_ms=0, auto_zero=0)
    return []


def _calibrate(_unit: Settings, channel: Channel, _given: Given, now_s: float) -> Answers:
    moves.calibrate(channel, now_s)
    return []


def _stop(_unit: Settings, channel: Channel, _given: Given, now_s: float) -> Answers:
    channel.stop(now_s)
    return []


def _zero(_unit: Settings, channel: Channel, _given: Given, now_s: float) -> Answers:
    commands.set_zero(channel, now_s)
    return []


def _answer_position(_unit: Settings, channel: Channel, _given: Given, now_s: float) -> Answers:
    (counts,) = commands.get_position(channel, now_s)
    return [f"P{channel.index}P{counts / 10:.1f}"]


def _answer_angle(_unit: Settings, channel: Channel, _given: Given, now_s: float) -> Answers:
    counts, _ = commands.get_angle(channel, now_s)
    return [f"A{channel.index}A{counts / 10:.1f}R0"]


def _answer_status(_unit: Settings, channel: Channel, _given: Given, _now_s: float) -> Answers:
    return [f"M{channel.index}{_STATUS[channel.status]}"]


def _answer_known(_unit: Settings, channel: Channel, _given: Given, _now_s: float) -> Answers:
    return [f"PPK{channel.index}K{int(channel.scale.known)}"]


def _answer_sensor(_unit: Settings, channel: Channel, _given: Given, _now_s: float) -> Answers:
    return [f"SP{channel.index}{'P' if channel.sensor_present else 'N'}"]


def _answer_type(_unit: Settings, channel: Channel, _given: Given, _now_s: float) -> Answers:
    return [f"ST{channel.index}T{channel.positioner_type}"]


def _set_type(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    code = _integer(given, "T", 0, 255)
    if code not in TYPES:
        raise AnsweredError(_PARAMETER)
    channel.stop(now_s)
    commands.set_sensor_type(channel, now_s, code)
    return []


def _answer_safe(_unit: Settings, channel: Channel, _given: Given, _now_s: float) -> Answers:
    return [f"SD{channel.index}D{channel.safe_direction}"]


def _set_safe(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    commands.set_safe_direction(channel, now_s, _integer(given, "D", 0, 1))
    return []


def _answer_frequency(_unit: Settings, channel: Channel, _given: Given, _now_s: float) -> Answers:
    return [f"CLF{channel.index}F{channel.frequency_hz}"]


def _set_frequency(_unit: Settings, channel: Channel, given: Given, _now_s: float) -> Answers:
    channel.frequency_hz = _integer(given, "F", 1, 18_500)
    return []


def _answer_scale(_unit: Settings, channel: Channel, _given: Given, now_s: float) -> Answers:
    scale, inverted = commands.get_scale(channel, now_s)
    return [f"SC{channel.index}I{inverted}S{scale}"]


def _set_scale(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    inverted = _integer(given, "I", 0, 1, 0)
    scale = _integer(given, "S", 1 - 2**31, 2**31 - 1, 0)
    commands.set_scale(channel, now_s, scale, inverted)
    return []


def _answer_alignment(_unit: Settings, channel: Channel, _given: Given, _now_s: float) -> Answers:
    vertical, forward, backward = channel.alignment
    amplitudes = f"F{forward}B{backward}" if vertical else ""
    return [f"PA{channel.index}A{vertical}{amplitudes}"]


def _set_alignment(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    vertical = _integer(given, "A", 0, 1)
    default = None if vertical else 1000
    forward = _integer(given, "F", 150, 1000, default)
    backward = _integer(given, "B", 150, 1000, default)
    commands.set_alignment(channel, now_s, vertical, forward, backward)
    return []


def _answer_property(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    key = _integer(given, "P", 0, 255)
    if not property_fits(key):
        raise AnsweredError(_PARAMETER)
    (value,) = get_property(channel, now_s, key)
    return [f"CP{channel.index}P{key}V{value}"]


def _set_property(_unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
    key, value = _integer(given, "P", 0, 255), _integer(given, "V", 0, 2**31 - 1)
    if not property_fits(key, value):
        raise AnsweredError(_PARAMETER)
    set_property(channel, now_s, key, value)
    return []


def _report_completion(_unit: Settings, channel: Channel, given: Given, _now_s: float) -> Answers:
    channel.report = _integer(given, "R", 0, 1)
    return []


def _report_error(unit: Settings, channel: Channel, given: Given, _now_s: float) -> Answers:
    code, on = _integer(given, "E", 21, 22), _integer(given, "R", 0, 1)
    (unit.reports.add if on else unit.reports.discard)((channel.index, code))
    return []


def _mover(letter: str, *, relative: bool) -> "_OfChannel":
    def run(unit: Settings, channel: Channel, given: Given, now_s: float) -> Answers:
        return _move(unit, channel, given, now_s, letter, relative=relative)

    return run


_OfChannel = Callable[[Settings, Channel, Given, float], Answers]
_FOR_ALL: Final = ("A", "SSP", "U", "D", "S", "M")
_OF_UNIT: Final[dict[str, Callable[[Settings, str], Answers]]] = {
    "I": _identify,
    "GID": _answer_number,
    "V": _answer_version,
    "R": _restart,
    "K": _stay_alive,
    "E": _answer_error,
    "CB": _set_baud,
    "GSPR": _answer_system,
}
_OF_CHANNEL: Final[dict[str, _OfChannel]] = {
    "A": _set_amplitude,
    "SSP": _set_steps,
    "SZ": _zero,
    "SCLF": _set_frequency,
    "GCLF": _answer_frequency,
    "GSP": _answer_sensor,
    "SST": _set_type,
    "GST": _answer_type,
    "SPA": _set_alignment,
    "GPA": _answer_alignment,
    "SSC": _set_scale,
    "GSC": _answer_scale,
    "SSD": _set_safe,
    "GSD": _answer_safe,
    "SCP": _set_property,
    "GCP": _answer_property,
    "SRC": _report_completion,
    "SER": _report_error,
    "U": _up,
    "D": _down,
    "MPA": _mover("P", relative=False),
    "MPR": _mover("P", relative=True),
    "MAA": _mover("A", relative=False),
    "MAR": _mover("A", relative=True),
    "MTR": _reference,
    "MES": _end_stop,
    "CS": _calibrate,
    "S": _stop,
    "GP": _answer_position,
    "GA": _answer_angle,
    "M": _answer_status,
    "GPPK": _answer_known,
}


def carry_out(unit: Settings, text: str, now_s: float) -> Answers:
    """Carry a command out and return its answers; call with the device's lock held.

    Raises
    ------
    AnsweredError
        It is answered with an error code of this protocol.
    Refusal
        The channel refuses, with a status of the library for USB.
    """
    found = _COMMAND.fullmatch(text)
    if found is None:
        raise AnsweredError(_PARSE)
    name, index, rest = found.groups()
    if name in _OF_UNIT:
        return _OF_UNIT[name](unit, index)
    if name not in _OF_CHANNEL:
        raise AnsweredError(_UNKNOWN)
    if index == "":
        raise AnsweredError(_MISSING)
    channels = unit.device.channels
    whole = int(index) == ALL and name in _FOR_ALL
    if not whole and int(index) >= len(channels):
        raise AnsweredError(_NO_CHANNEL)
    given = dict(_PARAMETER_TEXT.findall(rest))
    chosen = channels if whole else [channels[int(index)]]
    run = _OF_CHANNEL[name]
    return [answer for channel in chosen for answer in run(unit, channel, given, now_s)]
