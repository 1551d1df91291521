"""The shape of a pushed fibre as an image shows it: a second witness beside the force.

It is fitted without the force. How far the fibre is bent at the probe has to agree with how far the
probe has pushed it, and the shape with that of one beam which is clamped where the spans say, and
varies along itself as they allow. A fibre that turns or slides in the jaws, has a weak place, or
meets something besides the probe, bends otherwise.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtrc

from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.frame.arrays import Floats

CELLS: Final = 160
LEAST_PLACES: Final = 8
LEAST_SHOWN: Final = 0.4
"""Of how far the fibre is bent at the probe: less than that tells nothing of what it is there."""
LEAST_BENT_TIMES: Final = 12.0
"""Of the scatter of one place: what is bent less shows no shape."""
SHIFT_UM: Final = 1.5
"""How far an image may be shifted against an earlier one: stages creep, and the air trembles."""
LARGE_PART: Final = 0.015
"""Of how far it is bent: what a large push makes of the shape of a small one."""
SCALE_PART: Final = 0.01
"""How well an image tells micrometres of a platform."""
DEPTH_STEP_UM: Final = 1.0
LEAST_VARIATION: Final = 0.1
UNLIKELY: Final = 1e-4
SIGMAS: Final = 4.0
LEAST_FIBRES: Final = 4


@dataclass(frozen=True, slots=True, eq=False)
class BentShape:
    """How far aside an image shows a fibre at the end of a push, less where it lay before.

    Attributes
    ----------
    ahead_um, aside_um : ndarray, shape (n,), float64
        Places along the jaws from their tip, and how far the fibre had gone aside there, positive
        the way of the push.
    std_um : float
        Standard deviation of one of them, by how well the image shows it.
    probe_um : float
        Position of the probe's axis across the fibre when the image was taken.
    force_un : float
        What the sensor felt then, above the baseline.
    """

    ahead_um: Floats
    aside_um: Floats
    std_um: float
    probe_um: float
    force_un: float


@dataclass(frozen=True, slots=True)
class ShapeFit:
    """What the image says of a push.

    Attributes
    ----------
    bent_um, bent_std_um : float
        How far the fibre was bent where the probe stands, by the image alone.
    pushed_um, pushed_std_um : float
        The same by the axis and the force.
    chi2, freedom : float, int
        Of the shape.
    turned_part, turned_std_part : float
        Part of its way that the fibre goes as if it only turned about the jaws' tip, beyond what
        the clamp's depth makes of it.
    """

    bent_um: float
    bent_std_um: float
    pushed_um: float
    pushed_std_um: float
    chi2: float
    freedom: int
    turned_part: float
    turned_std_part: float

    @property
    def problem(self) -> str:
        """What does not agree; empty where all does."""
        off = self.bent_um - self.pushed_um
        if abs(off) > SIGMAS * math.hypot(self.bent_std_um, self.pushed_std_um):
            return (
                f"the image shows the fibre bent by {self.bent_um:.1f} um, and the probe has "
                f"pushed it by {self.pushed_um:.1f} um"
            )
        if chdtrc(self.freedom, self.chi2) < UNLIKELY:
            times = math.sqrt(self.chi2 / self.freedom)
            return (
                "the image shows it bent otherwise than one beam bends: "
                f"{times:.1f} times as far off as can be chance"
            )
        return ""


def fitted_shape(
    bent: BentShape,
    shape: NaturalShape,
    *,
    pushed_um: float,
    pushed_std_um: float,
    depth_um: float,
    depth_std_um: float,
    variation: float,
    length_um: float,
) -> ShapeFit | None:
    """Return what the image says of a push; None where it shows too little.

    Parameters
    ----------
    pushed_um, pushed_std_um : float
        How far the fibre gave way at the probe, by the axis and what gives way besides.
    depth_um, depth_std_um : float
        How deep in the jaws it is clamped.
    variation, length_um : float
        How much ln(EI) varies along the fibre, and over which length.
    """
    if len(bent.ahead_um) < LEAST_PLACES or not pushed_um > LEAST_BENT_TIMES * bent.std_um:
        return None
    unit, by_cell, middles = _unit(shape, bent.ahead_um, depth_um)
    if unit.max() < LEAST_SHOWN:
        return None
    deeper, _, _ = _unit(shape, bent.ahead_um, depth_um + DEPTH_STEP_UM)
    by_depth = (deeper - unit) / DEPTH_STEP_UM
    alike = np.exp(-np.abs(middles[:, None] - middles[None, :]) / length_um)
    varied = max(variation, LEAST_VARIATION) * pushed_um
    noise = bent.std_um**2 + (LARGE_PART * pushed_um * unit) ** 2
    whole = (
        np.diag(noise)
        + SHIFT_UM**2
        + (pushed_um * depth_std_um) ** 2 * np.outer(by_depth, by_depth)
        + varied**2 * by_cell @ alike @ by_cell.T
    )
    root = np.linalg.inv(whole)
    information = float(unit @ root @ unit)
    found = float(unit @ root @ bent.aside_um) / information
    left = bent.aside_um - found * unit
    turned, std = _turned_um(
        bent, shape, unit, pushed_um, whole + pushed_std_um**2 * np.outer(unit, unit)
    )
    return ShapeFit(
        bent_um=found,
        bent_std_um=math.hypot(information**-0.5, SCALE_PART * found),
        pushed_um=pushed_um,
        pushed_std_um=pushed_std_um,
        chi2=float(left @ root @ left),
        freedom=len(left) - 1,
        turned_part=turned / pushed_um,
        turned_std_part=std / pushed_um,
    )


def bent_um(shape: NaturalShape, ahead_um: Floats, *, pushed_um: float, depth_um: float) -> Floats:
    """Return how far places ahead of the jaws go aside in one even beam, shape (n,).

    Parameters
    ----------
    pushed_um : float
        How far the fibre gave way at the probe.
    depth_um : float
        How deep in the jaws it is clamped.
    """
    return pushed_um * _unit(shape, ahead_um, depth_um)[0]


def turned_in_jaws(fits: Sequence[ShapeFit]) -> str:
    """Return what images of several fibres say of the jaws; empty where those hold them firmly.

    One fibre may be soft where it leaves the jaws. Where all seem to be, the jaws turn, or the
    depths of the clamp are wrong together: spans cannot tell one from the other.
    """
    if len(fits) < LEAST_FIBRES:
        return ""
    weights = np.array([each.turned_std_part**-2.0 for each in fits])
    part = float(weights @ [each.turned_part for each in fits] / weights.sum())
    std = float(weights.sum() ** -0.5)
    if not part > SIGMAS * std:
        return ""
    return (
        f"images of {len(fits)} fibres show them turn in the jaws where the model has them bend: "
        f"{100.0 * part:.0f} +/- {100.0 * std:.0f} % of the way of the probe"
    )


def _turned_um(
    bent: BentShape, shape: NaturalShape, unit: Floats, pushed_um: float, whole: Floats
) -> tuple[float, float]:
    """Return how far the probe has only turned the fibre, instead of bending it, and the error."""
    more = bent.ahead_um / shape.at_um - unit
    root = np.linalg.inv(whole)
    information = float(more @ root @ more)
    turned = float(more @ root @ (bent.aside_um - pushed_um * unit)) / information
    return turned, information**-0.5


def _unit(shape: NaturalShape, ahead_um: Floats, depth_um: float) -> tuple[Floats, Floats, Floats]:
    """Return how far places go aside where the contact goes by 1, and what changes that.

    Returns
    -------
    unit : ndarray, shape (n,)
    by_cell : ndarray, shape (n, CELLS)
        Change of `unit` where ln(EI) of a piece of the fibre grows by 1.
    middles : ndarray, shape (CELLS,)
        Where the pieces lie along the fibre, from the jaws' tip.
    """
    along, arms = shape.arms_um()
    edges = np.linspace(-depth_um, float(along[-1]), CELLS + 1)
    middles, step = 0.5 * (edges[1:] + edges[:-1]), float(edges[1] - edges[0])
    arm = np.where(middles < 0.0, arms[0] - middles, np.interp(middles, along, arms))
    places = np.append(np.interp(ahead_um, *_runs(shape)), along[-1])
    x, y = shape.places_um(places)
    slopes = np.gradient(shape.aside_um, shape.ahead_um)
    slope = np.interp(x, shape.ahead_um, slopes)
    cell_x, cell_y = shape.places_um(middles)
    lever = (x[:, None] - cell_x) + slope[:, None] * (y[:, None] - cell_y)
    each = np.where(middles[None, :] < places[:, None], lever * arm, 0.0) * step
    moved = each.sum(axis=1)
    unit = moved[:-1] / moved[-1]
    by_cell = (unit[:, None] * each[-1] - each[:-1]) / moved[-1]
    return unit, by_cell, middles


def _runs(shape: NaturalShape) -> tuple[Floats, Floats]:
    """Return places ahead of the jaws and how far along the fibre they lie."""
    steps = np.hypot(np.diff(shape.ahead_um), np.diff(shape.aside_um))
    return shape.ahead_um, np.concatenate([[0.0], np.cumsum(steps)])
