"""The width of a fibre from its cross section, which is that of a hollow bar, blurred.

Half of the height is where the edge of a wide bar lies, but not that of a narrow hollow one: blur
fills the hollow first, and what is left looks like a wider bar without one. So the bar, its hollow
and the blur are fitted together, with weak beliefs of what fibres are. Where an image does not
tell them apart the beliefs decide, and the deviation grows.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import erf

from cosmic.frame.arrays import Floats, Floats32, Mask
from cosmic.vico.core.vision.grey import middle
from cosmic.vico.core.vision.profiles import Scene
from cosmic.vico.core.vision.smoothing import directions

BIN_PX: Final = 0.5
MOST_PARTS: Final = 16
FEWEST_ROWS: Final = 8
MOST_ROWS: Final = 320
FEWEST_IN_BIN: Final = 2
FEWEST_BINS: Final = 10
ROUNDS: Final = 14
MODEL_SHARE: Final = 0.004
"""Of the contrast: to more than this no real cross section is a hollow bar."""
DOUBT_SHARE: Final = 0.3
"""Of what the fit takes off the width at half of the height: so much may be wrong with it."""

LUMEN_DEPTH: Final = (0.3, 0.3)
"""Light in the hollow: 0, as dark as the walls, to 1, as light as the ground; its deviation."""
LUMEN_PART: Final = (0.55, 0.15)
"""Part of the width that is hollow."""
BLUR_PX: Final = 1.0
BLUR_LN: Final = 0.6
SHARED_LN: Final = 0.02
"""What fibres on one image do not tell better of its blur, however many they are."""
APERTURE_PX: Final = 0.29
"""Blur of the square of a pixel: no image is sharper."""

HEIGHT, DEPTH, GROUND, CENTRE, HALF, PART, BLUR = range(7)


@dataclass(frozen=True, slots=True)
class Section:
    """What a cross section amounts to, pixels.

    Attributes
    ----------
    blur_ln, blur_ln_std : float
        Logarithm of the standard deviation of the blur, with that of the pixels, as far as this
        section tells it.
    leaning : float
        By how much the width changes with that logarithm.
    hollow : float
        Light in the hollow, from the walls' (0) to the ground's (1), less its deviation.
    """

    width_px: float
    width_std_px: float
    blur_ln: float
    blur_ln_std: float
    leaning: float
    hollow: float = 0.0

    def with_blur(self, blur_ln: float, std: float) -> "Section":
        """Return the section in the light of what else is known of the blur."""
        own, other = self.blur_ln_std**-2, max(std, 1e-3) ** -2
        shift = other / (own + other) * (blur_ln - self.blur_ln)
        left = 1.0 / (own + other)
        gained = self.leaning**2 * (self.blur_ln_std**2 - left)
        return replace(
            self,
            width_px=max(self.width_px + self.leaning * shift, 0.5 * self.width_px),
            width_std_px=math.sqrt(max(self.width_std_px**2 - gained, 1e-4)),
            blur_ln=self.blur_ln + shift,
            blur_ln_std=math.sqrt(left),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Heights over the distance from the centre line, with their deviations."""

    across: Floats
    height: Floats
    std: Floats


