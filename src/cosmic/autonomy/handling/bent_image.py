"""How far aside images show a held fibre while it is pushed, place by place."""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.autonomy.bending.bent_shape import BentShape
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.grasp import HeldShape
from cosmic.frame.arrays import Floats
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.vision.algorithms import grey

NEAR_JAWS_UM: Final = 70.0
NEAR_PROBE_UM: Final = 70.0
"""Jaws and probe are as dark as the fibre: nothing is looked for so near to them."""
APART_PX: Final = 2.0
"""Between two places: nearer ones share the same pixels."""
FINE_PX: Final = 0.25
CLEAR_PX: Final = 2.0
"""So far from its edge a fibre is dark no more, out of focus though it may be."""
SLACK_PX: Final = 3.0
"""So far from where it is foreseen a fibre is looked for."""
GROUND_PERCENT: Final = 75
LEAST_DARK_PART: Final = 0.5
"""Of how dark the fibre is in the middle of its places: what is fainter is not it."""
LEAST_STD_PX: Final = 0.08
ROUNDS: Final = 4
OFF_SIGMAS: Final = 4.0
SMOOTH_ORDER: Final = 4
"""Of the polynomial that a beam pushed at one place follows, however uneven it is."""
SMOOTH_ROUNDS: Final = 20
MOST_PART: Final = 0.65
"""Of the places: where fewer follow one smooth line, it is not known which of them are the fibre's.
"""
SQRT_2: Final = 2.0**0.5
AROUND: Final = 4
"""So many steps to both sides show how steep the line is."""
LEAST_PLACES: Final = 8
BESIDE_PART: Final = 0.35
"""Of how dark the fibre is: what else is as dark beside it may draw its middle away."""


@dataclass(frozen=True, slots=True, eq=False)
class FibreSeen:
    """Where a held fibre runs in one image.

    Attributes
    ----------
    aside_um : ndarray, shape (n,), float64
        Of each place, the way of the push, beside where it should run unpushed.
    dark : ndarray, shape (n,), float64
        How much darker than the ground it is there, grey levels.
    scale_um_px : float
    """

    aside_um: Floats
    dark: Floats
    scale_um_px: float


@dataclass(frozen=True, slots=True, eq=False)
class HeldLine:
    """A fibre in the jaws as it should run, and the way it is pushed.

    Attributes
    ----------
    span_um : float
        Where the probe stands, from the tip of the jaws.
    width_um : float
        Of the fibre.
    sign : float
        1 where the push goes to growing y.
    """

    work: HandlingContext
    shape: HeldShape
    span_um: float
    width_um: float
    sign: float

    def places_um(self, scale_um_px: float) -> Floats:
        """Return where along the jaws the fibre is looked for."""
        return np.arange(NEAR_JAWS_UM, self.span_um - NEAR_PROBE_UM, APART_PX * scale_um_px)

    def seen(self, image: CameraImage, pushed_um: float = 0.0) -> FibreSeen:
        """Return where it runs in an image, near where it is foreseen.

        Parameters
        ----------
        pushed_um : float
            How far it was pushed at the probe.
        """
        work = self.work
        mapped = work.mapped_near(image, work.hold_tip_um)
        scale = mapped.scale_um_px
        ahead = self.places_um(scale)
        part = ahead / self.span_um
        foreseen = pushed_um * part**2 * (1.5 - 0.5 * part)
        half_px = 0.5 * self.width_um / scale
        reach_px = 2.0 * SLACK_PX + half_px + CLEAR_PX
        offsets_px = np.arange(-reach_px, reach_px, FINE_PX)
        x, y = work.tip_now(work.gripper)
        bows = np.array([self.shape.bow_um(float(each)) for each in ahead])
        middle = y + bows + self.sign * foreseen
        across = middle[:, None] + self.sign * scale * offsets_px[None, :]
        along = np.broadcast_to((x + work.jaws.forward * ahead)[:, None], across.shape)
        points_px = mapped.to_px(np.column_stack([along.ravel(), across.ravel()]))
        greys = _greys(image, points_px).reshape(across.shape)
        found = [_darkest(offsets_px, each, half_px) for each in greys]
        off_px, dark = np.array(found).reshape(-1, 2).T
        return FibreSeen(foreseen + scale * off_px, dark, scale)

    def bent(
        self, before: FibreSeen, after: FibreSeen, *, probe_um: float, force_un: float
    ) -> BentShape:
        """Return how far it was bent between two images, where both show it.

        Nowhere, where they were taken at different magnifications.
        """
        if before.scale_um_px != after.scale_um_px:
            return BentShape(np.empty(0), np.empty(0), np.inf, probe_um, force_un)
        ahead = self.places_um(after.scale_um_px)
        aside = after.aside_um - before.aside_um
        good = np.isfinite(aside) & np.isfinite(before.dark) & np.isfinite(after.dark)
        for each in (before, after):
            typical = float(np.median(each.dark[good])) if good.any() else np.inf
            good &= each.dark > LEAST_DARK_PART * typical
        # What lies below is as dark in both images, and no other place of the fibre is.
        times = after.dark / np.maximum(before.dark, 1e-9)
        good &= (times > LEAST_DARK_PART) & (times < 1.0 / LEAST_DARK_PART)
        ahead, aside = ahead[good], aside[good]
        std = max(_scatter(aside), LEAST_STD_PX * after.scale_um_px)
        kept = _in_one_piece(ahead, aside, std)
        kept[kept] = _on_one_line(ahead[kept], aside[kept], std)
        return BentShape(ahead[kept], aside[kept], std, probe_um, force_un)


