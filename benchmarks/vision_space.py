"""Fibres in space and in motion: tilt from focus, the focus from two images, held fibres followed.

Tilted fibres are drawn by formula, with the disc of a defocused lens that stands nearby; focus and
held fibres are the twin's images with its dirt, noise and uneven light.
"""

import math
import time

import cv2
import numpy as np
from tests.unit.twin.optics.image_bench import ImageBench

from benchmarks.figures import Figure, main, percentile
from benchmarks.twin_image import Set
from cosmic.frame.errors import CosmicError
from cosmic.twin.settings import shipped_settings
from cosmic.vico.api.measure import SpatialFibre, measure_stack
from cosmic.vico.core.defocus import calibrate, in_focus
from cosmic.vico.core.vision.held_tracking import HeldFibreTracker
from cosmic.vico.core.vision.tool_types import ExpectedTool
from cosmic.vico.core.vision.tracking import TrackState

NAME = "vision_space"
SHAPE, SCALE_UM_PX, APERTURE, DISTANCE_UM = (600, 800), 2.2, 0.043, 86_000.0
LENGTH_UM, WIDTH_UM, PIECES = 1000.0, 34.0, 20
TILTS_DEG = (0.0, 5.0, 10.0, 20.0)
FOCI_UM = np.arange(-300.0, 301.0, 60.0)
WAVELENGTH_UM = 0.55
FRAMES_HZ = 30.0

# ------------------------------------------------------------------ tilt


def tilted_stack(tilt_deg: float, seed: int) -> list[np.ndarray]:
    """Return images of a tilted fibre at any angle and place, sharp at different heights."""
    rng = np.random.default_rng(seed)
    tilt, azimuth = math.radians(tilt_deg), rng.uniform(0.0, math.pi)
    way = np.linspace(-0.5, 0.5, PIECES + 1) * LENGTH_UM
    height = way * math.sin(tilt) + rng.uniform(-30.0, 30.0)
    centre = rng.uniform(-150.0, 150.0, 2)
    nearer = (DISTANCE_UM / (DISTANCE_UM - height) / SCALE_UM_PX)[:, None]
    ahead = np.array([math.cos(azimuth), math.sin(azimuth)])
    ends = (centre + np.outer(way * math.cos(tilt), ahead)) * nearer
    ends += (0.5 * (SHAPE[1] - 1), 0.5 * (SHAPE[0] - 1))
    images = [np.full(SHAPE, 160.0, np.float32) for _ in FOCI_UM]
    for n in range(PIECES):
        sharp = cv2.GaussianBlur(piece(ends[n], ends[n + 1]), (0, 0), 1.2)
        for number, focus in enumerate(FOCI_UM.tolist()):
            radius = APERTURE * abs(focus - height[n : n + 2].mean()) / SCALE_UM_PX
            images[number] -= 80.0 * defocused(sharp, radius)
    noisy = [image + rng.normal(0.0, 2.5, SHAPE) for image in images]
    return [np.clip(np.round(image), 0, 255).astype(np.uint8) for image in noisy]


