"""``cosmic measure``: what it refuses, what it leaves alone, and what it writes all the same."""

import csv
import json
import os
import re
import signal
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

import cosmic
from cosmic.app.cli import main
from cosmic.app.commands import measure as command
from cosmic.frame.errors import ConfigError
from cosmic.vico.api.measure import (
    FileImage,
    Measurement,
    measure_page,
    measure_stack,
    read_images,
    write_csv,
)
from cosmic.vico.core.measuring import measurement
from unit.vico.measuring.test_image_files import damaged_page, film
from unit.vico.vision.drawn_fibres import arc, drawn_image

IMAGE = drawn_image([arc((60.0, 100.0), 0.2, 300.0, 0.6)], [9.0], shape=(300, 400))
EMPTY = np.full((64, 64), 120, np.uint8)


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """Return an image with one fibre, in a folder of its own."""
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images" / "a.png"), IMAGE)
    return tmp_path / "images" / "a.png"


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


def rows_of(file: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))


def test_pages_that_cannot_be_measured_do_not_cost_the_others(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damaged_page(tmp_path / "damaged.tif")
    with tifffile.TiffWriter(tmp_path / "small.tif") as file:
        for each in (IMAGE, EMPTY[:8, :8], IMAGE):
            file.write(each, metadata=None, contiguous=False)
    asked = ["measure", str(tmp_path / "damaged.tif"), str(tmp_path / "small.tif")]
    assert main([*asked, "--output", str(out)]) == 1
    names = [row["image"] for row in rows_of(out / "fibres.csv")]
    pages = [f"{name}.tif page {n}" for name in ("damaged", "small") for n in (1, 3)]
    assert names == pages
    said = capsys.readouterr()
    assert "damaged.tif: page 2: cannot be read" in said.err
    assert "small.tif: page 2: " in said.err
    assert "pages or parts of other files refused: 2" in said.out
    assert "## Pages and parts refused" in (out / "report.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("one", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_what_ends_it_keeps_what_was_measured(
    image: Path,
    out: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    one: signal.Signals,
    code: int,
) -> None:
    tifffile.imwrite(image.parent / "b.tif", np.stack([IMAGE] * 3), photometric="minisblack")

    def until_third(page: FileImage, size: float | None = None) -> Measurement:
        if page.name == "b.tif page 2":
            signal.raise_signal(one)
        return measure_page(page, size)

    monkeypatch.setattr(command, "measure_page", until_third)
    assert main(["measure", str(image.parent), "--output", str(out)]) == code
    assert [row["image"] for row in rows_of(out / "fibres.csv")] == ["a.png", "b.tif page 1"]
    assert (out / "report.md").exists()
    assert "interrupted at file 2 of 2" in capsys.readouterr().err


def test_a_second_signal_leaves_no_half_of_the_tables(
    image: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cv2.imwrite(str(image.with_name("b.png")), IMAGE)

    def until_second(page: FileImage, size: float | None = None) -> Measurement:
        if page.name == "b.png":
            signal.raise_signal(signal.SIGTERM)
        return measure_page(page, size)

    def signalled(path: Path, measured: Sequence[Measurement], *, spatial: bool) -> None:
        signal.raise_signal(signal.SIGTERM)
        write_csv(path, measured, spatial=spatial)

    monkeypatch.setattr(command, "measure_page", until_second)
    monkeypatch.setattr(command, "write_csv", signalled)
    assert main(["measure", str(image.parent), "--output", str(out)]) == 143
    assert [row["image"] for row in rows_of(out / "fibres.csv")] == ["a.png"]
    (whole,) = json.loads((out / "fibres.json").read_text(encoding="utf-8"))["images"]
    assert whole["image"] == "a.png"
    assert (out / "report.md").exists()


def test_an_error_nobody_foresaw_keeps_what_was_measured(
    image: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cv2.imwrite(str(image.with_name("b.png")), IMAGE)

    def until_second(page: FileImage, size: float | None = None) -> Measurement:
        if page.name == "b.png":
            raise AssertionError("a defect")
        return measure_page(page, size)

    monkeypatch.setattr(command, "measure_page", until_second)
    with pytest.raises(AssertionError):
        main(["measure", str(image.parent), "--output", str(out)])
    assert [row["image"] for row in rows_of(out / "fibres.csv")] == ["a.png"]


def test_a_name_that_is_no_utf_8_is_written_in_ascii(image: Path, out: Path) -> None:
    name = os.fsdecode(b"odd\xff.png")
    try:
        image.rename(image.with_name(name))
    except OSError:
        pytest.skip("the file system refuses such names")
    assert main(["measure", str(image.parent), "--output", str(out)]) == 0
    assert rows_of(out / "fibres.csv")[0]["image"] == r"odd\udcff.png"
    (found,) = json.loads((out / "fibres.json").read_text(encoding="utf-8"))["images"]
    assert found["image"] == name
    assert "images measured: 1" in (out / "report.md").read_text(encoding="utf-8")


def test_a_name_as_long_as_a_name_can_be_is_measured(image: Path, out: Path) -> None:
    long = image.rename(image.with_name(f"{'ü' * 123}.png"))
    assert main(["measure", str(long), "--output", str(out)]) == 0
    (overlay,) = out.glob("0001-*-overlay.png")
    assert overlay.name.startswith("0001-üüü")
    assert rows_of(out / "fibres.csv")[0]["image"] == long.name


def test_a_name_that_no_file_can_have_is_refused(
    image: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["measure", "x" * 300, str(image.with_name("absent.tif")), str(image)]
    assert main([*asked, "--output", str(out)]) == 1
    said = capsys.readouterr().err
    assert f"cosmic: {'x' * 80}: cannot be read (File name too long)" in said
    assert "absent.tif: is missing" in said
    assert len(rows_of(out / "fibres.csv")) == 1


def test_links_in_a_circle_are_refused_and_the_others_measured(
    image: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    circle = image.with_name("circle.png")
    circle.symlink_to(circle.name)
    assert main(["measure", str(circle), str(image), "--output", str(out)]) == 1
    assert f"cosmic: {circle}: " in capsys.readouterr().err
    assert len(rows_of(out / "fibres.csv")) == 1
    assert main(["measure", str(image), "--output", str(circle)]) == 1


@pytest.mark.parametrize("option", ["measure", "--output"])
def test_an_empty_name_is_refused(
    image: Path, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = [str(image), "--output", ""] if option == "--output" else [""]
    with pytest.raises(SystemExit) as caught:
        main(["measure", *asked])
    assert caught.value.code == 2
    assert "is empty" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options",
    [
        ["--every", "0"],
        ["--every", "-3"],
        ["--step-um", "50"],
        ["--lens-distance-um", "1000"],
        ["--focal-stack", "--step-um", "-50"],
        ["--focal-stack", "--step-um", "nan"],
        ["--focal-stack", "--lens-distance-um", "-1"],
        ["--pixel-size-um", "1e308"],
        ["--pixel-size-um", "1e-9"],
        ["--pixel-size-um", "nan"],
    ],
)
def test_options_that_mean_nothing_are_refused_before_anything_is_written(
    image: Path, out: Path, options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["measure", str(image), *options, "--output", str(out)]) == 1
    assert not out.exists()
    option = options[-2].removeprefix("--").split("-um")[0].replace("-", "[- ]")
    assert re.search(option, capsys.readouterr().err)


@pytest.mark.parametrize("size", ["1.5", True, b"1"])
def test_a_pixel_size_that_is_no_number_is_named(size: object) -> None:
    with pytest.raises(TypeError, match="pixel_size_um must be a number"):
        cosmic.measure(IMAGE, pixel_size_um=size)  # type: ignore[arg-type]


def test_files_of_one_name_differ_in_their_folders(tmp_path: Path, out: Path) -> None:
    for each in ("one", "two"):
        (tmp_path / each).mkdir()
        cv2.imwrite(str(tmp_path / each / "a.png"), IMAGE)
    folders = [str(tmp_path / each) for each in ("one", "two")]
    assert main(["measure", *folders, "--output", str(out)]) == 0
    rows = rows_of(out / "fibres.csv")
    assert [row["image"] for row in rows] == ["a.png", "a.png"]
    files = [str(tmp_path / each / "a.png") for each in ("one", "two")]
    assert [row["file"] for row in rows] == files
    images = json.loads((out / "fibres.json").read_text(encoding="utf-8"))["images"]
    assert [each["file"] for each in images] == files


def test_overwrite_leaves_nothing_of_the_earlier_run(image: Path, out: Path) -> None:
    cv2.imwrite(str(image.with_name("b.png")), IMAGE)
    assert main(["measure", str(image.parent), "--output", str(out)]) == 0
    (out / "networks.csv").write_text("image\n", encoding="utf-8")
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    assert main(["measure", str(image), "--output", str(out), "--overwrite"]) == 0
    assert sorted(each.name for each in out.iterdir()) == [
        "0001-a-napari.csv",
        "0001-a-overlay.png",
        "0001-a-rois.zip",
        "fibres.csv",
        "fibres.json",
        "notes.txt",
        "report.md",
    ]


@pytest.mark.parametrize("name", ["0001-a-rois.zip", "0007-b-overlay.png", "report.md"])
def test_nothing_is_replaced_without_overwrite(
    image: Path, out: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out.mkdir()
    (out / name).write_text("mine", encoding="utf-8")
    assert main(["measure", str(image), "--output", str(out)]) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert (out / name).read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(("options", "columns"), [([], 25), (["--focal-stack"], 32)])
def test_a_table_without_a_fibre_has_its_columns(
    image: Path, out: Path, options: list[str], columns: int
) -> None:
    if options:
        rng = np.random.default_rng(0)
        blank = [rng.integers(90, 110, (64, 64)).astype(np.uint8) for _ in range(4)]
        file = image.with_name("blank.tif")
        tifffile.imwrite(file, np.stack(blank), photometric="minisblack")
        options = [*options, "--step-um", "5", "--pixel-size-um", "1"]
    else:
        file = image.with_name("blank.png")
        cv2.imwrite(str(file), EMPTY)
    assert main(["measure", str(file), *options, "--output", str(out)]) == 0
    (head,) = csv.reader((out / "fibres.csv").read_text(encoding="utf-8").splitlines())
    assert len(head) == columns
    assert ("spatial_length_um" in head) is bool(options)
    plain = [each for each in head if each not in measurement.SPATIAL]
    assert plain == list(cosmic.measure(IMAGE).rows()[0])


def test_results_are_not_measured_as_images(
    image: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(image.parent)
    assert main(["measure", folder, "--output", folder]) == 1
    assert "choose another folder with --output" in capsys.readouterr().err
    assert main(["measure", str(image), "--output", folder]) == 0
    assert main(["measure", folder, "--output", str(out)]) == 0
    assert [row["image"] for row in rows_of(out / "fibres.csv")] == ["a.png"]
    assert "results of an earlier run left out: 1" in capsys.readouterr().err
    every = sorted(str(each) for each in image.parent.glob("*.png"))
    assert len(every) == 2
    assert main(["measure", *every, "--output", folder, "--overwrite"]) == 0
    assert [row["image"] for row in rows_of(image.parent / "fibres.csv")] == ["a.png"]


def test_hidden_files_of_macos_and_folders_in_folders_are_left_out(image: Path, out: Path) -> None:
    (image.parent / "._a.png").write_bytes(b"not an image")
    (image.parent / "deeper.png").mkdir()
    assert main(["measure", str(image.parent), "--output", str(out)]) == 0
    assert len(rows_of(out / "fibres.csv")) == 1


def test_names_of_files_count_as_the_table_does(tmp_path: Path, out: Path) -> None:
    file = film(tmp_path / "film.avi", 5)
    assert main(["measure", str(file), "--every", "2", "--output", str(out)]) == 0
    rows = rows_of(out / "fibres.csv")
    assert [row["image"] for row in rows] == [f"film.avi image {n}" for n in (1, 3, 5)]
    overlays = sorted(each.name for each in out.glob("*-overlay.png"))
    names = ("0001-film", "0001-film-page-3", "0001-film-page-5")
    assert overlays == [f"{name}-overlay.png" for name in names]


def test_why_a_pixel_size_is_not_used_is_said_once_for_a_file(
    tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stack = np.stack([IMAGE, IMAGE])
    scale = {"resolution": (1, 0.5), "metadata": {"unit": "um"}}
    tifffile.imwrite(tmp_path / "a.tif", stack, imagej=True, **scale)
    assert main(["measure", str(tmp_path / "a.tif"), "--output", str(out)]) == 0
    assert capsys.readouterr().err.count("not square: 1 x 2 µm") == 1
    assert "## Pixel sizes not used" in (out / "report.md").read_text(encoding="utf-8")
    given = ["--pixel-size-um", "1", "--overwrite", "--output", str(out)]
    assert main(["measure", str(tmp_path / "a.tif"), *given]) == 0
    assert "not square" not in capsys.readouterr().err


def channels(file: Path) -> None:
    sizes = {"PhysicalSizeX": 2.0, "PhysicalSizeY": 2.0, "PhysicalSizeZ": 5.0}
    stack = np.stack([np.stack([IMAGE] * 2)] * 5)
    tifffile.imwrite(file, stack, ome=True, metadata={"axes": "ZCYX", **sizes})


def times(file: Path) -> None:
    unit = {"unit": "um", "spacing": 1.0, "axes": "TYX"}
    tifffile.imwrite(file, np.stack([IMAGE] * 5), imagej=True, resolution=(0.5, 0.5), metadata=unit)


@pytest.mark.parametrize(
    ("written", "said"), [(channels, "2 channels"), (times, "5 moments in time")]
)
def test_pages_that_differ_in_more_than_height_are_no_focal_stack(
    tmp_path: Path, written: Callable[[Path], None], said: str
) -> None:
    written(tmp_path / "a.tif")
    with pytest.raises(ConfigError, match=said):
        measure_stack(list(read_images(tmp_path / "a.tif")))


def test_a_run_that_measured_nothing_leaves_no_folder_that_it_made(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.mkdir()
    for folder in (kept, tmp_path / "new" / "inner"):
        assert main(["measure", str(tmp_path / "nope.png"), "--output", str(folder)]) == 1
    assert list(tmp_path.iterdir()) == [kept]


def test_a_run_that_measured_nothing_is_not_in_the_way_of_the_next(image: Path, out: Path) -> None:
    assert main(["measure", str(image.with_name("nosuch.png")), "--output", str(out)]) == 1
    assert main(["measure", str(image), "--output", str(out)]) == 0
    assert len(rows_of(out / "fibres.csv")) == 1
