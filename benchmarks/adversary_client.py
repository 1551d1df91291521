"""The client of `benchmarks.adversary`: hostile commands by way of a station."""

import os
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import cosmic
from benchmarks.adversary_attacks import AxisAttack
from benchmarks.adversary_images import ImageAttack
from cosmic.frame.errors import CosmicError


def connected(endpoint: str) -> cosmic.Rig:
    """Connect to a station that may be too busy to answer at once."""
    for _ in range(20):
        with suppress(CosmicError):
            return cosmic.connect(stations={"fiberstation": endpoint})
    return cosmic.connect(stations={"fiberstation": endpoint})


IMAGES = 0.1
"""So much of what it does goes to ViCo."""


def main(endpoint: str, seed: str, folder: str) -> None:
    """Attack until standard input is closed."""
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    with connected(endpoint) as rig:
        attack = AxisAttack(rig, int(seed) + 1, "station")
        images = ImageAttack(rig, int(seed) + 1, Path(folder), "station, images")
        sent_s = 0.0
        while not ended.is_set():
            if attack.calls % 20 == 0:
                with suppress(CosmicError):
                    rig.take_control()
            (images if attack.chance.random() < IMAGES else attack).act()
            if time.monotonic() - sent_s > 0.1:
                sent_s = time.monotonic()
                print(f"calls {attack.calls} {images.calls}", flush=True)
            if attack.chance.random() < 0.02:
                with suppress(CosmicError):
                    rig.release_control()
        print(f"calls {attack.calls} {images.calls}", flush=True)
        for line in attack.raw + images.raw:
            print(line, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
