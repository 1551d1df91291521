"""The calibrations in use: one for each camera and tool, kept in files where there is a folder."""

import logging
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import Final

from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration import (
    SAME_ZOOM_COUNTS,
    Calibration,
    Plane,
    RotationCentre,
)
from cosmic.vico.core.calibration_store import load_calibration, save_calibration
from cosmic.vico.core.pixel_map import Pair, PixelMap

logger = logging.getLogger(__name__)

NEAR_UM: Final = 150.0
"""How far in height a map is used from where it was measured.

A lens 86 mm above the plate shows what lies 150 um higher larger by 0.2 %: 3 um at the edge of the
image at 2x.
"""


@dataclass(frozen=True, slots=True)
class MapFound:
    """A map for a zoom and a height.

    Attributes
    ----------
    off_um : float
        How far in height from where it was measured.
    """

    map: PixelMap
    off_um: float
    tool: str


class Calibrations:
    """All that was measured; any thread.

    Parameters
    ----------
    folder : Path or None
        Where files are kept, made when the first is written; None: nowhere.

    Raises
    ------
    ConfigError
        A file there is broken.
    """

    def __init__(self, cameras: Iterable[str], tools: Iterable[str], folder: Path | None) -> None:
        self._folder = folder
        self._lock = Lock()
        self._tools = tuple(tools)
        self._known: dict[tuple[str, str], Calibration] = {}
        for camera in cameras:
            for tool in (*self._tools, ""):
                path = self._path(camera, tool)
                if path is not None and path.exists():
                    self._known[camera, tool] = load_calibration(path, _title(camera, tool))

    def get(self, camera: str, tool: str) -> Calibration:
        """Return what was measured with a tool; with "" what belongs to the camera alone."""
        with self._lock:
            return self._known.get((camera, tool), Calibration(_title(camera, tool)))

    def add_plane(self, camera: str, tool: str, plane: Plane) -> None:
        """Put a map in force and keep it; raises `ConfigError` where it cannot be written."""
        self._put(camera, tool, self.get(camera, tool).with_plane(plane))

    def shift(self, camera: str, tool: str, by_um: Pair, zoom_counts: float | None = None) -> None:
        """Move the maps made with a tool, of one zoom or of all; raises as `add_plane`."""
        known = self.get(camera, tool)
        if known.planes and any(by_um):
            moved = tuple(
                _moved(each, by_um)
                if zoom_counts is None or abs(each.zoom_counts - zoom_counts) <= SAME_ZOOM_COUNTS
                else each
                for each in known.planes
            )
            self._put(camera, tool, replace(known, planes=moved))

    def set_rotation(self, camera: str, rotation: RotationCentre) -> None:
        """Put a rotation centre in force and keep it; raises as `add_plane`."""
        self._put(camera, "", self.get(camera, "").with_rotation(rotation))

    def find(
        self, camera: str, zoom_counts: float, height_um: float, tool: str | None = None
    ) -> MapFound:
        """Return the map measured nearest to a height; of any tool, or of the one given.

        Raises
        ------
        NotAvailable
            None was measured there; the text says what there is.
        """
        found, reasons = [], []
        for name in self._tools if tool is None else (tool,):
            calibration = self.get(camera, name)
            if not calibration.planes:
                continue
            try:
                found.append(_near(calibration, name, zoom_counts, height_um))
            except NotAvailable as exc:
                reasons.append(str(exc))
        if found:
            return min(found, key=lambda each: each.off_um)
        which = f" with the tool {tool!r}" if tool else ""
        raise NotAvailable(
            "; ".join(reasons) or f"{camera} has not been calibrated{which}: use Calibrate"
        )

    def _put(self, camera: str, tool: str, calibration: Calibration) -> None:
        with self._lock:
            self._known[camera, tool] = calibration
        path = self._path(camera, tool)
        if path is not None:
            save_calibration(path, calibration)
            logger.info("%s written", path)

    def _path(self, camera: str, tool: str) -> Path | None:
        if self._folder is None:
            return None
        return self._folder / (f"{camera}-{tool}.toml" if tool else f"{camera}.toml")


def _moved(plane: Plane, by_um: Pair) -> Plane:
    x_um, y_um = plane.fit.map.centre_um
    centre_um = x_um + by_um[0], y_um + by_um[1]
    return replace(plane, fit=replace(plane.fit, map=replace(plane.fit.map, centre_um=centre_um)))


def _title(camera: str, tool: str) -> str:
    return f"{camera} by {tool}" if tool else camera


def _near(calibration: Calibration, tool: str, zoom_counts: float, height_um: float) -> MapFound:
    heights = sorted(
        {plane.height_um for plane in calibration.planes}, key=lambda each: abs(each - height_um)
    )
    why = ""  # the error itself would hold this frame, and with it an image, until a collection
    for at_um in (height_um, *(each for each in heights if abs(each - height_um) <= NEAR_UM)):
        try:
            return MapFound(calibration.map_at(zoom_counts, at_um), abs(at_um - height_um), tool)
        except NotAvailable as exc:
            why = why or str(exc)
    raise NotAvailable(why or f"calibration of {calibration.camera}: nothing was measured")
