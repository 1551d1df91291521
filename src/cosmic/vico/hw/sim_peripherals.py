"""The simulated lens and lamp of a platform: their lines, and the trouble to inject into them."""

from typing import Final

from cosmic.frame.clock import Clock
from cosmic.twin.lens import AXES, TwinLens
from cosmic.twin.light import TwinLight
from cosmic.vico.hw.sim_brightlight import SimBrightLightLine
from cosmic.vico.hw.sim_line import NAMES as LINE_NAMES
from cosmic.vico.hw.sim_line import SimLine
from cosmic.vico.hw.sim_navitar import SimNavitarLine

NAMES: Final = (*LINE_NAMES, "lost_steps")
LOST_SHARE: Final = 0.05


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
        """Put a fault in force at the "lens" or the "light"; raises `ValueError`."""
        if name == "lost_steps":
            self._lose(LOST_SHARE)
        else:
            self._line(where).faults.inject(name)

    def clear(self, name: str | None = None) -> None:
        """End the fault `name`, or all, everywhere; raises `ValueError`."""
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
            raise ValueError(f"there is no line {where!r}; known: {', '.join(self._lines)}")
        return self._lines[where]


class SimPeripherals:
    """One platform's simulated lens and lamp; lines can be opened again and again."""

    def __init__(self, lens: TwinLens, light: TwinLight, clock: Clock, seed: int = 0) -> None:
        self.lens = lens
        self.light = light
        self.lens_line = SimNavitarLine(lens, clock, seed)
        self.light_line = SimBrightLightLine(light, clock, seed)
        self.faults = PeripheralFaults(lens, self.lens_line, self.light_line)
