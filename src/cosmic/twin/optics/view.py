"""Draws what one camera sees, tools included."""

import math
from dataclasses import dataclass
from threading import Lock
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats, Pixels
from cosmic.twin.optics.canvas import Layer, cover, patch
from cosmic.twin.optics.ground import FULL, Dirt, even_light, soil
from cosmic.twin.optics.noise import Noise
from cosmic.twin.optics.projection import STEADY, Area, Projection, Wobble, project
from cosmic.twin.optics.settings import OpticsSettings, ViewSettings
from cosmic.twin.optics.strokes import Shade, stroke
from cosmic.twin.optics.subjects import Solid, Strand, Subject

GROWTH_PX: Final = 0.71
"""OpenCV 5.0 draws smooth polygons larger than asked for by this at each edge: measured."""

EDGE_SIGMA_PX: Final = 0.45
"""Blur that their edges have already."""

MARGIN_PX: Final = 64.0
"""So far outside an image outlines are cut off: OpenCV's fixed point would overflow."""

_SHIFT: Final = 8

Points = list[list[float]]


def hull(points_px: Floats) -> Floats:
    """Return the convex outline of points, shape (n, 2)."""
    found = cv2.convexHull(points_px.astype(np.float32))
    return np.asarray(found.reshape(-1, 2), dtype=np.float64)


def outline(layer: Layer, corners_px: Floats, sigma_px: float, value: float) -> None:
    """Cover a convex outline, shape (n, 2), with one brightness, its edges blurred."""
    where = patch(layer, corners_px, 1.0, sigma_px)
    if where is None:
        return
    whole = cropped(where.cells(corners_px), where.width, where.height)
    corners = None if whole is None else shrunk(whole, GROWTH_PX)
    if corners is None:
        return
    mask = np.zeros((where.height, where.width), np.uint8)
    fixed = np.round(corners * (1 << _SHIFT)).astype(np.int32)
    cv2.fillConvexPoly(mask, fixed, 255, cv2.LINE_AA, _SHIFT)
    square = (sigma_px / where.cell) ** 2 - EDGE_SIGMA_PX**2
    if square > 0.04:
        cv2.GaussianBlur(mask, (0, 0), math.sqrt(square), mask, borderType=cv2.BORDER_REPLICATE)
    cover(layer, where, mask, value)


def shrunk(corners: Floats, by: float) -> Floats | None:
    """Return a convex outline with each edge moved inwards by `by`; None if nothing is left."""
    points = corners.tolist()
    sides = []
    turn = _area(points)
    for (x0, y0), (x1, y1) in zip(points, [*points[1:], points[0]], strict=True):
        length = math.hypot(x1 - x0, y1 - y0)
        if length > 1e-6:
            # a x + b y >= c inside
            a, b = (y0 - y1) / length, (x1 - x0) / length
            if turn < 0.0:
                a, b = -a, -b
            sides.append((a, b, a * x0 + b * y0 + by))
    return _cut(points, sides)


def cropped(corners: Floats, width: float, height: float) -> Floats | None:
    """Return the part of a convex outline near a rectangle; None if there is none."""
    sides = [
        (1.0, 0.0, -MARGIN_PX),
        (-1.0, 0.0, -width - MARGIN_PX),
        (0.0, 1.0, -MARGIN_PX),
        (0.0, -1.0, -height - MARGIN_PX),
    ]
    return _cut(corners.tolist(), sides)


def _cut(points: Points, sides: list[tuple[float, float, float]]) -> Floats | None:
    """Return what is left of a convex outline on the inner side of some lines."""
    for a, b, c in sides:
        left: Points = []
        x0, y0 = points[-1]
        in0 = a * x0 + b * y0 - c
        for x1, y1 in points:
            in1 = a * x1 + b * y1 - c
            if (in0 >= 0.0) != (in1 >= 0.0):
                part = in0 / (in0 - in1)
                left.append([x0 + part * (x1 - x0), y0 + part * (y1 - y0)])
            if in1 >= 0.0:
                left.append([x1, y1])
            x0, y0, in0 = x1, y1, in1
        if len(left) < 3:
            return None
        points = left
    return np.array(points)


def _area(points: Points) -> float:
    """Return twice the area of an outline; its sign tells which way round it goes."""
    following = [*points[1:], points[0]]
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(points, following, strict=True))


PER_GREY: Final = 64
"""Steps of a layer in one grey level of 255: four times full white fit in."""

RIM_UM: Final = 6.0
"""Width of the dark rim of a tool."""

RIM_SHADE: Final = 0.75


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """One exposure: what there is to be seen, and how it is taken; plain data.

    Attributes
    ----------
    at_s : float
        Platform time; the same time gives the same noise.
    zoom, focus : float
        Where the lens is, 0 to 1.
    percent : float
        How bright the lamp is, 0 to 100.
    binning : int
        So many pixels across and down are averaged into one.
    bits : int
        8: uint8; 16: uint16.
    """

    subject: Subject
    at_s: float
    zoom: float
    focus: float
    percent: float
    exposure_s: float
    gain_db: float
    area: Area
    binning: int
    bits: int
    wobble: Wobble = STEADY


