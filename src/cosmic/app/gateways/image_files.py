"""Images of a camera as files, for programs that fetch one."""

import struct
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Final

import numpy as np

from cosmic.app.gateways.session import GatewaySession
from cosmic.frame.errors import NotAvailable
from cosmic.vico.api.sent_image import SentImage
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.core.recording.tiff_png import encoded_png, encoded_tiff

LIVE_WIDTH_PX: Final = 800
LIVE_QUALITY: Final = 70
_HEAD: Final = struct.Struct("<d")


def newest_image(session: GatewaySession, camera: str) -> SentImage:
    """Return the newest whole image of a camera.

    Raises
    ------
    CallRefused
        There is no such camera.
    NotAvailable
        It has taken no image yet.
    """
    order = session.order("vico", "camera_handles.sent_latest", {}, (camera,))
    found = session.carry_out(order)
    if not isinstance(found, SentImage):
        raise NotAvailable(f"{camera}: no image was taken yet; start the camera")
    return found


def encoded_image(image: SentImage, ending: str, axes: Mapping[str, str]) -> bytes:
    """Return an image as a file: "png" and "tif" with scale and circumstances, or "jpg".

    Parameters
    ----------
    axes : mapping of str to str
        Unit of each axis, "um" or "deg", by its name.
    """
    if ending == "jpg":
        return jpeg(image.data, image.data.shape[1])
    received = image.received()
    row = row_of(received, datetime.now(UTC))
    encoded = encoded_tiff if ending == "tif" else encoded_png
    return encoded(image.data, row, dict(axes))


def shown_jpeg(payload: object) -> bytes | None:
    """Return an image of the stream "shown" for a live view: its time as a double, then JPEG."""
    if not isinstance(payload, SentImage):
        return None
    return _HEAD.pack(payload.exposed_s) + jpeg(payload.data, LIVE_WIDTH_PX)


def jpeg(data: "np.ndarray[Any, Any]", width_px: int) -> bytes:
    """Return an image as JPEG, at most so wide; deep images are shown by their brightest."""
    import cv2

    if data.dtype != np.uint8:
        brightest = max(1, int(data.max(initial=1)))
        data = (data.astype(np.float32) * (255.0 / brightest)).astype(np.uint8)
    if data.shape[1] > width_px:
        height_px = max(1, round(data.shape[0] * width_px / data.shape[1]))
        data = cv2.resize(data, (width_px, height_px), interpolation=cv2.INTER_AREA)
    pixels = data[:, :, ::-1] if data.ndim == 3 else data
    _, coded = cv2.imencode(
        ".jpg", np.ascontiguousarray(pixels), [cv2.IMWRITE_JPEG_QUALITY, LIVE_QUALITY]
    )
    found: bytes = coded.tobytes()
    return found
