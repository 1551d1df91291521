"""Operations that bring a fibre and the gripper together."""

import logging
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.guided_move import AimLimits, GuidedMove
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.jaws import move_jaws, note_closed, note_gap
from cosmic.autonomy.handling.lying_fibre import LyingFibre
from cosmic.autonomy.handling.plate import along, arc_lengths
from cosmic.autonomy.handling.sight import SeenFibre, box_around, find_seen, trace_along
from cosmic.autonomy.handling.tips import see_tip
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.frame.arrays import Floats
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.vision.tool_types import GripperTips

logger = logging.getLogger(__name__)

LOST = "lost"
TIP_NOT_SEEN = "tip not seen"
STAND_BACK_UM: Final = 900.0
MARGIN_UM: Final = 250.0
SAME_LENGTH: Final = 0.05
LOOKS: Final = 2
PREDICTED_UM: Final = 25.0
PREDICTED_PART: Final = 0.6
GAP_STD_PX: Final = 2.0


class Turn(FibreOperation):
    """The table turns the fibre along the jaws, which wait behind where its end will be."""

    name = "turn the table"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        (x, y), angle = fibre.reach.tip_um, fibre.reach.angle_deg
        yield work.rise(work.settings.places.travel_um)
        behind = work.at(work.gripper, x - STAND_BACK_UM * work.jaws.forward, y)
        yield work.go({work.table: angle} | behind)
        yield SAFE_POINT


class FindAgain(FibreOperation):
    """The fibre is looked for where the turn has brought it, and measured."""

    name = "find it again"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        if fibre.tries:
            x, y = work.tip_now(work.gripper)
            yield work.go_up(work.settings.places.travel_um)
            yield work.go(work.at(work.gripper, x - STAND_BACK_UM * work.jaws.forward, y))
        image = yield work.image()
        assert isinstance(image, CameraImage)
        if not fibre.tries and _where_predicted(work, fibre, image):
            return
        mapped = work.mapped(image)
        line_px = mapped.to_px(fibre.reach.line_um)
        margins = [MARGIN_UM * (1.0 + look) / mapped.scale_um_px for look in range(LOOKS)]
        boxes = [box_around(line_px, margin_px, image) for margin_px in margins]
        for box in boxes:
            seen = _matching(find_seen(image, mapped, box), fibre)
            if seen is not None:
                _take_note(work, fibre, seen, image)
                return
        fibre.images["not found"] = image
        # One that was grasped, and is gone, lies somewhere else now.
        work.shared.surveyed = work.shared.surveyed and not fibre.tries
        raise OperationFailed(LOST, f"fibre {fibre.number} was not found where the table turned it")


def _where_predicted(work: HandlingContext, fibre: HeldFibre, image: CameraImage) -> bool:
    """Take note of a fibre that lies where the turn should have brought it."""
    mapped, candidate = work.mapped(image), fibre.reach.candidate
    line_px = mapped.to_px(fibre.reach.line_um)
    trace = trace_along(image, line_px, PREDICTED_UM / mapped.scale_um_px)
    if not trace.contrast > PREDICTED_PART * candidate.contrast:
        return False
    fibre.line_um, fibre.line_px = fibre.reach.line_um, line_px
    fibre.inside_um = work.settings.grasp.inside_um
    fibre.free_um = candidate.length_um - fibre.inside_um
    fibre.images["geometry"] = image
    return True


def _matching(found: list[SeenFibre], fibre: HeldFibre) -> SeenFibre | None:
    """Return the fibre that is meant, known by its position and length."""
    wanted, length = fibre.reach.line_um, fibre.reach.candidate.length_um
    fitting = []
    for each in found:
        away = float(np.linalg.norm(each.line_um.mean(axis=0) - wanted.mean(axis=0)))
        if abs(each.length_um - length) <= SAME_LENGTH * length and away <= MARGIN_UM:
            fitting.append((away, each))
    return min(fitting, key=lambda pair: pair[0])[1] if fitting else None


def _take_note(
    work: HandlingContext, fibre: HeldFibre, seen: SeenFibre, image: CameraImage
) -> None:
    start = fibre.reach.line_um[0]
    turned = np.linalg.norm(seen.line_um[0] - start) > np.linalg.norm(seen.line_um[-1] - start)
    step = -1 if turned else 1
    fibre.seen = seen
    fibre.line_um, fibre.line_px = seen.line_um[::step], seen.line_px[::step]
    fibre.inside_um = work.settings.grasp.inside_um
    fibre.free_um = seen.length_um - fibre.inside_um
    fibre.images["geometry"] = image


def line_of(fibre: HeldFibre) -> Floats:
    """Return the fibre's line on the platform, from the end that is grasped."""
    return fibre.reach.line_um if fibre.line_um is None else fibre.line_um


