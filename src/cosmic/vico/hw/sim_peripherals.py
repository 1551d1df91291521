"""The simulated lens and lamp of a platform: their registers, how they speak, their faults.

Views of the twin's lens and lamp at the end of a simulated line. How they speak shares no code with
the drivers.
"""

from abc import abstractmethod
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.frame.errors import ArgumentError
from cosmic.twin.lens import AXES, LensAxisName, TwinLens
from cosmic.twin.lens_motor import LensPhase
from cosmic.twin.light import TwinLight
from cosmic.vico.hw.sim_line import NAMES as LINE_NAMES
from cosmic.vico.hw.sim_line import LineFaults, SimLine, Speaker

NAMES: Final = (*LINE_NAMES, "lost_steps")
LOST_SHARE: Final = 0.05

_FRAME_BYTES: Final = 7
_PROMPT: Final = "\r\n$ "
_AXES: Final[dict[int, LensAxisName]] = {0x10: "zoom", 0x20: "focus"}
_FIXED: Final = {0x02: 1, 0x03: 0x20100101, 0x04: 0x124, 0x05: 1}
_STATUS: Final = {
    (LensPhase.TO_HOME, -1): (1, 1),
    (LensPhase.OFF_HOME, 1): (2, 2),
    (LensPhase.TO_LIMIT, 1): (3, 3),
    (LensPhase.TO_LIMIT, -1): (3, 3),
    (LensPhase.SEEK, 1): (4, 5),
    (LensPhase.SEEK, -1): (7, 8),
    (LensPhase.BACKLASH, 1): (6, 6),
    (LensPhase.ABORT, 1): (11, 11),
    (LensPhase.ABORT, -1): (12, 12),
}
"""Code of each phase and direction, at speed and slowing down."""


class SimRegisters(Protocol):
    """What is behind the bytes of a simulated device."""

    @abstractmethod
    def get(self, number: int) -> int:
        """Return a register; 0 where there is none."""

    @abstractmethod
    def put(self, number: int, value: int) -> None:
        """Write a register, where that has a meaning."""


class FrameSpeaker(Speaker):
    """Hears frames in a stream of bytes, passes over what is none, and answers each."""

    def __init__(self, registers: SimRegisters) -> None:
        self._registers = registers
        self._heard = bytearray()

    @override
    def hear(self, data: bytes) -> bytes:
        self._heard += data
        said = bytearray()
        while len(self._heard) >= _FRAME_BYTES:
            if self._heard[0] == 0xFF and sum(self._heard[:_FRAME_BYTES]) & 0xFF == 0:
                said += self._answer(bytes(self._heard[1:6]))
                del self._heard[:_FRAME_BYTES]
            else:
                del self._heard[0]
        return bytes(said)

    def _answer(self, body: bytes) -> bytes:
        number = body[0] & 0x7F
        if body[0] & 0x80:
            value = int.from_bytes(body[1:], "little", signed=True)
            self._registers.put(number, value)
        else:
            value = self._registers.get(number)
        out = bytearray((0xFF, number))
        out += value.to_bytes(4, "little", signed=True)
        out.append((0x100 - sum(out) & 0xFF) & 0xFF)
        return bytes(out)


class TextSpeaker(Speaker):
    """Hears commands that end with a carriage return; Ctrl-C forgets one that was begun."""

    def __init__(self, registers: SimRegisters) -> None:
        self._registers = registers
        self._heard = ""

    @override
    def hear(self, data: bytes) -> bytes:
        said = ""
        for byte in data:
            if byte == 3:
                self._heard = ""
                said += _PROMPT
            elif byte in (10, 13):
                said += self._heard + self._obey(self._heard.split()) + _PROMPT
                self._heard = ""
            else:
                self._heard += chr(byte)
        return said.encode("latin-1")

    def _obey(self, words: list[str]) -> str:
        try:
            match words:
                case []:
                    return ""
                case ["read", number]:
                    return f"\r\n{self._registers.get(int(number))}"
                case ["write", number, value]:
                    self._registers.put(int(number), int(value))
                    return ""
                case ["stopall"]:
                    self._registers.put(0x13, 2)
                    self._registers.put(0x23, 2)
                    return ""
                case ["savesetup" | "defaultsetup"]:
                    return ""
        except ValueError:
            return "\r\nbad number"
        return "\r\nunknown command"


