"""Calibration, focus, tracking, tool tips and levels: how exact they are, and what they cost.

Exactness on the twin's own images with its dirt, noise and uneven light, and on tools drawn by
formula. Costs are processor time of the thread that computes, one core.
"""

import math
import time
from collections.abc import Callable

import cv2
import numpy as np
from tests.unit.twin.optics.image_bench import ImageBench
from tests.unit.vico.tool_images import tool_image

from benchmarks.figures import Figure, main, percentile
from cosmic.twin.settings import shipped_settings
from cosmic.vico.core.background import Background
from cosmic.vico.core.calibration_fit import Sighting, fit_map, fit_rotation
from cosmic.vico.core.focus import FocusSearch, sharpness
from cosmic.vico.core.vision.matching import displacement
from cosmic.vico.core.vision.tips import find_gripper, find_probe
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips, NotSeen
from cosmic.vico.core.vision.tracking import TemplateTracker, TrackState
from cosmic.vico.gui.levels import histogram
from cosmic.vico.hw.interface import Frame, PixelFormat, Roi

NAME = "vision_tools"
MAGNIFICATIONS = (1.0, 2.0, 5.0)
# Away from the fibres, so that none of them lies behind what is tracked.
HOME_UM = np.array([-3900.0, -395.0])
TOOLS = {
    "probe": {},
    "probe, noise 12": {"noise": 12.0},
    "probe, blur 4 px": {"blur": 4.0},
    "gripper": {"gap": 90.0},
    "gripper, noise 12": {"gap": 60.0, "noise": 12.0},
    "gripper, blur 4 px": {"gap": 90.0, "blur": 4.0},
    "gripper on a fibre": {"gap": 90.0, "fibre": True},
    "gripper holding a fibre": {"gap": 14.0, "fibre": True},
}


def cpu_ms(function: Callable[[], object], runs: int) -> float:
    """Return the median processor time of one call, after a first one that does not count."""
    function()
    spent = []
    for _ in range(runs):
        began = time.thread_time()
        function()
        spent.append(1e3 * (time.thread_time() - began))
    return percentile(spent, 50)


# ------------------------------------------------------------------ calibration on the twin


def jaw_stage(magnification: float) -> ImageBench:
    """Return the twin with the right gripper in the middle of the image, in focus."""
    bench = ImageBench(shipped_settings()).zoom(magnification).focus(60.0)
    return bench.go(
        right_x=float(HOME_UM[0]), right_y=float(HOME_UM[1]), right_z=-1440.0, right_gripper=60.0
    )


def calibration(magnification: float, checks: int) -> list[Figure]:
    """Calibrate with nine places and look at others."""
    bench = jaw_stage(magnification)
    scale_um = 4.4 / magnification
    rng = np.random.default_rng(7)
    room_px = 115.0
    tip = bench.scene.tips(bench.now_s)["right.jaw_b"]
    start = bench.px(*tip)
    tracker = TemplateTracker(size_px=96, reach_px=60.0)
    tracker.start(bench.optics.render(bench.now_s), (float(start[0]), float(start[1])))

    def look(offset_px: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        place = HOME_UM + offset_px * scale_um * (1.0, -1.0)
        bench.go(right_x=float(place[0]), right_y=float(place[1]))
        expected = start + offset_px
        track = tracker.follow(
            bench.optics.render(bench.now_s), (float(expected[0]), float(expected[1]))
        )
        if track.state is not TrackState.FOUND or track.position_px is None:
            return None
        return place, np.array(track.position_px)

    grid = [np.array([x, y]) * room_px for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)]
    seen = [found for offset in grid if (found := look(offset)) is not None]
    fit = fit_map([Sighting((*p.tolist(),), (*s.tolist(),)) for p, s in seen])
    misses, errors = 9 - len(seen), []
    for _ in range(checks):
        found = look(rng.uniform(-room_px, room_px, 2))
        if found is None:
            misses += 1
        else:
            errors.append(float(np.linalg.norm(fit.map.to_um(found[1]) - found[0])))
    text = f"calibration at {magnification:g}x: "
    return [
        Figure(NAME, text + "residual RMS", fit.rms_px, "px", 0.5),
        Figure(NAME, text + "place found, RMS", math.sqrt(np.mean(np.square(errors))), "um"),
        Figure(NAME, text + "place found, largest", max(errors), "um"),
        Figure(NAME, text + "places lost", misses, "", 0.0),
    ]


