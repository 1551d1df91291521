"""Records images of noise until it is killed; says how many are in the file, a line each."""

import sys
from pathlib import Path

import numpy as np

from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy
from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_recorder import ImageRecorder
from unit.vico.recording.image_helpers import AXES, image, noise, settings

RATE_HZ = 40.0


def main(path: str, image_format: str) -> None:
    size = {"width": 160, "height": 120}
    recorder = ImageRecorder(
        Path(path),
        ImageFormat(image_format),
        settings(**size, rate_hz=RATE_HZ),
        FailurePolicy(),
        axes=AXES,
    )
    recorder.start()
    shots = [noise(**size, seed=seed) for seed in range(8)]
    began_s = WALL.now_s()
    for number in range(10_000):
        time_s = WALL.now_s()
        recorder.put(image(number, np.asarray(shots[number % 8]), time_s=time_s))
        sys.stdout.write(f"{number} {time_s - began_s:.3f}\n")
        sys.stdout.flush()
        WALL.sleep(max(0.0, began_s + (number + 1) / RATE_HZ - WALL.now_s()))


if __name__ == "__main__":
    main(*sys.argv[1:])
