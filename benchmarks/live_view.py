"""The live view at 1600x1200, and a bare label with a pixmap in the same run.

A child process on a virtual display shows images of a fibre, first one after the other, then 30
a second with histogram, settings and all readings. Processor time is that of the whole process:
Qt paints with threads of its own. What the camera itself costs is not in it.
"""

import json
import os
import subprocess
import sys

from benchmarks.figures import Figure, main, percentile
from benchmarks.scene_view import ROOT, display

NAME = "live_view"
SHARE_PERCENT = 40.0
FRAME_MS = 1000.0 / 30.0 * SHARE_PERCENT / 100.0


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    count, seconds = ("5", "0.5") if quick else ("200", "10")
    with display() as environment:
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.live_view_child", count, seconds],
            capture_output=True,
            text=True,
            timeout=300,
            check=True,
            cwd=ROOT,
            env=os.environ | environment,
        )
    found = json.loads(done.stdout.splitlines()[-1])
    label_ms = 1e3 * percentile(found["label_s"], 50)
    figures = [Figure(NAME, "label with a pixmap: an image, p50", label_ms, "ms")]
    for key, name in (
        ("bare_s", "without findings"),
        ("full_s", "fibre and crosshair over it"),
        ("deep_s", "Mono12, fibre and crosshair"),
    ):
        times = found[key]
        middle_ms = 1e3 * percentile(times, 50)
        figures += [
            Figure(NAME, f"{name}: an image, p50", middle_ms, "ms", FRAME_MS),
            Figure(NAME, f"{name}: an image, p95", 1e3 * percentile(times, 95), "ms"),
            Figure(NAME, f"{name}: times the label", middle_ms / label_ms, ""),
        ]
    live = found["live"]
    missed = 100.0 * (1.0 - live["drawn_hz"] / live["came_hz"])
    return [
        *figures,
        Figure(NAME, "30 images a second: share of a core", 1e2 * live["share"], "%", 40.0),
        Figure(NAME, "30 images a second: not drawn", max(0.0, missed), "%", 5.0),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
