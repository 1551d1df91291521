"""How far the probe is from empty jaws, carried on from look to look without asking the jaws.

While bodies are nearer to each other than the probe is to any jaw, they alone decide how far things
may go until the next look. The jaws are left out then, and looked at again before they count.
"""

from collections.abc import Iterable, Mapping
from operator import sub

from cosmic.twin.kinematics import Slide


class ProbeToJaws:
    """What is left of a distance while stages go on.

    Parameters
    ----------
    slides : iterable of Slide
        The probe and the jaws.
    stages : iterable of str
        Those that are asked for besides.

    Attributes
    ----------
    left_um : float
        So far apart they are at least; 0 where that is not known.
    passed : bool
        The last look left the jaws out.
    """

    def __init__(self, slides: Iterable[Slide], stages: Iterable[str]) -> None:
        shares = dict.fromkeys(stages, 0.0)
        for slide in slides:
            for stage, direction in slide.directions:
                shares[stage] = max(shares.get(stage, 0.0), *map(abs, direction))
        self._stages = tuple(shares)
        # Two bodies come nearer to each other by as much as both go.
        self._nearer = 2.0 * max(shares.values(), default=0.0)
        self._places: list[float] = []
        self._time_s = 0.0
        self.left_um = 0.0
        self.passed = False
        self._next: tuple[list[float], float, float] = [], 0.0, 0.0

    def begin(self, values: Mapping[str, float], time_s: float, clear_um: float) -> None:
        """Take note of a distance, um, with the stages at `values`."""
        self._places = [values[name] for name in self._stages]
        self._time_s, self.left_um = time_s, clear_um
        self.passed = False

    def end(self) -> None:
        """Take note that it is not known."""
        self.left_um = 0.0
        self.passed = False

    def after_um(self, values: Mapping[str, float], time_s: float, drift_um_s: float) -> float:
        """Return what is left of it with the stages at `values`; each tool may drift besides."""
        places = [values[name] for name in self._stages]
        gone: float = sum(map(abs, map(sub, places, self._places)))
        left_um = self.left_um - self._nearer * gone - 2.0 * drift_um_s * (time_s - self._time_s)
        self._next = places, time_s, left_um
        return left_um

    def pass_by(self) -> None:
        """Go on to where `after_um` was asked for last, and leave the jaws out."""
        self._places, self._time_s, self.left_um = self._next
        self.passed = True

    def before(self) -> tuple[dict[str, float], float]:
        """Return where the stages were at the last look, and its time."""
        return dict(zip(self._stages, self._places, strict=True)), self._time_s
