"""How far tools really are from where the drawing has them: mounting, drift, bent tips."""

import math
import random
from collections.abc import Iterable

from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.kinematics import Point

NOWHERE: Point = (0.0, 0.0, 0.0)


class ToolOffsets:
    """Offset of each tool at each time; any thread.

    Parameters
    ----------
    tools : iterable of str
        Their names.
    wander : bool
        They are mounted not quite right, and drift.

    Attributes
    ----------
    tools : tuple of str

    Notes
    -----
    Drift begins at zero and goes to and fro on a tilted line, more slowly for one tool than for
    another. What controls the platform sees it in the image only: the stages do not.
    """

    def __init__(
        self, tools: Iterable[str], handling: HandlingSettings, seed: int, *, wander: bool
    ) -> None:
        tools = tuple(tools)
        self._mounted: dict[str, Point] = {}
        self._bent: dict[str, Point] = {}
        self._drift: dict[str, tuple[Point, float, float]] = {}
        for name in tools:
            chance = random.Random(f"tool {name} {seed}")
            sigma = handling.tool_offset_um
            mounted = tuple(chance.gauss(0.0, sigma) for _ in range(3))
            direction = tuple(chance.gauss(0.0, 1.0) for _ in range(3))
            size = handling.drift_um / max(math.hypot(*direction), 1e-9)
            period_s = handling.drift_period_s * chance.uniform(0.8, 1.25)
            phase = chance.uniform(0.0, 2.0 * math.pi)
            if wander:
                self._mounted[name] = mounted[0], mounted[1], mounted[2]
                amplitude = direction[0] * size, direction[1] * size, direction[2] * size
                self._drift[name] = amplitude, 2.0 * math.pi / period_s, phase
        self.tools = tuple(tools)
        self._places = self._where()
        drifts = self._drift.values()
        self._fastest_um_s = max(
            (math.hypot(*drift) * rate for drift, rate, _ in drifts), default=0.0
        )

    @property
    def still(self) -> bool:
        """Whether no tool is anywhere else than drawn."""
        return not self._mounted and not self._bent

    @property
    def fastest_um_s(self) -> float | None:
        """How fast a tool drifts at most; None while a tip is bent."""
        return None if self._bent else self._fastest_um_s

    def bend(self, tool: str, offset_um: Point) -> None:
        """Have the tip of a tool bent by so much; zeros end it."""
        bent = {name: each for name, each in self._bent.items() if name != tool}
        if any(offset_um):
            bent[tool] = offset_um
        self._bent = bent
        self._places = self._where()

    def _where(self) -> dict[str, tuple[Point, Point, float, float, float]]:
        """Return where each tool is without drift, and how it drifts: each look asks for it."""
        found = {}
        for tool in self.tools:
            x, y, z = self._mounted.get(tool, NOWHERE)
            bent = self._bent.get(tool, NOWHERE)
            direction, rate, phase = self._drift.get(tool, (NOWHERE, 0.0, 0.0))
            place = x + bent[0], y + bent[1], z + bent[2]
            found[tool] = place, direction, rate, phase, math.sin(phase)
        return found

    def at(self, tool: str, time_s: float) -> Point:
        """Return the offset of a tool at a time, um, world."""
        place = self._places.get(tool)
        if place is None:
            return NOWHERE
        (x, y, z), (dx, dy, dz), rate, phase, began = place
        part = math.sin(rate * time_s + phase) - began
        return x + part * dx, y + part * dy, z + part * dz
