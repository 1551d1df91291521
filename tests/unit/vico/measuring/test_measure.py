"""Images from anywhere, measured without a platform."""

import csv
import json
import struct
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

import cosmic
from cosmic.app.cli import main
from cosmic.frame.errors import ConfigError, RecordingError
from cosmic.vico.api import find_fibres
from cosmic.vico.api.measure import read_images
from unit.vico.vision.drawn_fibres import arc, drawn_image

IMAGE = drawn_image([arc((60.0, 100.0), 0.2, 300.0, 0.6)], [9.0], shape=(300, 400))


def test_an_array_is_measured_in_micrometres() -> None:
    measured = cosmic.measure(IMAGE, pixel_size_um=1.5)
    (row,) = measured.rows()
    assert row["length_um"] == pytest.approx(450.0, rel=0.003)
    assert row["certain"] is True
    assert measured.lengths_um == (row["length_um"],)
    assert cosmic.measure(IMAGE).rows()[0]["length_um"] is None


@pytest.mark.parametrize("size", [0.0, -1.0, float("nan"), float("inf")])
def test_a_pixel_size_that_is_no_length_is_refused(size: float) -> None:
    with pytest.raises(ConfigError, match="pixel size"):
        cosmic.measure(IMAGE, pixel_size_um=size)


def test_the_pixel_size_comes_from_the_file(tmp_path: Path) -> None:
    files = {name: tmp_path / f"{name}.tif" for name in ("ome", "imagej", "resolution", "print")}
    ome = {"axes": "YX", "PhysicalSizeX": 640.0, "PhysicalSizeXUnit": "nm"}
    tifffile.imwrite(files["ome"], IMAGE, ome=True, metadata=ome)
    scale = (1 / 0.64, 1 / 0.64)
    unit = {"unit": "um"}
    tifffile.imwrite(files["imagej"], IMAGE, imagej=True, resolution=scale, metadata=unit)
    centimetre = {"resolution": (15_625, 15_625), "resolutionunit": "CENTIMETER"}
    tifffile.imwrite(files["resolution"], IMAGE, **centimetre)
    tifffile.imwrite(files["print"], IMAGE, resolution=(300, 300), resolutionunit="INCH")
    found = {name: cosmic.measure(file) for name, file in files.items()}
    for name in ("ome", "imagej", "resolution"):
        assert found[name].pixel_size_um == pytest.approx(0.64, rel=1e-5), name
    assert found["print"].pixel_size_um is None
    assert cosmic.measure(files["ome"], pixel_size_um=2.0).pixel_size_um == 2.0


@pytest.mark.parametrize("compression", [5, 7, 32773, 8])  # LZW, JPEG, PackBits, deflate
def test_compressed_tiffs_are_read_with_all_their_pages(tmp_path: Path, compression: int) -> None:
    file = tmp_path / "packed.tif"
    dots = [cv2.IMWRITE_TIFF_XDPI, 25_400, cv2.IMWRITE_TIFF_YDPI, 25_400]
    dots += [cv2.IMWRITE_TIFF_ROWSPERSTRIP, 16]  # JPEG needs a multiple of eight
    how = [cv2.IMWRITE_TIFF_COMPRESSION, compression, *dots, cv2.IMWRITE_TIFF_RESUNIT, 2]
    assert cv2.imwritemulti(str(file), [IMAGE, IMAGE], how)
    with tifffile.TiffFile(file) as written:
        assert int(written.pages[1].compression) == compression
    pages = list(read_images(file))
    assert [each.name for each in pages] == ["packed.tif page 1", "packed.tif page 2"]
    for each in pages:
        assert each.pixel_size_um == pytest.approx(1.0)
        (fibre,) = find_fibres(each.pixels)
        assert fibre.length_px == pytest.approx(300.0, rel=0.003)


