"""Images, and what machine vision found on them, as they travel between stations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosmic.frame.errors import NotAvailable
from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.api.coordinate_transform import CoordinateTransform, Pixel
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.tool_tips import HeldSeen, TipSeen
from cosmic.vico.hw.interface import Frame, FrameStatus, PixelFormat

NOT_HOSTED = "micromanipulation is not hosted there"


@dataclass(frozen=True, slots=True)
class PlateMap:
    """Where the pixels of one image lie on the plate: an affine map.

    Attributes
    ----------
    corner_um : (float, float)
        Of pixel (0, 0).
    right_um, down_um : (float, float)
        By one pixel to the right, and down.
    """

    corner_um: Pixel
    right_um: Pixel
    down_um: Pixel

    @classmethod
    def of(cls, image: CameraImage, transform: CoordinateTransform) -> "PlateMap":
        """Return the map of an image; raises `NotAvailable` where it was not calibrated."""
        height, width = image.data.shape[:2]
        corner = transform.platform_um(image, (0.0, 0.0))
        right = transform.platform_um(image, (float(width), 0.0))
        down = transform.platform_um(image, (0.0, float(height)))
        return cls(corner, _step(corner, right, width), _step(corner, down, height))

    def to_um(self, point_px: Pixel) -> Pixel:
        """Return x and y on the platform."""
        (x, y), (x0, y0) = point_px, self.corner_um
        (xr, yr), (xd, yd) = self.right_um, self.down_um
        return x0 + x * xr + y * xd, y0 + x * yr + y * yd


def _step(start: Pixel, end: Pixel, count: int) -> Pixel:
    return (end[0] - start[0]) / count, (end[1] - start[1]) / count


@dataclass(frozen=True, slots=True, eq=False)
class ReceivedImage(CameraImage):
    """An image that came from another station.

    Attributes
    ----------
    plate : PlateMap or None
        Where its pixels lie on the platform; None where nobody knows, and `plate_problem` says why.
    """

    plate: PlateMap | None = None
    plate_problem: str = NOT_HOSTED


@dataclass(frozen=True, slots=True, eq=False)
class SentImage:
    """An image on its way; see `CameraImage`, `Frame` and `Circumstances`."""

    camera: str
    data: NDArray[Any]
    frame_id: int
    time_s: float
    exposed_s: float
    device_ns: int | None
    status: FrameStatus
    pixel_format: PixelFormat
    lost_before: int
    exposure_s: float | None
    gain_db: float | None
    zoom_counts: float | None
    focus_counts: float | None
    light_percent: float | None
    scale_um_px: float | None
    positions: dict[str, float]
    sample: int | None
    sample_s: float | None
    plate: PlateMap | None
    plate_problem: str

    @property
    def nbytes(self) -> int:
        """Size by which backlogs are limited."""
        return int(self.data.nbytes)

    @classmethod
    def of(cls, image: CameraImage, transform: CoordinateTransform | None) -> "SentImage":
        """Return what is sent of an image; a simulated camera draws it here."""
        plate, problem = _plate(image, transform)
        frame, known = image.frame, image.circumstances
        return cls(
            image.camera,
            frame.data,
            int(frame.frame_id),
            frame.time_s,
            frame.exposed_s,
            frame.device_ns,
            frame.status,
            frame.pixel_format,
            int(image.lost_before),
            known.exposure_s,
            known.gain_db,
            known.zoom_counts,
            known.focus_counts,
            known.light_percent,
            known.scale_um_px,
            dict(known.positions),
            known.sample,
            known.sample_s,
            plate,
            problem,
        )

    def received(self) -> ReceivedImage:
        """Return the image as handles give it."""
        frame = Frame(
            self.data,
            self.frame_id,
            self.time_s,
            self.exposed_s,
            self.device_ns,
            self.status,
            self.pixel_format,
        )
        known = Circumstances(
            self.exposure_s,
            self.gain_db,
            self.zoom_counts,
            self.focus_counts,
            self.light_percent,
            self.scale_um_px,
            self.positions,
            self.sample,
            self.sample_s,
        )
        return ReceivedImage(
            self.camera, frame, known, self.lost_before, self.plate, self.plate_problem
        )


def _plate(
    image: CameraImage, transform: CoordinateTransform | None
) -> tuple[PlateMap | None, str]:
    if transform is None:
        return None, NOT_HOSTED
    problem = transform.problem(image)
    if problem:
        return None, problem
    try:
        return PlateMap.of(image, transform), ""
    except NotAvailable as exc:
        return None, str(exc)


@dataclass(frozen=True, slots=True, eq=False)
class SentSeen:
    """What machine vision found, with the image's circumstances but not its pixels."""

    image: SentImage
    shape: tuple[int, ...]
    fibres: tuple[Fibre, ...]
    tips: tuple[TipSeen, ...]
    held: tuple[HeldSeen, ...] = ()

    @classmethod
    def of(cls, seen: Seen) -> "SentSeen":
        """Return what is sent."""
        data = seen.image.data
        bare = replace(seen.image.frame, data=np.zeros((0,), np.uint8))
        return cls(
            SentImage.of(replace(seen.image, frame=bare), None),
            tuple(data.shape),
            tuple(_plain(each) for each in seen.fibres),
            tuple(_plain_tip(each) for each in seen.tips),
            seen.held,
        )

    def received(self) -> Seen:
        """Return what a view shows; its image is empty."""
        bare = self.image.received()
        nothing = np.broadcast_to(np.zeros((), np.uint8), self.shape)
        empty = replace(bare, frame=replace(bare.frame, data=nothing))
        return Seen(empty, self.fibres, self.tips, self.held)


def _plain(fibre: Fibre) -> Fibre:
    return replace(fibre, uncertainties=dict(fibre.uncertainties))


def _plain_tip(tip: TipSeen) -> TipSeen:
    x, y = tip.point_px
    return TipSeen(tip.name, (float(x), float(y)), tip.certain)


def received(sent: object) -> ReceivedImage | None:
    """Return an image that came, where it is one."""
    return sent.received() if isinstance(sent, SentImage) else None


def same_point(one_um: Sequence[float], other_um: Sequence[float], within_um: float) -> bool:
    """Return whether two points are the same but for `within_um`."""
    return all(abs(a - b) <= within_um for a, b in zip(one_um, other_um, strict=True))
