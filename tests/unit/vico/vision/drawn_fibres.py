"""Small images of fibres for tests; the benchmarks have the thorough ones."""

import cv2
import numpy as np


def arc(start: tuple[float, float], angle: float, length: float, turn: float) -> np.ndarray:
    """Return an arc that turns by `turn` radians over its length."""
    count = int(length * 4)
    angles = angle + turn * (np.arange(count) + 0.5) / count
    steps = np.column_stack([np.cos(angles), np.sin(angles)]) * length / count
    return np.concatenate([[start], start + np.cumsum(steps, axis=0)])


def loop(start: tuple[float, float], angle: float, length: float) -> np.ndarray:
    """Return a curve that turns once around in its middle and crosses itself there."""
    count = int(length * 4)
    s = (np.arange(count) + 0.5) / count
    bend = np.exp(-(((s - 0.5) / 0.18) ** 4))
    angles = angle + 1.55 * np.pi * np.cumsum(bend) / bend.sum()
    steps = np.column_stack([np.cos(angles), np.sin(angles)]) * length / count
    return np.concatenate([[start], start + np.cumsum(steps, axis=0)])


def strip(shape: tuple[int, int], line: np.ndarray, width: float) -> np.ndarray:
    """Return the share of each pixel that a strip along a line covers."""
    scale = 4
    big = np.zeros((shape[0] * scale, shape[1] * scale), np.uint8)
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    left, right = (((line + side * normal + 0.5) * scale - 0.5) for side in (width / 2, -width / 2))
    for index in range(0, len(line) - 8, 8):
        last = min(index + 8, len(line) - 1)
        corners = np.array([left[index], left[last], right[last], right[index]])
        cv2.fillConvexPoly(big, np.round(corners * 16).astype(np.int32), 255, shift=4)
    small = cv2.resize(big, shape[::-1], interpolation=cv2.INTER_AREA)
    return small.astype(np.float32) / 255.0


def drawn_image(
    lines: list[np.ndarray],
    widths: list[float],
    *,
    shape: tuple[int, int] = (480, 640),
    contrast: float = -60.0,
    ground: float = 150.0,
    noise: float = 3.0,
    blur_px: float = 1.0,
    lumen: float = 0.0,
    seed: int = 0,
) -> np.ndarray:
    """Return an image of fibres on an even ground."""
    share = np.zeros(shape, np.float32)
    for line, width in zip(lines, widths, strict=True):
        body = strip(shape, line, width)
        if lumen:
            body = body - lumen * strip(shape, line, 0.5 * width)
        share = np.maximum(share, body)
    image = cv2.GaussianBlur(ground + contrast * share, (0, 0), blur_px)
    image = image + np.random.default_rng(seed).normal(0.0, noise, shape)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)
