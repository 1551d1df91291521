"""What the scene panel works out from the model of the platform."""

from collections.abc import Iterable
from typing import Final

from cosmic.mico.core.collision.model import SceneModel, pair_of
from cosmic.mico.core.motion.positioner import PositionerState

_STILL: Final = 1e-3
"""Share of its travel by which the position of an axis at rest may differ."""


def bodies_moved_by(model: SceneModel, axes: Iterable[str]) -> frozenset[str]:
    """Return the bodies that the axes move, with all that these carry."""
    wanted = frozenset(axes)
    driven = {drive.joint for drive in model.drives if drive.axis in wanted}
    moved: set[str] = set()
    for joint in model.joints:  # parents come before their children
        if joint.name in driven or joint.parent in moved:
            moved.add(joint.child)
    return frozenset(moved)


def margin_um(model: SceneModel, one: str, other: str) -> float:
    """Return how far apart two bodies must keep."""
    pair = pair_of(one, other)
    return next((each.margin_um for each in model.pairs if each.bodies == pair), 0.0)


def far(state: PositionerState, stood: float) -> bool:
    """Tell whether an axis stands elsewhere than where it stood."""
    if state.position is None:
        return False
    low, high = state.limits or (0.0, 1000.0)
    return abs(state.position - stood) > _STILL * (high - low)