def piece(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the share of each pixel that a short straight piece covers."""
    fine = 4
    step = (end - start) / np.linalg.norm(end - start)
    side = np.array([-step[1], step[0]]) * (WIDTH_UM / SCALE_UM_PX / 2.0)
    corners = (np.array([start + side, end + side, end - side, start - side]) + 0.5) * fine - 0.5
    low = np.floor(corners.min(axis=0) / fine).astype(int) - 2
    high = np.ceil(corners.max(axis=0) / fine).astype(int) + 3
    big = np.zeros(((high - low)[::-1] * fine).tolist(), np.uint8)
    cv2.fillConvexPoly(big, np.round((corners - low * fine) * 16).astype(np.int32), 255, shift=4)
    small = cv2.resize(big, (high - low).tolist(), interpolation=cv2.INTER_AREA)
    share = np.zeros(SHAPE, np.float32)
    share[low[1] : high[1], low[0] : high[0]] = small / 255.0
    return share


def defocused(sharp: np.ndarray, radius: float) -> np.ndarray:
    """Return what the disc of a defocused lens makes of it."""
    if radius < 0.4:
        return sharp
    side = 2 * math.ceil(radius) + 1
    y, x = np.mgrid[:side, :side] - side // 2
    disc = np.clip(radius + 0.5 - np.hypot(x, y), 0.0, 1.0).astype(np.float32)
    return cv2.filter2D(sharp, -1, disc / disc.sum())


def tilts(count: int) -> list[Figure]:
    """Measure tilted fibres."""
    figures = []
    for tilt in TILTS_DEG:
        errors, flat, angles, inside, lost = [], [], [], 0, 0
        for seed in range(count):
            stack = measure_stack(
                tilted_stack(tilt, seed), FOCI_UM, SCALE_UM_PX, lens_distance_um=DISTANCE_UM
            )
            space = [each for each in stack.measurement.spatial if isinstance(each, SpatialFibre)]
            if len(space) != 1:
                lost += 1
                continue
            (found,) = space
            errors.append(100.0 * abs(found.length_um / LENGTH_UM - 1.0))
            length = stack.measurement.fibres[0].length_px * SCALE_UM_PX
            flat.append(100.0 * abs(length / LENGTH_UM - 1.0))
            angles.append(abs(abs(found.tilt_deg) - tilt))
            inside += angles[-1] <= 2.0 * found.tilt_std_deg
        limit = 0.2 if tilt == 10.0 else None
        title = f"tilted by {tilt:g} degrees"
        figures += [
            Figure(NAME, f"{title}: length from above, median error", percentile(flat, 50), "%"),
            Figure(NAME, f"{title}: length, median error", percentile(errors, 50), "%", limit),
            Figure(NAME, f"{title}: length, p95", percentile(errors, 95), "%", limit),
            Figure(NAME, f"{title}: tilt, median error", percentile(angles, 50), "degrees"),
            Figure(NAME, f"{title}: within two deviations", 100.0 * inside / len(angles), "%"),
            Figure(NAME, f"{title}: not measured of {count}", lost, ""),
        ]
    return figures


# ------------------------------------------------------------------ focus


def two_images(magnification: float, runs: int) -> list[Figure]:
    """Focus on the plate from two images, begun anywhere within 5 px of blur."""
    bench = ImageBench(shipped_settings()).zoom(magnification)
    heights = np.concatenate([line[:, 2] for line in bench.optics.centre_lines_um(bench.now_s)])
    truth = float(np.median(heights[heights < 300.0]))
    view = bench.optics.projection(bench.now_s)
    per_px = 1.0 / (0.5 * view.aperture * view.px_um)
    depth_um = WAVELENGTH_UM / view.aperture**2

    def image_at(focus_um: float) -> tuple[float, np.ndarray]:
        bench.focus(focus_um)
        bench.now_s += 0.07
        return focus_um, bench.optics.render(bench.now_s)

    # Beyond its travel the lens stands at its end, wherever it was sent.
    travel = bench.optics.settings.views["microscope"]
    low, high = travel.focus_low_um, travel.focus_high_um
    places = np.clip(truth + np.linspace(-4.0, 4.0, 12) * per_px, low, high)
    model = calibrate([image_at(place) for place in np.unique(places).tolist()])
    rng = np.random.default_rng(11)
    inside, refused, errors = 0, 0, []
    for _ in range(runs):
        start = min(max(truth + rng.uniform(-5.0, 5.0) * per_px, low), high)
        onward = 2.0 * per_px
        other = start + onward if start + onward <= high else start - onward
        try:
            found = in_focus(image_at(start), image_at(other), model)
        except CosmicError:
            refused += 1
            continue
        errors.append(abs(found.position - truth))
        inside += errors[-1] <= 0.5 * depth_um
    title = f"focus from two images at {magnification:g}x"
    return [
        Figure(NAME, f"{title}: median error", percentile(errors, 50), "um"),
        Figure(NAME, f"{title}: p95", percentile(errors, 95), "um"),
        Figure(NAME, f"{title}: depth of field", depth_um, "um"),
        Figure(NAME, f"{title}: within it, of {runs}", 100.0 * inside / runs, "%"),
        Figure(NAME, f"{title}: refused of {runs}", refused, ""),
    ]


# ------------------------------------------------------------------ a held fibre


def held(magnification: float, frames: int) -> list[Figure]:
    """Follow the fibre in the left gripper at rest and while the gripper moves."""
    stage = Set()
    stage.look(magnification, 700.0)
    stage.now_s += 1.0
    tracker, rng = HeldFibreTracker(), np.random.default_rng(0)
    figures: list[Figure] = []
    for title, move in (("at rest", 0.0), ("moving", 260.0)):
        if move:
            stage.move("left.y", move, 260.0, wait=False)
        off, spent, states, lengths, fronts = [], [], [], [], []
        for _ in range(frames):
            stage.now_s += 1.0 / FRAMES_HZ
            image = np.asarray(stage.optics.render(stage.now_s))
            expected, true, front = where(stage, rng.uniform(-8.0, 8.0, 2))
            began = time.thread_time()
            track = tracker.follow(image, expected)
            spent.append(1e3 * (time.thread_time() - began))
            states.append(track.state)
            if track.tip_px is None or track.shape is None:
                continue
            off.append(np.array(track.tip_px) - true[-1])
            way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(true, axis=0), axis=1))])
            fronts.append(abs(track.shape.clamps[0].leaves_px[0] - front))
            free = way[-1] - np.interp(front, true[:, 0], way)
            lengths.append(100.0 * abs(track.shape.length_px / free - 1.0))
        away = np.array(off)
        name = f"held fibre at {magnification:g}x, {title}"
        jitter = float(np.hypot(*away.std(axis=0)))
        lost = sum(each is TrackState.LOST for each in states)
        figures += [
            Figure(NAME, f"{name}: tip, jitter", jitter, "px", 0.5),
            Figure(
                NAME, f"{name}: tip, off on the mean", float(np.hypot(*away.mean(axis=0))), "px"
            ),
            Figure(NAME, f"{name}: where it leaves the jaws, p95", percentile(fronts, 95), "px"),
            Figure(NAME, f"{name}: free length, p95", percentile(lengths, 95), "%", 0.2),
            Figure(NAME, f"{name}: lost of {frames} frames", lost, ""),
            Figure(
                NAME, f"{name}: processor, median", percentile(spent, 50), "ms", 1e3 / FRAMES_HZ
            ),
            Figure(NAME, f"{name}: processor, p95", percentile(spent, 95), "ms"),
        ]
    return figures


def where(stage: Set, off_px: np.ndarray) -> tuple[ExpectedTool, np.ndarray, float]:
    """Return where the gripper is expected, a little off; the true line of its fibre and front."""
    view, tips = stage.optics.projection(stage.now_s), stage.scene.tips(stage.now_s)
    at = {
        name: view.image_px(np.array([tips[f"left.{name}"]]))[0]
        for name in ("hold", "jaw_a", "jaw_b")
    }
    (true,) = (
        view.image_px(line)
        for line in stage.optics.centre_lines_um(stage.now_s)
        if line[0, 2] > 300.0
    )
    x, y = (at["hold"] + off_px).tolist()
    gap = float(abs(at["jaw_b"] - at["jaw_a"])[1])
    expected = ExpectedTool((x, y), (1.0, 0.0), 100.0 * view.px_um, gap_px=gap, reach_px=40.0)
    return expected, true, float(at["hold"][0])


def measure(quick: bool) -> list[Figure]:
    """Return all figures."""
    cv2.setNumThreads(1)
    figures = tilts(1 if quick else 15)
    for magnification in (2.0,) if quick else (1.0, 2.0, 5.0):
        figures += two_images(magnification, 2 if quick else 40)
    figures += held(2.0, 3 if quick else 60)
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
