"""Every lossless format gives back the pixels that went in; others come close."""

import csv

import numpy as np
import pytest

from cosmic.frame.errors import RecordingError
from cosmic.vico.core.recording.formats import FORMATS, ImageFormat
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.hw.interface import PixelFormat
from unit.vico.recording.image_helpers import AXES, image, images, noise

LOSSLESS = [each for each, traits in FORMATS.items() if traits.lossless]
SIZES = [(1, 1), (2, 3), (37, 23), (64, 48), (129, 17)]


def record(path, image_format, shots, *, complete=True, **how):
    how = {"axes": AXES, "rate_hz": 20.0, **how}
    file = ImageFile(path, image_format, **how)
    try:
        for shot in shots:
            file.append(shot.data, row_of(shot, None))
    finally:
        file.close(complete=complete)
    return file


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("pixel_format", PixelFormat)
@pytest.mark.parametrize("image_format", LOSSLESS)
def test_lossless_formats_give_back_every_bit_at_odd_sizes_too(
    tmp_path, image_format, pixel_format, size
):
    width, height = size
    went_in = [noise(pixel_format, width, height, seed) for seed in range(3)]
    shots = [image(number, data, pixel_format=pixel_format) for number, data in enumerate(went_in)]
    file = record(tmp_path / "run", image_format, shots)
    with open_image_recording(file.path) as found:
        assert found.complete
        assert found.pixel_format == pixel_format
        assert len(found) == 3
        for data, read in zip(went_in, found, strict=True):
            assert read.data.dtype == data.dtype
            np.testing.assert_array_equal(read.data, data)


@pytest.mark.parametrize("pixel_format", [PixelFormat.MONO8, PixelFormat.RGB8])
def test_the_small_format_comes_close_and_is_small(tmp_path, pixel_format):
    layers = 3 if pixel_format is PixelFormat.RGB8 else 1
    slope = np.linspace(0.0, 255.0, 321 * 241 * layers).astype(np.uint8)
    data = slope.reshape((241, 321, 3) if layers == 3 else (241, 321))
    shots = [image(n, data, pixel_format=pixel_format) for n in range(4)]
    file = record(tmp_path / "run", ImageFormat.SMALL, shots)
    assert file.path.stat().st_size < 4 * data.nbytes / 5
    with open_image_recording(file.path) as found:
        for read in found:
            assert read.data.shape == data.shape
            difference = np.abs(read.data.astype(int) - data)
            assert difference.mean() < 2.0
            assert difference.max() < 20


def test_images_that_threads_hold_back_are_written_at_the_end(tmp_path):
    shots = [image(number, time_s=number / 200.0) for number in range(5)]
    file = record(tmp_path / "run", ImageFormat.FAST, shots, rate_hz=200.0)
    with open_image_recording(file.path) as found:
        for shot, read in zip(shots, found, strict=True):
            np.testing.assert_array_equal(read.data, shot.data)


def test_the_small_format_refuses_deep_pixels(tmp_path):
    with pytest.raises(RecordingError, match="small cannot keep Mono12"):
        record(tmp_path / "run", ImageFormat.SMALL, images(1, pixel_format=PixelFormat.MONO12))


@pytest.mark.parametrize("image_format", ImageFormat)
def test_images_are_found_by_their_number_in_any_order(tmp_path, image_format):
    shots = list(images(12))
    file = record(tmp_path / "run", image_format, shots)
    with open_image_recording(file.path) as found:
        in_turn = [each.data for each in found]
        for index in (7, 8, 0, 11, 3, 3, 2, 10):
            read = found[index]
            assert read.row.frame_id == index
            np.testing.assert_array_equal(read.data, in_turn[index])
        for index in (12, -1):
            with pytest.raises(IndexError, match="0 to 11"):
                found[index]


@pytest.mark.parametrize("image_format", [ImageFormat.FFV1, ImageFormat.FAST])
def test_times_that_stand_still_or_jump_lose_no_image(tmp_path, image_format):
    times = [5.0, 5.0, 5.0001, 5.4, 4.0, 3605.0]
    shots = [image(n, time_s=time_s) for n, time_s in enumerate(times)]
    file = record(tmp_path / "run", image_format, shots)
    with open_image_recording(file.path) as found:
        assert found.time_s.tolist() == times
        for index in (5, 2, 0, 4):
            np.testing.assert_array_equal(found[index].data, shots[index].data)


def test_what_stands_beside_an_image_comes_back_exactly(tmp_path):
    shots = [image(0, device_ns=None), image(1, lost_before=3), image(2, scale_um_px=None)]
    file = record(tmp_path / "run", ImageFormat.FFV1, shots)
    with open_image_recording(tmp_path / "run.csv") as found:
        assert found.path == file.path
        assert found.camera == "cam"
        assert found.lost == 3
        assert found.axes == AXES
        for shot, read in zip(shots, found, strict=True):
            row = read.row
            assert (row.frame_id, row.device_ns) == (shot.frame.frame_id, shot.frame.device_ns)
            assert (row.time_s, row.exposed_s) == (shot.frame.time_s, shot.frame.exposed_s)
            assert row.circumstances == shot.circumstances


def test_the_side_file_names_the_unit_of_every_axis(tmp_path):
    record(tmp_path / "run", ImageFormat.FFV1, images(2))
    with (tmp_path / "run.csv").open(newline="") as file:
        first, second, end = csv.DictReader(file)
    assert (first["left.x_um"], first["table.rotation_deg"]) == ("10.0", "-1.5")
    assert (first["index"], second["index"], end["index"]) == ("0", "1", "-1")
    assert (first["status"], end["status"]) == ("complete", "end")
    assert (first["exposure_s"], first["zoom_counts"], first["focus_counts"]) == (
        "0.01",
        "1200.0",
        "",
    )
    assert first["scale_um_px"] == "0.8"


def test_an_axis_of_unknown_unit_is_recorded_without_one(tmp_path):
    file = ImageFile(tmp_path / "run", ImageFormat.FFV1, axes={"probe.z": "um"})
    file.append(noise(), row_of(image(), None))
    file.close(complete=True)
    with open_image_recording(file.path) as found:
        assert found.axes == {"probe.z": "um", "left.x": "", "table.rotation": ""}
        assert found[0].row.circumstances.positions == image().circumstances.positions
