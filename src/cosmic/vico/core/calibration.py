"""What is known of a camera's view of the platform: a map for each zoom and height measured."""

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration_fit import MapFit, RotationFit
from cosmic.vico.core.pixel_map import PixelMap, between

SAME_ZOOM_COUNTS: Final = 1.0
SAME_HEIGHT_UM: Final = 5.0


@dataclass(frozen=True, slots=True)
class Plane:
    """The map measured at one zoom position and one height.

    Attributes
    ----------
    zoom_counts : float
        0 where the lens has no motor.
    height_um : float
        Of what was tracked, in platform coordinates.
    measured : datetime
        With its time zone.
    """

    zoom_counts: float
    height_um: float
    fit: MapFit
    measured: datetime

    def age_s(self, now: datetime) -> float:
        """Return how long ago it was measured."""
        return (now - self.measured).total_seconds()


@dataclass(frozen=True, slots=True)
class RotationCentre:
    """About which point a rotary axis turns, with when that was measured."""

    axis: str
    fit: RotationFit
    measured: datetime


@dataclass(frozen=True, slots=True)
class Calibration:
    """All that was measured with one camera.

    Attributes
    ----------
    camera : str
        Its key.
    planes : tuple of Plane
        By zoom, then by height.
    """

    camera: str
    planes: tuple[Plane, ...] = ()
    rotation: RotationCentre | None = None

    def with_plane(self, plane: Plane) -> "Calibration":
        """Return it with `plane`, which replaces one of the same zoom and height."""
        others = [each for each in self.planes if not _same(each, plane)]
        ordered = sorted([*others, plane], key=lambda each: (each.zoom_counts, each.height_um))
        return replace(self, planes=tuple(ordered))

    def with_rotation(self, rotation: RotationCentre) -> "Calibration":
        """Return it with another rotation centre."""
        return replace(self, rotation=rotation)

    def age_s(self, now: datetime) -> float:
        """Return the age of its oldest map, s.

        Raises
        ------
        NotAvailable
            Nothing was measured yet.
        """
        if not self.planes:
            raise NotAvailable(f"calibration of {self.camera}: nothing has been measured yet")
        return max(plane.age_s(now) for plane in self.planes)

    def map_at(self, zoom_counts: float, height_um: float | None = None) -> PixelMap:
        """Return the map for a zoom position and a height, between those measured.

        Parameters
        ----------
        height_um : float or None
            None: the only height measured at this zoom.

        Raises
        ------
        NotAvailable
            Not between what was measured, or several heights were and none is given; the text
            says which there are. Nothing is extrapolated.
        """
        columns = self._columns()
        if not columns:
            raise NotAvailable(f"calibration of {self.camera}: nothing has been measured yet")
        zooms = list(columns)
        low, high, share = self._between(zooms, zoom_counts, SAME_ZOOM_COUNTS, "zoom", "counts")
        first = self._at_height(columns[low], height_um)
        if low == high:
            return first
        second = self._at_height(columns[high], height_um)
        if first.mirrored != second.mirrored:
            raise NotAvailable(
                f"calibration of {self.camera}: mirrored at one of zoom {low:g} and {high:g} and "
                "not at the other; measure both again"
            )
        return between(first, second, share)

    def scale_um_px(self, zoom_counts: float, height_um: float | None = None) -> float:
        """Return the size of an unbinned pixel; raises `NotAvailable` as `map_at` does.

        Without a height, and with several measured, that of the middle one: heights differ by
        less than what a scale bar shows.
        """
        if height_um is not None:
            return self.map_at(zoom_counts, height_um).scale_um_px
        middle = tuple(column[len(column) // 2] for column in self._columns().values())
        return replace(self, planes=middle).map_at(zoom_counts).scale_um_px

    def _columns(self) -> dict[float, list[Plane]]:
        """Return the planes by zoom, each zoom with its heights."""
        columns: dict[float, list[Plane]] = {}
        for plane in self.planes:
            near = (zoom for zoom in columns if abs(zoom - plane.zoom_counts) <= SAME_ZOOM_COUNTS)
            columns.setdefault(next(near, plane.zoom_counts), []).append(plane)
        return columns

    def _at_height(self, column: list[Plane], height_um: float | None) -> PixelMap:
        if height_um is None:
            if len(column) > 1:
                heights = ", ".join(f"{plane.height_um:g}" for plane in column)
                raise NotAvailable(
                    f"calibration of {self.camera}: measured at several heights ({heights} um); "
                    "say at which one"
                )
            return column[0].fit.map
        maps = {plane.height_um: plane.fit.map for plane in column}
        low, high, share = self._between(list(maps), height_um, SAME_HEIGHT_UM, "height", "um")
        return maps[low] if low == high else between(maps[low], maps[high], share)

    def _between(
        self, known: list[float], value: float, same: float, what: str, unit: str
    ) -> tuple[float, float, float]:
        """Return the neighbours of `value` and how far it is from the first to the second."""
        nearest = min(known, key=lambda each: abs(each - value))
        if abs(nearest - value) <= same:
            return nearest, nearest, 0.0
        if not min(known) <= value <= max(known):
            there = ", ".join(f"{each:g}" for each in known)
            raise NotAvailable(
                f"calibration of {self.camera}: {what} {value:g} {unit} lies outside what was "
                f"measured ({there} {unit}); measure there"
            )
        low = max(each for each in known if each < value)
        high = min(each for each in known if each > value)
        return low, high, (value - low) / (high - low)


def _same(first: Plane, second: Plane) -> bool:
    return (
        abs(first.zoom_counts - second.zoom_counts) <= SAME_ZOOM_COUNTS
        and abs(first.height_um - second.height_um) <= SAME_HEIGHT_UM
    )