def rotation() -> list[Figure]:
    """Find a rotation centre from five angles, with 1 um of noise in the places."""
    errors, stds_um = [], []
    angles = [-60.0, -30.0, 0.0, 30.0, 60.0]
    turn = np.radians(angles)
    for seed in range(50):
        noise = np.random.default_rng(seed).normal(0.0, 1.0, (5, 2))
        places = 700.0 * np.column_stack([np.cos(turn), np.sin(turn)]) + noise
        fit = fit_rotation(angles, [(x, y) for x, y in places.tolist()])
        errors.append(math.hypot(*fit.centre_um))
        stds_um.append(fit.std_um)
    return [
        Figure(NAME, "rotation centre, places to 1 um: p95", percentile(errors, 95), "um", 2.0),
        Figure(NAME, "rotation centre: uncertainty told", float(np.median(stds_um)), "um"),
    ]


# ------------------------------------------------------------------ focus on the twin


def focus(magnification: float, runs: int) -> list[Figure]:
    """Focus on the fibres on the plate."""
    found, positions, failures = [], 0, 0
    rng = np.random.default_rng(3)
    bench = ImageBench(shipped_settings()).zoom(magnification)
    heights = np.concatenate([line[:, 2] for line in bench.optics.centre_lines_um(bench.now_s)])
    truth = float(np.median(heights))
    reach = 1.2e3 / magnification**0.5
    depth = min(0.3 * reach, 300.0 / magnification)
    for _ in range(runs):
        away = float(rng.uniform(-0.4, 0.4)) * reach
        search = FocusSearch(
            truth + away - reach, truth + away + reach, coarse_step=depth, fine_step=depth / 4.0
        )
        while (target := search.target) is not None:
            bench.focus(target)
            bench.now_s += 0.07
            image = bench.optics.render(bench.now_s, roi=Roi(550, 400, 500, 400))
            search.add(target, sharpness(image))
            positions += 1
        if search.answer is None or search.answer.position is None:
            failures += 1
        else:
            found.append(search.answer.position - truth)
    text = f"focus at {magnification:g}x: "
    error = math.sqrt(float(np.mean(np.square(found)))) if found else math.nan
    return [
        Figure(NAME, text + "error RMS", error, "um"),
        Figure(NAME, text + "not found", failures, "", 0.0),
        Figure(NAME, text + "images a search", positions / runs, ""),
    ]


# ------------------------------------------------------------------ tools and tracking


def tools(name: str, changes: dict[str, float], count: int) -> list[Figure]:
    """Find tools drawn by formula."""
    errors, spent, missed, wrong = [], [], 0, 0
    find = find_gripper if "gap" in changes else find_probe
    for seed in range(count):
        image = tool_image(seed, **changes)
        began = time.thread_time()
        found = find(image.image, image.expected)
        spent.append(1e3 * (time.thread_time() - began))
        if isinstance(found, NotSeen):
            missed += 1
            continue
        place = found.hold_px if "gap" in changes else found.tip_px
        errors.append(math.dist(place, image.hold))
        wrong += found.certain and errors[-1] > 1.5
    return [
        Figure(NAME, f"{name}: tip, median", percentile(errors, 50), "px", 0.5),
        Figure(NAME, f"{name}: tip, p95", percentile(errors, 95), "px", 1.5),
        Figure(NAME, f"{name}: not seen of {count}", missed, ""),
        Figure(NAME, f"{name}: wrong by 1.5 px without a doubt", wrong, "", 0.0),
        Figure(NAME, f"{name}: processor", percentile(spent, 50), "ms"),
    ]


