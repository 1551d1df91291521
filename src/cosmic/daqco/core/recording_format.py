"""How a recording lies in its HDF5 file; described in docs/reference/recording-file.md."""

import os
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import h5py
import numpy as np
import numpy.typing as npt

from cosmic.daqco.core.scale import LARGEST_DEGREE, Scale
from cosmic.daqco.core.settings import ChannelSettings

SUFFIX: Final = ".h5"
FORMAT: Final = "CoSMic recording"
VERSION: Final = 1
CONFIDENCES: Final = {"unknown": 0, "estimated": 1, "known": 2}


@dataclass(frozen=True, slots=True)
class RecordingHeader:
    """What is known before the first sample, and stays.

    Attributes
    ----------
    scales : tuple of Scale
        In force at the start, one a channel; later ones come with the chunks.
    start_utc : datetime
        With a time zone; the same moment as `start_s`.
    start_s : float
        Platform time.
    configuration : str
        Text of platform.toml.
    axes : tuple of tuple
        Name and unit of each axis whose positions get a dataset of their own.
    """

    rate_hz: float
    channels: tuple[ChannelSettings, ...]
    scales: tuple[Scale, ...]
    start_utc: datetime
    start_s: float
    software: str = ""
    configuration: str = ""
    axes: tuple[tuple[str, str], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The channels, in the order of the rows."""
        return tuple(each.name for each in self.channels)

    @property
    def bytes_per_s(self) -> float:
        """How fast the file grows, about."""
        return (2 * len(self.channels) + 1) * self.rate_hz * 8.0


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """Something that happened while recording: a limit crossed, a mark, an error.

    Attributes
    ----------
    time_s : float
        Platform time.
    sample : int
        Number of the sample since acquisition began.
    kind : str
        A word, such as "limit" or "mark".
    channel : str
        Which one it concerns; empty where it concerns none.
    value : float
        In the unit of the channel; NaN where there is none.
    """

    time_s: float
    sample: int
    kind: str
    text: str = ""
    channel: str = ""
    value: float = float("nan")


@dataclass(frozen=True, slots=True)
class RecordedExposure:
    """An exposure of a camera that the sample clock triggered.

    Attributes
    ----------
    sample : int
        Number of the sample at which it began, since acquisition began.
    time_s : float
        Platform time of that sample.
    number : int
        Of the pulse, from 0 since acquisition began; a camera that was busy let it pass.
    camera : str
        Which one is triggered.
    """

    sample: int
    time_s: float
    number: int
    camera: str


@dataclass(frozen=True, slots=True)
class Overrun:
    """Samples that are missing in front of sample number `sample`.

    Attributes
    ----------
    sample : int
        Counted since acquisition began, anew where it began again.
    time_s : float
        Platform time of the first that is missing.
    column : int
        Where `sample` stands in the recording, counted from 0.
    """

    sample: int
    lost: int
    time_s: float
    column: int


@dataclass(frozen=True, slots=True)
class AxisPosition:
    """Where an axis was, one row of the file.

    Attributes
    ----------
    time_s : float
        Platform time.
    position : float
        In `unit`, "um" or "deg"; NaN where it is not known.
    confidence : str
        "known", "estimated" or "unknown".
    """

    time_s: float
    axis: str
    position: float
    unit: str = "um"
    confidence: str = "known"


def reason(exc: BaseException) -> str:
    """Return why a file could not be written or read; HDF5 tells it in a page of its own."""
    number = exc.errno if isinstance(exc, OSError) else None
    return os.strerror(number) if number else str(exc).partition("\n")[0]


def text_type(text_bytes: int) -> "np.dtype[np.bytes_]":
    """Return the HDF5 type of a text of fixed length; SWMR knows no others."""
    kind: np.dtype[np.bytes_] = h5py.string_dtype("utf-8", max(1, text_bytes))
    return kind


def encoded(text: str, text_bytes: int) -> bytes:
    """Return UTF-8 that fits, cut between two letters where it must be; "?" for half a letter."""
    data = text.encode("utf-8", "replace")
    if len(data) <= text_bytes:
        return data
    return data[: text_bytes - 3].decode("utf-8", "ignore").encode("utf-8") + "…".encode()


def decoded(data: bytes) -> str:
    """Return the text that `encoded` made."""
    return data.decode("utf-8", "replace")


NAME_BYTES: Final = 128
TEXT_BYTES: Final = 512

CHUNK: Final = np.dtype(
    [
        ("first_sample", "<i8"),
        ("column", "<i8"),
        ("samples", "<i8"),
        ("time_s", "<f8"),
        ("scale_version", "<i4"),
    ]
)
SCALE: Final = np.dtype(
    [
        ("version", "<i4"),
        ("channel", "<i4"),
        ("column", "<i8"),
        ("time_s", "<f8"),
        ("name", text_type(NAME_BYTES)),
        ("unit", text_type(NAME_BYTES)),
        ("terms", "<i4"),
        ("coefficients", "<f8", (LARGEST_DEGREE + 1,)),
    ]
)
EVENT: Final = np.dtype(
    [
        ("time_s", "<f8"),
        ("sample", "<i8"),
        ("kind", text_type(NAME_BYTES)),
        ("channel", text_type(NAME_BYTES)),
        ("value", "<f8"),
        ("text", text_type(TEXT_BYTES)),
    ]
)
OVERRUN: Final = np.dtype(
    [("sample", "<i8"), ("lost", "<i8"), ("time_s", "<f8"), ("column", "<i8")]
)
EXPOSURE: Final = np.dtype(
    [
        ("sample", "<i8"),
        ("time_s", "<f8"),
        ("number", "<i8"),
        ("camera", text_type(NAME_BYTES)),
    ]
)
POSITION: Final = np.dtype(
    [
        ("time_s", "<f8"),
        ("axis", "<i4"),
        ("position", "<f8"),
        ("confidence", h5py.enum_dtype(CONFIDENCES, basetype="i1")),
    ]
)
AXIS: Final = np.dtype([("name", text_type(NAME_BYTES)), ("unit", text_type(NAME_BYTES))])
CHANNEL: Final = np.dtype(
    [
        ("name", text_type(NAME_BYTES)),
        ("unit", text_type(NAME_BYTES)),
        ("low_v", "<f8"),
        ("high_v", "<f8"),
        ("colour", text_type(16)),
        ("board", text_type(NAME_BYTES)),
        ("input", text_type(NAME_BYTES)),
        ("mode", text_type(16)),
    ]
)

GROWING: Final[dict[str, "np.dtype[np.void]"]] = {
    "overruns": OVERRUN,
    "axes": AXIS,
    "positions": POSITION,
    "events": EVENT,
    "exposures": EXPOSURE,
    "scales": SCALE,
    "chunks": CHUNK,
}
"""Tables that grow while recording, in the order in which they are written: a row of ``chunks``
says that everything it speaks of is there."""


def scale_row(scale: Scale, *, version: int, channel: int, column: int, time_s: float) -> object:
    """Return a row of ``scales``."""
    coefficients = np.zeros(LARGEST_DEGREE + 1)
    coefficients[: len(scale.coefficients)] = scale.coefficients
    name, unit = encoded(scale.name, NAME_BYTES), encoded(scale.unit, NAME_BYTES)
    return (version, channel, column, time_s, name, unit, len(scale.coefficients), coefficients)


def scale_of(row: npt.NDArray[np.void]) -> Scale:
    """Return the scale that `scale_row` wrote."""
    coefficients = tuple(float(each) for each in row["coefficients"][: int(row["terms"])])
    name, unit = bytes(row["name"]), bytes(row["unit"])
    return Scale(decoded(name), decoded(unit), coefficients)


def channel_row(channel: ChannelSettings, scale: Scale) -> object:
    """Return a row of ``channels``."""
    return (
        encoded(channel.name, NAME_BYTES),
        encoded(scale.unit, NAME_BYTES),
        channel.low_v,
        channel.high_v,
        encoded(channel.colour, 16),
        encoded(channel.board, NAME_BYTES),
        encoded(channel.input, NAME_BYTES),
        encoded(channel.mode, 16),
    )
