"""OME-TIFF stacks and snaps, as programs of microscopy open them."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import MappingProxyType

import av
import numpy as np
import pytest
import tifffile

from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.core.recording.snap import save_image
from cosmic.vico.hw.interface import PixelFormat
from unit.vico.recording.image_helpers import AXES, image

TAKEN = datetime(2026, 5, 4, 9, 8, 7, 123456, tzinfo=UTC)
COUNT = 5


def on_a_stage(number, pixel_format=PixelFormat.MONO8):
    """Return image `number`, with the stage under the camera at another place each time."""
    shot = image(number, pixel_format=pixel_format)
    places = {"left.x": 1.0, "table.x": 100.0 + number, "table.y": -number}
    around = replace(shot.circumstances, positions=MappingProxyType(places))
    return replace(shot, circumstances=around)


def recorded(path, pixel_format=PixelFormat.MONO8, *, before_end=lambda: None):
    """Write a stack and return its images; call `before_end` before it is closed."""
    file = ImageFile(path, ImageFormat.STACK, axes=AXES, rate_hz=20.0)
    shots = [on_a_stage(number, pixel_format) for number in range(COUNT)]
    for number, shot in enumerate(shots):
        file.append(shot.data, row_of(shot, TAKEN + timedelta(seconds=number / 20)))
    before_end()
    file.close(complete=True)
    return shots


def planes_of(path):
    with tifffile.TiffFile(path) as file:
        found = tifffile.xml2dict(file.ome_metadata)["OME"]["Image"]
    return found, found["Pixels"]["Plane"]


@pytest.mark.parametrize("pixel_format", [PixelFormat.MONO8, PixelFormat.MONO12, PixelFormat.RGB8])
def test_a_stack_is_one_series_of_all_images(tmp_path, pixel_format):
    shots = recorded(tmp_path / "run.tif", pixel_format)
    with tifffile.TiffFile(tmp_path / "run.tif") as file:
        assert file.is_ome
        (series,) = file.series
        assert series.axes == ("TYXS" if pixel_format is PixelFormat.RGB8 else "TYX")
        np.testing.assert_array_equal(series.asarray(), [each.data for each in shots])


def test_a_stack_says_when_how_long_and_where(tmp_path):
    recorded(tmp_path / "run.tif")
    found, planes = planes_of(tmp_path / "run.tif")
    assert datetime.fromisoformat(found["AcquisitionDate"]) == TAKEN
    assert (found["Pixels"]["PhysicalSizeX"], found["Pixels"]["PhysicalSizeXUnit"]) == (0.8, "µm")
    assert [each["TheT"] for each in planes] == list(range(COUNT))
    assert [each["DeltaT"] for each in planes] == pytest.approx([0.0, 0.05, 0.1, 0.15, 0.2])
    assert {each["ExposureTime"] for each in planes} == {0.01}
    assert [each["PositionX"] for each in planes] == [100.0, 101.0, 102.0, 103.0, 104.0]
    assert [each["PositionY"] for each in planes] == [0.0, -1.0, -2.0, -3.0, -4.0]
    assert "PositionZ" not in planes[0]


def test_a_stack_says_the_interval_of_images_that_come_regularly(tmp_path):
    recorded(tmp_path / "run.tif")
    pixels = planes_of(tmp_path / "run.tif")[0]["Pixels"]
    assert pixels["TimeIncrement"] == pytest.approx(0.05)
    assert pixels["TimeIncrementUnit"] == "s"


@pytest.mark.parametrize("numbers", [(0,), (0, 1, 3), (0, 1, 2, 1), (0, 0)])
def test_a_stack_of_images_that_come_irregularly_says_no_interval(tmp_path, numbers):
    file = ImageFile(tmp_path / "run.tif", ImageFormat.STACK, axes=AXES, rate_hz=20.0)
    for number in numbers:
        shot = on_a_stage(number)
        file.append(shot.data, row_of(shot, TAKEN))
    file.close(complete=True)
    pixels = planes_of(tmp_path / "run.tif")[0]["Pixels"]
    assert "TimeIncrement" not in pixels


def test_a_stack_is_read_back_with_its_side_file(tmp_path):
    shots = recorded(tmp_path / "run.tif")
    with open_image_recording(tmp_path / "run.tif") as found:
        assert found.complete
        assert len(found) == COUNT
        assert found[3].row.circumstances.positions["table.x"] == 103.0
        for read, shot in zip(found, shots, strict=True):
            np.testing.assert_array_equal(read.data, shot.data)


def test_a_stack_that_was_never_closed_has_every_page(tmp_path):
    stack, copy = tmp_path / "run.tif", tmp_path / "copy.tif"
    shots = recorded(stack, before_end=lambda: copy.write_bytes(stack.read_bytes()))
    with tifffile.TiffFile(copy) as file:
        np.testing.assert_array_equal(
            [page.asarray() for page in file.pages], [each.data for each in shots]
        )


def test_a_snap_says_the_same_by_the_same_names(tmp_path):
    path = save_image(on_a_stage(2), tmp_path / "a.tif", axes={"left.x": "um"}, utc=TAKEN)
    found, plane = planes_of(path)
    assert datetime.fromisoformat(found["AcquisitionDate"]) == TAKEN
    assert (plane["DeltaT"], plane["ExposureTime"], plane["PositionX"]) == (0.0, 0.01, 102.0)
    with tifffile.TiffFile(path) as file:
        assert "left.x_um" in file.ome_metadata


@pytest.mark.parametrize("image_format", [ImageFormat.FFV1, ImageFormat.FAST, ImageFormat.SMALL])
def test_a_video_says_when_it_began_and_how_large_a_pixel_is(tmp_path, image_format):
    file = ImageFile(tmp_path / "run", image_format, rate_hz=20.0)
    for number in range(3):
        shot = image(number)
        file.append(shot.data, row_of(shot, TAKEN))
    file.close(complete=True)
    with av.open(str(file.path)) as video:
        found = {name.lower(): text for name, text in video.metadata.items()}
    assert datetime.fromisoformat(found["creation_time"]) == TAKEN
    assert float(found["pixel_size_um"]) == 0.8
    assert found["title"] == "cam"
