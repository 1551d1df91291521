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

from cosmic.frame.arrays import ByteMask, Floats, Floats32
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.vision.graph import FREE, Graph, build_graph, prune
from cosmic.vico.core.vision.grey import grey_image, middle
from cosmic.vico.core.vision.relief import Pieces, reduced
from cosmic.vico.core.vision.smoothing import arc_lengths

MOST_FORKS: Final = 20_000
LEVELS: Final = (0.8, 1.0, 1.25)
BINS: Final = 18
SMALL_PX: Final = 900
SCALES_PX: Final = (1.2, 2.0, 3.2)
NOISE_TIMES: Final = 2.5
OF_STRONGEST: Final = 0.15
LEAST_AREA: Final = 12
LEAST_SEGMENT: Final = 3.0
LARGEST_SPREAD: Final = 0.1
MOST_COVERED: Final = 0.6
LEAST_SEGMENTS: Final = 20
"""Fewer are dirt, or no sample to take statistics of."""
MOST_TURNED_DEG: Final = 6.5
"""In a width, on the mean: drawn networks of curly fibres turn by up to 6, rims of bubbles and
grains by 7 to 14, and what noise makes by 14 to 22."""
TURN_STEP: Final = 4
RING_PART: Final = 0.1
"""Ends nearer than this part of a segment's length make a ring of it."""
MOST_CLOSED: Final = 0.3
"""Share of the length in rings that nothing joins."""
SCALES_WITH: Final = 0.5
"""A piece this much wider than the typical segment, as a part of it and above, is a bundle."""

UNSTABLE: Final = "its length changes by more than a tenth with the threshold"
COVERED: Final = "fibres cover so much of the image that the ground between them is not seen"
NARROW: Final = "its fibres are narrower than the image resolves"
NOTHING: Final = "too little stands out to be a network"
TURNING: Final = (
    "for their width its segments bend more than fibres do: they may be noise, grains or bubbles"
)
CLOSED: Final = "much of it are closed rings, as of bubbles or drops"


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
        factor = max(1, round(max(pixels.shape) / SMALL_PX))
        ridges = _ridges(reduced(pixels, factor))
        masks = [_mask(ridges, level) for level in LEVELS]
        graphs = [_graph(mask) for mask in masks]
    except (ValueError, ArithmeticError, IndexError, cv2.error) as exc:
        raise NotAvailable(f"a network cannot be looked for on this image ({exc})") from exc
    lengths = [_length(graph) * factor for graph in graphs]
    return _network(graphs[1], factor, float(masks[1].mean()), lengths)


def _ridges(small: Floats32) -> Floats32:
    """Return how much each point lies on a ridge, lighter or darker, whichever is narrower.

    Of two neighbouring grounds the fibres are what is narrow: their ridges are sharper.
    """
    sides = []
    for sign in (1.0, -1.0):
        best = np.zeros_like(small)
        for scale in SCALES_PX:
            smooth = cv2.GaussianBlur(np.float32(sign) * small, (0, 0), scale)
            xx, yy, xy = (
                cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) for order in ((2, 0), (0, 2), (1, 1))
            )
            half, apart = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
            # Across a ridge it falls off, along it nothing happens.
            ridge = np.float32(scale**2) * (apart - half - np.abs(half + apart))
            best = np.maximum(best, ridge)
        sides.append(best)
    strong = [float(np.mean(np.sort(side.ravel())[-side.size // 20 :])) for side in sides]
    return np.asarray(sides[int(np.argmax(strong))], dtype=np.float32)


def _mask(ridges: Floats32, level: float) -> ByteMask:
    """Return where a ridge stands out, at a multiple of the usual threshold."""
    usual = max(NOISE_TIMES * middle(ridges), OF_STRONGEST * float(np.percentile(ridges, 99.0)))
    mask = (ridges > level * usual).astype(np.uint8)
    pieces = Pieces.of(mask)
    keep = np.repeat(pieces.areas >= LEAST_AREA, pieces.areas)
    found = np.zeros(mask.size, np.uint8)
    found[pieces.order[keep]] = 1
    return found.reshape(mask.shape)


def _graph(mask: ByteMask) -> Graph:
    graph = build_graph(mask, MOST_FORKS)
    if graph is None:
        raise NotAvailable(
            f"the image has more than {MOST_FORKS} junctions: look at a part of it, or zoom in"
        )
    prune(graph)
    return graph


def _length(graph: Graph) -> float:
    return sum(each.length for each in graph.branches if each.length >= LEAST_SEGMENT)


def _network(graph: Graph, factor: int, covered: float, lengths: Sequence[float]) -> Network:
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
    spread = float(np.ptp(lengths)) / 2.0
    doubts = [
        reason
        for doubtful, reason in (
            (len(segments) < LEAST_SEGMENTS, NOTHING),
            (spread > LARGEST_SPREAD * max(lengths[1], 1e-9), UNSTABLE),
            (_turned_deg(segments) > MOST_TURNED_DEG, TURNING),
            (_closed(segments) > MOST_CLOSED, CLOSED),
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


def _turned_deg(segments: Sequence[Segment]) -> float:
    """Return by how much segments turn within the width of a typical one, on the mean."""
    turned = length = 0.0
    for each in segments:
        steps = np.diff(each.line_px[::TURN_STEP], axis=0)
        if len(steps) > 1:
            angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
            turned += abs(float(angle[-1] - angle[0]))
            length += float(np.linalg.norm(steps, axis=1).sum())
    if not length:
        return 0.0
    return float(np.degrees(turned)) / length * float(np.median([one.width_px for one in segments]))


def _closed(segments: Sequence[Segment]) -> float:
    """Return the share of the length in segments without a junction whose ends meet."""
    rings = sum(
        each.length_px
        for each in segments
        if max(each.junctions) < 0
        and np.linalg.norm(each.line_px[-1] - each.line_px[0]) < RING_PART * each.length_px
    )
    return rings / max(sum(each.length_px for each in segments), 1e-9)


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
