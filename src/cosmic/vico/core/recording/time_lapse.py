"""`TimeLapse`: which images of a running camera belong to a time-lapse."""

import math
from dataclasses import dataclass
from typing import Final

from cosmic.frame.errors import ConfigError

SHORTEST_S: Final = 0.001


@dataclass(frozen=True, slots=True)
class TimeLapsePlan:
    """An image every `interval_s` of platform time.

    Attributes
    ----------
    interval_s : float
        Between two images.
    count : int or None
        How many times an image is due; None for no end.
    until_s : float or None
        Platform time after which no image is due; None for no end.

    Raises
    ------
    ConfigError
        An interval or a number that is not above 0, or an interval below a millisecond.
    """

    interval_s: float
    count: int | None = None
    until_s: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.interval_s < math.inf:
            raise ConfigError(f"time-lapse: interval {self.interval_s!r} s; it must be above 0")
        if self.interval_s < SHORTEST_S:  # each that is due is counted, also those without an image
            raise ConfigError(
                f"time-lapse: interval {self.interval_s!r} s; {SHORTEST_S:g} s is the shortest"
            )
        if self.count is not None and not self.count > 0:
            raise ConfigError(f"time-lapse: {self.count!r} images; there must be one at least")
        if self.until_s is not None and math.isnan(self.until_s):
            raise ConfigError("time-lapse: its end is not a number")


class TimeLapse:
    """Chooses images: the first one exposed at or after each time that is due; one thread.

    Times that are due keep to the grid from `start_s` on, so that a late image delays no other.

    Parameters
    ----------
    start_s : float
        Platform time at which the first image is due.
    late_after_s : float or None
        An image exposed later than this after its time counts as late; a tenth of the interval
        without it.
    """

    def __init__(
        self, plan: TimeLapsePlan, start_s: float, *, late_after_s: float | None = None
    ) -> None:
        self._plan = plan
        self._start_s = start_s
        self._late_after_s = plan.interval_s / 10.0 if late_after_s is None else late_after_s
        self._step = 0
        self._taken = self._late = self._missed = 0

    @property
    def taken(self) -> int:
        """Images chosen so far."""
        return self._taken

    @property
    def late(self) -> int:
        """Images among them that were exposed late."""
        return self._late

    @property
    def missed(self) -> int:
        """Times that were due and had no image before the next one."""
        return self._missed

    @property
    def due_s(self) -> float | None:
        """Platform time at which the next image is due; None when it is over."""
        due_s = self._start_s + self._step * self._plan.interval_s
        counted = self._plan.count is not None and self._step >= self._plan.count
        over = self._plan.until_s is not None and due_s > self._plan.until_s
        return None if counted or over else due_s

    @property
    def done(self) -> bool:
        """True when no image is due any more."""
        return self.due_s is None

    def take(self, exposed_s: float) -> bool:
        """Return whether the image exposed at `exposed_s` belongs to it."""
        due_s = self.due_s
        if due_s is None or not exposed_s >= due_s:
            return False
        passed = math.floor((exposed_s - due_s) / self._plan.interval_s)
        for _ in range(passed):
            self._step += 1
            self._missed += 1
            if self.done:  # the image came after the end
                return False
        due_s += passed * self._plan.interval_s
        self._late += exposed_s - due_s > self._late_after_s
        self._taken += 1
        self._step += 1
        return True
