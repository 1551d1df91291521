"""`save_image`: a file that other programs read, with its scale."""

import struct
import zlib
from dataclasses import replace
from datetime import UTC, datetime

import cv2
import numpy as np
import pytest
import tifffile

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.core.recording.snap import save_image
from cosmic.vico.core.recording.tiff_png import encoded_png
from cosmic.vico.hw.interface import FrameStatus, PixelFormat
from unit.vico.recording.image_helpers import AXES, image, noise

UTC_NOW = datetime(2026, 5, 4, 9, 8, 7, 123456, tzinfo=UTC)


def chunks(path):
    """Return the chunks of a PNG, with their checksums looked at."""
    content = path.read_bytes()
    found, at = [], 8
    while at < len(content):
        (length,) = struct.unpack_from(">I", content, at)
        kind, body = content[at + 4 : at + 8], content[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", content, at + 8 + length)[0] == zlib.crc32(kind + body)
        found.append((kind.decode(), body))
        at += 12 + length
    return found


@pytest.mark.parametrize("pixel_format", PixelFormat)
@pytest.mark.parametrize("name", ["a.tif", "a.TIFF", "a.png"])
def test_a_snap_keeps_every_bit(tmp_path, name, pixel_format):
    shot = image(data=noise(pixel_format), pixel_format=pixel_format)
    path = save_image(shot, tmp_path / name)
    if name.endswith("png"):
        read = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        read = read[:, :, ::-1] if read.ndim == 3 else read
    else:
        read = tifffile.imread(path)
    assert read.dtype == shot.data.dtype
    np.testing.assert_array_equal(read, shot.data)
    assert [each.name for each in tmp_path.iterdir()] == [name]


def test_a_tiff_says_its_scale_and_circumstances(tmp_path):
    path = save_image(image(7), tmp_path / "a.tif", axes=AXES, utc=UTC_NOW)
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        assert page.tags["ResolutionUnit"].value == tifffile.RESUNIT.CENTIMETER
        numerator, denominator = page.tags["XResolution"].value
        assert numerator / denominator == pytest.approx(1e4 / 0.8)
        assert file.is_ome
        described = tifffile.xml2dict(file.ome_metadata)["OME"]
    pixels = described["Image"]["Pixels"]
    assert (pixels["PhysicalSizeX"], pixels["PhysicalSizeXUnit"]) == (0.8, "µm")
    assert (pixels["PhysicalSizeY"], pixels["PhysicalSizeYUnit"]) == (0.8, "µm")
    values = described["StructuredAnnotations"]["MapAnnotation"]["Value"]["M"]
    known = {each["K"]: each["value"] for each in values}
    assert known["frame_id"] == 7
    assert known["left.x_um"] == 17.0
    assert known["table.rotation_deg"] == -1.5
    assert known["exposure_s"] == 0.01
    assert known["utc"] == "2026-05-04T09:08:07.123456+00:00"
    assert "focus_counts" not in known


def test_a_png_says_its_scale_and_circumstances(tmp_path):
    path = save_image(image(7), tmp_path / "a.png", axes=AXES, utc=UTC_NOW)
    found = chunks(path)
    assert found[0][0] == "IHDR"
    (pixels_a_metre,) = [body for kind, body in found if kind == "pHYs"]
    assert struct.unpack(">IIB", pixels_a_metre) == (1_250_000, 1_250_000, 1)
    texts = dict(body.split(bytes(5), 1) for kind, body in found if kind == "iTXt")
    assert texts[b"scale_um_px"] == b"0.8"
    assert texts[b"left.x_um"] == b"17.0"
    assert texts[b"Software"] == b"CoSMic"


@pytest.mark.parametrize("name", ["a.tif", "a.png"])
def test_without_a_known_scale_none_is_said(tmp_path, name):
    path = save_image(image(scale_um_px=None), tmp_path / name)
    if name.endswith("png"):
        assert "pHYs" not in [kind for kind, _ in chunks(path)]
    else:
        with tifffile.TiffFile(path) as file:
            assert "PhysicalSizeX" not in file.ome_metadata
            assert file.pages[0].tags["ResolutionUnit"].value != tifffile.RESUNIT.CENTIMETER


def test_a_snap_that_is_there_is_replaced_only_when_asked_to(tmp_path):
    path = save_image(image(0), tmp_path / "a.png")
    with pytest.raises(RecordingExistsError, match="may be replaced"):
        save_image(image(1), path)
    save_image(image(1), path, overwrite=True)
    np.testing.assert_array_equal(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), image(1).data)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a.jpg", r"must end in one of \.tif, \.tiff, \.png"),
        ("none/a.png", "does not exist; create it"),
        ("a:b.png", "cannot be part"),
    ],
)
def test_a_path_that_cannot_be_is_refused(tmp_path, name, said):
    with pytest.raises(RecordingError, match=said):
        save_image(image(), tmp_path / name)


def test_an_incomplete_image_is_not_saved(tmp_path):
    with pytest.raises(RecordingError, match="parts of the image are missing"):
        save_image(image(status=FrameStatus.INCOMPLETE), tmp_path / "a.png")


def test_a_disk_that_is_full_leaves_nothing_behind(tmp_path, monkeypatch):
    def full(path, content):
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(RecordingError, match="No space left on device"):
        save_image(image(), tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_texts_beyond_ascii_are_kept():
    shot = replace(image(), camera="Kamera über µ")
    coded = encoded_png(noise(), row_of(shot, UTC_NOW), {})
    assert b"camera" + bytes(5) + "Kamera über µ".encode() in coded
