"""A GigE Vision camera at full rate: what is lost, and what receiving costs.

Aravis' fake camera sends 1600 x 1200 pixels of 8 bit at 60 Hz over loopback, from a process of its
own; the client is another, once with and once without the privilege to read raw packets
(CAP_NET_RAW). True loss is told by the images: the fake camera's first pixel counts the frames
sent, modulo 255. Both processes share this machine; the camera takes about half a core, and sends
more slowly where it does not get it.
"""

import json
import shutil
import subprocess
import sys
import time
from contextlib import ExitStack

from benchmarks.figures import Figure, main

NAME = "aravis_camera"
PROGRAM = "arv-fake-gv-camera-0.8"
SERIAL = "BENCH"
RATE_HZ = 60.0
NET_RAW = 1 << 13

CLIENT = """
import json, pathlib, resource, sys, time
from dataclasses import replace
from cosmic.vico.hw.aravis import AravisLibrary
from cosmic.vico.hw.interface import FrameStatus, Roi

key, seconds, rate_hz = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
library = AravisLibrary(packet_bytes=8000)
camera = library.open(key)
camera.configure(
    replace(camera.settings, roi=Roi(0, 0, 1600, 1200), rate_hz=rate_hz, exposure_s=0.01)
)
camera.start()
while camera.receive(1.0) is None:
    pass
pixel = None
good = sent = first_id = last_id = 0
began, spent = time.monotonic(), time.process_time()
while time.monotonic() - began < seconds:
    frame = camera.receive(0.5)
    if frame is None or frame.status is not FrameStatus.COMPLETE:
        continue
    now = int(frame.data[0, 0])
    sent += 1 if pixel is None else (now - pixel) % 255
    first_id = frame.frame_id if pixel is None else first_id
    good, pixel, last_id = good + 1, now, frame.frame_id
spent = time.process_time() - spent
duration = time.monotonic() - began
counters = camera.counters
library.close()
status = pathlib.Path("/proc/self/status").read_text().splitlines()
print(json.dumps({
    "good": good, "sent": sent, "reported": last_id - first_id + 1 - good,
    "duration_s": duration, "share": spent / duration, "failed": counters.failed,
    "lost": counters.lost, "underrun": counters.underrun,
    "privileges": int(next(x.split()[1] for x in status if x.startswith("CapEff")), 16),
}))
"""


def client(seconds: float, *, raw: bool) -> dict[str, float]:
    """Run the client, with all privileges that this process has, or without CAP_NET_RAW."""
    less = "-net_raw,-net_admin"
    drop = [] if raw else ["setpriv", "--bounding-set", less, "--inh-caps", less]
    command = [*drop, sys.executable, "-c", CLIENT, f"Aravis-Fake-{SERIAL}"]
    done = subprocess.run(
        [*command, f"{seconds}", f"{RATE_HZ}"], capture_output=True, text=True, check=True
    )
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def figures_of(name: str, found: dict[str, float]) -> list[Figure]:
    """Return what one run showed."""
    # Counted between the first and the last good frame.
    missing = found["sent"] - found["good"]
    wrong = abs(found["reported"] - missing)
    return [
        Figure(NAME, f"{name}: frames received", found["good"] / found["duration_s"], "Hz"),
        Figure(NAME, f"{name}: bad frames", 100.0 * missing / found["sent"], "%", 0.1),
        Figure(NAME, f"{name}: loss reported less true loss", wrong, "frames", 0.0),
        Figure(NAME, f"{name}: failed and lost", found["failed"] + found["lost"], "frames"),
        Figure(NAME, f"{name}: no buffer was free", found["underrun"], "times"),
        Figure(NAME, f"{name}: share of a core", 100.0 * found["share"], "%", 15.0),
    ]


def measure(quick: bool) -> list[Figure]:
    """Return the figures; none where the fake camera is not installed."""
    program = shutil.which(PROGRAM)
    if program is None:
        print(f"{NAME}: {PROGRAM} is not installed (Debian: aravis-tools)", file=sys.stderr)
        return []
    seconds = 2.0 if quick else 60.0
    figures = []
    with ExitStack() as ended:
        camera = ended.enter_context(
            subprocess.Popen(
                [program, "-i", "127.0.0.1", "-s", SERIAL],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        )
        ended.callback(camera.kill)
        time.sleep(0.5)
        with_raw = client(seconds, raw=True)
        if int(with_raw["privileges"]) & NET_RAW:
            figures += figures_of("with CAP_NET_RAW", with_raw)
            without = client(seconds, raw=False) if shutil.which("setpriv") else None
        else:
            without = with_raw
        if without is not None:
            figures += figures_of("without CAP_NET_RAW", without)
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
