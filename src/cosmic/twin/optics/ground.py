"""What lies on the plate and before the sensor: uneven light, dust, scratches."""

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.optics.canvas import Layer
from cosmic.twin.optics.projection import Projection
from cosmic.twin.optics.settings import ImageSettings, SensorSettings
from cosmic.twin.optics.strokes import Shade, speck, stroke

FULL: Final = 16384
"""Brightness of the bare plate in a layer of light that passes."""

REACH_UM: Final = 6000.0
"""Dust lies so far around the middle of the plate."""

COARSE_PX: Final = 16

SCRATCH_UM: Final = 1.2
SCRATCH: Final = Shade(wall=0.86, lumen=0.86, wall_part=0.5)


@dataclass(frozen=True, slots=True)
class Dirt:
    """Dust and scratches; points on the plate in um, on the sensor as a part of its sides.

    Attributes
    ----------
    specks : ndarray, shape (n, 4), float64
        x, y, radius, and how much light passes.
    scratches : ndarray, shape (n, 2, 2), float64
        Their ends.
    on_sensor : ndarray, shape (n, 4), float64
        x, y, radius in pixels, and how much light passes.
    """

    specks: Floats
    scratches: Floats
    on_sensor: Floats


def make_dirt(image: ImageSettings, seed: int) -> Dirt:
    """Return dirt that depends on the seed alone."""
    rng = np.random.default_rng([seed, 0xD1])
    count = round(image.dust_per_mm2 * (2e-3 * REACH_UM) ** 2)
    specks = np.empty((count, 4))
    specks[:, :2] = rng.uniform(-REACH_UM, REACH_UM, (count, 2))
    specks[:, 2] = image.dust_um * rng.lognormal(0.0, 0.5, count)
    specks[:, 3] = rng.uniform(0.25, 0.85, count)
    middle = rng.uniform(-REACH_UM, REACH_UM, (image.scratches, 2))
    angle = rng.uniform(0.0, math.pi, image.scratches)
    half = rng.uniform(150.0, 900.0, image.scratches)
    arm = np.stack([half * np.cos(angle), half * np.sin(angle)], axis=1)
    on_sensor = np.empty((image.sensor_specks, 4))
    on_sensor[:, :2] = rng.uniform(0.05, 0.95, (image.sensor_specks, 2))
    on_sensor[:, 2] = rng.uniform(6.0, 14.0, image.sensor_specks)
    on_sensor[:, 3] = rng.uniform(0.93, 0.98, image.sensor_specks)
    return Dirt(specks, np.stack([middle - arm, middle + arm], axis=1), on_sensor)


def even_light(
    shape: tuple[int, int], view: Projection, sensor: SensorSettings, image: ImageSettings
) -> Layer:
    """Return the bare plate in uneven light; darkest in the corners and on the right."""
    height, width = shape
    side = sensor.width_px * view.px_um / view.magnification * sensor.pixel_um
    x = (np.arange(0, width + 2 * COARSE_PX, COARSE_PX) - view.axis_px[0]) / side
    y = (np.arange(0, height + 2 * COARSE_PX, COARSE_PX) - view.axis_px[1]) / side
    corner = 0.25 * (1.0 + (sensor.height_px / sensor.width_px) ** 2)
    radius = (x * x + (y * y)[:, None]) / corner
    light = (1.0 - image.uneven * radius) * (1.0 - image.slanted * x)
    coarse = (FULL * light.clip(0.05, 2.0)).astype(np.float32)
    # Cells are sampled at their first pixel, where resize expects their middle.
    rows = (np.arange(height, dtype=np.float32) / COARSE_PX)[:, None]
    columns = (np.arange(width, dtype=np.float32) / COARSE_PX)[None, :]
    maps = np.broadcast_to(columns, shape), np.broadcast_to(rows, shape)
    found = cv2.remap(coarse, np.ascontiguousarray(maps[0]), np.ascontiguousarray(maps[1]), 1)
    return np.asarray(found.astype(np.uint16))


def soil(
    layer: Layer,
    dirt: Dirt,
    view: Projection,
    sensor: SensorSettings,
    plate: Floats,
) -> None:
    """Draw dirt on a layer.

    Parameters
    ----------
    plate : ndarray, shape (4, 4), float64
        `world_from_plate`, um.
    """
    sigma = view.sigma_px(float(plate[2, 3]))
    scale = view.px_um_at(float(plate[2, 3]))
    points = view.image_px(on_plate(dirt.specks[:, :2], plate))
    height, width = layer.shape
    reach = 4.0 * sigma + 60.0 * scale
    seen = ((points > -reach) & (points < [width + reach, height + reach])).all(axis=1)
    for point, (_, _, radius, passes) in zip(points[seen], dirt.specks[seen], strict=True):
        speck(layer, point, radius * scale, sigma, passes)
    for ends in dirt.scratches:
        line = view.image_px(on_plate(ends, plate))
        stroke(layer, line, SCRATCH_UM * scale, sigma, SCRATCH)
    per_px = view.px_um / view.magnification * sensor.pixel_um
    sides = np.array([sensor.width_px, sensor.height_px])
    corner = np.array(view.axis_px) - 0.5 * sides * per_px
    for x, y, radius, passes in dirt.on_sensor:
        speck(layer, corner + sides * (x * per_px, y * per_px), radius * per_px, 0.5, passes)


def on_plate(points_um: Floats, plate: Floats, height_um: float = 0.0) -> Floats:
    """Return points on the plate, shape (n, 2), in the world, shape (n, 3)."""
    whole = np.column_stack(
        [points_um, np.full(len(points_um), height_um), np.ones(len(points_um))]
    )
    return np.asarray((whole @ plate.T)[:, :3])
