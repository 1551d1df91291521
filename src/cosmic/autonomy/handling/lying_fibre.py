"""Where the fibre that is to be grasped lies, followed from image to image beside the jaws."""

import math
from typing import Final

import numpy as np

from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.guided_move import Aim
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import along
from cosmic.autonomy.handling.sight import trace_along
from cosmic.autonomy.handling.tips import see_tip
from cosmic.autonomy.tools import tip_um
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.vision.tool_types import GripperTips

BEGIN_UM: Final = 60.0
LENGTH_UM: Final = 320.0
"""Where it is followed: so far ahead of the jaws, which hide what is between them, and so much."""
LEAST_PART: Final = 0.35
"""Of its contrast as it was measured: what is fainter is something else."""
ALIKE: Final = 2.0
"""From image to image it is so many times as dark at most."""
STEEPEST: Final = 0.5
"""Of the normal of its line, the part across the jaws at least: else nobody knows how far aside."""
TRACE_STD_PX: Final = 0.3


class LyingFibre:
    """A fibre on the plate that may shift while jaws come down around it; the run's thread.

    Parameters
    ----------
    line_um : ndarray, shape (n, 2), float64
        Its centre line on the platform, from the end that is grasped, as it was measured.

    Attributes
    ----------
    shift_um : float
        How far across the jaws it lies from there, as the last image that showed it says.
    """

    def __init__(self, work: HandlingContext, fibre: HeldFibre, line_um: Floats) -> None:
        self.shift_um = self._step_um = 0.0
        self._contrast: float | None = None
        self._jaws_off_um: float | None = None
        self._work = work
        self._fibre = fibre
        self._line = line_um
        last = min(BEGIN_UM + LENGTH_UM, max(fibre.free_um, 2.0 * BEGIN_UM))
        at = np.linspace(fibre.inside_um + BEGIN_UM, fibre.inside_um + last, 40)
        self._ahead = np.array([along(line_um, float(at_um)) for at_um in at])

    def follow(self, image: CameraImage) -> float | None:
        """See where it is now; returns how sure that is, um, or None where it is not seen."""
        mapped = self._work.mapped(image)
        # It goes on as it went.
        foreseen = self.shift_um + self._step_um
        points = mapped.to_px(self._ahead + np.array([0.0, foreseen]))
        reach_px = self._work.settings.grasp.followed_um / mapped.scale_um_px
        trace = trace_along(image, points, reach_px)
        if not self._is_it(trace.contrast):
            self._step_um = 0.0
            return None
        ahead, middle = points[-1] - points[0], points.mean(axis=0)
        left = np.array([ahead[1], -ahead[0]]) / np.linalg.norm(ahead)
        normal = mapped.to_um(middle + left) - mapped.to_um(middle)
        size = float(np.linalg.norm(normal))
        if not abs(float(normal[1])) > STEEPEST * size:
            return None
        now = foreseen + trace.offset_px * size**2 / float(normal[1])
        self._step_um, self.shift_um = now - self.shift_um, now
        self._contrast = trace.contrast
        return math.hypot(TRACE_STD_PX * mapped.scale_um_px, float(mapped.std_um(middle)))

    def _is_it(self, contrast: float) -> bool:
        if self._contrast is None:
            return contrast > LEAST_PART * self._fibre.reach.candidate.contrast
        return self._contrast / ALIKE < contrast < self._contrast * ALIKE

    def aim(self, image: CameraImage, at_rest: bool) -> Aim | None:
        """Return where the gripper's tip, in y, has the fibre in the middle between the jaws.

        How far the jaws are seen from where their stages say is measured while they do not go
        aside: a position that is late would be taken for it.
        """
        positions = image.circumstances.positions
        believed = tip_um(self._work.gripper, positions)
        try:
            std = self.follow(image)
            found = see_tip(self._work, image, self._work.gripper)
            if std is None or believed is None or not isinstance(found, GripperTips):
                return None
            mapped = self._work.mapped(image, believed[2])
        except NotAvailable:
            return None
        x, y = mapped.to_um(found.hold_px).tolist()
        if at_rest or self._jaws_off_um is None:
            self._jaws_off_um = believed[1] - y
        target = self.beside_um(x) + self._jaws_off_um - self._fibre.shift_um
        jaws = found.std_px * mapped.scale_um_px, float(mapped.std_um(found.hold_px))
        return Aim(target, math.hypot(std, *jaws))

    def beside_um(self, x_um: float) -> float:
        """Return its y there."""
        order = np.argsort(self._line[:, 0])
        line = self._line[order]
        return float(np.interp(x_um, line[:, 0], line[:, 1])) + self.shift_um
