"""Operations that get rid of a fibre, and see that it is gone."""

from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.grasp import in_jaws, seen_at
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.jaws import move_jaws, open_jaws
from cosmic.autonomy.handling.prepare import retract_probe
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.vico.core.image import CameraImage

ADHESION: Final = "jaw adhesion"
SKIPPED: Final = "skipped"
INTERRUPTED: Final = "interrupted"
WIPE_UM: Final = 250.0
ASIDE_UM: Final = 400.0
SHAKES: Final = 12
SHAKE_UM: Final = 12.0


class ToBin(FibreOperation):
    """The fibre is carried to where fibres are put away."""

    name = "carry to the bin"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        positions = work.settings.places
        if not work.beside_another:  # who may have the probe just then
            yield from retract_probe(work)
        yield work.rise(positions.travel_um)
        if work.held_fibre().bending is not None:
            yield from self._look_while_moving(work)
        yield work.go(work.bin_position())
        with work.mico.collision.contact("grasp"):
            yield work.go_up(positions.bin_um)

    @staticmethod
    def _look_while_moving(work: HandlingContext) -> Steps:
        """See that a measured fibre is still there: one that fell must not be measured again."""
        fibre, positions = work.held_fibre(), work.settings.places
        x = positions.view_x_um * work.jaws.forward
        yield work.go(work.at(work.gripper, x, positions.view_y_um))
        image = yield work.image()
        assert isinstance(image, CameraImage)
        if not seen_at(work, fibre, image, in_jaws(work, fibre), work.height_now()):
            fibre.held, work.shared.surveyed = False, False
            work.shared.dropped.append(fibre)


class Release(FibreOperation):
    """The jaws open, and leave."""

    name = "release"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        positions, forward = work.settings.places, work.jaws.forward
        yield from open_jaws(work)
        with work.mico.collision.contact("grasp"):
            yield work.go_up(positions.travel_um)
        # Each time elsewhere: what is seen may lie on the plate and not hang at the jaws.
        y = positions.view_y_um + ASIDE_UM * work.held_fibre().looks
        yield work.go(work.at(work.gripper, positions.view_x_um * forward, y))

    @override
    def verify(self, work: HandlingContext) -> Steps | None:
        return see_released(work)


def see_released(work: HandlingContext) -> Steps:
    """See by image that nothing hangs at the jaws.

    They are not moved aside for a second look: a fibre that falls off there is in the sample again.
    """
    fibre = work.held_fibre()
    image = yield work.image()
    assert isinstance(image, CameraImage)
    if _hangs(work, fibre, image):
        fibre.looks, fibre.doubted = fibre.looks + 1, False
        failure = OperationFailed(ADHESION, f"fibre {fibre.number} still sticks to the jaws")
        work.failures.append((Release.name, failure))
        raise failure
    fibre.held = False


def _hangs(work: HandlingContext, fibre: HeldFibre, image: CameraImage) -> bool:
    """Return whether something lies where the fibre would: what sticks goes with one jaw."""
    line, apart = in_jaws(work, fibre), 0.5 * (work.gap_um or 0.0)
    positions = (line + np.array([0.0, y]) for y in (0.0, apart, -apart))
    height = work.height_now()
    return any(seen_at(work, fibre, image, position, height) for position in positions)


class Wipe(FibreOperation):
    """The jaws are taken back to the bin, pressed to the plate, shaken and drawn along it."""

    name = "shake and wipe"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        positions = work.settings.places
        yield work.rise(positions.travel_um)
        yield work.go(self.where(work))
        with work.mico.collision.contact("grasp"):
            yield work.go_up(work.grasp_um)
            for _ in range(SHAKES):
                yield from move_jaws(work, -SHAKE_UM)
                yield from move_jaws(work, SHAKE_UM)
            x, y = work.tip_now(work.gripper)
            yield work.go(work.at(work.gripper, x, y + WIPE_UM))
            yield work.go(work.at(work.gripper, x - WIPE_UM * work.jaws.forward * 0.5, y))
            yield work.go_up(positions.bin_um)

    def where(self, work: HandlingContext) -> dict[str, float]:
        """Return where the gripper's axes stand meanwhile."""
        return work.bin_position()


class Finish(FibreOperation):
    """The fibre is done with."""

    name = "note the result"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        fibre.done_s, fibre.put_away = work.clock.now_s(), True
        work.shared.done_with(fibre)
        work.fibre = None
        yield SAFE_POINT


class NoteFailure(FibreOperation):
    """Keeps what the held fibre failed by, before anything else is done with it."""

    name = "note the failure"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        if work.failures:
            operation, failure = work.failures[-1]
            fibre.failure = OperationFailed(failure.cause, f"{operation}: {failure.text}")
        yield SAFE_POINT


class GiveUp(FibreOperation):
    """Says what a fibre was given up for, once the jaws are empty and out of the way."""

    name = "give it up"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        fibre.done_s = work.clock.now_s()
        work.shared.done_with(fibre)
        if not fibre.put_away and fibre.tries:
            work.shared.surveyed = False
        work.shared.skipped.append(fibre.reach.candidate)
        work.fibre = None
        yield SAFE_POINT
        raise fibre.failure or OperationFailed(SKIPPED, f"fibre {fibre.number}")


class ClearUp(FibreOperation):
    """What a run before this one left in the jaws is put away; nothing where all was in order."""

    name = "clear up"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.fibre
        if fibre is None:
            return
        work.ready, work.shared.surveyed, work.shared.zoomed = False, False, None
        yield from ToBin().steps(work)
        yield from Wipe().steps(work)
        yield from Release().steps(work)
        fibre.failure = fibre.failure or OperationFailed(INTERRUPTED, "the run before was ended")
        fibre.done_s = work.clock.now_s()
        work.shared.done_with(fibre)
        work.fibre = None
