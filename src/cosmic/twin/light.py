"""The twin's lamp: how bright it is at any moment."""

from typing import Final

from cosmic.twin.lens_settings import LightSettings

CHANGES_KEPT: Final = 256
"""So many changes back, instruments that report late still see how bright it was."""


class TwinLight:
    """A dimmed LED; it follows at once.

    Notes
    -----
    Any thread may look, also at the past; one at a time changes it.
    """

    def __init__(self, settings: LightSettings) -> None:
        self.settings = settings
        self._gives = 1.0
        self._changes: tuple[tuple[float, float], ...] = ((0.0, settings.start_percent),)

    def percent(self, now_s: float) -> float:
        """Return how bright it is at `now_s`, 0 to 100."""
        for since_s, percent in reversed(self._changes):
            if since_s <= now_s:
                return percent
        return self._changes[0][1]

    def given_percent(self, now_s: float) -> float:
        """Return how bright it really is: less than it is told when its LED is worn."""
        faded = max(1.0 - self.settings.fading_per_h * now_s / 3600.0, 0.0)
        return self._gives * faded * self.percent(now_s)

    def dim(self, part: float) -> None:
        """Have it give only a part of its light; its controller does not notice."""
        self._gives = part

    def set_percent(self, percent: float, now_s: float) -> None:
        """Make it so bright from `now_s` on."""
        if not 0.0 <= percent <= 100.0:
            raise ValueError(f"a brightness lies between 0 and 100 %, got {percent!r}")
        self._changes = (*self._changes[1 - CHANGES_KEPT :], (now_s, percent))