def test_colours_of_a_compressed_tiff_and_of_print_are_those_of_the_file(tmp_path: Path) -> None:
    colour = np.full((48, 64, 3), (10, 20, 250), np.uint8)
    cv2.imwrite(str(tmp_path / "lzw.tif"), colour, [cv2.IMWRITE_TIFF_COMPRESSION, 5])
    cv2.imwrite(str(tmp_path / "plain.tif"), colour, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
    inks = np.full((48, 64, 4), (0, 230, 240, 5), np.uint8)
    tifffile.imwrite(tmp_path / "print.tif", inks, photometric="separated")
    for name in ("lzw", "plain", "print"):
        (page,) = read_images(tmp_path / f"{name}.tif")
        assert page.pixels[5, 5].tolist() == pytest.approx([12, 22, 250], abs=4), name


def test_a_compression_that_nothing_here_decodes_is_named(tmp_path: Path) -> None:
    file = tmp_path / "odd.tif"
    tifffile.imwrite(file, IMAGE)
    data = bytearray(file.read_bytes())
    at = data.index(b"\x03\x01\x03\x00")  # the tag of the compression
    data[at + 8 : at + 10] = (34712).to_bytes(2, "little")  # JPEG 2000
    file.write_bytes(data)
    with pytest.raises(RecordingError, match=r"compressed by .*JPEG"):
        list(read_images(file))


def test_a_folder_is_measured_and_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "images", tmp_path / "out"
    folder.mkdir()
    cv2.imwrite(str(folder / "a.png"), IMAGE)
    cv2.imwrite(str(folder / "b.jpg"), cv2.merge([IMAGE] * 3))
    tifffile.imwrite(folder / "c.tif", np.stack([IMAGE, IMAGE]), photometric="minisblack")
    asked = ["measure", str(folder), "--pixel-size-um", "2", "--output", str(out)]
    assert main(asked) == 0
    assert "fibres: 4, certain: 4" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "fibres.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["image"] for row in rows] == ["a.png", "b.jpg", "c.tif page 1", "c.tif page 2"]
    assert float(rows[0]["length_um"]) == pytest.approx(600.0, rel=0.003)
    images = json.loads((out / "fibres.json").read_text(encoding="utf-8"))["images"]
    assert images[0]["pixel_size_from"] == "given"
    overlay = cv2.imread(str(out / "0001-a-overlay.png"))
    x, y = images[0]["fibres"][0]["centre_line_px"][40]
    assert overlay[round(y), round(x)].argmax() == 1  # green
    assert main(asked) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert main([*asked, "--overwrite"]) == 0


def test_imagej_reads_the_centre_line_back(tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    cv2.imwrite(str(file), IMAGE)
    assert main(["measure", str(file), "--output", str(tmp_path / "out")]) == 0
    with zipfile.ZipFile(tmp_path / "out" / "0001-a-rois.zip") as archive:
        (name,) = archive.namelist()
        data = archive.read(name)
    assert data[:4] == b"Iout"
    kind, top, left, count = data[6], *struct.unpack(">hh", data[8:12]), data[16:18]
    number = int.from_bytes(count, "big")
    points = np.frombuffer(data, ">f4", 2 * number, 64 + 4 * number).reshape(2, number).T
    line = cosmic.measure(IMAGE).fibres[0].centre_line_px
    assert kind == 5
    np.testing.assert_allclose(points, line + 0.5, atol=1e-3)
    assert (left, top) == tuple(np.floor(points.min(axis=0)))


def test_what_cannot_be_read_is_named_and_the_rest_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, torn = tmp_path / "good.png", tmp_path / "torn.tif"
    cv2.imwrite(str(good), IMAGE)
    torn.write_bytes(b"II*\0 nothing of a TIFF")
    out = tmp_path / "out"
    assert main(["measure", str(torn), str(good), "--output", str(out)]) == 1
    said = capsys.readouterr()
    assert "torn.tif" in said.err
    assert "files refused: 1" in said.out
    assert (out / "0002-good-overlay.png").exists()
    with pytest.raises(RecordingError, match="is not one of"):
        cosmic.measure(tmp_path / "film.xyz")


def web(seed: int = 2) -> np.ndarray:
    """Return an image so full of fibres that no single one can be made out."""
    rng = np.random.default_rng(seed)
    image = np.full((400, 500), 40.0, np.float32)
    for _ in range(28):
        x, y = rng.uniform(0, 500), rng.uniform(0, 400)
        angle = rng.normal(0.5, 0.3)
        step = 700.0 * np.array([np.cos(angle), np.sin(angle)])
        ends = [(int(x - step[0]), int(y - step[1])), (int(x + step[0]), int(y + step[1]))]
        cv2.line(image, *ends, 170.0, 5, cv2.LINE_AA)
    image = cv2.GaussianBlur(image, (0, 0), 1.0) + rng.normal(0.0, 3.0, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8)


def test_a_network_is_measured_where_no_fibre_can_be(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "web.png"), web())
    out = tmp_path / "out"
    assert main(["measure", str(tmp_path / "web.png"), "--output", str(out)]) == 0
    (row,) = csv.DictReader((out / "networks.csv").read_text(encoding="utf-8").splitlines())
    assert int(row["junctions"]) > 60
    assert float(row["direction_deg"]) == pytest.approx(np.degrees(0.5), abs=8.0)
    assert 0.4 < float(row["alignment"]) < 0.95
    (image,) = json.loads((out / "fibres.json").read_text(encoding="utf-8"))["images"]
    assert sum(image["network"]["orientation_share"]) == pytest.approx(1.0, abs=0.01)


def test_images_of_a_video_are_measured(tmp_path: Path) -> None:
    file = tmp_path / "film.avi"
    size = (IMAGE.shape[1], IMAGE.shape[0])
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, size)
    for _ in range(5):
        writer.write(cv2.merge([IMAGE] * 3))
    writer.release()
    out = tmp_path / "out"
    assert main(["measure", str(file), "--every", "2", "--output", str(out)]) == 0
    rows = list(csv.DictReader((out / "fibres.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["image"] for row in rows] == [f"film.avi image {n}" for n in (1, 3, 5)]
    assert "## Lengths" not in (out / "report.md").read_text(encoding="utf-8")


def test_the_report_says_why_fibres_are_doubted_and_files_refused(tmp_path: Path) -> None:
    folder, out = tmp_path / "images", tmp_path / "out"
    folder.mkdir()
    cut = drawn_image([arc((-40.0, 100.0), 0.2, 300.0, 0.6)], [9.0], shape=(300, 400))
    cv2.imwrite(str(folder / "cut.png"), cut)
    cv2.imwrite(str(folder / "whole.png"), IMAGE)
    (folder / "broken.png").write_bytes(b"no image")
    assert main(["measure", str(folder), "--pixel-size-um", "2", "--output", str(out)]) == 1
    report = (out / "report.md").read_text(encoding="utf-8")
    assert "the image's border cuts it off" in report
    assert "broken.png" in report
    assert "## Lengths of certain fibres" in report


def test_napari_gets_a_path_for_each_fibre(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), IMAGE)
    out = tmp_path / "out"
    assert main(["measure", str(tmp_path / "a.png"), "--output", str(out)]) == 0
    rows = list(csv.DictReader((out / "0001-a-napari.csv").read_text().splitlines()))
    line = cosmic.measure(IMAGE).fibres[0].centre_line_px
    assert {row["shape-type"] for row in rows} == {"path"}
    assert float(rows[0]["axis-0"]) == pytest.approx(line[0, 1], abs=0.01)
    assert float(rows[0]["axis-1"]) == pytest.approx(line[0, 0], abs=0.01)
