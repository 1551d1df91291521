"""The free part of a fibre that a gripper holds: from the jaws' front to its tip, or to the next.

Jaws are as dark as a fibre, so that a centre line runs into them. Where they are is known, and the
line is cut at their front. Next to the front it is bent by the jaws' own shade; what lies between
one and several widths further out says where, and in which direction, the fibre leaves.
"""

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from cosmic.frame.arrays import Floats, Mask
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.vision import axial, beyond, certainty, checks
from cosmic.vico.core.vision.ends import EndKind
from cosmic.vico.core.vision.smoothing import arc_lengths, resampled
from cosmic.vico.core.vision.tool_types import GripperTips

SHADE_WIDTHS: Final = 1.0
SHADE_PX: Final = 10.0
NEAR_PX: Final = 16.0
"""So much farther than a width from the front an end may be lost in the jaws' shade."""
FITTED_WIDTHS: Final = 7.0
FITTED_PX: Final = 40.0
STEP_PX: Final = 1.0
OF_THE_JAWS: Final = frozenset(
    {
        EndKind.BORDER.value,
        EndKind.BODY.value,
        EndKind.LOST.value,
        axial.GAP,
        axial.DOUBLED,
        axial.STEP,
        beyond.GOES_ON,
        beyond.SOFT,
        certainty.IMPROBABLE,
        checks.CONTINUES,
        checks.IMPRECISE,
        checks.LEFT_OVER,
    }
)
"""What jaws do to the line of a fibre that they hold; that it is one is known."""
FEWEST: Final = 8


@dataclass(frozen=True, slots=True)
class Clamp:
    """Where a fibre leaves a gripper.

    Attributes
    ----------
    leaves_px : (float, float)
        On the line between the two fronts.
    angle_deg : float
        From the direction in which the gripper points to that of the fibre, towards the y axis
        (clockwise on the screen) positive: the slope at the clamp.
    angle_std_deg : float
    curvature_px : float
        1/px, with the sign of `angle_deg`.
    """

    leaves_px: tuple[float, float]
    angle_deg: float
    angle_std_deg: float
    curvature_px: float


@dataclass(frozen=True, slots=True, eq=False)
class HeldShape:
    """The free part of a held fibre.

    Attributes
    ----------
    line_px : ndarray, shape (n, 2)
        From the (first) gripper on.
    length_px, length_std_px : float
    clamps : tuple of Clamp
        One, or one for each gripper.
    doubts : tuple of str
        Those of the grippers' tips, and of the fibre but for what jaws do to its line.
    """

    line_px: Floats
    length_px: float
    length_std_px: float
    clamps: tuple[Clamp, ...]
    doubts: tuple[str, ...]


