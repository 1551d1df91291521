"""What of a fibre's bending stays for a while or for good: creep, and plastic set.

The held fibre is cut into cells from the clamp on. Each has a curvature that creeps after that of
the load, in one element for each decade of time, and one that sets where the surface yields. Both
move the place where the fibre would stand without the probe; the elastic push does the rest.
"""

from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats

CELLS: Final = 16
TIMES_S: Final = np.array([0.03, 0.3, 3.0, 30.0, 300.0])
"""One for each decade; what is slower does not show in a measurement."""

SAME_TIME: Final = 1e-9
"""Part by which times between looks differ that are the same but for rounding."""

FADING_PER_S: Final = -1.0 / TIMES_S[:, None]

FULLEST: Final = 1.45
"""Moment, in that of first yield, up to which a section is followed; it ends at 1.5."""

SOONEST_S: Final = 0.002
PART_OF_AGE: Final = 0.05
LATEST_S: Final = 0.5


def crept_part(slope: float, after_s: float) -> float:
    """Return by how much more a fibre has given way so long after a step, of the elastic part."""
    return slope * float((1.0 - np.exp(-after_s / TIMES_S)).sum())


class Inelastic:
    """Creep and set of one fibre in one grip.

    Parameters
    ----------
    length_um : float
        From the clamp to the end.
    slope : float
        Part of the force that goes in each decade.
    yield_curvature : float
        At which the surface yields, 1/um; inf: it does not.
    """

    def __init__(self, length_um: float, *, slope: float, yield_curvature: float) -> None:
        self._cell_um = length_um / CELLS
        self._at_um = (np.arange(CELLS) + 0.5) * self._cell_um
        self._slope = slope
        self._yield = yield_curvature
        self._creeping = np.zeros((len(TIMES_S), CELLS))
        self._far = np.empty_like(self._creeping)
        self._set = np.zeros(CELLS)
        self._has_set = False
        self._before = np.zeros(CELLS)
        self._time_s = 0.0
        self._loaded_s = 0.0
        self._force_un = 0.0
        self._arm_um, self._levers = 0.0, np.zeros(CELLS)
        self._kept, self._kept_for_s = np.ones((len(TIMES_S), 1)), 0.0

    def offset_um(self, arm_um: float) -> float:
        """Return how far the fibre stands back, at so far from the clamp."""
        levers = self._levers_um(arm_um)
        # No `dot`: it gives the interpreter up, and has to win it back, at each look.
        np.multiply(self._creeping, levers, out=self._far)
        back = self._slope * float(np.add.reduce(self._far, axis=None))
        if self._has_set:
            back += float(np.add.reduce(self._set * levers))
        return self._cell_um * back

    def follow(self, time_s: float, force_un: float, arm_um: float, ei_un_um2: float) -> None:
        """Take note of the force there from now on; times rise."""
        passed_s, self._time_s = time_s - self._time_s, time_s
        creeping, kept = self._creeping, self._kept
        if abs(passed_s - self._kept_for_s) > SAME_TIME * passed_s:
            self._kept_for_s = passed_s
            np.exp(np.multiply(FADING_PER_S, passed_s, out=kept), out=kept)
        creeping -= self._before
        creeping *= kept
        creeping += self._before
        if abs(force_un - self._force_un) > 1e-3 * abs(self._force_un) + 1e-3:
            self._loaded_s = time_s
        self._force_un = force_un
        bend = force_un / ei_un_um2
        np.multiply(self._levers_um(arm_um), bend, out=self._before)
        # No cell bends more than the one at the clamp.
        if abs(bend) * max(arm_um - 0.5 * self._cell_um, 0.0) > self._yield:
            self._yielded()

    def _yielded(self) -> None:
        """Take note of what sets where the surface yields."""
        part = np.minimum(np.abs(self._before) / self._yield, FULLEST)
        beyond = np.where(part > 1.0, 1.0 / np.sqrt(3.0 - 2.0 * part) - part, 0.0)
        grown = np.maximum(np.abs(self._set), self._yield * beyond)
        self._set = np.where(beyond > 0.0, np.copysign(grown, self._before), self._set)
        self._has_set = True

    def _levers_um(self, arm_um: float) -> Floats:
        """Return how far each cell is from a force so far from the clamp; asked for often."""
        if arm_um != self._arm_um:
            self._arm_um = arm_um
            np.subtract(arm_um, self._at_um, out=self._levers)
            np.maximum(self._levers, 0.0, out=self._levers)
        return self._levers

    @property
    def restless_s(self) -> float:
        """For how long nothing changes that could be felt, though all stands still."""
        if not (self._slope and self._force_un):
            return LATEST_S
        age_s = self._time_s - self._loaded_s
        return min(max(SOONEST_S, PART_OF_AGE * age_s), LATEST_S)
