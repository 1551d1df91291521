"""Recordings of images: how fast, at what cost of the processor, and whether all comes back.

Images of 1600 x 1200 px with an uneven ground and noise of sigma 2.5 go through the whole
recorder as fast as it takes them; the side file is written as well. The time includes closing the
file; the processor's is that of the whole process, the loop that hands over and listens included.
Reading the file again, which compares every pixel, is not counted. Raw is one unbuffered write a
image into the same directory, and the bare codec is PyAV's own loop without a thread or a side
file, both in turn with the recording. At the end images come three times
as fast as FFV1 can take them, with a queue of 64 MB.
"""

import os
import shutil
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import av
import numpy as np

from benchmarks.figures import Figure, main
from cosmic.frame.failure import FailurePolicy
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.recording.formats import FORMATS, ImageFormat, Traits
from cosmic.vico.core.recording.image_recorder import ImageRecorder
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.hw.interface import CameraSettings, Frame, Roi

NAME = "image_recorder"
WIDTH, HEIGHT, RATE_HZ, SIGMA = 1600, 1200, 60.0, 2.5
SEEDS = 8
WAITING = 12
# Frames a second that issue 5 asks for.
WANTED = {ImageFormat.FFV1: 50.0, ImageFormat.FAST: 200.0}
SETTINGS = CameraSettings(0.001, 0.0, RATE_HZ, Roi(0, 0, WIDTH, HEIGHT))
AXES = {f"{stage}.{axis}": "um" for stage in ("left", "right") for axis in "xyz"}


def frames() -> list[np.ndarray]:
    """Return images of noise on an uneven ground."""
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-1, 1, WIDTH), np.linspace(-1, 1, HEIGHT))
    ground = 150.0 - 30.0 * (x * x + y * y)
    found = []
    for _ in range(SEEDS):
        noisy = np.rint(ground + rng.normal(0.0, SIGMA, ground.shape))
        found.append(np.clip(noisy, 0, 255).astype(np.uint8))
        found[-1].flags.writeable = False
    return found


def image(data: np.ndarray, number: int, rate_hz: float = RATE_HZ) -> CameraImage:
    """Return one image."""
    time_s = number / rate_hz
    around = Circumstances(0.01, 0.0, 1.0, 2.0, 50.0, 0.5, dict.fromkeys(AXES, 1.25))
    return CameraImage("bench", Frame(data, number, time_s, time_s - 0.01, number), around)


def size_of(path: Path) -> int:
    """Return the bytes of a file, or of all in a directory."""
    files = path.iterdir() if path.is_dir() else [path]
    return sum(each.stat().st_size for each in files)


def remove(path: Path) -> None:
    """Take a recording away."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    path.with_suffix(".csv").unlink()


def raw_s(folder: Path, parts: list[np.ndarray], count: int) -> float:
    """Return the time of writing the bytes of `count` images."""
    path = folder / "raw"
    os.sync()
    began = time.perf_counter()
    with path.open("wb", buffering=0) as file:
        for number in range(count):
            file.write(parts[number % SEEDS])
    spent = time.perf_counter() - began
    path.unlink()
    return spent


def bare_s(folder: Path, parts: list[np.ndarray], count: int, found: Traits) -> float:
    """Return the time of PyAV's own loop with the same codec, without anything of ours."""
    os.sync()
    began = time.perf_counter()
    with av.open(str(folder / f"bare{found.suffix}"), "w", format=found.container) as container:
        stream = container.add_stream(found.codec, rate=60, options=dict(found.options or {}))
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = "gray"
        stream.codec_context.thread_type = found.threads
        stream.codec_context.thread_count = 2
        for number in range(count):
            frame = av.VideoFrame.from_ndarray(parts[number % SEEDS], format="gray")
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    spent = time.perf_counter() - began
    (folder / f"bare{found.suffix}").unlink()
    return spent


def recorded(
    folder: Path, parts: list[np.ndarray], count: int, image_format: ImageFormat
) -> tuple[float, float, float, bool]:
    """Return seconds, seconds of the processor, share of the raw size, and whether it is exact."""
    os.sync()
    began, cpu = time.perf_counter(), time.process_time()
    settings = replace(SETTINGS, rate_hz=WANTED.get(image_format, RATE_HZ))
    recorder = ImageRecorder(folder / "run", image_format, settings, FailurePolicy(), axes=AXES)
    recorder.start()
    for number in range(count):
        while recorder.stats.waiting > WAITING:
            time.sleep(0.002)
        recorder.put(image(parts[number % SEEDS], number))
    recorder.request_end()
    recorder.join(120.0)
    spent, cpu = time.perf_counter() - began, time.process_time() - cpu
    if recorder.error is not None or recorder.stats.written != count:
        raise RuntimeError(f"images were lost: {recorder.error or recorder.stats}")
    share = size_of(recorder.path) / (count * parts[0].nbytes)
    with open_image_recording(recorder.path) as found:
        same = [np.array_equal(each.data, parts[each.index % SEEDS]) for each in found]
    remove(recorder.path)
    return spent, cpu, share, len(same) == count and all(same)


