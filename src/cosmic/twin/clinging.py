"""A fibre that stays at a jaw which opened, and what frees it."""

import math
import random

from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.kinematics import Point


class Clinging:
    """How a fibre sticks to a jaw, until it is shaken off or wiped off along the plate.

    Parameters
    ----------
    key : str
        Names seed, fibre and grasp: the same key, the same number of tries.
    position : (float, float, float)
        Of the jaw's tip, um, world.
    """

    def __init__(self, handling: HandlingSettings, key: str, position: Point) -> None:
        self._handling = handling
        self._chance = random.Random(f"free {key}")
        self._turns = list(position)
        self._ways = [0, 0, 0]
        self._last = position
        self._wiped_um = 0.0

    def look(self, position: Point, low_um: float) -> str:
        """Follow the jaw and return "shaken" or "wiped" once the fibre is free, else "".

        Parameters
        ----------
        low_um : float
            Below this height above the plate the fibre touches it.
        """
        if self._shaken(position):
            return "shaken"
        way = math.dist(position[:2], self._last[:2])
        self._last = position
        if position[2] >= low_um:
            return ""
        self._wiped_um += way
        if self._wiped_um < self._handling.wipe_um:
            return ""
        self._wiped_um = 0.0
        return "wiped" if self._chance.random() < self._handling.wipe_frees else ""

    def _shaken(self, position: Point) -> bool:
        for axis, now in enumerate(position):
            since = now - self._turns[axis]
            way = self._ways[axis]
            if way == 0:
                if abs(since) >= self._handling.shake_um:
                    self._ways[axis], self._turns[axis] = (1 if since > 0.0 else -1), now
            elif since * way > 0.0:
                self._turns[axis] = now
            elif abs(since) >= self._handling.shake_um:
                self._ways[axis], self._turns[axis] = -way, now
                if self._chance.random() < self._handling.shake_frees:
                    return True
        return False
