"""`DataChunk`: samples of all channels, acquired once and handed on by reference (Fig. 6.13)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cosmic.daqco.core.scale import Scale

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DataChunk:
    """Samples of all channels, frozen; the same object for every receiver, any thread.

    Attributes
    ----------
    first_sample : int
        Number of the first sample since acquisition began, 64 bit; no gaps between chunks.
    time_s : float
        Platform time of the first sample.
    rate_hz : float
        Samples per second and channel.
    channels : tuple of str
        Names, in the order of the rows.
    volts : ndarray, shape (channels, n), float64, V
        Read-only.
    scales : tuple of Scale
        In force when it was acquired, one a channel.

    Raises
    ------
    ValueError
        They do not fit together.
    """

    first_sample: int
    time_s: float
    rate_hz: float
    channels: tuple[str, ...]
    volts: Values
    scales: tuple[Scale, ...]

    def __post_init__(self) -> None:
        rows = len(self.channels)
        fits = self.volts.ndim == 2 and len(self.volts) == rows == len(self.scales)
        if not (fits and self.volts.dtype == float and self.samples > 0 and self.rate_hz > 0.0):
            raise ValueError("samples, channels and scales do not fit together")
        self.volts.flags.writeable = False

    @property
    def samples(self) -> int:
        """How many samples a channel."""
        return int(self.volts.shape[1])

    @property
    def end_time_s(self) -> float:
        """Platform time of the sample after the last."""
        return self.time_s + self.samples / self.rate_hz

    @property
    def nbytes(self) -> int:
        """Size by which a backlog is limited."""
        return self.volts.nbytes

    def newest(self) -> dict[str, float]:
        """Return the newest value of every channel in its physical unit."""
        values = (
            float(scale.apply(volts))
            for scale, volts in zip(self.scales, self.volts[:, -1], strict=True)
        )
        return dict(zip(self.channels, values, strict=True))

    @cached_property
    def values(self) -> Values:
        """Physical values, shape (channels, n), float64, in the unit of each scale; read-only."""
        values = np.empty_like(self.volts)
        for row, scale in enumerate(self.scales):
            values[row] = scale.apply(self.volts[row])
        values.flags.writeable = False
        return values


def missing_samples(before: DataChunk, after: DataChunk) -> int:
    """Return how many samples a channel are missing between two chunks that came in this order.

    Numbers that begin anew belong to another acquisition, and nothing is missing.
    """
    return max(0, after.first_sample - before.first_sample - before.samples)
