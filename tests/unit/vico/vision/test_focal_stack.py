"""Heights, one sharp image and fibres in space, from images at several heights of the focus."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from cosmic.app.cli import main
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.api.measure import FocalStack, heights_along, measure_stack
from cosmic.vico.core.vision.focal_stack import height_map, sharp_image
from unit.vico.vision.drawn_fibres import arc, strip

SHAPE = (300, 460)
SCALE_UM_PX, PX_PER_UM, DISTANCE_UM = 2.0, 0.02, 40_000.0
LENGTH_UM, WIDTH_PX, PIECES = 700.0, 12.0, 14
FOCI_UM = np.arange(-200.0, 201.0, 50.0)


def disc(radius: float) -> np.ndarray:
    side = 2 * int(np.ceil(radius)) + 1
    y, x = np.mgrid[:side, :side] - side // 2
    found = np.clip(radius + 0.5 - np.hypot(x, y), 0.0, 1.0)
    return found / found.sum()


def seen(pieces: list[tuple[np.ndarray, float]], focus_um: float, seed: int) -> np.ndarray:
    """Return what a lens shows of pieces of fibre, each at its height."""
    image = np.full(SHAPE, 150.0)
    for covered, height in pieces:
        sharp = cv2.GaussianBlur(covered, (0, 0), 1.0)
        radius = PX_PER_UM * abs(height - focus_um)
        image -= 60.0 * (cv2.filter2D(sharp, -1, disc(radius)) if radius > 0.4 else sharp)
    image += np.random.default_rng(seed).normal(0.0, 2.0, SHAPE)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def tilted(tilt_deg: float, aside_um: float = 0.0) -> list[np.ndarray]:
    """Return a stack of a straight fibre that rises to the right, seen by a lens nearby."""
    tilt = np.radians(tilt_deg)
    way = np.linspace(-0.5, 0.5, PIECES + 1) * LENGTH_UM
    height = way * np.sin(tilt)
    nearer = DISTANCE_UM / (DISTANCE_UM - height) / SCALE_UM_PX
    x = 0.5 * (SHAPE[1] - 1) + (way * np.cos(tilt) + aside_um) * nearer
    y = 0.5 * (SHAPE[0] - 1) + 0.0 * nearer
    ends = np.column_stack([x, y])
    pieces = [
        (strip(SHAPE, np.linspace(*ends[n : n + 2], 9), WIDTH_PX), float(height[n : n + 2].mean()))
        for n in range(PIECES)
    ]
    return [seen(pieces, focus, n) for n, focus in enumerate(FOCI_UM.tolist())]


@pytest.mark.parametrize(("tilt_deg", "aside_um"), [(0.0, 0.0), (10.0, 0.0), (-10.0, 80.0)])
def test_the_length_of_a_tilted_fibre_is_corrected(tilt_deg: float, aside_um: float) -> None:
    stack = measure_stack(
        tilted(tilt_deg, aside_um), FOCI_UM, SCALE_UM_PX, lens_distance_um=DISTANCE_UM
    )
    (row,) = stack.measurement.rows()
    assert abs(row["tilt_deg"]) == pytest.approx(abs(tilt_deg), abs=0.5)
    assert row["spatial_length_um"] == pytest.approx(LENGTH_UM, rel=0.002)
    if tilt_deg:
        assert row["length_um"] < 0.99 * LENGTH_UM
    (fibre,) = stack.measurement.spatial
    right = fibre.line_um[np.argmax(fibre.line_um[:, 0]), 2]
    left = fibre.line_um[np.argmin(fibre.line_um[:, 0]), 2]
    rise = LENGTH_UM * np.sin(np.radians(tilt_deg))
    assert right - left == pytest.approx(rise, abs=6.0)


def two_heights() -> tuple[FocalStack, np.ndarray, np.ndarray]:
    lines = [arc((60.0, y), 0.0, 340.0, 0.0) for y in (80.0, 220.0)]
    pieces = [
        (strip(SHAPE, line, WIDTH_PX), height)
        for line, height in zip(lines, (-120.0, 130.0), strict=True)
    ]
    images = [seen(pieces, focus, n) for n, focus in enumerate(FOCI_UM.tolist())]
    return FocalStack.of(images[::-1], FOCI_UM[::-1]), lines[0], lines[1]


def test_heights_are_seen_where_there_are_edges_and_nowhere_else() -> None:
    stack, _, _ = two_heights()
    found = height_map(stack)
    low, high = found.height_um[75:86, 100:360], found.height_um[215:226, 100:360]
    assert np.isfinite(low).mean() > 0.9
    assert float(np.nanmedian(low)) == pytest.approx(-120.0, abs=8.0)
    assert float(np.nanmedian(high)) == pytest.approx(130.0, abs=8.0)
    assert not np.isfinite(found.height_um[145:155]).any()


def test_one_image_is_as_sharp_as_each_where_it_is_sharpest() -> None:
    stack, low, high = two_heights()
    sharp = sharp_image(stack)
    assert sharp.dtype == np.uint8
    for line, height in ((low, -120.0), (high, 130.0)):
        rows = slice(int(line[0, 1]) - 20, int(line[0, 1]) + 21)
        best = stack.images[int(np.argmin(np.abs(stack.heights_um - height)))]
        steep = [
            np.abs(np.diff(each[rows, 120:340].astype(float).mean(axis=1))).max()
            for each in (sharp, best, stack.images[len(stack.images) // 2])
        ]
        assert steep[0] > 0.9 * steep[1]
        assert steep[0] > 1.3 * steep[2]


def test_a_stack_that_cannot_be_one_is_refused() -> None:
    image = np.full(SHAPE, 120, np.uint8)
    for images, heights, why in (
        ([image] * 3, [0.0, 1.0, 2.0], "4 or more"),
        ([image] * 4, [0.0, 1.0, 1.0, 2.0], "height of its own"),
        ([image] * 4, [0.0, 1.0, np.nan, 2.0], "height of its own"),
        ([image] * 3 + [image[:100]], [0.0, 1.0, 2.0, 3.0], "different shapes"),
    ):
        with pytest.raises(ConfigError, match=why):
            FocalStack.of(images, heights)
    noise = [np.random.default_rng(n).integers(100, 110, SHAPE, np.uint8) for n in range(6)]
    stack = FocalStack.of(noise, [float(n) for n in range(6)])
    assert not np.isfinite(height_map(stack).height_um).any()
    with pytest.raises(NotAvailable, match="come into focus"):
        heights_along(stack, arc((60.0, 150.0), 0.0, 300.0, 0.0), WIDTH_PX)
    with pytest.raises(ConfigError, match="pixel size"):
        measure_stack(noise, [float(n) for n in range(6)])
    with pytest.raises(ConfigError, match="give the step"):
        measure_stack(noise, None, 1.0)


def test_a_stack_from_a_file_is_measured_and_written(tmp_path: Path) -> None:
    file, out = tmp_path / "stack.ome.tif", tmp_path / "out"
    sizes = {"PhysicalSizeX": SCALE_UM_PX, "PhysicalSizeY": SCALE_UM_PX, "PhysicalSizeZ": 50.0}
    tifffile.imwrite(file, np.stack(tilted(10.0)), ome=True, metadata={"axes": "ZYX"} | sizes)
    asked = ["measure", str(file), "--focal-stack", "--output", str(out)]
    assert main([*asked, "--lens-distance-um", str(DISTANCE_UM)]) == 0
    (row,) = csv.DictReader((out / "fibres.csv").read_text(encoding="utf-8").splitlines())
    assert float(row["spatial_length_um"]) == pytest.approx(LENGTH_UM, rel=0.002)
    heights = tifffile.imread(out / "0001-stack.ome-heights.tif")
    assert heights.shape == SHAPE
    low, high = np.nanpercentile(heights, (5.0, 95.0))
    assert high - low == pytest.approx(109.0, abs=15.0)
    assert (out / "0001-stack.ome-sharp.png").exists()
