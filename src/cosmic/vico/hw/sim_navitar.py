"""A simulated Navitar motor controller: its registers, as a view of the twin's lens."""

from typing import Final

from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.twin.lens import LensAxisName, TwinLens
from cosmic.twin.lens_motor import LensPhase
from cosmic.vico.hw.sim_frames import FrameSpeaker, SimRegisters
from cosmic.vico.hw.sim_line import LineFaults, SimLine
from cosmic.vico.hw.sim_text import TextSpeaker

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