class View:
    """One camera's view, with what does not move kept from image to image; any thread."""

    def __init__(
        self,
        settings: OpticsSettings,
        view: ViewSettings,
        dirt: Dirt,
        noise: Noise,
    ) -> None:
        self._settings = settings
        self._view = view
        self._dirt = dirt
        self._noise = noise
        image = settings.picture
        dark = image.contrast
        self._shade = Shade(
            1.0 - dark * (1.0 - image.wall), 1.0 - dark * (1.0 - image.lumen), image.wall_part
        )
        self._lock = Lock()
        self._even_key: object = None
        self._even: Layer = np.empty((0, 0), np.uint16)
        self._still_key: object = None
        self._still: Layer = self._even
        self._lit_key: object = None
        self._lit: Layer = self._even

    def draw(self, shot: Shot) -> Pixels:
        """Return an image, shape (height, width), uint8 or uint16."""
        subject, area = shot.subject, shot.area
        projection = project(
            self._view,
            self._settings.camera,
            zoom=shot.zoom,
            focus=shot.focus,
            area=area,
            binning=shot.binning,
            wavelength_um=self._settings.picture.wavelength_um,
            wobble=shot.wobble,
        )
        gain = 10.0 ** (shot.gain_db / 20.0)
        grey = self._grey(shot.percent, projection) * shot.exposure_s * gain
        with self._lock:
            layer = self._lit_up(subject, projection, area, grey).copy()
        for strand in subject.held:
            self._strand(layer, projection, strand)
        for solid in sorted(subject.solids, key=lambda each: each.height_um):
            self._solid(layer, projection, solid, grey)
        return self._exposed(layer, shot, grey=grey, gain=gain)

    # ------------------------------------------------------------------ brightness

    def _grey(self, percent: float, projection: Projection) -> float:
        """Return the grey level of the bare plate for an exposure of one second at 0 dB."""
        image = self._settings.picture
        lamp = percent / image.full_percent + image.stray
        dimming = projection.magnification**-self._view.dimming
        return float(image.ground_grey * lamp * dimming / image.full_exposure_s)

    def _exposed(self, layer: Layer, shot: Shot, *, grey: float, gain: float) -> Pixels:
        camera = self._settings.camera
        light = camera.shot_grey * gain * min(grey, 255.0)
        # Binned pixels are averaged: their noise is less, their brightness the same.
        sigma = math.sqrt((camera.noise_grey * gain) ** 2 + light) / shot.binning
        black = camera.black_grey * PER_GREY
        return self._noise.expose(layer, sigma * PER_GREY, black, shot.at_s, shot.bits)

    # ------------------------------------------------------------------ what stays

    def _lit_up(self, subject: Subject, projection: Projection, area: Area, grey: float) -> Layer:
        """Return the plate with what lies on it, as bright as it is now."""
        still_key = (projection, area, subject.plate.round(6).tobytes(), subject.lying_key)
        if still_key != self._still_key:
            self._still = self._plate(subject, projection, area)
            self._still_key, self._lit_key = still_key, None
        if grey != self._lit_key:
            scale = grey * PER_GREY / FULL
            self._lit = np.empty_like(self._still)
            cv2.addWeighted(self._still, scale, self._still, 0.0, 0.0, self._lit)
            self._lit_key = grey
        return self._lit

    def _plate(self, subject: Subject, projection: Projection, area: Area) -> Layer:
        sensor, image = self._settings.camera, self._settings.picture
        even_key = area, projection.px_um / projection.magnification, projection.axis_px
        if even_key != self._even_key:
            shape = area.height_px, area.width_px
            self._even = even_light(shape, projection, sensor, image)
            self._even_key = even_key
        layer = self._even.copy()
        soil(layer, self._dirt, projection, sensor, subject.plate)
        for each in subject.lying:
            self._strand(layer, projection, each.in_world(subject.plate))
        return layer

    # ------------------------------------------------------------------ what is drawn

    def _strand(self, layer: Layer, projection: Projection, strand: Strand) -> None:
        height = strand.height_um
        stroke(
            layer,
            projection.image_px(strand.line_um),
            0.5 * strand.width_um * projection.px_um_at(height),
            projection.sigma_px(height),
            self._shade,
        )

    def _solid(self, layer: Layer, projection: Projection, solid: Solid, grey: float) -> None:
        image = self._settings.picture
        points = projection.image_px(solid.corners_um)
        sigma = projection.sigma_px(solid.height_um)
        if patch(layer, points, 1.0, sigma) is None:
            return
        corners = hull(points)
        silicon = solid.link.startswith("probe")
        value = (image.silicon if silicon else image.steel) * grey * PER_GREY
        rim_px = RIM_UM * projection.px_um
        inner = shrunk(corners, rim_px) if rim_px > sigma else None
        outline(layer, corners, sigma, value if inner is None else RIM_SHADE * value)
        if inner is not None:
            outline(layer, inner, sigma, value)