class TracedLine(Protocol):
    """What `held_shape` takes: a `Fibre`, or a line that was followed."""

    @property
    def centre_line_px(self) -> Floats:
        """Points x, y from end to end, shape (n, 2)."""
        ...

    @property
    def width_px(self) -> float:
        """Mean width."""
        ...

    @property
    def ends_px(self) -> Floats:
        """The two ends, shape (2, 2)."""
        ...

    @property
    def ends_std_px(self) -> Floats:
        """How sure each is, shape (2,)."""
        ...

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why it may not be one whole fibre."""
        ...


def held_shape(
    fibre: TracedLine, gripper: GripperTips, other: GripperTips | None = None
) -> HeldShape:
    """Return the free part of a fibre between a gripper and its tip, or between two grippers.

    Raises
    ------
    NotAvailable
        The fibre does not come out between the jaws.
    """
    line = resampled(fibre.centre_line_px, STEP_PX)
    free, first = _cut(line, gripper, fibre.width_px)
    away = np.linalg.norm(fibre.ends_px - free[-1], axis=1)
    ends_std = float(fibre.ends_std_px[int(np.argmin(away))])
    clamps = [first]
    if other is not None:
        back, last = _cut(free[::-1], other, fibre.width_px)
        free = back[::-1]
        clamps.append(last)
        ends_std = other.std_px
    length = float(arc_lengths(free)[-1])
    std = float(np.hypot(np.hypot(gripper.std_px, ends_std), 2e-4 * length))
    doubts = [*gripper.doubts, *(other.doubts if other is not None else ())]
    doubts += [each for each in fibre.doubts if each not in OF_THE_JAWS]
    return HeldShape(free, length, std, tuple(clamps), tuple(dict.fromkeys(doubts)))


def _cut(line: Floats, gripper: GripperTips, width: float) -> tuple[Floats, Clamp]:
    """Return the part ahead of a gripper's front, from there on, and how it leaves."""
    forward = np.mean([jaw.forward for jaw in gripper.jaws], axis=0)
    norm = float(np.linalg.norm(forward))
    if not norm > 0.5:
        raise ConfigError("held fibre: the jaws do not point to one side")
    forward /= norm
    hold = np.array(gripper.hold_px)
    ahead = (line - hold) @ forward
    aside = np.abs((line - hold) @ np.array([-forward[1], forward[0]]))
    reach = 0.5 * gripper.gap_px + 0.5 * max(jaw.width_px for jaw in gripper.jaws) + width
    out = _coming_out(line, ahead, aside <= reach, SHADE_WIDTHS * width + NEAR_PX)
    s = float((out[0] - hold) @ forward) + arc_lengths(out)
    skip = SHADE_WIDTHS * width + SHADE_PX
    used = (s >= skip) & (s <= max(skip, float(s[0])) + max(FITTED_WIDTHS * width, FITTED_PX))
    if used.sum() < FEWEST:
        raise NotAvailable("held fibre: too little of it is free to be measured")
    return _leaving(out, s, used, hold, forward)


def _coming_out(line: Floats, ahead: Floats, beside: Mask, near: float) -> Floats:
    """Return the part of a line that is ahead of the front, from there on."""
    crosses = ((ahead[:-1] <= 0) != (ahead[1:] <= 0)) & beside[:-1]
    crossings = np.flatnonzero(crosses)
    if len(crossings):
        at = int(crossings[-1] if ahead[-1] > 0 else crossings[0])
        return line[at + 1 :] if ahead[at + 1] > 0 else line[at::-1]
    # It may be lost in the shade of the jaws shortly before it comes to them.
    for ends in (line, line[::-1]):
        first = 0 if ends is line else -1
        if 0 < ahead[first] <= near and beside[first]:
            return ends
    raise NotAvailable("held fibre: no fibre comes out between the jaws; look at the image")


def _leaving(
    out: Floats, s: Floats, used: Mask, hold: Floats, forward: Floats
) -> tuple[Floats, Clamp]:
    """Return a line that begins at the front, found by a parabola through what is near it."""
    side = np.array([-forward[1], forward[0]])
    along, aside = (out - hold) @ forward, (out - hold) @ side
    fitted, spread = np.polyfit(along[used], aside[used], 2, cov="unscaled")
    rest = aside[used] - np.polyval(fitted, along[used])
    # Neighbouring points of a smooth line are not measured by themselves.
    noise = max(float(rest.std()), 0.05) * np.sqrt(FEWEST)
    slope, bend = float(fitted[1]), 2.0 * float(fitted[0])
    first = float(along[used].min())
    near = np.arange(0.0, max(first, STEP_PX), STEP_PX)
    start = hold + near[:, None] * forward + np.polyval(fitted, near)[:, None] * side
    rest_of = out[s > float(s[used][0])]
    return np.concatenate([start, rest_of]), Clamp(
        (float(start[0, 0]), float(start[0, 1])),
        float(np.degrees(np.arctan(slope))),
        float(np.degrees(noise * np.sqrt(spread[1, 1]) / (1.0 + slope**2))),
        bend / (1.0 + slope**2) ** 1.5,
    )
