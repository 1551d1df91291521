"""The ASCII protocol of SCUs with RS-232 firmware: lines out, lines in, error codes.

A command is ``:``, its text and a line feed; so is an answer. In the automatic error mode, which is
always used here, every command has exactly one answer: what was asked for, or ``E`` and a code, 0
for done. ``C`` and ``CE`` come unasked, when a movement has ended well or badly.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.addresses import refused, where
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
from cosmic.mico.hw.scu3d_types import positioner_type

_F = DeviceFault
ERRORS: Final[dict[int, tuple[DeviceFault, str]]] = {
    1: (_F.COMMUNICATION, "the command arrived garbled"),
    2: (_F.UNSUPPORTED, "the firmware knows no such command"),
    3: (_F.NO_CHANNEL, "the unit has no such channel"),
    4: (_F.PARAMETER, "there is no such mode of error reports"),
    13: (_F.COMMUNICATION, "the command arrived with a wrong syntax"),
    15: (_F.PARAMETER, "a number was too large"),
    17: (_F.PARAMETER, "a value was not accepted"),
    18: (_F.PARAMETER, "a value was missing"),
    19: (_F.NO_SENSOR, "the positioner has no sensor"),
    20: (_F.WRONG_KIND, "the command does not fit the positioner type (linear or rotary)"),
    21: (_F.END_STOP, "the positioner ran into its end stop"),
    22: (_F.TIMEOUT, "the target was not reached in the time that the unit allows"),
    23: (_F.HIGH_VOLTAGE, "the high voltage is out of range; switch the unit off and on again"),
    24: (_F.OVERHEATED, "the unit is too hot; it resumes by itself"),
    25: (_F.CALIBRATION, "calibration failed; move away from the end stop and try again"),
    26: (_F.REFERENCE, "no reference was found; check that nothing blocks the positioner"),
    27: (_F.BUSY, "not possible now; wait until it has stopped"),
}
GARBLED: Final = (1, 13)
"""Codes that say that a line was spoilt on its way: nothing was done, and it can be sent again."""
WHOLE_UNIT: Final = 255

MOST_STEPS: Final = 29_999
FREQUENCY_HZ: Final = (1, 18_500)
AMPLITUDE_V: Final = (15.0, 100.0)
HOLD_FOR_EVER_MS: Final = 60_000
MOST_UM: Final = (2**31 - 1) / 10.0
"""A guess: the firmware is taken to count 0.1 um in 32 bit, as the library for USB does."""
FULL_TURN_DEG: Final = 360.0

_LETTERS: Final[dict[str, Activity]] = {
    "S": Activity.STOPPED,
    "A": Activity.SETTING_AMPLITUDE,
    "M": Activity.STEPPING,
    "T": Activity.TARGETING,
    "H": Activity.HOLDING,
    "C": Activity.CALIBRATING,
    "R": Activity.REFERENCING,
}
_NUMBER: Final = r"(-?\d+(?:\.\d+)?)"


def code_error(code: int, asked: str, at: Channel, *, serial: Serial | None = None) -> DeviceError:
    """Return the exception for an error code, also for one that nobody documented."""
    channel = None if at.channel == WHOLE_UNIT else at.channel
    here = where(at.device, channel, serial=serial)
    fault, text = ERRORS.get(code, (DeviceFault.OTHER, "an error that is not documented"))
    kind = DeviceTimeout if fault is DeviceFault.TIMEOUT else DeviceError
    said = f"{here}: {asked} was answered with error {code}: {text}"
    return kind(said, fault=fault, code=code, device=at.device, channel=channel)


# Out


def _between(value: float, low: float, high: float, what: str, at: Channel) -> float:
    if not low <= value <= high:
        raise refused(f"{what} must be {low:g} to {high:g}, got {value!r}", at)
    return value


def _whole(value: float, low: int, high: int, what: str, at: Channel) -> int:
    _between(value, low, high, what, at)
    if value != int(value):
        raise refused(f"{what} must be a whole number, got {value!r}", at)
    return int(value)


def hold_ms(hold_s: float, at: Channel) -> int:
    """Return a hold time in ms; inf holds for ever, which a finite time is not to be taken for."""
    if hold_s == math.inf:
        return HOLD_FOR_EVER_MS
    return round(1e3 * _between(hold_s, 0.0, (HOLD_FOR_EVER_MS - 1) / 1e3, "hold time in s", at))


def frequency(frequency_hz: float, at: Channel) -> int:
    """Return a frequency of 1 to 18500 Hz."""
    return _whole(frequency_hz, *FREQUENCY_HZ, "frequency in Hz", at)


def move(at: Channel, value: float, unit: AxisUnit, hold_s: float, *, relative: bool) -> str:
    """Return the command for a movement to or by `value`, rounded to 0.1 um or 0.1 millidegree."""
    mode = "R" if relative else "A"
    if unit == "um":
        _between(value, -MOST_UM, MOST_UM, "a target or distance in um", at)
        return f"MP{mode}{at.channel}P{value:.1f}H{hold_ms(hold_s, at)}"
    if not -FULL_TURN_DEG < value < FULL_TURN_DEG:
        raise refused(f"an angle must be less than a full turn, got {value!r} deg", at)
    return f"MA{mode}{at.channel}A{1e3 * value:.1f}R0H{hold_ms(hold_s, at)}"


def step(at: Channel, steps: int, amplitude_v: float, frequency_hz: int) -> str:
    """Return the command for steps; their sign is the direction."""
    count = _whole(steps, -MOST_STEPS, MOST_STEPS, "steps", at)
    decivolts = round(10.0 * _between(amplitude_v, *AMPLITUDE_V, "amplitude in V", at))
    hertz = frequency(frequency_hz, at)
    if count == 0:
        return f"S{at.channel}"  # a unit would take no number for its last one, or for endless
    return f"{'U' if count > 0 else 'D'}{at.channel}F{hertz}A{decivolts}S{abs(count)}"


def reference(at: Channel, hold_s: float) -> str:
    """Return the command for a reference run, which leaves the stored zero alone."""
    return f"MTR{at.channel}H{hold_ms(hold_s, at)}Z0"


def end_stop(at: Channel, direction: Direction, hold_s: float) -> str:
    """Return the command for a run to an end stop; a unit stops there and cannot hold."""
    hold_ms(hold_s, at)
    return f"MES{at.channel}D{'U' if direction is Direction.FORWARD else 'D'}"


# In


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of one channel, and how its answer is read.

    Attributes
    ----------
    command : str
        Without channel.
    pattern : str
        The whole answer, ``{}`` for the channel.
    make : callable
        Takes the channel and the groups of the pattern, and returns the event.
    """

    command: str
    pattern: str
    make: Callable[[Channel, tuple[str, ...]], Event]

    def read(self, text: str, at: Channel) -> Event | None:
        """Return what `text` says; None where it is no answer to this."""
        found = re.fullmatch(self.pattern.format(at.channel), text)
        return None if found is None else self.make(at, found.groups())


