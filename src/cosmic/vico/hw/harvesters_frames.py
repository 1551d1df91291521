"""Pictures out of the buffers of a GenTL producer, and their numbers."""

import logging
from typing import Any, Final

import numpy as np

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.vico.hw.harvesters_features import CODES
from cosmic.vico.hw.interface import PixelFormat, Pixels

logger = logging.getLogger(__name__)

_MOST_LOST: Final = 10_000
_BLOCK_NUMBERS: Final = 0xFFFF
_FORMATS: Final = {code: each for each, codes in CODES.items() for code in codes}


class BlockNumbers:
    """Numbers the frames of one run from 0, by the numbers that the camera gives them.

    Attributes
    ----------
    last : int
        Of the newest frame; -1 before the first.
    """

    def __init__(self) -> None:
        self.last = -1
        self._raw: int | None = None

    def advance(self, raw: int) -> int:
        """Take the frame that the camera calls `raw`; return how many are missing before it."""
        step = 1 if self._raw is None else raw - self._raw
        if step < 1:  # GigE Vision 1 goes from 65535 to 1
            step %= _BLOCK_NUMBERS
        if not 1 <= step <= _MOST_LOST:
            logger.warning("GenTL: frame %d follows frame %s", raw, self._raw)
            step = 1
        self._raw = raw
        self.last += step
        return step - 1

    def skip(self) -> None:
        """Count a frame that came without a number that can be trusted."""
        self.last += 1
        if self._raw is not None:
            self._raw += 1


def pixels_of(buffer: Any, name: str) -> tuple[Pixels, PixelFormat]:
    """Copy the first picture of a GenTL buffer, which is the driver's again afterwards.

    Raises
    ------
    DeviceError
        It holds no picture in a format that CoSMic reads.
    """
    for component in buffer.payload.components:
        code = str(component.data_format)
        if code in _FORMATS and component.data is not None:
            data = _shaped(component, code)
            data.flags.writeable = False
            return data, _FORMATS[code]
    formats = ", ".join(str(each.data_format) for each in buffer.payload.components)
    raise DeviceError(
        f"{name}: receive: it sends {formats or 'nothing'}, which CoSMic does not read; choose "
        f"another pixel format",
        fault=DeviceFault.UNSUPPORTED,
    )


def _shaped(component: Any, code: str) -> Pixels:
    height, width = int(component.height), int(component.width)
    flat = np.asarray(component.data)
    if _FORMATS[code] is not PixelFormat.RGB8:
        return flat[: height * width].reshape(height, width).copy()
    layers = 4 if "a8" in code else 3
    picture = flat[: height * width * layers].reshape(height, width, layers)[:, :, :3]
    if code.startswith("BGR"):
        picture = picture[:, :, ::-1]
    return np.ascontiguousarray(picture) if layers == 4 or code[0] == "B" else picture.copy()
