"""The twin's image: what one frame of 1600 x 1200 costs, beside drawing it plainly.

Naive is a frame of fibres and probe alone, without dust or uneven light, as one would draw it
first: lines and a rectangle, the whole frame blurred for each height, fresh noise everywhere.
Times are those of the processor, for the drawing thread and the threads of OpenCV. "Standing":
nothing moves. "Moving": the probe goes through the image and bends the held fibre. "Everything":
the table turns as well, so that nothing can be kept.
"""

import math
import time
from collections.abc import Callable

import cv2
import numpy as np

from benchmarks.figures import Figure, main, percentile
from cosmic.frame.clock import ManualClock
from cosmic.twin.lens import LensAxisName
from cosmic.twin.optics.optics import Optics
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings

NAME = "twin_image"
PERIOD_S = 1.0 / 15.0
MAGNIFICATIONS = (0.58, 2.0, 5.0)
TARGET_MS = 15.0


class Set:
    """The shipped scene with the held fibre before the microscope, and the probe beside it."""

    def __init__(self) -> None:
        self.scene = Scene.from_settings(shipped_settings(), ManualClock())
        assert self.scene.optics is not None
        assert self.scene.lens is not None
        self.optics: Optics = self.scene.optics
        self.lens = self.scene.lens
        self.now_s = 0.0
        for name, place in {"left.z": -810.0, "left.x": 3000.0, "probe.x": -500.0}.items():
            self.move(name, place, 2000.0)
        self.move("probe.y", -4950.0, 5000.0)

    def move(self, name: str, place: float, speed: float, *, wait: bool = True) -> float:
        """Start a stage, wait for it if told so, and return when it arrives."""
        stage = self.scene.stages[name]
        route = stage.route(self.now_s)
        route.go(place, speed)
        stage.follow(route, held_until_s=1e9)
        if wait:
            self.now_s = route.end_s + 0.01
        return route.end_s

    def look(self, magnification: float, focus_um: float) -> None:
        """Set zoom and focus."""
        view = self.optics.settings.views["microscope"]
        low, high = view.magnification_low, view.magnification_high
        zoom = math.log(magnification / low) / math.log(high / low)
        focus = (focus_um - view.focus_low_um) / (view.focus_high_um - view.focus_low_um)
        ends: tuple[tuple[LensAxisName, float, float], ...] = (
            ("zoom", zoom, self.lens.zoom_range_counts[1]),
            ("focus", focus, self.lens.focus_range_counts[1]),
        )
        for axis, part, highest in ends:
            there = self.lens.position_counts(axis, self.now_s)
            self.lens.turn_by_hand(axis, part * highest - there, self.now_s)

    def frames_ms(self, count: int, before: Callable[[], None] | None = None) -> list[float]:
        """Return the processor's time for each of the next frames."""
        spent = []
        for _ in range(count):
            self.now_s += PERIOD_S
            if before is not None:
                before()
            began = time.process_time()
            self.optics.render(self.now_s)
            spent.append(1e3 * (time.process_time() - began))
        return spent


def naive_ms(stage: Set, count: int) -> list[float]:
    """Return the time of drawing fibres and probe plainly, blurring and noise all over."""
    rng = np.random.default_rng(0)
    size = stage.optics.sensor_px
    spent = []
    for _ in range(count):
        stage.now_s += PERIOD_S
        lines = stage.optics.centre_lines_um(stage.now_s)
        view = stage.optics.projection(stage.now_s)
        tip = stage.scene.tips(stage.now_s)["probe"]
        began = time.process_time()
        image = np.full(size[::-1], 150.0, np.float32)
        for height in (0.0, 700.0):
            for line in lines:
                if (line[0, 2] > 300.0) == (height > 300.0):
                    points = [np.round(view.image_px(line) * 16).astype(np.int32)]
                    wide = max(1, round(34.0 * view.px_um))
                    cv2.polylines(image, points, False, 80.0, wide, cv2.LINE_AA, 4)
            image = cv2.GaussianBlur(image, (0, 0), view.sigma_px(height))
        x, y = np.round(view.image_px(np.array([tip]))[0]).astype(int).tolist()
        half = round(25.0 * view.px_um)
        cv2.rectangle(image, (x - half, 0), (x + half, y), 40.0, -1)
        image += rng.normal(0.0, 1.5, image.shape)
        np.clip(np.rint(image), 0, 255).astype(np.uint8)
        spent.append(1e3 * (time.process_time() - began))
    return spent


def at_zoom(magnification: float, count: int) -> list[Figure]:
    """Measure one zoom."""
    stage = Set()
    stage.look(magnification, 700.0)
    stage.frames_ms(2)
    standing = stage.frames_ms(count)
    stage.move("probe.y", -5100.0, 150.0 / (count * PERIOD_S), wait=False)
    moving = stage.frames_ms(count)
    stage.move("table.rotation", 5.0, 5.0 / (count * PERIOD_S), wait=False)
    everything = stage.frames_ms(count)
    name = f"{magnification:g}x"
    limit = TARGET_MS if magnification == 2.0 else None
    return [
        Figure(NAME, f"{name}, standing: mean a frame", mean(standing), "ms", limit),
        Figure(NAME, f"{name}, moving: mean a frame", mean(moving), "ms", limit),
        Figure(NAME, f"{name}, moving: p95", percentile(moving, 95), "ms"),
        Figure(NAME, f"{name}, everything: mean a frame", mean(everything), "ms"),
    ]


def mean(values: list[float]) -> float:
    """Return the mean."""
    return sum(values) / len(values)


def measure(quick: bool) -> list[Figure]:
    """Return all figures."""
    count = 4 if quick else 60
    figures = [figure for each in MAGNIFICATIONS for figure in at_zoom(each, count)]
    moving = next(each.value for each in figures if each.name.startswith("2x, moving: mean"))
    stage = Set()
    stage.look(2.0, 700.0)
    naive = mean(naive_ms(stage, count))
    return [
        *figures,
        Figure(NAME, "2x, naive: mean a frame", naive, "ms"),
        Figure(NAME, "2x, moving beside naive", moving / naive, "", 0.5),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
