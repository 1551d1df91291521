"""Programs that are not ours read the images we record: ffprobe, ffmpeg, OpenCV, tifffile."""

import hashlib
import json
import shutil
import subprocess

import cv2
import numpy as np
import pandas as pd
import pytest
import tifffile

from cosmic.frame.failure import FailurePolicy
from cosmic.vico.core.recording.formats import FORMATS, ImageFormat
from cosmic.vico.core.recording.image_recorder import ImageRecorder
from cosmic.vico.core.recording.side_row import COLUMNS
from cosmic.vico.hw.interface import PixelFormat
from system.docs_blocks import ROOT, table_rows
from unit.vico.recording.image_helpers import AXES, image, noise, settings

COUNT, RATE_HZ = 30, 25.0
LOSSLESS_VIDEO = [each for each, found in FORMATS.items() if found.lossless and found.codec]
RAW = {PixelFormat.MONO8: "gray", PixelFormat.RGB8: "rgb24"}
needs_ffmpeg = pytest.mark.skipif(
    shutil.which("ffmpeg") is None or shutil.which("ffprobe") is None,
    reason="ffmpeg and ffprobe are not installed",
)


@pytest.fixture
def recorded(tmp_path):
    def record(image_format, pixel_format=PixelFormat.MONO8, *, width=131, height=77):
        shots = [
            image(
                number,
                noise(pixel_format, width, height, seed=number),
                pixel_format=pixel_format,
                time_s=50.0 + number / RATE_HZ,
            )
            for number in range(COUNT)
        ]
        how = settings(pixel_format, width, height, RATE_HZ)
        recorder = ImageRecorder(tmp_path / "run", image_format, how, FailurePolicy(), axes=AXES)
        recorder.start()
        for shot in shots:
            assert recorder.put(shot)
        recorder.request_end()
        assert recorder.join()
        return recorder.path, [shot.data for shot in shots]

    return record


def run(*command):
    return subprocess.run(command, capture_output=True, check=True, timeout=60).stdout


@needs_ffmpeg
@pytest.mark.parametrize("image_format", [*LOSSLESS_VIDEO, ImageFormat.SMALL])
def test_ffprobe_counts_every_image_with_its_time(recorded, image_format):
    path, _ = recorded(image_format)
    entries = "stream=codec_name,width,height,nb_read_frames:frame=pts_time"
    command = ["-v", "error", "-count_frames", "-show_entries", entries, "-of", "json"]
    said = json.loads(run("ffprobe", *command, str(path)))
    (stream,) = said["streams"]
    assert stream["codec_name"] == FORMATS[image_format].codec
    assert (stream["width"], stream["height"]) == (131, 77)
    assert int(stream["nb_read_frames"]) == COUNT
    times_s = [float(each["pts_time"]) for each in said["frames"]]
    assert times_s == pytest.approx([number / RATE_HZ for number in range(COUNT)], abs=0.001)


@needs_ffmpeg
@pytest.mark.parametrize(
    "pixel_format", [PixelFormat.MONO8, PixelFormat.MONO12, PixelFormat.MONO16, PixelFormat.RGB8]
)
@pytest.mark.parametrize("image_format", LOSSLESS_VIDEO)
def test_ffmpeg_decodes_the_very_bytes_that_went_in(recorded, image_format, pixel_format):
    path, went_in = recorded(image_format, pixel_format)
    raw = RAW.get(pixel_format, "gray16le")
    command = ["-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", raw, "-"]
    came_out = run("ffmpeg", *command)
    expected = b"".join(data.astype(data.dtype.newbyteorder("<")).tobytes() for data in went_in)
    assert hashlib.md5(came_out).digest() == hashlib.md5(expected).digest()


@pytest.mark.parametrize("image_format", LOSSLESS_VIDEO)
def test_opencv_reads_the_same_pixels(recorded, image_format):
    path, went_in = recorded(image_format)
    video = cv2.VideoCapture(str(path))
    try:
        assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(RATE_HZ, rel=0.05)
        for data in went_in:
            there, read = video.read()
            assert there
            np.testing.assert_array_equal(read[:, :, 1], data)
        assert not video.read()[0]
    finally:
        video.release()


@pytest.mark.parametrize("pixel_format", PixelFormat)
def test_tifffile_reads_a_sequence_with_its_scale(recorded, pixel_format):
    path, went_in = recorded(ImageFormat.TIFF, pixel_format)
    stack = tifffile.TiffSequence(str(path / "*.tif")).asarray()
    np.testing.assert_array_equal(stack, np.stack(went_in))
    with tifffile.TiffFile(path / "run_000003.tif") as file:
        assert 'PhysicalSizeX="0.8"' in file.ome_metadata


@pytest.mark.parametrize("pixel_format", [PixelFormat.MONO8, PixelFormat.MONO16])
def test_opencv_reads_a_sequence_of_png(recorded, pixel_format):
    path, went_in = recorded(ImageFormat.PNG, pixel_format)
    files = sorted(path.iterdir())
    assert len(files) == COUNT
    for file, data in zip(files, went_in, strict=True):
        np.testing.assert_array_equal(cv2.imread(str(file), cv2.IMREAD_UNCHANGED), data)


def test_pandas_reads_the_side_file_without_losing_a_digit(recorded):
    path, _ = recorded(ImageFormat.FFV1)
    table = pd.read_csv(path.with_suffix(".csv"))
    there = table[table["index"] >= 0]
    assert there["frame_id"].tolist() == list(range(COUNT))
    assert there["device_ns"].tolist() == [2**61 + 50_000_000 * n for n in range(COUNT)]
    assert there["time_s"].tolist() == [50.0 + n / RATE_HZ for n in range(COUNT)]
    assert there["left.x_um"].iloc[3] == 13.0
    assert pd.to_datetime(there["utc"]).is_monotonic_increasing
    assert table["status"].iloc[-1] == "end"


def test_the_page_of_the_reference_lists_every_format_and_column():
    listed = [row[0].strip("`") for row in table_rows(ROOT / "docs/reference/image-recording.md")]
    assert listed[1 : 1 + len(ImageFormat)] == [each.value for each in ImageFormat]
    first = listed.index(COLUMNS[0])
    assert tuple(listed[first : first + len(COLUMNS)]) == COLUMNS
