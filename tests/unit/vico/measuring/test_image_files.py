"""Files of other programs: the pixel size of each page, and files that are damaged."""

import io
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from cosmic.frame.errors import ConfigError, RecordingError
from cosmic.vico.api.measure import measure, read_images
from unit.vico.vision.drawn_fibres import arc, drawn_image

IMAGE = drawn_image([arc((60.0, 100.0), 0.2, 300.0, 0.6)], [9.0], shape=(300, 400))
HALF = cv2.resize(IMAGE, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
OTHER = np.ascontiguousarray(IMAGE[::-1])
CENTIMETRE = {"resolutionunit": "CENTIMETER", "metadata": None}


def ome(x: float, y: float, unit: str = "µm", axes: str = "YX") -> dict[str, object]:
    sizes = {"PhysicalSizeX": x, "PhysicalSizeXUnit": unit}
    return {"axes": axes, **sizes, "PhysicalSizeY": y, "PhysicalSizeYUnit": unit}


def png(path: Path, *chunks: tuple[bytes, bytes]) -> Path:
    """Write an image with chunks before its pixels."""
    coded = cv2.imencode(".png", IMAGE)[1].tobytes()
    more = b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
    path.write_bytes(coded[:33] + more + coded[33:])
    return path


def size_of(path: Path) -> tuple[float | None, str]:
    page = next(iter(read_images(path)))
    return page.pixel_size_um, page.pixel_size_from


def test_pixels_that_are_not_square_have_no_size(tmp_path: Path) -> None:
    unit = {"unit": "um"}
    tifffile.imwrite(
        tmp_path / "imagej.tif", IMAGE, imagej=True, resolution=(1, 0.5), metadata=unit
    )
    tifffile.imwrite(tmp_path / "ome.tif", IMAGE, ome=True, metadata=ome(1.0, 2.0))
    tifffile.imwrite(tmp_path / "tag.tif", IMAGE, resolution=(10_000, 5000), **CENTIMETRE)
    png(tmp_path / "phys.png", (b"pHYs", struct.pack(">IIB", 1_000_000, 500_000, 1)))
    for name in ("imagej.tif", "ome.tif", "tag.tif", "phys.png"):
        size, said = size_of(tmp_path / name)
        assert size is None, name
        assert "pixels are not square: 1 x 2 µm" in said, name
        assert measure(tmp_path / name).lengths_um == ()
    nearly = {"resolution": (10_000, 10_001), **CENTIMETRE}
    tifffile.imwrite(tmp_path / "nearly.tif", IMAGE, **nearly)
    assert size_of(tmp_path / "nearly.tif")[0] == pytest.approx(1.0, rel=1e-3)


def test_each_page_has_its_own_pixel_size(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "pages.tif") as file:
        file.write(IMAGE, resolution=(10_000, 10_000), **CENTIMETRE)
        file.write(HALF, resolution=(5000, 5000), **CENTIMETRE)
    with tifffile.TiffWriter(tmp_path / "series.ome.tif", ome=True) as file:
        file.write(IMAGE, metadata=ome(1.0, 1.0))
        file.write(HALF, metadata=ome(2.0, 2.0))
    for name in ("pages.tif", "series.ome.tif"):
        pages = list(read_images(tmp_path / name))
        assert [each.pixel_size_um for each in pages] == pytest.approx([1.0, 2.0]), name
        assert [each.number for each in pages] == [1, 2]


def test_pages_of_reduced_resolution_and_masks_are_no_images(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "pyramid.tif") as file:
        file.write(IMAGE, resolution=(10_000, 10_000), **CENTIMETRE)
        file.write(HALF, subfiletype=1, resolution=(5000, 5000), **CENTIMETRE)
    (page,) = read_images(tmp_path / "pyramid.tif")
    assert (page.name, page.pixels.shape) == ("pyramid.tif", IMAGE.shape)
    with tifffile.TiffWriter(tmp_path / "pyramid.ome.tif", ome=True) as file:
        file.write(IMAGE, subifds=1, metadata=ome(1.0, 1.0))
        file.write(HALF, subfiletype=1)
    (page,) = read_images(tmp_path / "pyramid.ome.tif")
    assert page.pixels.shape == IMAGE.shape


@pytest.mark.parametrize(
    ("unit", "per_unit", "size_um"),
    [
        ("micrometer", 0.5, 2.0),
        ("micron", 0.5, 2.0),
        ("inches", 25_400, 1.0),
        ("inch", 72, None),
        ("inch", 300, None),
        ("mm", 10, 100.0),
        ("parsec", 0.5, None),
    ],
)
def test_a_unit_of_imagej_is_understood_or_named(
    tmp_path: Path, unit: str, per_unit: float, size_um: float | None
) -> None:
    file = tmp_path / "scaled.tif"
    scale = (per_unit, per_unit)
    tifffile.imwrite(file, IMAGE, imagej=True, resolution=scale, metadata={"unit": unit})
    found, said = size_of(file)
    assert found == (None if size_um is None else pytest.approx(size_um, rel=1e-5))
    if unit == "parsec":
        assert "'parsec'" in said
    elif size_um is None:
        assert "resolution of a print" in said


@pytest.mark.parametrize(
    ("unit", "um"),
    [("Å", 1e-4), ("pm", 1e-6), ("nm", 1e-3), ("µm", 1), ("mm", 1e3), ("cm", 1e4), ("in", 25_400)],
)
def test_a_unit_of_ome_is_understood(tmp_path: Path, unit: str, um: float) -> None:
    sizes = ome(2.0 / um, 2.0 / um, unit)
    tifffile.imwrite(tmp_path / "a.ome.tif", IMAGE, ome=True, metadata=sizes)
    assert size_of(tmp_path / "a.ome.tif")[0] == pytest.approx(2.0)


def test_an_unknown_unit_of_ome_is_named_and_nothing_else_is_taken(tmp_path: Path) -> None:
    more = {"resolution": (10_000, 10_000), "resolutionunit": "CENTIMETER"}
    sizes = ome(2.0, 2.0, "reference frame")
    tifffile.imwrite(tmp_path / "a.ome.tif", IMAGE, ome=True, metadata=sizes, **more)
    size, said = size_of(tmp_path / "a.ome.tif")
    assert size is None
    assert "'reference frame'" in said


def test_the_palette_of_a_tiff_is_applied(tmp_path: Path) -> None:
    shuffled = np.random.default_rng(3).permutation(256)
    numbers = np.argsort(shuffled).astype(np.uint8)[IMAGE]
    table = np.repeat(shuffled.astype(np.uint16)[None] * 257, 3, axis=0)
    table[0] = 0  # no red
    tifffile.imwrite(tmp_path / "p.tif", numbers, photometric="palette", colormap=table)
    (page,) = read_images(tmp_path / "p.tif")
    np.testing.assert_array_equal(page.pixels[:, :, 0], IMAGE)
    assert page.pixels[:, :, 2].max() == 0


def test_a_png_is_parsed_and_not_searched(tmp_path: Path) -> None:
    ten = struct.pack(">IIB", 100_000, 100_000, 1)
    text = (b"tEXt", b"Comment\0see pHYs" + struct.pack(">IIB", 500_000, 500_000, 1))
    assert size_of(png(tmp_path / "text.png", text)) == (None, "not known")
    assert size_of(png(tmp_path / "both.png", text, (b"pHYs", ten)))[0] == pytest.approx(10.0)
    late = (b"tEXt", b"Comment\0" + b"x" * 9000)
    assert size_of(png(tmp_path / "late.png", late, (b"pHYs", ten)))[0] == pytest.approx(10.0)


def test_images_behind_the_single_page_of_imagej_are_all_read(tmp_path: Path) -> None:
    stack = np.stack([IMAGE, OTHER, IMAGE]).astype(np.uint16)
    file = tmp_path / "stack.tif"
    tifffile.imwrite(file, stack, imagej=True, truncate=True)
    with tifffile.TiffFile(file) as written:
        assert len(written.pages) == 1
    pages = list(read_images(file))
    assert [each.name for each in pages] == [f"stack.tif page {n}" for n in (1, 2, 3)]
    np.testing.assert_array_equal([each.pixels for each in pages], stack)
    file.write_bytes(file.read_bytes()[: -IMAGE.size])
    problems: list[RecordingError] = []
    assert len(list(read_images(file, refused=problems.append))) == 2
    assert "declares 3 images, and 2 can be read" in str(problems[0])
    with pytest.raises(RecordingError, match="not complete"):
        list(read_images(file))


def damaged_page(file: Path) -> None:
    """Write three pages of which the second cannot be unpacked."""
    with tifffile.TiffWriter(file) as writer:
        for each in (IMAGE, OTHER, IMAGE):
            writer.write(each, compression="zlib", metadata=None, contiguous=False)
    with tifffile.TiffFile(file) as written:
        at = written.pages[1].dataoffsets[0]
    data = bytearray(file.read_bytes())
    data[at : at + 200] = bytes(200)
    file.write_bytes(data)


def test_a_damaged_page_does_not_keep_the_others_from_being_read(tmp_path: Path) -> None:
    file = tmp_path / "pages.tif"
    damaged_page(file)
    problems: list[RecordingError] = []
    pages = list(read_images(file, refused=problems.append))
    assert [each.number for each in pages] == [1, 3]
    (problem,) = problems
    assert str(problem).startswith(f"{file}: page 2: cannot be read")
    with pytest.raises(RecordingError, match="page 2"):
        list(read_images(file))


@pytest.mark.parametrize("rows", [16, 300])
def test_lzw_that_is_damaged_is_refused(tmp_path: Path, rows: int) -> None:
    file = tmp_path / "packed.tif"
    how = [cv2.IMWRITE_TIFF_COMPRESSION, 5, cv2.IMWRITE_TIFF_ROWSPERSTRIP, rows]
    noise = np.random.default_rng(0).normal(0, 3, IMAGE.shape)
    noisy = np.clip(IMAGE + noise, 0, 255).astype(np.uint8)
    cv2.imwrite(str(file), noisy, how)
    (page,) = read_images(file)
    np.testing.assert_array_equal(page.pixels, noisy)
    whole = file.read_bytes()
    with tifffile.TiffFile(file) as written:
        middle = written.pages[0].dataoffsets[-1] + written.pages[0].databytecounts[-1] // 2
    for damage in (bytes(2000), np.random.default_rng(1).bytes(2000)):
        begin = middle - len(damage)
        file.write_bytes(whole[:begin] + damage + whole[middle:])
        with pytest.raises(RecordingError, match="compressed by LZW, cannot be decoded"):
            list(read_images(file))


def test_colours_of_one_page_are_no_channels_and_no_pages(tmp_path: Path) -> None:
    colour = np.stack([cv2.merge([IMAGE] * 3)] * 4)
    sizes = ome(2.0, 2.0, axes="ZYXS") | {"PhysicalSizeZ": 5.0}
    file = tmp_path / "rgb.ome.tif"
    tifffile.imwrite(file, colour, ome=True, photometric="rgb", metadata=sizes)
    pages = list(read_images(file))
    assert len(pages) == 4
    assert {each.besides_height for each in pages} == {""}
    assert pages[0].step_um == 5.0


def test_a_tiff_changed_at_any_place_is_read_or_refused(tmp_path: Path) -> None:
    bases = []
    small = IMAGE[::6, ::6].copy()
    for how in (
        {"imagej": True, "resolution": (2, 2), "metadata": {"unit": "um"}},
        {"ome": True, "metadata": ome(1.0, 1.0)},
        {"compression": "zlib", "metadata": None},
        {"bigtiff": True, "metadata": None},
    ):
        data = io.BytesIO()
        tifffile.imwrite(data, small, **how)
        bases.append(data.getvalue())
    rng, file = np.random.default_rng(7), tmp_path / "changed.tif"
    refused = 0
    for number in range(400):
        data = bytearray(bases[number % len(bases)])
        for _ in range(rng.integers(1, 4)):
            data[int(rng.integers(4, min(len(data), 700)))] = rng.choice([0, 1, 3, 5, 12, 255])
        file.write_bytes(data)
        try:
            list(read_images(file))
        except RecordingError:
            refused += 1
    assert 40 < refused < 400


@pytest.mark.parametrize("size", [(80, 83_886_140), (30_000, 30_000)])
def test_a_small_file_that_declares_a_huge_image_is_refused(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    file = tmp_path / "huge.tif"
    tifffile.imwrite(file, IMAGE, metadata=None, rowsperstrip=IMAGE.shape[0])
    data = bytearray(file.read_bytes())
    for tag, value in zip((256, 257), size, strict=True):
        at = data.index(struct.pack("<H", tag))
        struct.pack_into("<HHII", data, at, tag, 4, 1, value)
    file.write_bytes(data)
    with pytest.raises(RecordingError, match="declares"):
        list(read_images(file))


@pytest.mark.parametrize("name", ["empty.png", "empty.jpg", "empty.tif", "empty.mp4"])
def test_an_empty_image_is_called_empty(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(RecordingError, match=r"is empty") as caught:
        list(read_images(tmp_path / name))
    assert "OpenCV" not in str(caught.value)


def test_what_is_missing_or_a_folder_is_called_so(tmp_path: Path) -> None:
    (tmp_path / "folder.tif").mkdir()
    for path, said in (
        (tmp_path / "absent.tif", "is missing"),
        (tmp_path / "absent", "is missing"),
        (tmp_path / "folder.tif", "is a folder"),
        (tmp_path / f"{'x' * 300}.tif", "cannot be read"),
    ):
        with pytest.raises(RecordingError, match=said):
            list(read_images(path))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="has no pipes with a name")
@pytest.mark.parametrize("name", ["pipe.png", "pipe.tif", "pipe.avi"])
def test_a_pipe_that_nobody_writes_to_is_refused_and_not_waited_for(
    tmp_path: Path, name: str
) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(RecordingError, match="is a pipe or a device"):
        list(read_images(tmp_path / name))


def film(path: Path, images: int = 8) -> Path:
    size = (IMAGE.shape[1], IMAGE.shape[0])
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, size)
    for _ in range(images):
        writer.write(cv2.merge([IMAGE] * 3))
    writer.release()
    return path


def test_a_video_that_is_not_complete_is_called_so(tmp_path: Path) -> None:
    file = film(tmp_path / "film.avi")
    assert len(list(read_images(file))) == 8
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    problems: list[RecordingError] = []
    found = list(read_images(file, refused=problems.append))
    assert 1 <= len(found) < 8
    assert f"declares 8 images, and {len(found)} can be read" in str(problems[0])
    assert len(list(read_images(film(tmp_path / "film.mkv")))) == 8


@pytest.mark.parametrize("every", [0, -3])
def test_each_nth_image_is_from_one_on(tmp_path: Path, every: int) -> None:
    with pytest.raises(ConfigError, match="N = 1"):
        list(read_images(film(tmp_path / "film.avi", 2), every))


def cut_jpeg() -> bytes:
    coded: bytes = cv2.imencode(".jpg", IMAGE)[1].tobytes()
    return coded[: len(coded) * 9 // 10]


def cut_png() -> bytes:
    coded: bytes = cv2.imencode(".png", IMAGE)[1].tobytes()
    return coded[: len(coded) * 9 // 10]


@pytest.mark.parametrize(("name", "data"), [("cut.jpg", cut_jpeg), ("cut.png", cut_png)])
def test_an_image_that_is_cut_off_is_refused(
    tmp_path: Path, name: str, data: Callable[[], bytes]
) -> None:
    (tmp_path / name).write_bytes(data())
    with pytest.raises(RecordingError, match=r"cut off|damaged"):
        list(read_images(tmp_path / name))
