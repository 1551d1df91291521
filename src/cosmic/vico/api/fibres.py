"""Fibres in um and on the platform, from what was found in pixels."""

from dataclasses import dataclass, fields

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import NotAvailable
from cosmic.frame.renamed import Renamed
from cosmic.vico.api.coordinate_transform import CoordinateTransform
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.vision.algorithms import grey
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.finding import find_fibres
from cosmic.vico.core.vision.tool_bodies import without_tools


@dataclass(frozen=True, slots=True, eq=False)
class PlacedFibre(Fibre):
    """A fibre found on one image, with its size and point where those can be told.

    Attributes
    ----------
    image : CameraImage
        Where it was found; the values in px are those of its pixels.
    scale_um_px : float or None
        Of the zoom the image was taken with; None where nobody knows: then every um is None.
    centre_line_um, ends_um, grasp_points_um : ndarray, shape (n, 2), or None
        x, y on the platform; None where the camera was not calibrated. `doubts` says why.
    """

    image: CameraImage
    scale_um_px: float | None
    centre_line_um: Floats | None
    ends_um: Floats | None
    grasp_points_um: Floats | None
    picture = Renamed("image")

    @property
    def length_um(self) -> float | None:
        """Along the centre line."""
        return self._um(self.length_px)

    @property
    def length_std_um(self) -> float | None:
        """Standard deviation of the length, without that of the scale."""
        return self._um(self.length_std_px)

    @property
    def projected_length_um(self) -> float | None:
        """The largest distance between two of its points."""
        return self._um(self.projected_length_px)

    @property
    def width_um(self) -> float | None:
        """Mean width."""
        return self._um(self.width_px)

    def _um(self, value_px: float) -> float | None:
        return None if self.scale_um_px is None else value_px * self.scale_um_px


def locate_fibres(image: CameraImage, transform: CoordinateTransform | None) -> list[PlacedFibre]:
    """Find the fibres on an image and say how long they are and where.

    What is in doubt and lies on a tool whose place is known is left out.
    """
    reason = (
        "micromanipulation is not hosted here" if transform is None else transform.problem(image)
    )
    tools = {} if transform is None else transform.expected_bodies(image)
    found = without_tools(find_fibres(grey(image.data)), tools.values())
    return [_located(each, image, transform, reason) for each in found]


def _located(
    fibre: Fibre, image: CameraImage, transform: CoordinateTransform | None, reason: str
) -> PlacedFibre:
    scale = image.circumstances.scale_um_px
    doubts = list(fibre.doubts)
    if scale is None:
        doubts.append("no um: the scale of this image is not known")
    lines: list[Floats | None] = [None, None, None]
    if transform is None or reason:
        doubts.append(f"no point on the platform: {reason}")
    else:
        wanted = (fibre.centre_line_px, fibre.ends_px, fibre.grasp_points_px)
        try:
            lines = [_on_platform(each, image, transform) for each in wanted]
        except NotAvailable as exc:
            doubts.append(f"no point on the platform: {exc}")
    centre_line_um, ends_um, grasp_points_um = lines
    known = {each.name: getattr(fibre, each.name) for each in fields(Fibre)}
    return PlacedFibre(
        **known | {"doubts": tuple(doubts)},
        image=image,
        scale_um_px=scale,
        centre_line_um=centre_line_um,
        ends_um=ends_um,
        grasp_points_um=grasp_points_um,
    )


def _on_platform(points_px: Floats, image: CameraImage, transform: CoordinateTransform) -> Floats:
    found = [transform.platform_um(image, (float(x), float(y))) for x, y in points_px]
    return np.array(found, dtype=np.float64).reshape(-1, 2)
