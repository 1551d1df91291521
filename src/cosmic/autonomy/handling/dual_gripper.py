"""Operations of two grippers that take turns at the plate and at the probe."""

from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.grasp import Carry
from cosmic.autonomy.handling.plate import PlateFrame, Reach
from cosmic.autonomy.handling.prepare import clear_image
from cosmic.autonomy.handling.put_away import SKIPPED, Wipe
from cosmic.autonomy.handling.survey import NONE_LEFT, Choose, approaches_of, none_left
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.frame.errors import MoveRefused
from cosmic.frame.verdict import Reason
from cosmic.vico.core.image import CameraImage

OBSTRUCTED: Final = "other gripper in the way"
NOT_FREE: Final = "jaws not free"
NONE_HERE: Final = "no fibre for this gripper"
NEAR_UM: Final = 100.0
LOW_UM: Final = 40.0
QUARTER_DEG: Final = 90.0


def front(work: HandlingContext) -> float:
    """Return 1 where the probe comes from larger y, otherwise -1."""
    return 1.0 if work.probe.forward[1] < 0.0 else -1.0


def behind_um(work: HandlingContext) -> float:
    """Return x of the position where an arm is out of the other's way with a fibre."""
    positions, pair = work.settings.places, work.settings.pair
    return (positions.hold_x_um - pair.behind_um) * work.jaws.forward


def hidden(work: HandlingContext, approach: Reach) -> bool:
    """Return whether a fibre lies where an arm at the probe, or the probe itself, may hide it."""
    positions, side = work.settings.places, front(work)
    nearest_um = float((side * approach.line_um[:, 1]).max())
    return nearest_um > side * positions.hold_y_um - work.settings.pair.hidden_um


def over(work: HandlingContext) -> bool:
    """Return whether an arm begins no further fibre in this round; if it does, that is noted."""
    shared, again = work.shared, work.settings.re_survey
    shared.seeking.discard(work.settings.gripper)
    if shared.enough() or not shared.surveyed or stands_aside(work):
        return True
    if again and shared.since_survey >= again:
        return True
    angle = work.table_deg
    if not any(approaches_of(work, each, angle) for each in work.shared.candidates):
        return True
    shared.seeking.add(work.settings.gripper)
    return False


def stands_aside(work: HandlingContext) -> bool:
    """Return whether an arm could not put away so many fibres that it is not to be used."""
    most = work.settings.pair.stuck
    last = [each for each in work.shared.finished if each.arm == work.settings.gripper][-most:]
    return len(last) == most and all(each.stuck for each in last)


class ChooseInTurn(Choose):
    """The fibre that can be seen beside the other arm, by the smallest turn of the table."""

    @override
    def rank(self, work: HandlingContext, approach: Reach, angle_deg: float) -> tuple[float, ...]:
        return float(hidden(work, approach)), *super().rank(work, approach, angle_deg)

    @override
    def none(self, work: HandlingContext) -> OperationFailed:
        return OperationFailed(NONE_HERE, "the other gripper has taken the last one")


class DrawBack(FibreOperation):
    """The arm goes up and back to its own side, so that the plate is seen and may turn."""

    name = "draw back from the plate"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        with work.mico.collision.contact("grasp"):
            yield work.rise(work.settings.places.travel_um)
        _, y = work.tip_now(work.gripper)
        yield work.go(work.at(work.gripper, behind_um(work), y))
        yield SAFE_POINT


class StandBy(FibreOperation):
    """The fibre is held at the height of the probe, beside the way to it."""

    name = "stand by"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        y = work.settings.places.hold_y_um - front(work) * work.settings.pair.beside_um
        yield work.go(work.at(work.gripper, behind_um(work), y))
        yield work.go_up(work.hold_tip_um)
        yield SAFE_POINT


