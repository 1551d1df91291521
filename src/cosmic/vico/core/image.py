"""A frame together with the circumstances it was taken under."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from cosmic.vico.hw.interface import Frame, Pixels


@dataclass(frozen=True, slots=True)
class Circumstances:
    """What was set when a frame was taken; None where nobody knows.

    Attributes
    ----------
    zoom_counts, focus_counts : float or None
        Motors of the lens.
    light_percent : float or None
    scale_um_px : float or None
        Of the zoom position, for one pixel of this frame (binning counted).
    positions : mapping of str to float
        Stage positions by axis, um or degrees.
    sample : int or None
        Number of the sample at which its exposure began, where the sample clock triggered it.
    sample_s : float or None
        Platform time of that sample.
    """

    exposure_s: float | None = None
    gain_db: float | None = None
    zoom_counts: float | None = None
    focus_counts: float | None = None
    light_percent: float | None = None
    scale_um_px: float | None = None
    positions: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    sample: int | None = None
    sample_s: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """One frame of one camera, as it goes to the display, the recorder and machine vision.

    Attributes
    ----------
    lost_before : int
        Frames that the camera lost since the image before this one.
    """

    camera: str
    frame: Frame
    circumstances: Circumstances
    lost_before: int = 0

    @property
    def data(self) -> Pixels:
        """The pixels; see `Frame.data`."""
        return self.frame.data

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height, without waiting for the pixels."""
        return self.frame.size_px
