"""Images that nobody meant to measure: tiny, constant, torn, of any type."""

from collections.abc import Callable

import cv2
import numpy as np

from unit.vico.vision.drawn_fibres import arc, drawn_image

Image = np.ndarray
Maker = Callable[[np.random.Generator, tuple[int, int]], Image]


def fibres(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return fibres anywhere, partly beyond the border."""
    lines, widths = [], []
    for _ in range(int(rng.integers(1, 5))):
        start = (float(rng.uniform(0, shape[1])), float(rng.uniform(0, shape[0])))
        length = float(rng.uniform(15, 1.2 * max(shape)))
        lines.append(arc(start, float(rng.uniform(0, 6.3)), length, float(rng.normal(0, 1.5))))
        widths.append(float(rng.uniform(1.0, 14.0)))
    contrast = float(rng.choice([-90.0, -30.0, -8.0, 60.0]))
    noise = float(rng.choice([0.0, 2.0, 12.0]))
    return drawn_image(lines, widths, shape=shape, contrast=contrast, noise=noise)


def constant(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return one level everywhere."""
    return np.full(shape, rng.integers(0, 256), np.uint8)


def noisy(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return nothing but noise."""
    return rng.integers(0, 256, shape).astype(np.uint8)


def stepped(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a few flat areas."""
    rows, columns = (int(rng.integers(1, 7)) for _ in range(2))
    few = rng.integers(0, 256, (rows, columns)).astype(np.uint8)
    return np.asarray(cv2.resize(few, shape[::-1], interpolation=cv2.INTER_NEAREST))


def sparse(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return single pixels, rows and columns on black."""
    image = np.zeros(shape, np.uint8)
    for _ in range(int(rng.integers(0, 6))):
        row, column = (int(rng.integers(0, side)) for side in shape)
        kind = int(rng.integers(0, 3))
        image[row if kind != 1 else slice(None), column if kind != 2 else slice(None)] = 255
    return image


def lines(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return sharp lines and rectangles without any noise."""
    image = np.full(shape, 128, np.uint8)
    for _ in range(int(rng.integers(1, 8))):
        ends = [(int(rng.integers(0, shape[1])), int(rng.integers(0, shape[0]))) for _ in range(2)]
        cv2.line(image, *ends, int(rng.integers(0, 256)), int(rng.integers(1, 9)))
    return image


def compressed(image: Image, quality: int) -> Image:
    """Return an image after JPEG."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE))


def torn(rng: np.random.Generator, image: Image) -> Image:
    """Return an image with lost lines, torn blocks, or flipped bits."""
    found = image.copy()
    kind = int(rng.integers(0, 4))
    row = int(rng.integers(0, len(found)))
    if kind == 0:
        found[row:] = int(rng.integers(0, 256))
    elif kind == 1:
        found[row:] = np.roll(found[row:], int(rng.integers(1, 30)), axis=1)
    elif kind == 2:
        found ^= (rng.random(found.shape) < 0.02).astype(np.uint8) << np.uint8(7)
    else:
        found = compressed(found, int(rng.integers(1, 25)))
    return found


def typed(rng: np.random.Generator, image: Image) -> Image:
    """Return an image as another type, order or shape."""
    kind = int(rng.integers(0, 12))
    ways: list[Callable[[], Image]] = [
        lambda: image.astype(np.uint16) * 257,
        lambda: image.astype(">u2") * 16,
        lambda: image > 128,
        lambda: image.astype(np.float32) / 255.0,
        lambda: np.where(image > np.percentile(image, 90), np.nan, image.astype(float)),
        lambda: cv2.merge([image, image[::-1].copy(), image]),
        lambda: cv2.merge([image] * 4),
        lambda: image[:, :, None],
        lambda: image.astype(np.int16) - 300,
        lambda: image[::-1, ::-1],
        lambda: image.T,
    ]
    return ways[kind]() if kind < len(ways) else image


def odd_image(seed: int) -> Image:
    """Return one of them."""
    rng = np.random.default_rng(seed)
    small, large = (16, 40) if seed % 3 == 0 else (16, 140)
    shape = (int(rng.integers(small, large)), int(rng.integers(small, large)))
    makers: list[Maker] = [fibres, fibres, fibres, constant, noisy, stepped, sparse, lines]
    image = makers[int(rng.integers(0, len(makers)))](rng, shape)
    if rng.random() < 0.5:
        image = torn(rng, image)
    return typed(rng, image)
