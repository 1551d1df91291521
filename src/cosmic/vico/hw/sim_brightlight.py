"""A simulated BrightLight: its registers, as a view of the twin's lamp."""

from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.twin.light import TwinLight
from cosmic.vico.hw.sim_frames import FrameSpeaker, SimRegisters
from cosmic.vico.hw.sim_line import LineFaults, SimLine


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
