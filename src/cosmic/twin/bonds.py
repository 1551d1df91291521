"""Fibres that lie on or along each other, and what hangs on to what is lifted."""

from collections.abc import Iterator

import numpy as np

from cosmic.twin.centre_line import turned
from cosmic.twin.fibre import Carried, Fibre
from cosmic.twin.surroundings import Record
from cosmic.twin.tools import Tool


class Bonds:
    """Which fibres are bonded.

    Parameters
    ----------
    partner_un : float
        Pull that takes a lying fibre off the plate: a stronger bond drags the partner along.
    """

    def __init__(self, fibres: list[Fibre], partner_un: float, record: Record) -> None:
        self._fibres = fibres
        self._partner_un = partner_un
        self._record = record
        self._bonds: list[tuple[int, int, float]] = []
        self.add(fibres, 0)

    def add(self, fibres: list[Fibre], begin: int) -> None:
        """Take note of the fibres of a plate; its first has the number `begin`."""
        self._bonds += [
            (begin + each.settings.bonded_to, each.number, each.settings.bond_un)
            for each in fibres
            if each.settings.bonded_to is not None
        ]

    def of(self, fibre: Fibre) -> Iterator[Fibre]:
        """Yield the partners of a fibre."""
        for one, two, _ in self._bonds:
            if fibre.number in (one, two):
                yield self._fibres[two if fibre.number == one else one]

    def drag(self, fibre: Fibre, tool: Tool) -> None:
        """Take along what sticks more to a lifted fibre than to the plate; the rest stays."""
        for bond in [each for each in self._bonds if fibre.number in each[:2]]:
            one, two, pull = bond
            partner = self._fibres[two if fibre.number == one else one]
            if partner.lies and pull > self._partner_un:
                self._hang(partner, fibre, tool)
            elif partner.lies or partner.holds:
                self._bonds.remove(bond)
                self._record("parted", fibre=fibre.number, partner=partner.number)

    def _hang(self, partner: Fibre, fibre: Fibre, tool: Tool) -> None:
        # As it lay to the fibre before that was taken and turned into line.
        hold = fibre.holds[tool.name]
        x, y, angle = partner.plate_pose
        x0, y0, angle0 = fibre.plate_pose
        turn = hold.angle_rad - angle0
        line = turned(partner.line_um.placed(x - x0, y - y0, angle), turn)
        line = line + hold.frame_um(fibre.line_um, (0.0, 0.0, 0.0))
        relative = np.column_stack([line, np.zeros(len(line))])
        partner.carried = Carried(f"{tool.name}.hold", relative, angle + turn, "hanging")
        partner.on_plate = False
        self._record("dragged", fibre=partner.number, by=fibre.number)

    def part(self, fibre: Fibre) -> None:
        """Undo the bonds of a fibre that one gripper takes while another holds its partner."""
        for bond in [each for each in self._bonds if fibre.number in each[:2]]:
            partner = self._fibres[bond[0] if fibre.number == bond[1] else bond[1]]
            if partner.holds:
                self._bonds.remove(bond)
                self._record("parted", fibre=fibre.number, partner=partner.number)
