"""Correct an image for uneven light and for dust that is always there."""

from dataclasses import dataclass
from threading import Lock
from typing import Final, cast

import cv2
import numpy as np
import numpy.typing as npt
from typing_extensions import override

from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.interface import Frame, FrameStatus, PixelFormat, Pixels

MOST_FRAMES: Final = 1000
# A point darker than this part of the mean is an edge of the field, not uneven light.
DARKEST_PART: Final = 0.1


@dataclass(frozen=True, slots=True)
class _Kind:
    """What an image must have in common with the background it is corrected by."""

    shape: tuple[int, ...]
    pixel_format: PixelFormat
    binning: int

    @override
    def __str__(self) -> str:
        return f"{self.shape[1]} x {self.shape[0]} px, {self.pixel_format}, binning {self.binning}"


@dataclass(frozen=True, slots=True, eq=False)
class _Field:
    kind: _Kind
    gain: npt.NDArray[np.float32]
    frames: int


class Background:
    """The flat field of one camera: collected from frames of an empty ground, then divided by.

    One thread gives the frames (`correct`); any may call the rest. Nothing set, nothing is
    changed: an image passes as it is, also while frames are being collected.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._field: _Field | None = None
        self._wanted = 0
        self._taken = 0
        self._kind: _Kind | None = None
        self._sum: npt.NDArray[np.float64] | None = None

    @property
    def frames(self) -> int:
        """How many frames the background in force rests on; 0: none is in force."""
        field = self._field
        return 0 if field is None else field.frames

    @property
    def missing(self) -> int:
        """How many frames are still to come until the new background is in force."""
        return max(0, self._wanted - self._taken)

    def collect(self, frames: int) -> None:
        """Make a background of the next `frames` frames that come, whenever that is.

        Raises
        ------
        ConfigError
            Not from 1 to 1000.
        """
        if not 1 <= frames <= MOST_FRAMES:
            raise ConfigError(f"background: {frames} frames; give 1 to {MOST_FRAMES}")
        with self._lock:
            self._taken, self._sum, self._kind = 0, None, None
            self._wanted = frames

    def reset(self) -> None:
        """Have images pass as they are, and collect none."""
        with self._lock:
            self._wanted, self._field = 0, None

    def add(self, frame: Frame, binning: int = 1) -> None:
        """Take a frame for the background if one is being collected; incomplete ones are not.

        Frames of another kind than the first begin the collection anew: the image was changed.

        Raises
        ------
        ConfigError
            The last frame came, and they are black; the background in force stays.
        """
        if frame.status is FrameStatus.COMPLETE:
            with self._lock:
                self._add(frame, _kind(frame, binning))

    def _add(self, frame: Frame, kind: _Kind) -> None:
        if self._wanted <= 0:
            return
        if self._sum is None or kind != self._kind:
            self._kind, self._taken = kind, 0
            self._sum = np.zeros(frame.data.shape, np.float64)
        self._sum += frame.data
        self._taken += 1
        if self._taken >= self._wanted:
            mean, self._sum, self._wanted = self._sum / self._taken, None, 0
            self._field = _Field(kind, _gain(mean), self._taken)

    def misfit(self, frame: Frame, binning: int = 1) -> str:
        """Return why a frame cannot be corrected by the background in force; empty: it can."""
        field = self._field
        kind = _kind(frame, binning)
        if field is None or field.kind == kind:
            return ""
        return (
            f"background: it was taken at {field.kind}, and the image is {kind}; "
            "take it again or reset it"
        )

    def correct(self, frame: Frame, binning: int = 1) -> Pixels:
        """Return the pixels without the uneven light, in the same format; read-only.

        Raises
        ------
        ConfigError
            The background was taken with another size, format or binning.
        """
        field = self._field
        if field is None:
            return frame.data
        reason = self.misfit(frame, binning)
        if reason:
            raise ConfigError(reason)
        depth = cv2.CV_8U if frame.data.dtype == np.uint8 else cv2.CV_16U
        corrected = cast("Pixels", cv2.multiply(frame.data, field.gain, dtype=depth))
        full_scale = frame.pixel_format.full_scale
        if full_scale not in (255, 65535):
            np.minimum(corrected, full_scale, out=corrected)
        corrected.flags.writeable = False
        return corrected


def _kind(frame: Frame, binning: int) -> _Kind:
    return _Kind(frame.data.shape, frame.pixel_format, binning)


def _gain(mean: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    """Return what makes every point of `mean` as bright as its average, each layer for itself."""
    level = mean.mean(axis=(0, 1))
    if not np.all(level >= 1.0):
        raise ConfigError(
            "background: the frames are black; light the ground, and take the background again"
        )
    return np.asarray(level / np.maximum(mean, DARKEST_PART * level), dtype=np.float32)
