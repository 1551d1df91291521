"""Chunks and headers for the tests of recordings."""

from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.recording_format import RecordingHeader
from cosmic.daqco.core.scale import VOLTS, Scale
from cosmic.daqco.core.settings import ChannelSettings

FORCE = Scale("FT-S1000", "uN", (-12.5, 500.0))
START_UTC = datetime(2026, 5, 4, 12, 30, 15, 250_000, tzinfo=UTC)


def header(
    names: tuple[str, ...] = ("force", "noise"),
    rate_hz: float = 1000.0,
    scales: tuple[Scale, ...] | None = None,
    start_s: float = 100.0,
) -> RecordingHeader:
    """Return a header; "force" has a scale in micronewtons, everything else is in volts."""
    channels = tuple(
        ChannelSettings(name=name, board="Dev1", input=f"ai{row}", low_v=-5.0, high_v=5.0)
        for row, name in enumerate(names)
    )
    return RecordingHeader(
        rate_hz=rate_hz,
        channels=channels,
        scales=scales or tuple(FORCE if name == "force" else VOLTS for name in names),
        start_utc=START_UTC,
        start_s=start_s,
        software="CoSMic 1.2.3",
        configuration="[daqco]\n# µN\n",
    )


def volts_of(rows: int, samples: int, seed: int = 0) -> np.ndarray:
    """Return voltages that a 16-bit board would give."""
    counts = np.random.default_rng(seed).integers(-32768, 32767, (rows, samples))
    return counts * (10.0 / 32768.0)


def chunks(
    head: RecordingHeader,
    volts: np.ndarray,
    size: int = 10,
    *,
    first_sample: int = 0,
    scales: tuple[Scale, ...] | None = None,
) -> Iterator[DataChunk]:
    """Yield `volts` in chunks of `size` samples, on the clock of the header."""
    for at in range(0, volts.shape[1], size):
        part = volts[:, at : at + size].copy()
        number = first_sample + at
        yield DataChunk(
            first_sample=number,
            time_s=head.start_s + number / head.rate_hz,
            rate_hz=head.rate_hz,
            channels=head.names,
            volts=part,
            scales=scales or head.scales,
        )
