"""Draw an image of each kind that is doubted, for docs/images/fibres-not-certain.jpg.

`python -m benchmarks.refused_images FILE` draws them, finds the fibres, refuses to write where one
that should be doubted is certain, and prints the reasons as a table for the page.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

from benchmarks.fibre_pairs import Piece, View, without_noise
from cosmic.vico.api import find_fibres

SHAPE = (240, 360)
COLUMNS = 3
VIEW = View(SHAPE, 150.0, -60.0, 1.2, 3.0, 0.0, opaque=False, jpeg=None, lumen=0.0)
WHOLE = "one whole fibre"


def bow(start: tuple[float, float], end: tuple[float, float], height: float = 0.0) -> np.ndarray:
    """Return a bow between two points."""
    s = np.linspace(0.0, 1.0, 120)[:, None]
    along = np.array(end) - np.array(start)
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    return np.asarray(np.array(start) + s * along + 4.0 * height * s * (1.0 - s) * normal)


def piece(line: np.ndarray, width: float = 12.0, taken: float = 1.0) -> Piece:
    """Return a fibre of even width."""
    count = len(line)
    return Piece(line, np.full(count, width), np.full(count, taken))


def ring() -> np.ndarray:
    """Return a closed circle."""
    angle = np.linspace(0.0, 2.0 * np.pi, 160)
    return np.column_stack([180.0 + 80.0 * np.cos(angle), 120.0 + 80.0 * np.sin(angle)])


def images() -> dict[str, np.ndarray]:
    """Return an image of each kind by its name."""
    rng = np.random.default_rng(5)
    left, right = (40.0, 100.0), (320.0, 130.0)
    thinner = piece(bow((210.0, 118.0), (320.0, 160.0)), 4.0, 0.6)
    web = [
        piece(bow(tuple(rng.uniform(-60, 60, 2)), tuple(rng.uniform(200, 420, 2))), 6.0)
        for _ in range(14)
    ]
    drawn = {
        WHOLE: [piece(bow(left, right, 20.0))],
        "a gap of a third of a width": [
            piece(bow(left, (178.0, 115.0))),
            piece(bow((182.0, 115.4), right)),
        ],
        "ends that touch at an angle": [
            piece(bow(left, (180.0, 115.0))),
            piece(bow((180.0, 115.0), (300.0, 60.0))),
        ],
        "ends that overlap": [
            piece(bow(left, (190.0, 116.0))),
            piece(bow((172.0, 114.0), right)),
        ],
        "one half darker": [
            piece(bow(left, (180.0, 115.0)), 12.0, 0.75),
            piece(bow((180.0, 115.0), right)),
        ],
        "it goes on thinner": [piece(bow(left, (210.0, 118.0))), thinner],
        "cut off by the border": [piece(bow((-20.0, 90.0), (280.0, 150.0), 20.0))],
        "two side by side": [
            piece(bow(left, right), 7.0),
            piece(bow((40.0, 109.5), (320.0, 139.5)), 7.0),
        ],
        "a ring": [piece(ring(), 9.0)],
        "a shallow crossing": [
            piece(bow((40, 105), (320, 130)), 9.0),
            piece(bow((40, 135), (320, 100)), 9.0),
        ],
        "too many meet": web,
    }
    clean = {
        name: without_noise(each, VIEW, np.ones(SHAPE, np.float32)) for name, each in drawn.items()
    }
    clean["out of focus"] = cv2.GaussianBlur(clean[WHOLE], (0, 0), 6.0)
    return {
        name: np.clip(np.round(each + rng.normal(0.0, 3.0, SHAPE)), 0, 255).astype(np.uint8)
        for name, each in clean.items()
    }


def tile(name: str, image: np.ndarray) -> tuple[np.ndarray, str]:
    """Return an image with its fibres drawn and named, and why they are doubted."""
    colour = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    fibres = find_fibres(image)
    for fibre in fibres:
        line = np.round(fibre.centre_line_px * 16).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(
            colour, [line], False, (60, 160, 30) if fibre.certain else (20, 110, 255), 2,
            cv2.LINE_AA, shift=4,
        )  # fmt: skip
    cv2.putText(colour, name, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (20, 20, 20), 1, cv2.LINE_AA)
    if any(fibre.certain for fibre in fibres) != (name == WHOLE):
        raise SystemExit(f"{name}: certain fibres are not what the page says")
    reasons = list(dict.fromkeys(doubt for fibre in fibres for doubt in fibre.doubts))
    return colour, "; ".join(reasons[:3]) or ("certain" if fibres else "nothing is found")


def main() -> None:
    """Write the image and print the table."""
    cv2.setNumThreads(1)
    made = {name: tile(name, image) for name, image in images().items()}
    tiles = [
        cv2.copyMakeBorder(each, 3, 3, 3, 3, cv2.BORDER_CONSTANT, value=(255,) * 3)
        for each, _ in made.values()
    ]
    rows = [np.hstack(tiles[at : at + COLUMNS]) for at in range(0, len(tiles), COLUMNS)]
    if not cv2.imwrite(str(Path(sys.argv[1])), np.vstack(rows)):
        raise SystemExit(f"{sys.argv[1]}: cannot be written")
    for name, (_, why) in made.items():
        sys.stdout.write(f"| {name} | {why} |\n")


if __name__ == "__main__":
    main()
