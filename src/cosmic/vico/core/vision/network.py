"""A dense image as a graph: where fibres meet, and the segments between.

Where no single fibre can be told, orientation, density and the lengths between junctions still can.
The graph is made at three thresholds; what they disagree in is its uncertainty.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.vision.graph import FREE, Graph, build_graph, prune
from cosmic.vico.core.vision.grey import Floats, Mask, grey_image
from cosmic.vico.core.vision.relief import Relief, find_relief, kernel
from cosmic.vico.core.vision.smoothing import arc_lengths

MOST_FORKS: Final = 20_000
LEVELS: Final = (0.8, 1.0, 1.25)
BINS: Final = 18
LEAST_SEGMENT: Final = 3.0
LARGEST_SPREAD: Final = 0.1
MOST_COVERED: Final = 0.6
SCALES_WITH: Final = 0.5
"""A piece this much wider than the typical segment, as a part of it and above, is a bundle."""

UNSTABLE: Final = "its length changes by more than a tenth with the threshold"
COVERED: Final = "fibres cover so much of the image that the ground between them is not seen"
NARROW: Final = "its fibres are narrower than the image resolves"
NOTHING: Final = "too little stands out to be a network"


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """What lies between two junctions, or a junction and a free end.

    Attributes
    ----------
    line_px : ndarray, shape (n, 2)
    junctions : (int, int)
        Numbers of the junctions at its ends; -1 at a free end.
    bundle : bool
        It is so wide that it is more than one fibre, which no edge separates.
    """

    line_px: Floats
    length_px: float
    width_px: float
    orientation_deg: float
    junctions: tuple[int, int]
    bundle: bool


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """The network of fibres on one image, in pixels.

    Attributes
    ----------
    junctions_px : ndarray, shape (n, 2)
    segments : tuple of Segment
    length_px, length_std_px : float
        Of all segments together.
    orientation_share : ndarray, shape (18,)
        Share of the length in each ten degrees from 0 on, from the x axis towards the y axis.
    alignment : float
        0 where all directions are alike, 1 where there is one.
    direction_deg : float
        The mean direction; it means nothing where `alignment` is near 0.
    covered : float
        Share of the image.
    certain : bool
        Whether lengths and directions can be relied on as statistics; `doubts` says why not. No
        single fibre of a network is certain.
    """

    junctions_px: Floats
    segments: tuple[Segment, ...]
    length_px: float
    length_std_px: float
    orientation_share: Floats
    alignment: float
    direction_deg: float
    covered: float
    certain: bool
    doubts: tuple[str, ...]

    @property
    def segment_lengths_px(self) -> Floats:
        """Of the segments between two junctions; those that end freely are cut off."""
        return np.array([each.length_px for each in self.segments if min(each.junctions) >= 0])


def find_network(image: npt.NDArray[np.generic]) -> Network:
    """Return the network on an image; takes what `find_fibres` takes.

    Raises
    ------
    ConfigError
        The image has another type or shape; dtype and shape are named.
    NotAvailable
        It has more junctions than can be told apart, or cannot be looked at.
    """
    pixels = grey_image(image)
    try:
        relief = find_relief(pixels)
        graphs = [_graph(_mask(relief, level)) for level in LEVELS]
    except (ValueError, ArithmeticError, IndexError, cv2.error) as exc:
        raise NotAvailable(f"a network cannot be looked for on this image ({exc})") from exc
    lengths = [_length(graph) * relief.factor for graph in graphs]
    return _network(graphs[1], relief, lengths)


def _mask(relief: Relief, level: float) -> Mask:
    """Return what stands out locally, at a multiple of the threshold that is used for fibres."""
    taken = relief.height[relief.mask > 0]
    if not taken.size:
        return relief.mask
    size = max(9, int(0.06 * max(relief.height.shape))) | 1
    around = cv2.blur(relief.height, (size, size))
    limit = np.maximum(level * around, 0.5 * level * float(np.percentile(taken, 10)))
    mask = (relief.height > limit).astype(np.uint8)
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, kernel(3)), dtype=np.uint8)


def _graph(mask: Mask) -> Graph:
    graph = build_graph(mask, MOST_FORKS)
    if graph is None:
        raise NotAvailable(
            f"the image has more than {MOST_FORKS} junctions: look at a part of it, or zoom in"
        )
    prune(graph)
    return graph


def _length(graph: Graph) -> float:
    return sum(each.length for each in graph.branches if each.length >= LEAST_SEGMENT)


def _network(graph: Graph, relief: Relief, lengths: Sequence[float]) -> Network:
    factor = relief.factor
    kept = [each for each in graph.branches if each.length >= LEAST_SEGMENT]
    halves = np.array([graph.half_width(each.points) for each in kept])
    typical = float(np.median(halves)) if len(halves) else 0.0
    shift = 0.5 * (factor - 1)
    segments = []
    for each, half in zip(kept, halves, strict=True):
        line = each.points * factor + shift
        step = line[-1] - line[0]
        segments.append(
            Segment(
                line,
                float(arc_lengths(line)[-1]),
                float(max(2.0 * half - 0.5, 0.5)) * factor,
                float(np.degrees(np.arctan2(step[1], step[0]))) % 180.0,
                (_number(each.nodes[0]), _number(each.nodes[1])),
                bool(half > (1.0 + SCALES_WITH) * typical + 0.5),
            )
        )
    share, alignment, direction = _directions(segments)
    covered = float(_mask(relief, 1.0).mean())
    spread = float(np.ptp(lengths)) / 2.0
    doubts = [
        reason
        for doubtful, reason in (
            (len(segments) < 3, NOTHING),
            (spread > LARGEST_SPREAD * max(lengths[1], 1e-9), UNSTABLE),
            (covered > MOST_COVERED, COVERED),
            (typical < 1.2, NARROW),
        )
        if doubtful
    ]
    nodes = np.array(graph.nodes, dtype=np.float64).reshape(-1, 2) * factor + shift
    return Network(
        nodes,
        tuple(segments),
        lengths[1],
        spread,
        share,
        alignment,
        direction,
        covered,
        not doubts,
        tuple(doubts),
    )


def _number(node: int) -> int:
    return -1 if node == FREE else node


def _directions(segments: Sequence[Segment]) -> tuple[Floats, float, float]:
    """Return the share of length by direction, how much they agree, and their mean, degrees."""
    if not segments:
        return np.zeros(BINS), 0.0, 0.0
    steps = np.concatenate([each.line_px[2::2] - each.line_px[:-2:2] for each in segments])
    weight = np.linalg.norm(steps, axis=1)
    angle = np.arctan2(steps[:, 1], steps[:, 0])
    total = max(float(weight.sum()), 1e-9)
    share, _ = np.histogram(np.degrees(angle) % 180.0, BINS, (0.0, 180.0), weights=weight)
    mean = complex((weight * np.exp(2j * angle)).sum()) / total
    direction = float(np.degrees(0.5 * np.angle(mean))) % 180.0
    return np.asarray(share / total), float(abs(mean)), direction
