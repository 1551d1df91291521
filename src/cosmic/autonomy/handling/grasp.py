"""Operations that take a fibre up and carry it to the probe."""

from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.handling.in_hand import FibreInHand
from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.plate import along
from cosmic.autonomy.handling.reach import LOST, line_of
from cosmic.autonomy.handling.shape import HeldShape, held_shape
from cosmic.autonomy.handling.sight import trace_along
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import OperationFailed, Steps
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.pixel_map import Floats

MISSED: Final = "missed grasp"
DROPPED: Final = "dropped"
SEEN_PART: Final = 0.35
"""Of a fibre's contrast: what is darker than that is the fibre."""
REACH_UM: Final = 70.0
BEGIN_UM: Final = 60.0
LENGTH_UM: Final = 320.0


class TestGrasp(FibreOperation):
    """The jaws go a little up and aside, and the fibre should follow."""

    __test__ = False  # for pytest, by its name
    name = "lift and see that it follows"

    @override
    def steps(self, work: FibreWork) -> Steps:
        fibre, places = work.in_hand(), work.settings.places
        before = ahead_of_jaws(fibre)
        x, y = work.tip_now(work.gripper)
        with work.mico.collision.contact("grasp"):
            yield work.go_up(places.test_um)
        yield work.go(work.at(work.gripper, x, y + places.test_aside_um))
        picture = yield work.picture()
        assert isinstance(picture, Picture)
        if seen_at(work, fibre, picture, in_jaws(work, fibre), places.test_um):
            fibre.held = True
            work.learn_height(held=True)
            return
        if seen_at(work, fibre, picture, before, 0.0):
            work.learn_height(held=False)
            raise OperationFailed(
                MISSED, f"fibre {fibre.number} lies where it was: the jaws closed beside it"
            )
        work.surveyed = False
        raise OperationFailed(LOST, f"fibre {fibre.number} is neither in the jaws nor on its place")


def ahead_of_jaws(fibre: FibreInHand) -> Floats:
    """Return the begin of the free part of a fibre that still lies, on the platform."""
    last = min(BEGIN_UM + LENGTH_UM, fibre.free_um)
    at = np.linspace(fibre.inside_um + BEGIN_UM, fibre.inside_um + last, 40)
    return np.array([along(line_of(fibre), float(way)) for way in at])


def shape_of(work: FibreWork, fibre: FibreInHand) -> HeldShape:
    """Return the shape that the fibre should have in the jaws."""
    return held_shape(line_of(fibre), fibre.inside_um, work.jaws.forward)


def in_jaws(work: FibreWork, fibre: FibreInHand) -> Floats:
    """Return where the begin of its free part should be while the jaws hold it."""
    x, y = work.tip_now(work.gripper)
    shape = shape_of(work, fibre)
    at = np.linspace(BEGIN_UM, max(min(BEGIN_UM + LENGTH_UM, shape.reach_um), 2.0 * BEGIN_UM), 40)
    bows = np.array([shape.bow_um(float(each)) for each in at])
    return np.column_stack([x + work.jaws.forward * at, y + bows])


def seen_at(
    work: FibreWork, fibre: FibreInHand, picture: Picture, line_um: Floats, height_um: float
) -> bool:
    """Return whether something as dark as the fibre lies along a line, or next to it."""
    mapped = work.mapped_near(picture, height_um)
    trace = trace_along(picture, mapped.to_px(line_um), REACH_UM / mapped.scale_um_px)
    contrast = fibre.reach.candidate.contrast
    return trace.contrast > SEEN_PART * contrast


class Carry(FibreOperation):
    """The fibre is lifted to the height of the probe and carried in front of it."""

    name = "carry to the probe"

    @override
    def steps(self, work: FibreWork) -> Steps:
        fibre, places = work.in_hand(), work.settings.places
        yield work.go_up(work.hold_tip_um)
        x = places.hold_x_um * work.jaws.forward
        yield work.go(work.at(work.gripper, x, places.hold_y_um, work.hold_tip_um))
        picture = yield work.picture()
        assert isinstance(picture, Picture)
        fibre.pictures["held"] = picture
        if not seen_at(work, fibre, picture, in_jaws(work, fibre), work.hold_tip_um):
            fibre.held, work.surveyed = False, False
            raise OperationFailed(DROPPED, f"fibre {fibre.number} is no longer in the jaws")