def twin_tools(count: int) -> list[Figure]:
    """Find the twin's grippers and probe at 2x, over its plate with fibres."""
    bench = ImageBench(shipped_settings()).zoom(2.0).focus(60.0)
    bench.go(left_z=-1440.0, right_z=-1440.0)
    px_um = bench.optics.projection(bench.now_s).px_um
    rng = np.random.default_rng(0)
    errors, missed, wrong = [], 0, 0
    for _ in range(count):
        bench.go(
            left_x=rng.uniform(3600.0, 3900.0),
            left_y=rng.uniform(-150.0, 330.0),
            left_gripper=rng.uniform(80.0, 250.0),
            right_x=-rng.uniform(3500.0, 3850.0),
            right_y=rng.uniform(-150.0, 330.0),
            right_gripper=rng.uniform(80.0, 250.0),
            probe_x=rng.uniform(-100.0, 200.0),
            probe_y=-rng.uniform(4300.0, 4600.0),
        )
        image, tips = bench.optics.render(bench.now_s), bench.scene.tips(bench.now_s)
        for side, forward in (("left", (1.0, 0.0)), ("right", (-1.0, 0.0)), ("probe", (0.0, 1.0))):
            probe = side == "probe"
            inner = np.array([tips[side]] * 2 if probe else [tips[f"{side}.jaw_{w}"] for w in "ab"])
            truth = bench.px(*inner.mean(axis=0))
            away = truth + rng.uniform(-20.0, 20.0, 2)
            gap = px_um * math.dist(*inner)
            width = (50.0 if probe else 100.0) * px_um
            expected = ExpectedTool((float(away[0]), float(away[1])), forward, width, gap)
            found = (find_probe if probe else find_gripper)(image, expected)
            if isinstance(found, NotSeen):
                missed += 1
                continue
            place = found.hold_px if isinstance(found, GripperTips) else found.tip_px
            if found.certain:
                errors.append(math.dist(place, truth))
                wrong += errors[-1] > 1.5
    total = 3 * count
    return [
        Figure(NAME, "twin at 2x: tip, median", percentile(errors, 50), "px", 0.5),
        Figure(NAME, "twin at 2x: tip, p95", percentile(errors, 95), "px", 1.5),
        Figure(NAME, f"twin at 2x: not seen of {total}", missed, ""),
        Figure(NAME, f"twin at 2x: doubted of {total}", total - missed - len(errors), ""),
        Figure(NAME, "twin at 2x: wrong by 1.5 px without a doubt", wrong, "", 0.0),
    ]


def tracking(runs: int) -> list[Figure]:
    """Follow a probe that is drawn anew at each place."""
    errors = []
    first = tool_image(0, specks=0)
    corner = [round(float(each)) - 48 for each in first.hold]
    region = Roi(corner[0], corner[1], 96, 96)
    rng = np.random.default_rng(1)
    for seed in range(runs):
        shift = rng.uniform(-20.0, 20.0, 2)
        moved = tool_image(0, specks=0, shift=shift, noise_seed=seed)
        match = displacement(first.image, moved.image, region, 40.0)
        if match is not None:
            centre = np.array(corner) + 47.5
            errors.append(float(np.linalg.norm(np.array(match.centre_px) - centre - shift)))
    spent = cpu_ms(lambda: displacement(first.image, first.image, region, 40.0), 20)
    return [
        Figure(NAME, "template of 96 px: displacement, median", percentile(errors, 50), "px", 0.5),
        Figure(NAME, "template of 96 px: displacement, p95", percentile(errors, 95), "px"),
        Figure(NAME, "template of 96 px, reach 40 px: processor", spent, "ms"),
    ]


# ------------------------------------------------------------------ costs


def costs(runs: int) -> list[Figure]:
    """Measure what runs on every image, at 1600 x 1200."""
    noise = np.random.default_rng(0).normal(120.0, 30.0, (1200, 1600))
    image = np.clip(cv2.GaussianBlur(noise, (0, 0), 1.0), 0, 255).astype(np.uint8)
    deep = image.astype(np.uint16) * 16
    frame = Frame(image, 1, 0.0, 0.0)
    background = Background()
    background.collect(1)
    background.add(frame)
    part = Roi(600, 400, 400, 400)
    asked = {
        "levels and stretch, 8 bit": (
            lambda: histogram(image, PixelFormat.MONO8.full_scale).levels(),
            1.0,
        ),
        "levels and stretch, 12 bit": (
            lambda: histogram(deep, PixelFormat.MONO12.full_scale).levels(),
            1.0,
        ),
        "flat field, 8 bit": (lambda: background.correct(frame), None),
        "focus measure, whole image": (lambda: sharpness(image), None),
        "focus measure, 400 x 400 px": (lambda: sharpness(image, part), None),
    }
    return [
        Figure(NAME, f"{name}: processor", cpu_ms(function, runs), "ms", limit)
        for name, (function, limit) in asked.items()
    ]


def measure(quick: bool) -> list[Figure]:
    """Return all figures."""
    figures = costs(5 if quick else 50)
    figures += rotation()
    figures += tracking(4 if quick else 40)
    for magnification in MAGNIFICATIONS[1:2] if quick else MAGNIFICATIONS:
        figures += calibration(magnification, 4 if quick else 40)
        figures += focus(magnification, 1 if quick else 10)
    figures += twin_tools(2 if quick else 40)
    for name, changes in TOOLS.items():
        figures += tools(name, changes, 3 if quick else 60)
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
