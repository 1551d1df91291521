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