class CarryInTurn(Carry):
    """The fibre is carried in front of the probe, from where the other arm is gone."""

    @override
    def precondition(self, work: HandlingContext) -> None:
        for other in work.arms:
            if other is work or other.fibre is None or not other.fibre.held:
                continue
            x, _ = other.tip_now(other.gripper)
            if not (behind_um(other) - x) * other.jaws.forward > -NEAR_UM:
                failure = OperationFailed(
                    OBSTRUCTED, f"{other.gripper.shown} still holds a fibre near the probe"
                )
                work.failures.append((self.name, failure))  # what the fibre is given up for
                raise failure

    @override
    def steps(self, work: HandlingContext) -> Steps:
        work.held_fibre().probe_from_s = work.clock.now_s()
        yield from super().steps(work)


class Withdraw(FibreOperation):
    """Probe and arm draw back from each other, and leave the way to the other arm."""

    name = "draw back from the probe"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        x, y = work.tip_now(work.probe)
        side = front(work)
        back = work.settings.places.hold_y_um + side * work.settings.pair.probe_back_um
        if side * (back - y) > 1.0:
            yield work.go(work.at(work.probe, x, back))
        _, y = work.tip_now(work.gripper)
        yield work.go(work.at(work.gripper, behind_um(work), y))
        work.held_fibre().probe_until_s = work.clock.now_s()
        yield SAFE_POINT


class WipeInTurn(Wipe):
    """The same, where nothing stands up from the table below the jaws."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        yield work.rise(work.settings.places.travel_um)
        yield work.go(work.bin_position())
        try:
            # Without leave to touch: the gate knows what stands there.
            yield work.go_up(LOW_UM)
        except MoveRefused as refusal:
            if refusal.verdict.reason is not Reason.COLLISION:
                raise
            angle = work.table_deg
            yield work.go({work.table: angle - QUARTER_DEG if angle > 0.0 else angle + QUARTER_DEG})
        yield from super().steps(work)


class GoOn(FibreOperation):
    """After a fibre that was given up the arm goes on, also where the jaws were not freed."""

    name = "go on"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.fibre
        if fibre is not None:
            fibre.failure = fibre.failure or OperationFailed(SKIPPED, f"fibre {fibre.number}")
            fibre.done_s, fibre.stuck = work.clock.now_s(), True
            work.shared.finished.append(fibre)
            work.shared.skipped.append(fibre.reach.candidate)
            work.fibre, work.shared.surveyed = None, False
        yield SAFE_POINT


class ClearAway(FibreOperation):
    """The arm leaves the image, where the sample is to be looked at again."""

    name = "clear the view"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        if not (work.shared.surveyed and work.shared.candidates):
            yield from clear_image(work)


class SeeSides(FibreOperation):
    """Where the positions of one arm are in the frame of another, by the maps of both."""

    name = "see both sides"

    def __init__(self, other: str) -> None:
        self._other = other

    @override
    def steps(self, work: HandlingContext) -> Steps:
        image = yield work.image()
        assert isinstance(image, CameraImage)
        other = work.shared.arms[self._other]
        height, width = image.data.shape[:2]
        middle_px = (width / 2.0, height / 2.0)
        off = np.asarray(work.mapped(image).to_um(middle_px))
        off = off - np.asarray(other.mapped(image).to_um(middle_px))
        x, y = other.calibration.frame.centre_um
        work.calibration.frame = PlateFrame((x + float(off[0]), y + float(off[1])))
        yield SAFE_POINT


class EndRound(FibreOperation):
    """Looks whether there is any more to do, and has the plate looked at again if so."""

    name = "see whether to go on"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        yield SAFE_POINT
        shared = work.shared
        if shared.enough():
            return
        if all(stands_aside(each) for each in work.arms):
            raise OperationFailed(
                NOT_FREE, "both grippers failed to release: inspect and clear the jaws"
            )
        if shared.surveyed and not shared.since_survey:
            raise OperationFailed(NONE_LEFT, none_left(shared.skip_reasons))
        shared.surveyed = False
