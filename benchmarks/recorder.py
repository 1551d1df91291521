"""Recordings: how fast they are written beside the same bytes written raw, and what they cost.

Raw is one unbuffered write a chunk into the same directory, in turn with the recording, so
that both meet the same machine; the disk's cache is emptied before each. The share
of the processor is that of the recorder's thread and of a loop that hands over chunks of 10 ms, at
32 channels x 15 kHz.
"""

import os
import statistics
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure, main, percentile
from cosmic.daqco.api.export import export_file
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.file_writer import UDaqFileWriter
from cosmic.daqco.core.recording_format import RecordingHeader
from cosmic.daqco.core.scale import VOLTS
from cosmic.daqco.core.settings import ChannelSettings
from cosmic.frame.failure import FailurePolicy

NAME = "recorder"
CHANNELS, RATE_HZ, CHUNK = 32, 15_000.0, 150
# Without chunks that wait, a thread that hands over and one that writes would wait by turns.
WAITING = 30_000


def header(rate_hz: float = RATE_HZ) -> RecordingHeader:
    """Return what is recorded."""
    channels = tuple(
        ChannelSettings(name=f"c{number}", board="Dev1", input=f"ai{number}")
        for number in range(CHANNELS)
    )
    return RecordingHeader(
        rate_hz=rate_hz,
        channels=channels,
        scales=(VOLTS,) * CHANNELS,
        start_utc=datetime.now(UTC),
        start_s=0.0,
    )


def signals() -> list[np.ndarray]:
    """Return chunks of noise as a 16-bit board gives it."""
    rng = np.random.default_rng(0)
    counts = [np.round(rng.normal(0.0, 1000.0, (CHANNELS, CHUNK))) for _ in range(64)]
    return [each * (10.0 / 32768.0) for each in counts]


def chunk(head: RecordingHeader, volts: np.ndarray, number: int) -> DataChunk:
    """Return one chunk."""
    first = number * CHUNK
    return DataChunk(first, first / head.rate_hz, head.rate_hz, head.names, volts, head.scales)


def raw_s(folder: Path, parts: list[np.ndarray], count: int) -> float:
    """Return the time of writing as many bytes as a recording of `count` chunks has.

    It has the volts, the physical values, and a time of each sample.
    """
    path = folder / "raw"
    times = np.zeros(CHUNK)
    os.sync()
    began = time.perf_counter()
    with path.open("wb", buffering=0) as file:
        for number in range(count):
            part = parts[number % len(parts)]
            file.write(part)
            file.write(part)
            file.write(times)
    spent = time.perf_counter() - began
    path.unlink()
    return spent


def recorded_s(folder: Path, parts: list[np.ndarray], count: int) -> float:
    """Return the time of recording `count` chunks as fast as it goes, closing included."""
    head = header()
    path = folder / "run.h5"
    chunks = [chunk(head, parts[number % len(parts)], number) for number in range(count)]
    os.sync()
    began = time.perf_counter()
    writer = UDaqFileWriter(path, head, FailurePolicy())
    writer.start()
    for each in chunks:
        while writer.backlog > WAITING:
            time.sleep(0.0002)
        writer.put(each)
    writer.request_end()
    writer.join(60.0)
    spent = time.perf_counter() - began
    with open_recording(path) as found:
        if writer.error is not None or found.samples != count * CHUNK or found.overruns:
            raise RuntimeError(f"samples were lost: {writer.error}")
    path.unlink()
    return spent


def throughput(folder: Path, seconds: float, runs: int) -> list[Figure]:
    """Compare a recording with raw writing, taking turns."""
    parts, count = signals(), round(seconds * RATE_HZ / CHUNK)
    megabytes = count * CHUNK * (2 * CHANNELS + 1) * 8 / 1e6
    raw, recorded = [], []
    raw_s(folder, parts, count)
    for _ in range(runs):
        raw.append(raw_s(folder, parts, count))
        recorded.append(recorded_s(folder, parts, count))
    slower = [one / other for one, other in zip(recorded, raw, strict=True)]
    return [
        Figure(NAME, "raw writing", megabytes / statistics.median(raw), "MB/s"),
        Figure(NAME, "recording", megabytes / statistics.median(recorded), "MB/s"),
        Figure(NAME, "recording slower than raw, times", statistics.median(slower), "", 2.5),
        Figure(
            NAME,
            "recording, times the rate of 32 x 15 kHz",
            seconds / statistics.median(recorded),
            "",
        ),
    ]


def real_time(folder: Path, seconds: float) -> list[Figure]:
    """Record at the pace of a board."""
    parts, count, head = signals(), round(seconds * RATE_HZ / CHUNK), header()
    path = folder / "run.h5"
    writer = UDaqFileWriter(path, head, FailurePolicy())
    writer.start()
    puts, most = [], 0
    began, cpu = time.perf_counter(), time.process_time()
    for number in range(count):
        each = chunk(head, parts[number % len(parts)], number)
        time.sleep(max(0.0, began + number * CHUNK / RATE_HZ - time.perf_counter()))
        asked = time.perf_counter()
        writer.put(each)
        puts.append(1e6 * (time.perf_counter() - asked))
        most = max(most, writer.backlog)
    spent = time.process_time() - cpu
    writer.request_end()
    writer.join(60.0)
    figures = [
        Figure(NAME, "32 x 15 kHz: share of a core", 100.0 * spent / seconds, "%", 8.0),
        Figure(NAME, "32 x 15 kHz: put, p50", percentile(puts, 50), "us"),
        Figure(NAME, "32 x 15 kHz: put, p99", percentile(puts, 99), "us"),
        Figure(NAME, "32 x 15 kHz: most waiting", 1e3 * most / RATE_HZ, "ms"),
        Figure(NAME, "32 x 15 kHz: samples lost", count * CHUNK - written(path), "", 0.0),
        *reading(path, seconds),
    ]
    path.unlink()
    return figures


def written(path: Path) -> int:
    """Return how many samples are in a file."""
    with open_recording(path) as found:
        return found.samples


def reading(path: Path, seconds: float) -> list[Figure]:
    """Read one channel of a recording, and export it."""
    began = time.perf_counter()
    with open_recording(path) as found:
        found.values("c7")
    read = time.perf_counter() - began
    figures = [
        Figure(NAME, "reading one of 32 channels, a minute of it", 60e3 * read / seconds, "ms")
    ]
    for to in ("csv", "tdms"):
        began = time.perf_counter()
        size = export_file(path, to).stat().st_size
        spent = time.perf_counter() - began
        figures.append(Figure(NAME, f"export to {to}, of real time", 100.0 * spent / seconds, "%"))
        figures.append(Figure(NAME, f"export to {to}", size / 1e6 / spent, "MB/s"))
    return figures


def measure(quick: bool) -> list[Figure]:
    """Return all figures."""
    # Where the temporary directory is in memory, name another.
    home = os.environ.get("COSMIC_BENCHMARK_DIRECTORY")
    with tempfile.TemporaryDirectory(dir=home) as name:
        folder = Path(name)
        return [
            *throughput(folder, 1.0 if quick else 60.0, 1 if quick else 5),
            *real_time(folder, 1.0 if quick else 20.0),
        ]


if __name__ == "__main__":
    main(__doc__, measure)
