"""What was measured, written for spreadsheets, programs, people and ImageJ."""

import csv
import io
import json
import struct
import zipfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import RecordingError
from cosmic.vico.core.measuring.measurement import Measurement, columns
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.focal_stack import HeightMap
from cosmic.vico.core.vision.grey import grey_image
from cosmic.vico.core.vision.spatial import SpatialFibre
from cosmic.vico.hw.interface import Pixels

CERTAIN_BGR, DOUBTFUL_BGR = (80, 200, 60), (40, 140, 255)
NETWORK_BGR, BUNDLE_BGR = (220, 180, 40), (200, 60, 200)
ROI_VERSION, POLYLINE, SUB_PIXEL = 228, 5, 128


def write_csv(path: Path, measured: Sequence[Measurement], *, spatial: bool = False) -> None:
    """Write a row for each fibre, and the names of the columns in any case.

    Parameters
    ----------
    spatial : bool
        Name the columns of focal stacks even where no fibre was found on any.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    rows = [row for each in measured for row in each.rows()]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(
        text, columns(spatial=spatial or any(each.spatial for each in measured))
    )
    writer.writeheader()
    writer.writerows(rows)
    _write(path, encoded(text.getvalue()))


def write_networks(path: Path, measured: Sequence[Measurement]) -> None:
    """Write a row for each network, if there is one; raises `RecordingError`."""
    rows = [row for each in measured if (row := each.network_row()) is not None]
    if not rows:
        return
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    _write(path, encoded(text.getvalue()))


def write_napari(path: Path, measured: Measurement) -> None:
    """Write the centre lines as a layer of shapes that napari opens; raises `RecordingError`.

    napari counts rows first, from the centre of a pixel as this program does.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["index", "shape-type", "vertex-index", "axis-0", "axis-1"])
    for number, fibre in enumerate(measured.fibres):
        for vertex, (x, y) in enumerate(fibre.centre_line_px.tolist()):
            writer.writerow([number, "path", vertex, round(y, 3), round(x, 3)])
    _write(path, text.getvalue().encode())


def write_json(path: Path, measured: Sequence[Measurement]) -> None:
    """Write everything, centre lines too; raises `RecordingError`."""
    images = [
        {
            "image": each.name,
            "file": each.file,
            "rows": each.shape[0],
            "columns": each.shape[1],
            "pixel_size_um": each.pixel_size_um,
            "pixel_size_from": each.pixel_size_from,
            "fibres": [
                row | {"centre_line_px": np.round(fibre.centre_line_px, 3).tolist()} | space
                for row, fibre, space in zip(each.rows(), each.fibres, _lines_um(each), strict=True)
            ],
            "network": _whole_network(each),
        }
        for each in measured
    ]
    _write(path, encoded(json.dumps({"images": images}, indent=1, ensure_ascii=False)))


def _lines_um(measured: Measurement) -> list[dict[str, object]]:
    """Return the line in space of each fibre of a focal stack."""
    if not measured.spatial:
        return [{} for _ in measured.fibres]
    return [
        {"line_um": np.round(each.line_um, 3).tolist()} if isinstance(each, SpatialFibre) else {}
        for each in measured.spatial
    ]


def write_heights(folder: Path, stem: str, sharp: Pixels, heights: HeightMap) -> None:
    """Write the sharp image as PNG and the heights, um, as a TIFF of floats with NaN.

    Raises
    ------
    RecordingError
        They cannot be written.
    """
    for name, (done, coded) in {
        f"{stem}-sharp.png": cv2.imencode(".png", sharp),
        f"{stem}-heights.tif": cv2.imencode(".tif", heights.height_um),
    }.items():
        if not done:
            raise RecordingError(f"{folder / name}: cannot be coded")
        _write(folder / name, coded.tobytes())


def _whole_network(measured: Measurement) -> dict[str, object] | None:
    row, net = measured.network_row(), measured.network
    if row is None or net is None:
        return None
    return {
        **row,
        "orientation_share": np.round(net.orientation_share, 5).tolist(),
        "junctions_px": np.round(net.junctions_px, 2).tolist(),
        "segment_list": [
            {
                "junctions": each.junctions,
                "length_px": each.length_px,
                "width_px": each.width_px,
                "orientation_deg": each.orientation_deg,
                "bundle": each.bundle,
                "line_px": np.round(each.line_px, 2).tolist(),
            }
            for each in net.segments
        ],
    }


def write_overlay(path: Path, image: npt.NDArray[np.generic], measured: Measurement) -> None:
    """Write the image with its fibres as PNG: certain ones green, others orange."""
    grey = grey_image(image).astype(np.float32)
    low, high = (float(value) for value in np.percentile(grey, (0.1, 99.9)))
    even = np.clip((grey - low) / max(high - low, 1.0) * 255.0, 0, 255).astype(np.uint8)
    drawn = cv2.cvtColor(even, cv2.COLOR_GRAY2BGR)
    for number, fibre in enumerate(measured.fibres, start=1):
        colour = CERTAIN_BGR if fibre.certain else DOUBTFUL_BGR
        line = np.round(fibre.centre_line_px * 16).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(drawn, [line], False, colour, 2, cv2.LINE_AA, shift=4)
        x, y = (int(value) for value in fibre.centre_line_px[0])
        cv2.putText(drawn, str(number), (x + 6, y - 6), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 2)
    for segment in measured.network.segments if measured.network is not None else ():
        line = np.round(segment.line_px * 16).astype(np.int32).reshape(-1, 1, 2)
        colour = BUNDLE_BGR if segment.bundle else NETWORK_BGR
        cv2.polylines(drawn, [line], False, colour, 1, cv2.LINE_AA, shift=4)
    done, coded = cv2.imencode(".png", drawn)
    if not done:
        raise RecordingError(f"{path}: the overlay cannot be written as PNG")
    _write(path, coded.tobytes())


def write_rois(path: Path, measured: Measurement) -> None:
    """Write the centre lines as ROIs that ImageJ and Fiji open; raises `RecordingError`."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, fibre in enumerate(measured.fibres, start=1):
            said = "certain" if fibre.certain else "doubtful"
            archive.writestr(f"fibre-{number:03d}-{said}.roi", roi(fibre))
    _write(path, whole.getvalue())


def roi(fibre: Fibre) -> bytes:
    """Return a polyline as ImageJ's RoiDecoder reads it: big-endian, with sub-pixel points.

    ImageJ counts from the corner of a pixel, this program from its centre.
    """
    points = fibre.centre_line_px + 0.5
    low = np.floor(points.min(axis=0)).astype(int)
    high = np.ceil(points.max(axis=0)).astype(int)
    width = int(np.clip(round(fibre.width_px), 1, 32_767))
    head = struct.pack(
        ">4shBBhhhhH16shiiihhBBhii",
        b"Iout", ROI_VERSION, POLYLINE, 0, low[1], low[0], high[1], high[0], len(points), bytes(16),
        width, 0, 0, 0, 0, SUB_PIXEL, 0, 0, 0, 0, 0,
    )  # fmt: skip
    whole = np.round(points - low).astype(">i2").T.tobytes()
    data: bytes = head + whole + points.astype(">f4").T.tobytes()
    return data


def encoded(text: str) -> bytes:
    r"""Return text as UTF-8; bytes of a file's name that are none become such as ``\udcff``."""
    return text.encode("utf-8", "backslashreplace")


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as exc:
        raise RecordingError(f"{path}: cannot be written ({exc.strerror or exc})") from exc
