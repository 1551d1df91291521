"""Where a fibre comes to lie that nothing holds any more."""

import math
import random
from typing import Final

import numpy as np

from cosmic.twin.bonds import Bonds
from cosmic.twin.centre_line import turned
from cosmic.twin.fibre import Fibre
from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.surroundings import Record, Surroundings
from cosmic.twin.tools import Tool

PLATE_HALF_UM: Final = 12_000.0
"""The plate of the URDF is so large to each side; what is let go beyond it is gone."""


class Falls:
    """Lays fibres on the plate, and with them what hangs on them.

    Parameters
    ----------
    scatter : bool
        They land aside, the more the higher they fell from.
    """

    def __init__(
        self, handling: HandlingSettings, bonds: Bonds, record: Record, *, scatter: bool
    ) -> None:
        self._handling = handling
        self._bonds = bonds
        self._record = record
        self._scatters = scatter

    def fall(
        self, fibre: Fibre, origin: tuple[float, float], tool: Tool, around: Surroundings
    ) -> None:
        """Let a fibre fall on the plate below; `origin` is that of its own frame, world."""
        hold = fibre.holds.get(tool.name)
        angle = hold.angle_rad if hold is not None else 0.0
        if fibre.carried is not None:
            angle = fibre.carried.angle_rad
        fibre.falls += 1
        x, y, turn = self._scatter(fibre, max(tool.hold[2] - self._handling.fall_um, 0.0))
        plate = around.plate()
        there = np.linalg.solve(plate, np.array([origin[0] + x, origin[1] + y, plate[2, 3], 1.0]))
        turned_by = math.atan2(plate[1, 0], plate[0, 0])
        pose = float(there[0]), float(there[1]), angle + turn - turned_by
        fibre.lay(pose)
        middle = fibre.line_um.placed(*pose).mean(axis=0)
        fibre.gone = bool(np.abs(middle).max() > PLATE_HALF_UM)
        self._record(
            "gone" if fibre.gone else "landed",
            fibre=fibre.number,
            x_um=round(float(middle[0]), 2),
            y_um=round(float(middle[1]), 2),
            angle_deg=round(math.degrees(pose[2]), 3),
        )
        for partner in self._bonds.of(fibre):
            if partner.carried is not None and partner.carried.why == "hanging":
                self.come_down(partner, tool, around)

    def come_down(self, fibre: Fibre, tool: Tool, around: Surroundings) -> None:
        """Let a fibre fall that went along with a tool without being held."""
        carried = fibre.carried
        if carried is None:
            return
        first = np.array(around.anchor(carried.anchor)) + carried.line_um[0]
        start = turned(fibre.line_um.points_um[:1], carried.angle_rad)[0]
        origin = float(first[0] - start[0]), float(first[1] - start[1])
        self.fall(fibre, origin, tool, around)

    def _scatter(self, fibre: Fibre, height_um: float) -> tuple[float, float, float]:
        if height_um <= 0.0 or not self._scatters:
            return 0.0, 0.0, 0.0
        handling = self._handling
        chance = random.Random(f"fall {fibre.key} {fibre.falls}")
        sigma = handling.fall_um + handling.fall_part * height_um
        turn = chance.gauss(0.0, math.radians(handling.fall_deg))
        return chance.gauss(0.0, sigma), chance.gauss(0.0, sigma), turn
