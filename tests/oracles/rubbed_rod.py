"""A clamped fibre pushed by a probe that gives way sideways, with friction where they touch.

Coulomb's friction step by step: at each step the contact sticks, unless that takes more friction
than there is; then it slides, and friction is what it can be. The rod is integrated from the clamp
to the contact, and what is sought are the moment at the clamp, the two forces, and the place.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import root

CELLS = 120
TIGHT = 1e-10


@dataclass
class RubbedRod:
    """One fibre and one probe, and what was between them until now; a probe from above.

    Parameters
    ----------
    heading_rad, curvature : float
        Natural shape: an arc with this heading at the clamp; curvature in rad/um.
    abscissa_um : float
        Where the probe's holder stands, from the clamp along x.
    side_un_um : float
        Stiffness of the probe along x.
    radius_um : float
        Of the edge and half the fibre together; it rolls on the fibre's middle.
    """

    ei_un_um2: float
    abscissa_um: float
    friction: float
    side_un_um: float
    heading_rad: float = 0.0
    curvature: float = 0.0
    radius_um: float = 1e-3
    rolled_um: float | None = field(default=None, init=False)
    _found: np.ndarray | None = field(default=None, init=False)
    _met: tuple[float, float] = field(default=(0.0, 0.0), init=False)

    def natural(self) -> tuple[float, float]:
        """Return the place at which an unloaded probe touches, and the height of its middle."""
        low, high = 0.0, 3.0 * self.abscissa_um
        for _ in range(80):
            middle = 0.5 * (low + high)
            x, y, heading, _ = self._end(np.array([0.0, 0.0, 0.0, middle]))
            if x - self.radius_um * np.sin(heading) < self.abscissa_um:
                low = middle
            else:
                high = middle
        return middle, float(y + self.radius_um * np.cos(heading))

    def _end(self, at: np.ndarray) -> tuple[float, float, float, float]:
        """Return x, y, heading and moment at the contact for moment, forces and place."""
        moment, across, along, place = at
        step = place / CELLS
        x = y = 0.0
        heading = self.heading_rad
        for _ in range(CELLS):
            middle = heading + 0.5 * step * (self.curvature + moment / self.ei_un_um2)
            cos, sin = np.cos(middle), np.sin(middle)
            moment_middle = moment - 0.5 * step * (across * cos - along * sin)
            heading = heading + step * (self.curvature + moment_middle / self.ei_un_um2)
            moment = moment - step * (across * cos - along * sin)
            x, y = x + step * cos, y + step * sin
        return x, y, heading, moment

    def _missed(self, scaled: np.ndarray, travel_um: float, held: str | float) -> np.ndarray:
        at = scaled * self._scales()
        x, y, heading, moment = self._end(at)
        _, across, along, place = at
        cos, sin = np.cos(heading), np.sin(heading)
        normal = along * sin - across * cos  # on the fibre, towards it
        rubbed = along * cos + across * sin
        if held == "sticks":
            last = (place - self.radius_um * heading - self.rolled_um) / self.abscissa_um
        else:
            last = (rubbed - held * normal) / self._scales()[1]
        return np.array(
            [
                moment / self._scales()[0],
                # The force on the probe is opposite, and moves it.
                (x - self.radius_um * sin + along / self.side_un_um) / self.abscissa_um - 1.0,
                (y + self.radius_um * cos - self._met[1] + travel_um) / self.abscissa_um,
                last,
            ]
        )

    def _scales(self) -> np.ndarray:
        length, ei = self.abscissa_um, self.ei_un_um2
        return np.array([ei / length, ei / length**2, ei / length**2, length])

    def _solve(self, travel_um: float, held: str | float) -> np.ndarray | None:
        """Return what balances; None where nothing near does."""
        begin = self._found / self._scales()
        found = root(self._missed, begin, (travel_um, held), method="hybr", tol=TIGHT)
        return found.x * self._scales() if np.abs(found.fun).max() < 1e-7 else None

    def rubs(self, at: np.ndarray) -> float:
        """Return friction as a part of the normal force; positive pulls the fibre outwards."""
        _, _, heading, _ = self._end(at)
        cos, sin = np.cos(heading), np.sin(heading)
        _, across, along, _ = at
        return float((along * cos + across * sin) / (along * sin - across * cos))

    def go(self, travel_um: float) -> tuple[float, float, float]:
        """Move the probe on; return the force across, along (outwards, on the probe), and friction.

        Go in short steps: a step that slides out and back is seen as its end.
        """
        if self._found is None:
            place, height = self.natural()
            self._met = place, height
            heading = self.heading_rad + self.curvature * place
            self.rolled_um = place - self.radius_um * heading
            force = 3.0 * self.ei_un_um2 * travel_um / place**3
            self._found = np.array([-force * place, -force, 0.0, place])
        found = self._solve(travel_um, "sticks")
        if found is None or abs(self.rubs(found)) > self.friction:
            found = self._slid(travel_um)
        self._found = found
        return -found[1], -found[2], self.rubs(found)

    def _slid(self, travel_um: float) -> np.ndarray:
        """Return what balances as it slides: outwards on a fibre that friction pulls outwards."""
        for rubs in (self.friction, -self.friction):
            found = self._solve(travel_um, rubs)
            if found is None:
                continue
            rolled = float(found[3] - self.radius_um * self._end(found)[2])
            if (rolled - self.rolled_um) * rubs >= 0.0:
                self.rolled_um = rolled
                return found
        raise ArithmeticError(f"neither sticks nor slides at {travel_um} um")
