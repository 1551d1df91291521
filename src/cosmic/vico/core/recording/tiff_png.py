"""One image as TIFF or PNG, with its scale and circumstances, for other programs to read.

TIFF is OME-TIFF with the resolution in pixels a centimetre besides; PNG has pixels a metre
(pHYs) and the circumstances as texts.
"""

import io
import struct
import zlib
from collections.abc import Mapping
from typing import Final

import numpy as np

from cosmic.frame.errors import RecordingError
from cosmic.vico.core.recording.ome import described
from cosmic.vico.core.recording.side_row import SideRow, position_texts
from cosmic.vico.hw.interface import Pixels

UM_IN_CM: Final = 1e4
UM_IN_M: Final = 1e6
PNG_COMPRESSION: Final = 1
_IHDR_END: Final = 8 + 25  # the signature and the first chunk, which has a fixed length
SOFTWARE: Final = "CoSMic"


def details(row: SideRow, axes: Mapping[str, str]) -> dict[str, str]:
    """Return what is known about an image, as texts by the names of the side file's columns."""
    positions = row.circumstances.positions
    units = {axis: axes.get(axis, "") for axis in positions}
    found = row.texts() | position_texts(row, units)
    return {name: text for name, text in found.items() if text and name not in {"index", "dropped"}}


def encoded_tiff(data: Pixels, row: SideRow, axes: Mapping[str, str]) -> bytes:
    """Return an uncompressed OME-TIFF of one image.

    Parameters
    ----------
    axes : mapping of str to str
        Unit of each axis by its name.
    """
    import tifffile

    scale_um_px = row.circumstances.scale_um_px
    metadata = described([row], scale_um_px) | {
        "axes": "YXS" if data.ndim == 3 else "YX",
        "MapAnnotation": {"Namespace": "cosmic/image", **details(row, axes)},
    }
    resolution = (UM_IN_CM / scale_um_px, UM_IN_CM / scale_um_px) if scale_um_px else None
    file = io.BytesIO()
    tifffile.imwrite(
        file,
        data,
        ome=True,
        photometric="rgb" if data.ndim == 3 else "minisblack",
        resolution=resolution,
        resolutionunit="CENTIMETER" if resolution else None,
        software=SOFTWARE,
        metadata=metadata,
    )
    return file.getvalue()


def encoded_png(data: Pixels, row: SideRow, axes: Mapping[str, str]) -> bytes:
    """Return a PNG; arguments as `encoded_tiff`."""
    import cv2

    known, scale_um_px = details(row, axes), row.circumstances.scale_um_px
    pixels = data[:, :, ::-1] if data.ndim == 3 else data
    done, coded = cv2.imencode(
        ".png", np.ascontiguousarray(pixels), [cv2.IMWRITE_PNG_COMPRESSION, PNG_COMPRESSION]
    )
    if not done:
        raise RecordingError(f"an image of shape {data.shape} cannot be written as PNG")
    whole = coded.tobytes()
    extra = [_text_chunk(name, text) for name, text in {"Software": SOFTWARE, **known}.items()]
    if scale_um_px:
        per_m = round(UM_IN_M / scale_um_px)
        extra.insert(0, _chunk(b"pHYs", struct.pack(">IIB", per_m, per_m, 1)))
    return b"".join([whole[:_IHDR_END], *extra, whole[_IHDR_END:]])


def _text_chunk(name: str, text: str) -> bytes:
    # Keyword, no compression, no language, no translation, UTF-8.
    return _chunk(b"iTXt", name.encode("latin-1", "replace") + bytes(5) + text.encode("utf-8"))


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
