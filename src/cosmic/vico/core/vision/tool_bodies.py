"""What looks like a fibre, and is a jaw or the probe where stages and calibration say so."""

from collections.abc import Iterable
from typing import Final, TypeVar

import numpy as np
from scipy.spatial import cKDTree

from cosmic.frame.arrays import Floats
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.smoothing import arc_lengths
from cosmic.vico.core.vision.tool_types import ExpectedTool

SLACK_PX: Final = 12.0
"""How far beside a tool, or ahead of it, its line may lie: calibration, blur and shade."""
COVERED: Final = 0.5
"""Share of a held fibre's free part that is on a line which is that fibre, jaws and all."""
NEAR_PX: Final = 3.0

AnyFibre = TypeVar("AnyFibre", bound=Fibre)


def without_tools(
    fibres: Iterable[AnyFibre], tools: Iterable[ExpectedTool]
) -> tuple[AnyFibre, ...]:
    """Return the fibres but for those in doubt that lie on a tool.

    A line that leaves a tool by more than a jaw's width stays: it may be a fibre that is held.
    """
    known = tuple(tools)
    return tuple(
        each
        for each in fibres
        if each.certain or not any(_lies_on(each.centre_line_px, tool) for tool in known)
    )


def without_held(fibres: Iterable[AnyFibre], free_parts: Iterable[Floats]) -> tuple[AnyFibre, ...]:
    """Return the fibres but for those of which a free part between or before jaws is known.

    Parameters
    ----------
    free_parts : iterable of ndarray, shape (n, 2)
        Lines, in pixels of the same image.
    """
    known = tuple(free_parts)
    return tuple(
        each for each in fibres if not any(_covers(each.centre_line_px, free) for free in known)
    )


def _lies_on(line: Floats, tool: ExpectedTool) -> bool:
    forward = np.array(tool.forward)
    from_tip = line - np.array(tool.tip_px)
    ahead = from_tip @ forward
    aside = np.abs(from_tip @ np.array([-forward[1], forward[0]]))
    outside = (ahead > max(0.0, tool.step_px) + SLACK_PX) | (aside > tool.half_px + SLACK_PX)
    if outside.all():
        return False
    steps = np.diff(arc_lengths(line), prepend=0.0)
    return float(steps[outside].sum()) <= max(tool.width_px, SLACK_PX)


def _covers(line: Floats, free: Floats) -> bool:
    if not len(line) or not len(free):
        return False
    away = cKDTree(line).query(free)[0]
    return float((away <= NEAR_PX).mean()) >= COVERED