class SimNavitar(SimRegisters):
    """Registers of a two-axis controller without end switches."""

    def __init__(self, lens: TwinLens, clock: Clock) -> None:
        self._lens = lens
        self._clock = clock
        self._product = 0x4001 if lens.settings.generation == 1 else 0x5001
        self._targets: dict[LensAxisName, int] = {"zoom": 0, "focus": 0}
        self._homed = {"zoom": not lens.cold, "focus": not lens.cold}

    @override
    def get(self, number: int) -> int:
        if number == 0x01:
            return self._product
        axis = _AXES.get(number & 0x70)
        if axis is None:
            return _FIXED.get(number, 0)
        return self._get(axis, number & 0x0F)

    @override
    def put(self, number: int, value: int) -> None:
        axis = _AXES.get(number & 0x70)
        if axis is None:
            return
        now_s, what = self._clock.now_s(), number & 0x0F
        if what == 0x0:
            self._seek(axis, value, now_s)
        elif what == 0x1:
            self._seek(axis, self._lens.counter(axis, now_s) + value, now_s)
        elif what == 0x3 and value == 0:
            self._homed[axis] = True
            self._lens.home(axis, now_s)
        elif what == 0x3 and value == 1:
            self._lens.limit(axis, now_s)
        elif what == 0x3 and value == 2:
            self._lens.abort(axis, now_s)

    def _seek(self, axis: LensAxisName, target: int, now_s: float) -> None:
        self._targets[axis] = target
        self._lens.seek(axis, target, now_s)

    def _get(self, axis: LensAxisName, what: int) -> int:
        settings = self._lens.settings
        motor = settings.zoom if axis == "zoom" else settings.focus
        fixed = {
            0x0: self._targets[axis],
            0x5: 10,
            0x6: round(motor.initial_speed_counts_s),
            0x7: round(motor.top_speed_counts_s),
            0x8: motor.backlash_counts,
            0xC: motor.limit_counts,
        }
        if what == 0x2:
            return self._lens.counter(axis, self._clock.now_s())
        if what == 0x4:
            return self._status(axis, motor.limit_counts)
        return fixed.get(what, 0)

    def _status(self, axis: LensAxisName, limit: int) -> int:
        now_s = self._clock.now_s()
        phase, direction, slowing = self._lens.phase(axis, now_s)
        if phase != LensPhase.IDLE:
            return _STATUS[phase, direction][slowing]
        counter = self._lens.counter(axis, now_s)
        at_home = self._homed[axis] and counter == 0
        return (0x100 if at_home else 0) | (0x200 if counter >= limit else 0)


class SimNavitarLine(SimLine):
    """The line to a simulated controller, with its faults and those of the motors."""

    def __init__(self, lens: TwinLens, clock: Clock, seed: int = 0) -> None:
        registers = SimNavitar(lens, clock)
        frames = lens.settings.generation == 1
        speaker = FrameSpeaker(registers) if frames else TextSpeaker(registers)
        super().__init__(speaker, LineFaults(), seed)


class SimBrightLight(SimRegisters):
    """Registers of the lamp."""

    def __init__(self, light: TwinLight, clock: Clock) -> None:
        self._light = light
        self._clock = clock

    @override
    def get(self, number: int) -> int:
        if number == 0x40:
            return round(self._light.percent(self._clock.now_s()) * 10.0)
        if number == 0x42:
            return round(self._light.settings.start_percent * 10.0)
        return 0x4000 if number == 0x01 else 0

    @override
    def put(self, number: int, value: int) -> None:
        if number == 0x41:
            number, value = 0x40, self.get(0x40) + value
        if number == 0x40:
            self._light.set_percent(min(max(value, 0), 1000) / 10.0, self._clock.now_s())


class SimBrightLightLine(SimLine):
    """The line to a simulated lamp, with its faults."""

    def __init__(self, light: TwinLight, clock: Clock, seed: int = 0) -> None:
        super().__init__(FrameSpeaker(SimBrightLight(light, clock)), LineFaults(), seed)


class PeripheralFaults:
    """Faults by name, of the lens's line, of the lamp's, and of the motors; any thread.

    Notes
    -----
    - Of a line: see `LineFaults`.
    - `lost_steps`: both motors lose one step in twenty from the next movement on.
    """

    def __init__(self, lens: TwinLens, lens_line: SimLine, light_line: SimLine) -> None:
        self._lens = lens
        self._lines = {"lens": lens_line, "light": light_line}

    def inject(self, name: str, *, where: str = "lens") -> None:
        """Put a fault in force at the "lens" or the "light"; raises `ArgumentError`."""
        if name == "lost_steps":
            self._lose(LOST_SHARE)
        else:
            self._line(where).faults.inject(name)

    def clear(self, name: str | None = None) -> None:
        """End the fault `name`, or all, everywhere; raises `ArgumentError`."""
        if name in (None, "lost_steps"):
            self._lose(0.0)
        if name != "lost_steps":
            for line in self._lines.values():
                line.faults.clear(name)

    def _lose(self, share: float) -> None:
        for axis in AXES:
            self._lens.lose_steps(axis, share)

    def _line(self, where: str) -> SimLine:
        if where not in self._lines:
            raise ArgumentError(f"there is no line {where!r}; known: {', '.join(self._lines)}")
        return self._lines[where]


class SimPeripherals:
    """One platform's simulated lens and lamp; lines can be opened again and again."""

    def __init__(self, lens: TwinLens, light: TwinLight, clock: Clock, seed: int = 0) -> None:
        self.lens = lens
        self.light = light
        self.lens_line = SimNavitarLine(lens, clock, seed)
        self.light_line = SimBrightLightLine(light, clock, seed)
        self.faults = PeripheralFaults(lens, self.lens_line, self.light_line)