def throughput(
    folder: Path, parts: list[np.ndarray], image_format: ImageFormat, count: int, runs: int
) -> list[Figure]:
    """Compare one format with raw writing, taking turns."""
    raw, bare, found = [], [], []
    traits = FORMATS[image_format]
    for _ in range(runs):
        if image_format in WANTED:
            bare.append(bare_s(folder, parts, count, traits) / count)
        raw.append(raw_s(folder, parts, count) / count)
        found.append(recorded(folder, parts, count, image_format))
    spent = [each[0] / count for each in found]
    wanted = WANTED.get(image_format)
    title = image_format.value
    figures = [
        Figure(NAME, f"{title}: images a second", 1.0 / statistics.median(spent), "1/s"),
        Figure(
            NAME,
            f"{title}: an image",
            1e3 * statistics.median(spent),
            "ms",
            1e3 / wanted if wanted else None,
            1e3 * min(spent),
            1e3 * max(spent),
        ),
        Figure(
            NAME,
            f"{title}: processor, an image",
            1e3 * statistics.median(each[1] / count for each in found),
            "ms",
        ),
        Figure(
            NAME,
            f"{title}: slower than raw, times",
            statistics.median(one / other for one, other in zip(spent, raw, strict=True)),
            "",
        ),
        Figure(NAME, f"{title}: size, of raw", 100.0 * found[0][2], "%"),
    ]
    if bare:
        slower = statistics.median(one / other for one, other in zip(spent, bare, strict=True))
        figures.append(Figure(NAME, f"{title}: slower than the bare codec, times", slower, ""))
    if traits.lossless:
        wrong = sum(not each[3] for each in found)
        figures.append(Figure(NAME, f"{title}: recordings not bit-exact", wrong, "", 0.0))
    return figures


def overload(folder: Path, parts: list[np.ndarray], seconds: float) -> list[Figure]:
    """Hand over more than can be written."""
    recorder = ImageRecorder(
        folder / "run",
        ImageFormat.FFV1,
        SETTINGS,
        FailurePolicy(),
        axes=AXES,
        queue_bytes=64 * 1024 * 1024,
    )
    recorder.start()
    rate_hz, began, longest = 3.0 * WANTED[ImageFormat.FFV1], time.perf_counter(), 0.0
    count = round(seconds * rate_hz)
    for number in range(count):
        time.sleep(max(0.0, began + number / rate_hz - time.perf_counter()))
        asked = time.thread_time()
        recorder.put(image(parts[number % SEEDS], number, rate_hz))
        longest = max(longest, time.thread_time() - asked)
    recorder.request_end()
    recorder.join(120.0)
    stats = recorder.stats
    with open_image_recording(recorder.path) as found:
        listed = sum(row.status == "dropped" for row in found.rows)
        wrong = sum(
            not np.array_equal(p.data, parts[p.row.frame_id % SEEDS]) for p in found if p.row
        )
    remove(recorder.path)
    return [
        Figure(NAME, "overload: images dropped", 100.0 * stats.dropped / count, "%"),
        Figure(
            NAME,
            "overload: images neither written nor told as dropped",
            abs(count - stats.written - stats.dropped) + abs(stats.dropped - listed),
            "",
            0.0,
        ),
        Figure(NAME, "overload: images with a wrong row", wrong, "", 0.0),
        Figure(NAME, "overload: longest put, processor", 1e3 * longest, "ms"),
    ]


def measure(quick: bool) -> list[Figure]:
    """Return all figures."""
    home = os.environ.get("COSMIC_BENCHMARK_DIRECTORY")
    parts = frames()
    counts = {
        ImageFormat.FFV1: 300,
        ImageFormat.FAST: 600,
        ImageFormat.SMALL: 300,
        ImageFormat.TIFF: 200,
        ImageFormat.PNG: 40,
    }
    with tempfile.TemporaryDirectory(dir=home) as name:
        folder = Path(name)
        found = [
            figure
            for image_format, count in counts.items()
            for figure in throughput(
                folder, parts, image_format, 10 if quick else count, 1 if quick else 3
            )
        ]
        return found + overload(folder, parts, 0.5 if quick else 4.0)


if __name__ == "__main__":
    main(__doc__, measure)