def gathered(scene: Scene, line: Floats, good: Mask, ground: Floats, reach: float) -> Samples:
    """Return the heights of the pixels along a line over their distance from it.

    Pixels are taken as they are, each at its own distance: interpolated ones are more blurred.
    """
    rows = np.flatnonzero(good)
    rows = rows[:: 1 + len(rows) // MOST_ROWS]
    parts = int(np.clip(len(rows) // FEWEST_ROWS, 1, MOST_PARTS))
    ahead = directions(line)[rows].astype(np.float32)
    points = line[rows].astype(np.float32)
    most = math.ceil(reach)
    steps = np.arange(-most, most + 1, dtype=np.float32)
    x = points[:, 0, None] - ahead[:, 1, None] * steps
    y = points[:, 1, None] + ahead[:, 0, None] * steps
    column, row = np.rint(x), np.rint(y)
    away = steps + (row - y) * ahead[:, 0, None] - (column - x) * ahead[:, 1, None]
    right, bottom = scene.corner
    inside = (column >= 0) & (column <= right) & (row >= 0) & (row <= bottom)
    inside &= np.abs(away) <= reach
    values = scene.image[
        np.clip(row, 0, bottom).astype(np.intp), np.clip(column, 0, right).astype(np.intp)
    ]
    height = np.float32(scene.sign) * (values - ground[rows, None].astype(np.float32))
    bins = int(2.0 * reach / BIN_PX) + 2
    index = np.rint((away + reach) / BIN_PX).astype(np.intp)
    index += (np.arange(len(rows)) * parts // max(len(rows), 1) * bins)[:, None]
    return _summed(index[inside], away[inside], height[inside], (parts, bins))


def _summed(
    at: npt.NDArray[np.intp], away: Floats32, height: Floats32, shape: tuple[int, int]
) -> Samples:
    """Return the median over parts of the fibre of the means in bins: dirt spoils a part only."""
    size = shape[0] * shape[1]
    count = np.bincount(at, minlength=size).reshape(shape)
    total = np.bincount(at, height, size).reshape(shape)
    seen = count >= FEWEST_IN_BIN
    full = 2 * seen.sum(axis=0) > shape[0]
    if not full.any():
        return Samples(*np.empty((3, 0)))
    seen, count, total = seen[:, full], count[:, full], total[:, full]
    mean = np.where(seen, total / np.maximum(count, 1), np.nan)
    typical = _middle(mean, seen)
    # The scatter of few parts is itself uncertain; that of all bins is not.
    scatter = 1.4826 * _middle(np.abs(mean - typical), seen)
    scatter = np.maximum(scatter, middle(scatter))
    point = np.bincount(at, away, size).reshape(shape)[:, full].sum(axis=0)
    return Samples(point / count.sum(axis=0), typical, 1.25 * scatter / math.sqrt(shape[0]))


def _middle(values: Floats, seen: Mask) -> Floats:
    """Return the median of each column of what was seen; the rest is NaN."""
    ordered, count = np.sort(values, axis=0), seen.sum(axis=0)
    columns = np.arange(values.shape[1])
    pair = ordered[(count - 1) // 2, columns] + ordered[count // 2, columns]
    return np.asarray(0.5 * pair)


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """What is believed of a section: where it lies most likely, how firmly, and its bounds."""

    mean: Floats
    precision: Floats
    low: Floats
    high: Floats

    @classmethod
    def of(cls, contrast: float, width: float) -> "Belief":
        """Return the belief for a fibre of some width at half of its height."""
        blur = math.log(BLUR_PX)
        mean = [contrast, LUMEN_DEPTH[0], 0.0, 0.0, 0.5 * width, LUMEN_PART[0], blur]
        std = [math.inf, LUMEN_DEPTH[1], 0.1 * contrast, 0.5, math.inf, LUMEN_PART[1], BLUR_LN]
        low = [0.2 * contrast, 0.0, -contrast, -1.0, 0.1 * width, 0.1, math.log(APERTURE_PX)]
        high = [9.0 * contrast, 0.98, contrast, 1.0, 0.8 * width + 1.0, 0.95, math.log(width + 4.0)]
        return cls(np.array(mean), np.array(std) ** -2.0, np.array(low), np.array(high))

    def within(self, state: Floats) -> Floats:
        """Return the nearest state within the bounds."""
        return np.minimum(np.maximum(state, self.low), self.high)


@dataclass(frozen=True, slots=True, eq=False)
class _At:
    """A state, how badly it fits, and the way to a better one."""

    state: Floats
    cost: float
    normal: Floats
    right: Floats

    @classmethod
    def of(cls, samples: Samples, weight: Floats, belief: Belief, state: Floats) -> "_At":
        model, slopes = _model(samples.across, state)
        rest = (samples.height - model) * weight
        off = belief.mean - state
        slopes *= weight[:, None]
        normal = slopes.T @ slopes
        normal.flat[::8] += belief.precision
        cost = float(rest @ rest + belief.precision @ (off * off))
        return cls(state, cost, normal, slopes.T @ rest + belief.precision * off)


def fit_section(samples: Samples, width: float) -> Section | None:
    """Fit a blurred hollow bar to a section of some width at half height; None: it is none."""
    contrast = float(samples.height.max(initial=0.0))
    if len(samples.across) < FEWEST_BINS or not contrast > 0.0:
        return None
    belief = Belief.of(contrast, width)
    weight = 1.0 / np.hypot(samples.std, MODEL_SHARE * contrast)
    now = _At.of(samples, weight, belief, belief.within(belief.mean))
    damping = 1e-3
    for _ in range(ROUNDS):
        damped = now.normal.copy()
        damped.flat[::8] *= 1.0 + damping
        state = belief.within(now.state + np.linalg.solve(damped, now.right))
        then = _At.of(samples, weight, belief, state)
        gain = now.cost - then.cost
        if gain >= 0.0:
            now, damping = then, 0.2 * damping
            if gain < 1e-3 * now.cost + 1e-2:
                break
        else:
            damping *= 8.0
    return _section(now, len(samples.across), width)


def _section(found: _At, count: int, width: float) -> Section:
    spread = np.linalg.inv(found.normal) * max(1.0, found.cost / (count - 7))
    half, blur = float(found.state[HALF]), float(found.state[BLUR])
    return Section(
        width_px=2.0 * half,
        width_std_px=math.hypot(
            2.0 * math.sqrt(float(spread[HALF, HALF])), DOUBT_SHARE * (width - 2.0 * half)
        ),
        blur_ln=blur,
        blur_ln_std=math.sqrt(float(spread[BLUR, BLUR])),
        leaning=2.0 * float(spread[HALF, BLUR] / spread[BLUR, BLUR]),
        hollow=float(found.state[DEPTH]) - math.sqrt(float(spread[DEPTH, DEPTH])),
    )


def _model(x: Floats, state: Floats) -> tuple[Floats, Floats]:
    """Return the section of a state, and its derivatives, shape (samples, 7)."""
    height, depth, ground, centre, half, part, log_blur = state.tolist()
    blur = math.exp(log_blur)
    outer = _bar(x - centre, half, blur)
    inner = _bar(x - centre, half * part, blur)
    slopes = np.empty((len(x), 7))
    slopes[:, HEIGHT] = outer[0] - depth * inner[0]
    slopes[:, DEPTH] = -height * inner[0]
    slopes[:, GROUND] = 1.0
    slopes[:, CENTRE] = height * (outer[2] - depth * inner[2])
    slopes[:, HALF] = height * (outer[1] - depth * part * inner[1])
    slopes[:, PART] = -height * depth * half * inner[1]
    slopes[:, BLUR] = height * (outer[3] - depth * inner[3])
    return ground + height * slopes[:, HEIGHT], slopes


def _bar(x: Floats, half: float, blur: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return a blurred bar, and how it changes with its half width, its point and its blur."""
    sides = np.array([half - x, half + x]) / blur
    right, left = np.exp(-0.5 * sides * sides) * (1.0 / math.sqrt(2.0 * math.pi))
    bar = 0.5 * erf(sides * math.sqrt(0.5)).sum(axis=0)
    return (
        bar,
        (right + left) / blur,
        (right - left) / blur,
        -(sides[0] * right + sides[1] * left),
    )


def pooled(sections: list[Section]) -> list[Section]:
    """Return sections from one image, which is blurred alike where it is in focus.

    One whose own blur disagrees lies at another height, and is left as it is.
    """
    if len(sections) < 2:
        return sections
    blurs = np.array([each.blur_ln for each in sections])
    stds = np.array([each.blur_ln_std for each in sections])
    typical = middle(blurs)
    alike = np.abs(blurs - typical) <= np.maximum(3.0 * stds, 0.1)
    found = []
    for index, each in enumerate(sections):
        others = alike.copy()
        others[index] = False
        if not (alike[index] and others.any()):
            found.append(each)
            continue
        weights = stds[others] ** -2.0
        mean = float((weights * blurs[others]).sum() / weights.sum())
        # They share what is wrong with the beliefs.
        std = math.hypot(float(weights.sum()) ** -0.5, SHARED_LN)
        found.append(each.with_blur(mean, std))
    return found
