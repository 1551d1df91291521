"""What a fibre forgets: each step of a force on it loses its part in every tenfold time.

Curvature that crept stays after a push, and goes back as slowly as it came. So a fibre stands
aside where it was pushed before, by less and less; near the jaws that counts most, for there a
small force was enough to push it so far.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats

RELAXED_AT_S: Final = 1.0
"""Each step counts from so long after it: stiffness is what a fibre shows then."""

LEAST_S: Final = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """Steps of force on a held fibre, as they act where the probe stands now.

    Attributes
    ----------
    time_s, step_un : ndarray, shape (n,), float64
        When, and by how much, it rose or fell.
    """

    time_s: Floats
    step_un: Floats

    @classmethod
    def of(cls, time_s: Floats, force_un: Floats) -> "Loads":
        """Return the steps between readings, each half way between two."""
        return cls(_middles_s(time_s), np.diff(force_un, prepend=0.0))

    @classmethod
    def of_push(cls, time_s: Floats, force_un: Floats) -> "Loads":
        """Return the steps of a whole push; after its last reading the probe is off."""
        steps = cls.of(time_s, force_un)
        off = np.append(steps.step_un, -steps.step_un.sum())
        return cls(np.append(steps.time_s, time_s[-1]), off)

    @classmethod
    def of_others(cls, pushes: Sequence[tuple["Loads", float]], lever_um: float) -> "Loads":
        """Return what other pushes, each with its lever, are at this one.

        A force bends each cell of the fibre by its own lever; where the probe stands now, that
        force would have gone as far as this one.
        """
        if not pushes:
            return NO_LOADS
        steps = [each.step_un * _as_much_at(lever_um, there_um) for each, there_um in pushes]
        return cls(np.concatenate([each.time_s for each, _ in pushes]), np.concatenate(steps))

    def lost_un(self, time_s: Floats) -> Floats:
        """Return what of the force is lost at some times, for a part of 1 in a tenfold time."""
        return np.asarray(_decades(time_s, self.time_s) @ self.step_un)


NO_LOADS: Final = Loads(np.zeros(0), np.zeros(0))


def lost(time_s: Floats) -> Floats:
    """Return what is lost at each time of the force at each, for a part of 1 in a tenfold time."""
    return np.asarray(-np.diff(_decades(time_s, _middles_s(time_s)), append=0.0))


def _middles_s(time_s: Floats) -> Floats:
    return np.asarray(time_s - 0.5 * np.diff(time_s, prepend=2.0 * time_s[0] - time_s[1]))


def _decades(time_s: Floats, stepped_s: Floats) -> Floats:
    """Return how many tenfold times each step is old, a row for each time; 0 before it."""
    since = (time_s[:, None] - stepped_s[None, :]) / RELAXED_AT_S
    return np.where(since > 0.0, np.log10(np.maximum(since, LEAST_S)), 0.0)


def _as_much_at(lever_um: float, there_um: float) -> float:
    """Return the force at a lever that bends a cantilever there as one of 1 at another does."""
    near, far = sorted((lever_um, there_um))
    bent = near * near * (3.0 * far - near) / 2.0
    return bent / lever_um**3
