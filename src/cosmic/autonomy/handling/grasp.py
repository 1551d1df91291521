"""Taking a fibre up, and what is known of its shape in the jaws."""

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.handling.approach import LOST, line_of
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import along, arc_lengths
from cosmic.autonomy.handling.sight import trace_along
from cosmic.autonomy.procedures.operation import OperationFailed, Steps, Yielded
from cosmic.frame.arrays import Floats
from cosmic.vico.core.image import CameraImage

TANGENT_UM: Final = 120.0
"""Length to both sides of the jaws' tip from which the direction there is taken."""
STEP_UM: Final = 5.0
SLOPE_UM: Final = 20.0
"""To both sides, from where a slope is taken."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldShape:
    """The free part of a fibre, which leaves the jaws straight ahead.

    Attributes
    ----------
    ahead_um, aside_um, along_um : ndarray, shape (n,), float64
        Of positions along it, from the jaws' tip: along the jaws, in y, and along the fibre. Ends
        where the fibre turns back.
    """

    ahead_um: Floats
    aside_um: Floats
    along_um: Floats

    @property
    def reach_um(self) -> float:
        """How far ahead of the jaws it reaches."""
        return float(self.ahead_um[-1])

    def bow_um(self, ahead_um: float) -> float:
        """Return how far in y the fibre is from straight ahead, so far from the jaws."""
        return float(np.interp(ahead_um, self.ahead_um, self.aside_um))

    def slope_at(self, ahead_um: float) -> float:
        """Return how steep the fibre is there, as a tangent."""
        near = self.bow_um(ahead_um + SLOPE_UM) - self.bow_um(ahead_um - SLOPE_UM)
        return near / (2.0 * SLOPE_UM)

    def gentle_um(self, steepest_deg: float) -> float:
        """Return how far ahead of the jaws the fibre slopes less than so much."""
        slope = np.abs(np.degrees(np.arctan2(np.diff(self.aside_um), np.diff(self.ahead_um))))
        steep = slope > steepest_deg
        return float(self.ahead_um[int(steep.argmax())]) if steep.any() else self.reach_um

    def natural(self, ahead_um: float, towards: float) -> NaturalShape:
        """Return the shape that a push meets.

        Parameters
        ----------
        ahead_um : float
            Where the middle of the probe is, along the jaws.
        towards : float
            1 or -1: which way along y the probe is, seen from the fibre.
        """
        return NaturalShape(self.ahead_um, towards * self.aside_um, ahead_um)


def held_shape(line_um: Floats, inside_um: float, forward: float) -> HeldShape:
    """Return the shape that a fibre has in the jaws.

    Parameters
    ----------
    line_um : ndarray, shape (n, 2)
        Its centre line as it lay, from the end that is grasped.
    inside_um : float
        Length between the jaws.
    forward : float
        1 or -1: which way along x the jaws point.
    """
    whole = float(arc_lengths(line_um)[-1])
    near = np.linspace(max(0.0, inside_um - TANGENT_UM), min(whole, inside_um + TANGENT_UM), 25)
    points = np.array([along(line_um, float(at_um)) for at_um in near])
    slope = np.array([np.polyfit(near - inside_um, points[:, i], 2)[1] for i in (0, 1)])
    angle = (0.0 if forward > 0.0 else math.pi) - math.atan2(slope[1], slope[0])
    cos, sin = math.cos(angle), math.sin(angle)
    count = max(8, int((whole - inside_um) / STEP_UM))
    at = np.linspace(inside_um, whole, count)
    free = np.array([along(line_um, float(at_um)) for at_um in at]) - along(line_um, inside_um)
    ahead = forward * (cos * free[:, 0] - sin * free[:, 1])
    aside = sin * free[:, 0] + cos * free[:, 1]
    rises = np.diff(ahead) > 0.0
    last = len(ahead) if rises.all() else max(int(rises.argmin()) + 1, 2)
    return HeldShape(ahead[:last], aside[:last], at[:last] - inside_um)


MISSED: Final = "missed grasp"
DROPPED: Final = "dropped"
SEEN_PART: Final = 0.35
"""Of a fibre's contrast: what is darker than that is the fibre."""
REACH_UM: Final = 70.0
BEGIN_UM: Final = 60.0
LENGTH_UM: Final = 320.0
ASIDE_UM: Final = 2.5 * REACH_UM
FOLLOWED_PART: Final = 0.75
FOLLOWED_UM: Final = 15.0
"""What goes along with the jaws is as dark as it was, and as far beside where it should be."""


