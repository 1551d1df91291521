"""Contact of the probe with one body, kept over time so that nothing tunnels."""

from dataclasses import dataclass


@dataclass(slots=True)
class ProbeContact:
    """Whether the probe pushes against a body.

    A stage can carry the probe right through a fibre between two looks. What counts is therefore
    not where the probe is, but from where it came: once in front of the body and within its
    reach, it stays on that side until it goes back or leaves sideways. A probe that comes in from
    the side, past the body's face, stands beside it and pushes nothing.

    Attributes
    ----------
    pressed : bool
        They push against each other, or stick.
    """

    pressed: bool = False
    _reach: float | None = None
    _travel: float = 0.0

    def look(self, reach_um: float, travel_um: float) -> bool:
        """Take note of where the probe is now, and return whether they touch.

        Parameters
        ----------
        reach_um : float
            How far inside the body's reach the probe is, in x and z; negative: outside.
        travel_um : float
            How far the probe's tip is past the body's face; negative: in front of it.
        """
        before, travel_before = self._reach, self._travel
        self._reach, self._travel = reach_um, travel_um
        if reach_um <= 0.0:
            self.pressed = False
        elif not self.pressed and travel_um > 0.0:
            self.pressed = before is not None and self._came_from_front(before, travel_before)
        return self.pressed

    def lose(self) -> None:
        """End the contact: it slid off, and the probe stands behind the body."""
        self.pressed = False

    def come_off(self) -> None:
        """End the contact on the side where it began: it was drawn apart."""
        self.pressed = False
        self._travel = min(self._travel, 0.0)

    def _came_from_front(self, before: float, travel_before: float) -> bool:
        if travel_before > 0.0 or self._reach is None:
            return False
        if before >= 0.0:
            return True
        # Both crossed between two looks: which first?
        into_reach = -before / (self._reach - before)
        past_face = -travel_before / (self._travel - travel_before)
        return into_reach <= past_face
