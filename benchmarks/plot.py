"""Refresh of the plotter with 32 channels at 15 kHz, and pyqtgraph's own way in the same run.

A refresh is everything the window does for it: take the chunks, scale them, put them into the
history, paint the new columns and show them. A child process on a virtual display measures it,
one refresh after the other, each with the samples of 1/60 s.
"""

import json
import os
import subprocess
import sys

from benchmarks.figures import Figure, main, percentile
from benchmarks.scene_view import ROOT, display

NAME = "plot"
MEDIAN_MS, P99_MS, ZOOM_MS = 4.0, 8.0, 100.0
LEAST_RATIO = 30.0


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    with display() as environment:
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.plot_child", "10" if quick else "600"],
            capture_output=True,
            text=True,
            timeout=500,
            check=True,
            cwd=ROOT,
            env=os.environ | environment,
        )
    found = json.loads(done.stdout.splitlines()[-1])
    figures = []
    for span, run in found.items():
        ours, theirs = run["refresh_s"], run["peak_s"]
        middle_ms = 1e3 * percentile(ours, 50)
        theirs_ms = 1e3 * percentile(theirs, 50)
        paints = run["paints"] / len(ours)
        zoom_ms = 1e3 * max(run["zoom_s"])
        missed = run["spikes"] - run["spikes_seen"]
        figures += [
            Figure(NAME, f"{span}: refresh, p50", middle_ms, "ms", MEDIAN_MS),
            Figure(NAME, f"{span}: refresh, p99", 1e3 * percentile(ours, 99), "ms", P99_MS),
            Figure(NAME, f"{span}: processor time, p50", 1e3 * percentile(run["cpu_s"], 50), "ms"),
            Figure(NAME, f"{span}: paints of a refresh", paints, "times", 1.1),
            Figure(NAME, f"{span}: pyqtgraph with peaks, p50", theirs_ms, "ms"),
            # Figures are met from above, so the ratio stands upside down.
            Figure(NAME, f"{span}: our time to theirs", middle_ms / theirs_ms, "", 1 / LEAST_RATIO),
            Figure(NAME, f"{span}: redraw after a zoom, slowest", zoom_ms, "ms", ZOOM_MS),
            Figure(NAME, f"{span}: spikes of one sample not seen", missed, "", 0.0),
        ]
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