class TestGrasp(FibreOperation):
    """The jaws go a little up and aside, and the fibre should follow."""

    __test__ = False  # for pytest, by its name
    name = "lift and see that it follows"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, positions = work.held_fibre(), work.settings.places
        before = ahead_of_jaws(fibre)
        x, y = work.tip_now(work.gripper)
        with work.mico.collision.contact("grasp"):
            yield work.go_up(positions.test_um)
        yield work.go(work.at(work.gripper, x, y + positions.test_aside_um))
        image = yield work.image()
        assert isinstance(image, CameraImage)
        if seen_at(work, fibre, image, in_jaws(work, fibre), positions.test_um):
            fibre.held = True
            work.learn_height(held=True)
            return
        if seen_at(work, fibre, image, before, 0.0):
            work.learn_height(held=False)
            raise OperationFailed(
                MISSED, f"fibre {fibre.number} lies where it was: the jaws closed beside it"
            )
        work.shared.surveyed = False
        raise OperationFailed(LOST, f"fibre {fibre.number} is neither in the jaws nor where it lay")


def ahead_of_jaws(fibre: HeldFibre) -> Floats:
    """Return the begin of the free part of a fibre that still lies, on the platform."""
    last = min(BEGIN_UM + LENGTH_UM, fibre.free_um)
    at = np.linspace(fibre.inside_um + BEGIN_UM, fibre.inside_um + last, 40)
    return np.array([along(line_of(fibre), float(at_um)) for at_um in at])


def shape_of(work: HandlingContext, fibre: HeldFibre) -> HeldShape:
    """Return the shape that the fibre should have in the jaws."""
    return held_shape(line_of(fibre), fibre.inside_um, work.jaws.forward)


def in_jaws(work: HandlingContext, fibre: HeldFibre) -> Floats:
    """Return where the begin of its free part should be while the jaws hold it."""
    x, y = work.tip_now(work.gripper)
    shape = shape_of(work, fibre)
    at = np.linspace(BEGIN_UM, max(min(BEGIN_UM + LENGTH_UM, shape.reach_um), 2.0 * BEGIN_UM), 40)
    bows = np.array([shape.bow_um(float(each)) for each in at])
    return np.column_stack([x + work.jaws.forward * at, y + bows])


def seen_at(
    work: HandlingContext, fibre: HeldFibre, image: CameraImage, line_um: Floats, height_um: float
) -> bool:
    """Return whether something as dark as the fibre lies along a line, or next to it."""
    contrast, _ = _traced(work, image, line_um, height_um)
    return contrast > SEEN_PART * fibre.reach.candidate.contrast


def _traced(
    work: HandlingContext, image: CameraImage, line_um: Floats, height_um: float
) -> tuple[float, float]:
    """Return how dark it is along a line, or next to it, in grey levels, and how far aside, um."""
    mapped = work.mapped_near(image, height_um)
    trace = trace_along(image, mapped.to_px(line_um), REACH_UM / mapped.scale_um_px)
    return trace.contrast, trace.offset_px * mapped.scale_um_px


class Carry(FibreOperation):
    """The fibre is lifted to the height of the probe and carried in front of it."""

    name = "carry to the probe"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, positions = work.held_fibre(), work.settings.places
        yield work.go_up(work.hold_tip_um)
        x = positions.hold_x_um * work.jaws.forward
        yield work.go(work.at(work.gripper, x, positions.hold_y_um, work.hold_tip_um))
        fibre.images["held"] = yield from see_held(work, fibre)


def see_held(work: HandlingContext, fibre: HeldFibre) -> Generator[Yielded, object, CameraImage]:
    """See that a fibre is still in the jaws, before the probe; return the image.

    Raises
    ------
    OperationFailed
        It is not.
    """
    image = yield work.image()
    assert isinstance(image, CameraImage)
    if not seen_at(work, fibre, image, in_jaws(work, fibre), work.hold_tip_um):
        raise _lost_from_jaws(work, fibre)
    return image


def see_it_follow(work: HandlingContext, fibre: HeldFibre) -> Steps:
    """See that a fibre goes along when the jaws go aside, away from the probe, and come back.

    What fell, or broke off, lies right under the jaws, and looks from above as if they held it.

    Raises
    ------
    OperationFailed
        It does not.
    """
    x, y = work.tip_now(work.gripper)
    here = yield from see_held(work, fibre)
    dark, beside_um = _traced(work, here, in_jaws(work, fibre), work.hold_tip_um)
    aside = ASIDE_UM if work.probe.forward[1] > 0 else -ASIDE_UM
    yield work.go(work.at(work.gripper, x, y + aside))
    there = yield from see_held(work, fibre)
    dark_there, beside_there_um = _traced(work, there, in_jaws(work, fibre), work.hold_tip_um)
    # Another one may lie there, or one may have crossed the fibre before and made it darker.
    least = FOLLOWED_PART * min(dark, fibre.reach.candidate.contrast)
    if dark_there < least or abs(beside_there_um - beside_um) > FOLLOWED_UM:
        raise _lost_from_jaws(work, fibre)
    yield work.go(work.at(work.gripper, x, y))


def _lost_from_jaws(work: HandlingContext, fibre: HeldFibre) -> OperationFailed:
    fibre.held, work.shared.surveyed = False, False
    return OperationFailed(DROPPED, f"fibre {fibre.number} is no longer in the jaws")