class Shift(FibreOperation):
    """The next try is made a little to one side, then to the other."""

    name = "try beside it"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, shift = work.held_fibre(), work.settings.grasp.shift_um
        side = 1.0 if fibre.tries % 2 else -1.0
        fibre.shift_um = side * shift * ((fibre.tries + 1) // 2)
        yield SAFE_POINT


class Approach(FibreOperation):
    """The open jaws come down around the fibre."""

    name = "approach and descend"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        x, y = along(line_of(fibre), fibre.inside_um).tolist()
        yield work.go(work.at(work.gripper, x, y))
        with work.mico.collision.contact("grasp"):
            if work.settings.grasp.follow_um > 0.0:
                yield from _follow_down(work, fibre, y)
            else:
                yield work.go_up(work.grasp_um)

    @override
    def undo(self, work: HandlingContext) -> Steps:
        with work.mico.collision.contact("grasp"):
            yield work.go_up(work.settings.places.travel_um)


def _follow_down(work: HandlingContext, fibre: HeldFibre, y_um: float) -> Steps:
    """Come down around the fibre, and go along with it where it shifts.

    The jaws wait above it until it is between them: none is set down on it.
    """
    grasp, gripper = work.settings.grasp, work.gripper
    lying = LyingFibre(work, fibre, line_of(fibre))
    axis = work.mico[gripper.z_axis]
    most = grasp.follow_most_um
    axis.set_closed_loop_frequency(min(grasp.descend_hz, work.settings.frequency_hz))
    try:
        for height in (max(grasp.hover_um, work.grasp_um), work.grasp_um):
            _, now_um = work.tip_now(gripper)
            yield GuidedMove(
                work.go_up(height),
                camera=work.vico.camera(work.settings.camera),
                clock=work.clock,
                look=lying.aim,
                correct=lambda to_um: work.go({gripper.y_axis: to_um - gripper.tip_um[1]}),
                target_um=now_um,
                limits=AimLimits(grasp.close_enough_um, most),
            )
            # What it has gone along with counts for all of the way down.
            gone = abs(work.tip_now(gripper)[1] - y_um)
            most = max(grasp.follow_most_um - gone, 0.0)
    except OperationFailed:
        fibre.tries += 1  # it is looked for with the gripper out of the way
        raise
    finally:
        axis.set_closed_loop_frequency(work.settings.frequency_hz)
        _note_shift(work, fibre, lying)


def _note_shift(work: HandlingContext, fibre: HeldFibre, lying: LyingFibre) -> None:
    """Take note of where a fibre lies that has shifted since it was measured."""
    if abs(lying.shift_um) > 0.5 * work.settings.grasp.close_enough_um:
        logger.info("fibre %d has shifted by %.0f um", fibre.number, lying.shift_um)
        fibre.line_um = line_of(fibre) + np.array([0.0, lying.shift_um])


class Refine(FibreOperation):
    """Jaws and fibre are seen on one image, and the jaws are moved until the fibre is between."""

    name = "refine by image"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, settings = work.held_fibre(), work.settings.grasp
        for _ in range(settings.corrections):
            image = yield work.image()
            assert isinstance(image, CameraImage)
            off = _off_um(work, fibre, image)
            if off is None:
                continue
            if abs(off - fibre.shift_um) <= settings.close_enough_um:
                return
            x, y = work.tip_now(work.gripper)
            with work.mico.collision.contact("grasp"):
                yield work.go(work.at(work.gripper, x, y + off - fibre.shift_um))
        image = yield work.image()
        assert isinstance(image, CameraImage)
        off = _off_um(work, fibre, image)
        if off is None or abs(off - fibre.shift_um) > 2.0 * settings.close_enough_um:
            raise OperationFailed(
                TIP_NOT_SEEN, "the jaws were not seen around the fibre: check light and focus"
            )


def _off_um(work: HandlingContext, fibre: HeldFibre, image: CameraImage) -> float | None:
    """Return how far the fibre is from the middle between the jaws, in y; None: not seen."""
    if work.settings.grasp.follow_um > 0.0:
        lying = LyingFibre(work, fibre, line_of(fibre))
        lying.follow(image)
        _note_shift(work, fibre, lying)
    found = see_tip(work, image, work.gripper)
    if not isinstance(found, GripperTips):
        return None
    mapped = work.mapped(image)
    hold = mapped.to_um(found.hold_px)
    gap_um = found.gap_px * mapped.scale_um_px
    note_gap(work, gap_um, GAP_STD_PX * mapped.scale_um_px)
    line = line_of(fibre)
    order = np.argsort(line[:, 0])
    beside = float(np.interp(hold[0], line[order, 0], line[order, 1]))
    inside = float(np.interp(hold[0], line[order, 0], arc_lengths(line)[order]))
    fibre.inside_um, fibre.free_um = inside, fibre.length_um - inside
    return beside - float(hold[1])


class CloseJaws(FibreOperation):
    """The jaws close around the fibre."""

    name = "close the gripper"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        gap = work.gap_um if work.gap_um is not None else work.settings.grasp.gap_um
        yield from move_jaws(work, -(gap + work.settings.grasp.closing_um))
        work.gap_um = 0.0
        note_closed(work)
        work.held_fibre().tries += 1

    @override
    def undo(self, work: HandlingContext) -> Steps:
        yield from move_jaws(work, work.settings.grasp.gap_um)