@dataclass(frozen=True, slots=True)
class ScaleRead(OtherAnswer):
    """What an axis counts from, and whether it counts backwards."""

    inverted: bool = False


SENSOR_PRESENT: Final = Question(
    "GSP", "SP{}([PN])", lambda at, said: SensorPresentRead(at, present=said[0] == "P")
)
SCALE: Final = Question(
    "GSC",
    r"SC{}I([01])S(-?\d+)",
    lambda at, said: ScaleRead(at, f"scale: {said[1]}", inverted=said[0] == "1"),
)
TYPE: Final = Question(
    "GST", r"ST{}T(\d+)", lambda at, said: TypeRead(at, positioner_type(int(said[0])))
)
POSITION_KNOWN: Final = Question(
    "GPPK", "PPK{}K([01])", lambda at, said: PositionKnownRead(at, known=said[0] == "1")
)
SAFE_DIRECTION: Final = Question(
    "GSD",
    "SD{}D([01])",
    lambda at, said: SafeDirectionRead(
        at, Direction.FORWARD if said[0] == "1" else Direction.BACKWARD
    ),
)
ACTIVITY: Final = Question(
    "M", "M{}([SAMTHCR])", lambda at, said: ActivityRead(at, _LETTERS[said[0]])
)
POSITION: Final[dict[AxisUnit, Question]] = {
    "um": Question("GP", "P{}P" + _NUMBER, lambda at, said: PositionRead(at, float(said[0]), "um")),
    "deg": Question(
        "GA",
        "A{}A" + _NUMBER + r"R(-?\d+)",
        lambda at, said: PositionRead(
            at, float(said[0]) / 1e3 + FULL_TURN_DEG * int(said[1]), "deg"
        ),
    ),
}


def error_code(text: str) -> int | None:
    """Return the code of an answer ``E<code>``; None where it is none."""
    found = re.fullmatch(r"E(\d{1,3})", text)
    return None if found is None else int(found.group(1))


def unasked(text: str, device: int, serial: Serial | None) -> Event | None:
    """Return what a line says that comes without a question; None where it is none of those."""
    found = re.fullmatch(r"C(\d{1,3})", text)
    if found is not None:
        return Completed(Channel(device, int(found.group(1))))
    found = re.fullmatch(r"CE(\d{1,3})E(\d{1,3})", text)
    if found is None:
        return None
    at = Channel(device, int(found.group(1)))
    error = code_error(int(found.group(2)), "a movement", at, serial=serial)
    return Failed(None if at.channel == WHOLE_UNIT else at, error)
