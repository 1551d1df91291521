"""Grippers and probes drawn by formula: rectangles blurred by a Gaussian, exact at any place."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import erf

from cosmic.vico.core.vision.tool_types import ExpectedTool

HEIGHT, WIDTH = 400, 480
SIGMAS = np.linspace(-5.0, 5.0, 401)
STEP = 0.5 * (1.0 + erf(SIGMAS / math.sqrt(2.0)))


def box(tip: np.ndarray, forward: np.ndarray, width: float, blur: float) -> np.ndarray:
    """Return how much of each pixel an endless box covers whose front's middle is `tip`."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float64)
    ahead = (x - tip[0]) * forward[0] + (y - tip[1]) * forward[1]
    aside = np.abs(-(x - tip[0]) * forward[1] + (y - tip[1]) * forward[0])

    def step(distance: np.ndarray) -> np.ndarray:
        return np.interp(distance / blur, SIGMAS, STEP)

    return step(-ahead) * (step(0.5 * width - aside) - step(-0.5 * width - aside))


@dataclass(frozen=True)
class ToolImage:
    image: np.ndarray
    hold: np.ndarray
    forward: np.ndarray
    expected: ExpectedTool


def tool_image(
    seed: int,
    *,
    width: float = 45.0,
    gap: float = 0.0,
    blur: float = 1.5,
    noise: float = 4.0,
    uneven: float = 0.3,
    specks: int = 25,
    fibre: bool = False,
    off_px: float = 20.0,
    shift: tuple[float, float] = (0.0, 0.0),
    noise_seed: int | None = None,
) -> ToolImage:
    """Draw a probe (no gap) or a gripper in a random pose, expected some pixels off."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0 * math.pi)
    forward = np.array([math.cos(angle), math.sin(angle)])
    side = np.array([-forward[1], forward[0]])
    hold = np.array([WIDTH / 2, HEIGHT / 2]) + rng.uniform(-40.0, 40.0, 2) + shift
    y, x = np.mgrid[:HEIGHT, :WIDTH] / HEIGHT
    ground = 150.0 * (1.0 - uneven * ((x - 0.4) ** 2 + (y - 0.6) ** 2))
    layer = np.ones((HEIGHT, WIDTH), np.float32)
    for _ in range(specks):
        at = rng.integers((0, 0), (WIDTH, HEIGHT)).tolist()
        cv2.circle(layer, at, int(rng.integers(1, 4)), float(rng.uniform(0.4, 0.9)), -1)
    if fibre:
        start, end = hold - 60.0 * forward, hold + 150.0 * forward + rng.uniform(-30, 30, 2)
        for thick, shade in ((13, 0.42), (6, 0.72)):
            ends = [tuple(np.rint(each * 16).astype(int).tolist()) for each in (start, end)]
            cv2.line(layer, *ends, shade, thick, cv2.LINE_AA, shift=4)
    image = ground * cv2.GaussianBlur(layer, (0, 0), blur)
    offsets = (0.0,) if gap == 0.0 else (-0.5 * (gap + width), 0.5 * (gap + width))
    for aside in offsets:
        cover = box(hold + aside * side, forward, width, blur)
        image = image * (1.0 - cover) + 0.24 * ground * cover
    grain = rng if noise_seed is None else np.random.default_rng(noise_seed)
    image = image + grain.normal(0.0, noise, image.shape)
    turn = math.radians(rng.uniform(-2.0, 2.0))
    pointing = np.array(
        [
            forward[0] * math.cos(turn) - forward[1] * math.sin(turn),
            forward[0] * math.sin(turn) + forward[1] * math.cos(turn),
        ]
    )
    away = rng.uniform(-off_px, off_px, 2)
    expected = ExpectedTool(
        tuple((hold + away).tolist()), tuple(pointing.tolist()), width, gap, reach_px=40.0
    )
    return ToolImage(np.clip(np.rint(image), 0, 255).astype(np.uint8), hold, forward, expected)
