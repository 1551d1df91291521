"""What is true of a fibre at one moment."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.twin.centre_line import CentreLine
from cosmic.twin.fibre import Fibre, PlatePose
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.kinematics import Point
from cosmic.twin.optics.bent import Compliance
from cosmic.twin.tools import Tool

Where = Literal["plate", "held", "stuck", "hanging", "gone"]


@dataclass(frozen=True, slots=True, eq=False)
class FibreState:
    """Where a fibre is and who has it.

    Attributes
    ----------
    settings : FibreSettings
        Size and stiffness; shorter than at the start where it broke.
    held_by : tuple of str
        Grippers; empty while none holds it.
    where : str
        "plate", "held", "stuck" to a jaw that opened, "hanging" on a held fibre, "gone" off the
        plate.
    plate_pose : (float, float, float)
        x, y and angle (rad) of its own frame on the plate, while it lies there.
    anchor : str
        The tip that it goes along with otherwise; see `Workspace.tips`.
    relative_um : ndarray, shape (n, 3), float64
        Where it is relative to the anchor, not counting what the probe does to it; empty on the
        plate.
    tension_un : float
        Pull between two grippers.
    seen_um : float
        How wide it looks from above: a ribbon in the jaws shows its edge, or its face.
    compliance : Compliance or None
        How it gives way to the probe, where one gripper holds it.
    """

    number: int
    settings: FibreSettings
    held_by: tuple[str, ...]
    where: Where
    shape: CentreLine
    plate_pose: PlatePose
    anchor: str
    relative_um: Floats
    tension_un: float
    seen_um: float
    compliance: Compliance | None
    _position: Floats

    @property
    def line_um(self) -> Floats:
        """Its middle in the world, shape (n, 3), um, not counting what the probe does to it."""
        if self.where not in ("plate", "gone"):
            return np.asarray(self.relative_um + self._position)
        flat = self.shape.placed(*self.plate_pose)
        height = np.full(len(flat), 0.5 * self.settings.thickness_um)
        whole = np.column_stack([flat, height, np.ones(len(flat))])
        return np.asarray((whole @ self._position.T)[:, :3])

    @property
    def ends_um(self) -> tuple[Point, Point]:
        """Both ends of that."""
        first, last = self.line_um[[0, -1]].tolist()
        return tuple(first), tuple(last)


_NONE = np.empty((0, 3))


def state_of(
    fibre: Fibre, tools: Mapping[str, Tool], tips: Mapping[str, Point], plate: Floats
) -> FibreState:
    """Return what is true of a fibre now."""
    where: Where = "gone" if fibre.gone else "plate"
    anchor, relative, position, tension = "", _NONE, plate, 0.0
    if fibre.holds:
        where, anchor = "held", f"{next(iter(fibre.holds))}.hold"
        relative = fibre.held_um(tools)
        if len(fibre.holds) > 1:
            tension = fibre.tension_un(fibre.line(tools).reach_um)
    elif fibre.carried is not None:
        carried = fibre.carried
        where, anchor, relative = carried.why, carried.anchor, carried.line_um
    if anchor:
        position = np.array(tips[anchor])
    return FibreState(
        fibre.number,
        fibre.settings,
        tuple(fibre.holds),
        where,
        fibre.line_um,
        fibre.plate_pose,
        anchor,
        relative,
        tension,
        fibre.seen_um,
        fibre.compliance,
        position,
    )
