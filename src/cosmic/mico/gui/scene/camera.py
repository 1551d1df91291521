"""The camera of the 3D view, as plain numbers: where it looks from, and what is seen where."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from cosmic.mico.core.collision.model import Floats

_FIELD_DEG: Final = 28.0
_CUT: Final = 2.0
_NEAREST_MM: Final = 0.2
_FARTHEST_MM: Final = 5_000.0


@dataclass(frozen=True)
class Sight:
    """What to look at, and from where.

    What stands more than twice the radius before the centre is cut away.

    Attributes
    ----------
    centre_mm : tuple of float
        In the middle of the picture.
    radius_mm : float
        A ball of this radius around the centre fits into the picture.
    azimuth_deg, elevation_deg : float
        Where the camera stands, seen from the centre: -90 and 0 is in front (at negative y).
    """

    centre_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius_mm: float = 50.0
    azimuth_deg: float = -60.0
    elevation_deg: float = 30.0

    @property
    def cut_mm(self) -> float:
        """How far before the centre the picture begins."""
        return _CUT * self.radius_mm


@dataclass(frozen=True)
class Camera:
    """A camera that turns about a point; z stays upright."""

    sight: Sight = Sight()

    @property
    def distance_mm(self) -> float:
        """From the camera to the centre."""
        return self.sight.radius_mm / float(np.sin(np.radians(_FIELD_DEG / 2.0)))

    @property
    def near_mm(self) -> float:
        """From the camera to where the picture begins: what stands nearer is cut away.

        Seen from above the objective, from the side a stage would hide the working area.
        """
        return self.distance_mm - self.sight.cut_mm

    @property
    def axes(self) -> Floats:
        """To the right, up, and towards the camera: unit vectors as rows, shape (3, 3)."""
        azimuth, elevation = np.radians((self.sight.azimuth_deg, self.sight.elevation_deg))
        level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        back = np.cos(elevation) * level + np.array([0.0, 0.0, np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return np.stack([right, np.cross(back, right), back])

    @property
    def place_mm(self) -> Floats:
        """Where the camera stands."""
        return np.asarray(self.sight.centre_mm + self.distance_mm * self.axes[2])

    def view(self) -> Floats:
        """Return `camera_from_world`, shape (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes
        matrix[:3, 3] = -self.axes @ self.place_mm
        return matrix

    def projection(self, width: float, height: float) -> Floats:
        """Return the projection of OpenGL for a picture of this size, shape (4, 4)."""
        near, far = self.near_mm, self.distance_mm * 40.0
        scale = self._scale(width, height)
        matrix = np.zeros((4, 4))
        matrix[0, 0] = scale * min(1.0, height / width)
        matrix[1, 1] = scale * min(1.0, width / height)
        matrix[2, 2:] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
        matrix[3, 2] = -1.0
        return matrix

    @staticmethod
    def _scale(width: float, height: float) -> float:
        """Return the scale at which the field of view fills the shorter side."""
        if not (width > 0 and height > 0):
            raise ValueError(f"an image of {width} x {height} has no projection")
        return 1.0 / float(np.tan(np.radians(_FIELD_DEG / 2.0)))

    def px_mm(self, width: float, height: float) -> float:
        """Return how many pixels one mm has at the centre."""
        return self._scale(width, height) * min(width, height) / (2.0 * self.distance_mm)

    def project(self, points_mm: Floats, width: float, height: float) -> tuple[Floats, Floats]:
        """Return where points are seen, shape (n, 2), px, and how far before the camera, mm."""
        seen = (points_mm - self.place_mm) @ self.axes.T
        depth = -seen[:, 2]
        safe = np.where(depth > 1e-9, depth, np.nan)
        scale = self._scale(width, height) * min(width, height) / 2.0
        with np.errstate(invalid="ignore"):
            right = width / 2.0 + scale * seen[:, 0] / safe
            down = height / 2.0 - scale * seen[:, 1] / safe
        return np.stack([right, down], axis=1), depth

    def ray(self, right: float, down: float, width: float, height: float) -> tuple[Floats, Floats]:
        """Return where the line of sight through a pixel leaves the cut, mm, and its direction."""
        scale = self._scale(width, height) * min(width, height) / 2.0
        seen = np.array([(right - width / 2.0) / scale, (height / 2.0 - down) / scale, -1.0])
        seen_along = seen @ self.axes
        seen_along /= np.linalg.norm(seen_along)
        return self.place_mm + seen_along * self.near_mm / float(
            -seen_along @ self.axes[2]
        ), seen_along

    def orbit(self, azimuth_deg: float, elevation_deg: float) -> Self:
        """Return the camera turned about its centre."""
        elevation = float(np.clip(self.sight.elevation_deg + elevation_deg, -90.0, 90.0))
        azimuth = (self.sight.azimuth_deg + azimuth_deg) % 360.0
        return self._at(replace(self.sight, azimuth_deg=azimuth, elevation_deg=elevation))

    def pan(self, right_mm: float, up_mm: float) -> Self:
        """Return the camera moved sideways, its centre with it."""
        moved = np.asarray(self.sight.centre_mm) + right_mm * self.axes[0] + up_mm * self.axes[1]
        x, y, z = (float(value) for value in moved)
        return self._at(replace(self.sight, centre_mm=(x, y, z)))

    def zoom(self, factor: float) -> Self:
        """Return the camera with everything `factor` times as large."""
        radius = float(np.clip(self.sight.radius_mm / factor, _NEAREST_MM, _FARTHEST_MM))
        return self._at(replace(self.sight, radius_mm=radius))

    def _at(self, sight: Sight) -> Self:
        return replace(self, sight=sight)
