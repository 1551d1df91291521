"""`ImageRecord`: the newest image of a camera, as areaDetector's NDStdArrays shows arrays."""

from typing import Any, Final

import numpy as np

from cosmic.app.gateways import epics_channels as ca
from cosmic.app.gateways.epics_channels import Channel
from cosmic.frame.plan_shape import unix_now_s
from cosmic.vico.api.sent_image import SentImage
from cosmic.vico.hw.interface import PixelFormat

LARGEST_IMAGE: Final = 4_000_000
"""In values; what is larger has an alarm and no data."""
EPICS_EPOCH_S: Final = 631_152_000
"""The 1st of January 1990, in seconds since 1970."""
_DATA_TYPES: Final = (
    *("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32"),
    *("Int64", "UInt64", "Float32", "Float64"),
)
_COLOUR_MODES: Final = ("Mono", "Bayer", "RGB1", "RGB2", "RGB3", "YUV444", "YUV422", "YUV421")
_DIMENSIONS: Final = 3


class ImageRecord:
    """Channels of one camera; in the loop of the server.

    Parameters
    ----------
    base : str
        What their names begin with, such as "COSMIC:microscope:image:".
    pixel_format : PixelFormat
        Decides the type of `ArrayData`: bytes, or whole numbers for more than 8 bits.
    """

    def __init__(self, base: str, camera: str, pixel_format: PixelFormat) -> None:
        self._bytes = pixel_format in (PixelFormat.MONO8, PixelFormat.RGB8)
        self._array = (ca.pixels if self._bytes else ca.wholes)(LARGEST_IMAGE)
        self._sizes = tuple(ca.whole() for _ in range(_DIMENSIONS))
        self._count, self._all = ca.whole(2), ca.wholes(_DIMENSIONS)
        self._number, self._counter, self._size = ca.whole(), ca.whole(), ca.whole()
        self._colours, self._kind = ca.choice(_COLOUR_MODES), ca.choice(_DATA_TYPES, 1)
        self._time = ca.number()
        self._shown = 0
        fields: dict[str, Channel] = {
            "ArrayData": self._array,
            "NDimensions_RBV": self._count,
            "Dimensions_RBV": self._all,
            "ArraySize_RBV": self._size,
            "ArrayCounter_RBV": self._counter,
            "UniqueId_RBV": self._number,
            "TimeStamp_RBV": self._time,
            "ColorMode_RBV": self._colours,
            "DataType_RBV": self._kind,
            "BayerPattern_RBV": ca.choice(("RGGB", "GBRG", "GRBG", "BGGR")),
            "EnableCallbacks": ca.choice(("Disable", "Enable"), 1),
            "EnableCallbacks_RBV": ca.choice(("Disable", "Enable"), 1),
            "PluginType_RBV": ca.line("NDPluginStdArrays"),
            "PortName_RBV": ca.line(f"{camera}.image"),
            "NDArrayPort": ca.line(camera),
            "NDArrayPort_RBV": ca.line(camera),
        }
        fields |= {f"ArraySize{at}_RBV": each for at, each in enumerate(self._sizes)}
        self.channels = {base + name: each for name, each in fields.items()}

    async def show(self, image: SentImage) -> None:
        """Show an image: its sizes first, its number last."""
        data = image.data
        fits = data.size <= LARGEST_IMAGE and (data.dtype == np.uint8 or not self._bytes)
        alarm = ca.NO_ALARM if fits else ca.UNKNOWN
        # Of colours as they come, the colour varies fastest: areaDetector calls that RGB1.
        sizes = [int(each) for each in reversed(data.shape)]
        for channel, size in zip(self._sizes, (*sizes, 0), strict=False):
            await ca.show(channel, size)
        await ca.show(self._count, len(sizes))
        await self._all.write(sizes)
        await ca.show(self._colours, "RGB1" if len(sizes) == _DIMENSIONS else "Mono")
        await ca.show(self._kind, "UInt8" if data.dtype == np.uint8 else "UInt16")
        await ca.show(self._size, int(data.nbytes))
        if fits:
            coded: Any = data.tobytes() if self._bytes else data.ravel().astype(np.int32)
            await ca.show(self._array, coded)
        self._shown += 1
        await ca.show(self._time, unix_now_s() - EPICS_EPOCH_S)
        await ca.show(self._counter, self._shown & 0x7FFFFFFF)
        await ca.show(self._number, image.frame_id & 0x7FFFFFFF, alarm)
