"""Friction where the probe touches a fibre: it turns round when the probe does."""

from dataclasses import dataclass

from cosmic.twin.rod import PushCurve


@dataclass(slots=True)
class Rubbing:
    """Which way the fibre is rubbed, over the travel of the probe.

    Attributes
    ----------
    turn_um : float
        Travel over which it turns round: the contact sticks before it slides.
    part : float
        1 while the push grows, -1 while it falls, between while the contact sticks.
    """

    turn_um: float
    part: float = 0.0
    _travel_um: float = 0.0

    def follow(self, travel_um: float) -> float:
        """Take note of where the probe is now, and return `part`."""
        moved, self._travel_um = travel_um - self._travel_um, travel_um
        part: float = self.part + 2.0 * moved / self.turn_um
        self.part = min(max(part, -1.0), 1.0)
        return self.part


@dataclass(frozen=True, slots=True)
class RubbedPush:
    """Force over travel between that of a growing and of a falling push."""

    growing: PushCurve
    falling: PushCurve
    part: float

    @property
    def reach_um(self) -> float:
        """Travel at which the fibre slides off."""
        return min(self.growing.reach_um, self.falling.reach_um)

    def force_un(self, travel_um: float) -> float:
        """Return the force at a travel."""
        one, other = self.growing.force_un(travel_um), self.falling.force_un(travel_um)
        return 0.5 * (one + other) + 0.5 * self.part * (one - other)

    def along_un(self, travel_um: float) -> float:
        """Return the force along the fibre on the probe at a travel, outwards."""
        one, other = self.growing.along_un(travel_um), self.falling.along_un(travel_um)
        return 0.5 * (one + other) + 0.5 * self.part * (one - other)