def _greys(image: CameraImage, points_px: Floats) -> Floats:
    """Return the brightness at places between pixels; nan off the image."""
    import cv2  # imported here: it takes a while

    pixels = grey(image.data).astype(np.float32)
    places = points_px.astype(np.float32).reshape(1, -1, 2)
    found = cv2.remap(
        pixels,
        places[..., 0],
        places[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(float("nan"),),
    )
    return np.asarray(found.ravel(), dtype=np.float64)


def _darkest(offsets_px: Floats, greys: Floats, half_px: float) -> tuple[float, float]:
    """Return where across a line the middle of something dark is, and how dark; nan: nowhere."""
    if not np.isfinite(greys).all():
        return np.nan, np.nan
    dark = np.clip(float(np.percentile(greys, GROUND_PERCENT)) - greys, 0.0, None)
    wide = max(1, round(half_px / FINE_PX))
    smooth = np.convolve(dark, np.ones(wide) / wide, mode="same")
    near = np.abs(offsets_px) <= SLACK_PX
    middle = float(offsets_px[int(np.argmax(np.where(near, smooth, -1.0)))])
    spread = max(1.5, half_px)
    for _ in range(ROUNDS):
        weights = dark * np.exp(-0.5 * ((offsets_px - middle) / spread) ** 2)
        total = float(weights.sum())
        if not total > 0.0:
            return np.nan, np.nan
        middle = float(weights @ offsets_px) / total
    there = float(np.interp(middle, offsets_px, smooth))
    away = np.abs(offsets_px - middle)
    beside = smooth[(away > half_px + CLEAR_PX) & (away < half_px + CLEAR_PX + SLACK_PX)]
    alone = beside.max(initial=0.0) < BESIDE_PART * there
    return (middle, there) if alone else (np.nan, np.nan)


def _scatter(values: Floats) -> float:
    """Return the standard deviation of single values about a smooth line through them."""
    if len(values) < 4:
        return np.inf
    turns = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return float(1.4826 * np.median(np.abs(turns)) / np.sqrt(6.0))


def _in_one_piece(ahead_um: Floats, aside_um: Floats, std_um: float) -> npt.NDArray[np.bool_]:
    """Return which values are of the longest piece without a jump: beyond is something else."""
    kept = np.zeros(len(ahead_um), dtype=np.bool_)
    if len(ahead_um) < LEAST_PLACES:
        return kept
    apart, steps = np.diff(ahead_um), np.diff(aside_um)
    around = np.lib.stride_tricks.sliding_window_view(
        np.pad(steps / apart, AROUND, mode="reflect"), 2 * AROUND + 1
    )
    jumps = np.abs(steps - np.median(around, axis=1) * apart) > OFF_SIGMAS * SQRT_2 * std_um
    pieces = np.concatenate([[0], np.cumsum(jumps)])
    return np.asarray(pieces == np.bincount(pieces).argmax())


def _on_one_line(ahead_um: Floats, aside_um: Floats, std_um: float) -> npt.NDArray[np.bool_]:
    """Return which values follow the smooth line of most of them: all, where no line is.

    Something dark that stays where it is draws the middle of the fibre towards it, the less the
    farther the fibre has gone, and so without a jump.
    """
    every = np.ones(len(ahead_um), dtype=np.bool_)
    if len(ahead_um) < LEAST_PLACES:
        return every
    powers = np.vander((ahead_um - ahead_um.mean()) / np.ptp(ahead_um), SMOOTH_ORDER + 1)
    weights, off = np.ones(len(ahead_um)), np.zeros(len(ahead_um))
    for _ in range(SMOOTH_ROUNDS):
        weighed = powers * weights[:, None]
        off = aside_um - powers @ np.linalg.lstsq(weighed, aside_um * weights, rcond=None)[0]
        scatter = max(std_um, 1.4826 * float(np.median(np.abs(off))))
        weights = 1.0 / np.sqrt(1.0 + (off / (2.0 * scatter)) ** 2)
    near = np.abs(off) < OFF_SIGMAS * std_um
    return near if near.mean() > MOST_PART else every
