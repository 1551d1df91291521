"""Where a point in the world lies in an image, and how sharp it is there."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.optics.settings import SensorSettings, ViewSettings

DIFFRACTION: Final = 0.21
"""Standard deviation of the image of a point, in wavelengths over the aperture."""

PIXEL_SIGMA: Final = 0.29
"""Standard deviation that the square of a pixel adds."""


@dataclass(frozen=True, slots=True)
class Area:
    """The part of the sensor in an image, in binned pixels."""

    x_px: int
    y_px: int
    width_px: int
    height_px: int


@dataclass(frozen=True, slots=True)
class Wobble:
    """By how much a run of the zoom left the lens elsewhere than the last did.

    Attributes
    ----------
    scale : float
        Of the image.
    x_um, y_um : float
        Where the optical axis meets the plate.
    focus_um : float
        Height that is sharp.
    """

    scale: float = 1.0
    x_um: float = 0.0
    y_um: float = 0.0
    focus_um: float = 0.0


STEADY: Final = Wobble()


@dataclass(frozen=True, slots=True)
class Projection:
    """A camera's view at one zoom and focus, onto one area of its sensor.

    Attributes
    ----------
    axis_px : (float, float)
        Where the optical axis meets the image; a pixel's centre has whole numbers.
    axis_um : (float, float)
        Where it meets the plate.
    px_um : float
        Pixels a micrometre at the height of the plate.
    cos, sin : float
        Of the angle by which the camera is turned.
    blur_um : float
        Standard deviation of the blur by diffraction, um.
    distortion, middle_px, corner_px
        By how much the corners are moved outwards; from where, and how far off they are.
    """

    axis_px: tuple[float, float]
    axis_um: tuple[float, float]
    px_um: float
    cos: float
    sin: float
    magnification: float
    aperture: float
    blur_um: float
    focus_um: float
    distance_um: float
    distortion: float = 0.0
    middle_px: tuple[float, float] = (0.0, 0.0)
    corner_px: float = 1.0

    def image_px(self, points_um: Floats) -> Floats:
        """Return where points of the world, shape (n, 3), lie in the image, shape (n, 2)."""
        x = points_um[:, 0] - self.axis_um[0]
        y = points_um[:, 1] - self.axis_um[1]
        scale = self.px_um * self.distance_um / (self.distance_um - points_um[:, 2])
        found = np.empty((len(points_um), 2))
        found[:, 0] = self.axis_px[0] + scale * (self.cos * x + self.sin * y)
        # Rows count downwards, y goes up.
        found[:, 1] = self.axis_px[1] - scale * (self.cos * y - self.sin * x)
        if self.distortion:
            aside = found - self.middle_px
            square = (aside * aside).sum(axis=1) / self.corner_px**2
            # Far outside the image a cubic would fold back.
            found += aside * (self.distortion * np.minimum(square, 4.0))[:, None]
        return found

    def px_um_at(self, height_um: float) -> float:
        """Return the pixels a micrometre at a height above the plate."""
        return self.px_um * self.distance_um / (self.distance_um - height_um)

    def sigma_px(self, height_um: float) -> float:
        """Return the standard deviation of the blur at a height above the plate, in pixels."""
        # The cone of light cut at the wrong height is a disc; its spread is half its radius.
        defocus_um = 0.5 * self.aperture * abs(height_um - self.focus_um)
        spread_um = math.hypot(self.blur_um, defocus_um)
        return math.hypot(PIXEL_SIGMA, spread_um * self.px_um_at(height_um))


def project(
    view: ViewSettings,
    sensor: SensorSettings,
    *,
    zoom: float,
    focus: float,
    area: Area,
    binning: int,
    wavelength_um: float,
    wobble: Wobble = STEADY,
) -> Projection:
    """Return a view with zoom and focus at a part of their ways, 0 to 1."""
    magnification = _between(view.magnification_low, view.magnification_high, zoom)
    aperture = _between(view.aperture_low, view.aperture_high, zoom)
    angle = math.radians(view.rotation_deg)
    # Pixel centres: (x + 0.5) / binning - 0.5 is where a sensor's pixel lies in a binned one.
    axis_x = sensor.width_px / 2.0 + zoom * view.zoom_shift_x_px
    axis_y = sensor.height_px / 2.0 + zoom * view.zoom_shift_y_px
    return Projection(
        axis_px=(axis_x / binning - 0.5 - area.x_px, axis_y / binning - 0.5 - area.y_px),
        axis_um=(view.centre_x_um + wobble.x_um, view.centre_y_um + wobble.y_um),
        px_um=wobble.scale * magnification / (sensor.pixel_um * binning),
        cos=math.cos(angle),
        sin=math.sin(angle),
        magnification=magnification,
        aperture=aperture,
        blur_um=DIFFRACTION * wavelength_um / aperture,
        focus_um=view.focus_low_um
        + focus * (view.focus_high_um - view.focus_low_um)
        + zoom * view.focus_shift_um
        + wobble.focus_um,
        distortion=view.distortion,
        middle_px=(
            sensor.width_px / 2.0 / binning - 0.5 - area.x_px,
            sensor.height_px / 2.0 / binning - 0.5 - area.y_px,
        ),
        corner_px=0.5 * math.hypot(sensor.width_px, sensor.height_px) / binning,
        distance_um=view.working_distance_um,
    )


def _between(low: float, high: float, part: float) -> float:
    return float(low * (high / low) ** part)
