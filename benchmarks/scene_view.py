"""Frames per second of the 3D view under software rendering, and of the projections.

A child process paints a generated platform of 28 bodies, all of which move in every frame, on a
virtual display of its own; where there is none, only the projections are measured.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.figures import Figure, main, percentile

NAME = "scene_view"
ROOT = Path(__file__).resolve().parents[1]
FRAMES_PER_S = 20.0
HOVER_MS = 10.0


@contextmanager
def display() -> Iterator[dict[str, str]]:
    """Run a virtual display; gives the environment for programs that are to use it."""
    if shutil.which("Xvfb") is None:
        yield {"QT_QPA_PLATFORM": "offscreen"}
        return
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x900x24"],
        pass_fds=(write,),
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    try:
        with os.fdopen(read) as answer:
            number = answer.readline().strip()
        yield {"QT_QPA_PLATFORM": "xcb", "DISPLAY": f":{number}"}
    finally:
        server.terminate()
        server.wait(10)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    with display() as environment:
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.scene_view_child", "3" if quick else "60"],
            capture_output=True,
            text=True,
            timeout=300,
            check=True,
            cwd=ROOT,
            env=os.environ | environment,
        )
    found = json.loads(done.stdout.splitlines()[-1])
    figures = []
    for name, size in (
        ("gl small", ""),
        ("gl", ""),
        ("gl large", " at 1000x760"),
        ("projections", ""),
    ):
        run = found[name]
        title = f"{run['view']}, {run['triangles']} triangles{size}"
        frame_ms = 1e3 * percentile(run["frames_s"], 50)
        limit = None if name == "projections" else 1e3 / FRAMES_PER_S
        figures.append(Figure(NAME, f"{title}: a frame, p50", frame_ms, "ms", limit))
        figures.append(Figure(NAME, f"{title}: frames", 1e3 / frame_ms, "1/s"))
    ratio = percentile(found["gl"]["frames_s"], 50) / percentile(
        found["projections"]["frames_s"], 50
    )
    hover_ms = 1e3 * percentile(found["gl"]["hover_s"], 99)
    return [
        *figures,
        Figure(NAME, "a frame of the 3D view to one of the projections", ratio, "times"),
        Figure(NAME, "name under the cursor, p99", hover_ms, "ms", HOVER_MS),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
