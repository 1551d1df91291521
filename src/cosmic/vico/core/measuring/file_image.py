"""One page of a file, and how it is said that a file cannot be read."""

import lzma
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import RecordingError

# What tifffile, the libraries under it and OpenCV raise on files that lie about themselves.
UNREADABLE = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    AssertionError,
    RuntimeError,  # NotImplementedError and the errors of imagecodecs as well
    ImportError,
    MemoryError,
    EOFError,
    struct.error,
    zlib.error,
    lzma.LZMAError,
    cv2.error,
)
MOST_SAID = 200

Refused = Callable[[RecordingError], None]
"""Is given why a page cannot be read; the others are read all the same."""


@dataclass(frozen=True, slots=True, eq=False)
class FileImage:
    """One page of a file.

    Attributes
    ----------
    pixels : ndarray, shape (height, width) or (height, width, layers)
        Colours in the order blue, green, red.
    pixel_size_from : str
        Where it was found; where it is not known but something is said of it, why.
    step_um : float or None
        Distance in height to the next page, where the file says so.
    number : int
        Of the page or image in its file, from 1.
    besides_height : str
        What else differs from page to page, such as "2 channels"; empty where nothing does.
    """

    name: str
    pixels: npt.NDArray[np.generic]
    pixel_size_um: float | None
    pixel_size_from: str
    step_um: float | None = None
    number: int = 1
    besides_height: str = ""


@contextmanager
def reading(what: str) -> Iterator[None]:
    """Raise `RecordingError` for whatever a library raises on a file that cannot be read."""
    try:
        yield
    except UNREADABLE as exc:
        if isinstance(exc, OSError) and exc.strerror:
            said = exc.strerror
        else:
            said = (str(exc).strip() or type(exc).__name__).splitlines()[0][:MOST_SAID]
        raise RecordingError(f"{what}: cannot be read ({said})") from exc


def refuse(problem: RecordingError, refused: Refused | None) -> None:
    """Hand a problem to whoever asked for the others; raises it where nobody did."""
    if refused is None:
        raise problem
    refused(problem)
