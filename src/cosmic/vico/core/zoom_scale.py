"""How large things appear: magnification and um per pixel for every position of the zoom."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

from cosmic.frame.errors import ConfigError


@dataclass(frozen=True, slots=True)
class ZoomPoint:
    """A position of the zoom at which the scale was measured.

    Attributes
    ----------
    zoom : float
        Magnification.
    scale_um_px : float
        Of an unbinned pixel.
    name : str
        What the operator chooses it by; empty: it only belongs to the table.
    """

    counts: int
    zoom: float
    scale_um_px: float
    name: str = ""


class ZoomScale:
    """A table of zoom positions; between two of them everything changes by equal factors.

    Beyond its ends nothing is known, and nothing is guessed.

    Parameters
    ----------
    points : sequence of ZoomPoint
        In any order; none: no position has a scale.

    Raises
    ------
    ConfigError
        Two points at one position, a magnification that does not rise, a scale that does not
        fall.
    """

    def __init__(self, points: Sequence[ZoomPoint]) -> None:
        self._points = tuple(sorted(points, key=lambda each: each.counts))
        for point in self._points:
            if not (0.0 < point.zoom < math.inf and 0.0 < point.scale_um_px < math.inf):
                raise ConfigError(
                    f"zoom position {point.counts}: magnification {point.zoom} and scale "
                    f"{point.scale_um_px} um/px must be above 0"
                )
        for one, other in zip(self._points, self._points[1:], strict=False):
            rises = one.zoom < other.zoom and one.scale_um_px > other.scale_um_px
            if one.counts == other.counts or not rises:
                raise ConfigError(
                    f"zoom positions {one.counts} and {other.counts}: magnification must rise "
                    f"from one to the next ({one.zoom:g}, {other.zoom:g}) and the scale must fall "
                    f"({one.scale_um_px:g}, {other.scale_um_px:g} um/px)"
                )

    @property
    def points(self) -> tuple[ZoomPoint, ...]:
        """The table, from the smallest magnification."""
        return self._points

    @property
    def steps(self) -> tuple[ZoomPoint, ...]:
        """Those with a name."""
        return tuple(each for each in self._points if each.name)

    @property
    def zoom_range(self) -> tuple[float, float]:
        """Least and most magnification.

        Raises
        ------
        ConfigError
            The table is empty.
        """
        if not self._points:
            raise ConfigError("no zoom position has a magnification: add some to the settings")
        return self._points[0].zoom, self._points[-1].zoom

    def scale_um_px(self, counts: float, binning: int = 1) -> float | None:
        """Return what one pixel is there, binning counted; None outside the table."""
        scale = self._between(counts, [each.scale_um_px for each in self._points])
        return None if scale is None else scale * binning

    def zoom(self, counts: float) -> float | None:
        """Return the magnification there; None outside the table."""
        return self._between(counts, [each.zoom for each in self._points])

    def label(self, counts: float) -> str:
        """Return the magnification as the operator reads it, such as "2.0x"; "" outside."""
        zoom = self.zoom(counts)
        return "" if zoom is None else zoom_text(zoom)

    def counts(self, zoom: float) -> int:
        """Return the position of a magnification.

        Raises
        ------
        ConfigError
            Outside the table, or no number.
        """
        low, high = self.zoom_range
        if not low <= zoom <= high:
            raise ConfigError(
                f"a magnification of {zoom:g} is not in the table: "
                f"{zoom_text(low)} to {zoom_text(high)}"
            )
        after = bisect_right([each.zoom for each in self._points], zoom)
        if after == len(self._points):
            return self._points[-1].counts
        one, other = self._points[after - 1], self._points[after]
        part = math.log(zoom / one.zoom) / math.log(other.zoom / one.zoom)
        return round(one.counts + part * (other.counts - one.counts))

    def _between(self, counts: float, values: Sequence[float]) -> float | None:
        points = self._points
        if not points or not points[0].counts <= counts <= points[-1].counts:
            return None
        after = bisect_right([each.counts for each in points], counts)
        if after == len(points):
            return values[-1]
        one, other = points[after - 1].counts, points[after].counts
        part = (counts - one) / (other - one)
        ratio = values[after] / values[after - 1]
        return values[after - 1] * float(ratio**part)


def zoom_text(zoom: float) -> str:
    """Return a magnification as the operator reads it: "0.58x", "2.0x", "12x"."""
    return f"{zoom:.2f}x" if zoom < 1.0 else f"{zoom:.1f}x" if zoom < 10.0 else f"{zoom:.0f}x"
