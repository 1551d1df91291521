"""Operations on the standard: it is chosen where it lies, and put back there after it was bent."""

from typing import Final

from typing_extensions import override

from cosmic.autonomy.handling.approach import line_of
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.grasp import in_jaws, seen_at
from cosmic.autonomy.handling.plate import along
from cosmic.autonomy.handling.prepare import clear_image, retract_probe
from cosmic.autonomy.handling.put_away import ADHESION, Wipe
from cosmic.autonomy.handling.sight import find_seen
from cosmic.autonomy.handling.survey import approaches_of, look, take
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.vico.core.image import CameraImage

NO_STANDARD: Final = "no standard"


class LookForStandard(FibreOperation):
    """A wide image, by which the standard is found; what else lies there is noted as well."""

    name = "look for the standard"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        if work.shared.surveyed and work.shared.standard is not None:
            return
        yield from clear_image(work)
        image = yield work.image()
        assert isinstance(image, CameraImage)
        look(work, find_seen(image, work.mapped(image)))
        yield SAFE_POINT


class ChooseStandard(FibreOperation):
    """The standard, with the smallest turn of the table."""

    name = "choose the standard"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        standard, settings = work.shared.standard, work.settings.standard
        if standard is None:
            raise OperationFailed(
                NO_STANDARD,
                f"no free, straight fibre of {settings.length_um:.0f} um lies within "
                f"{settings.within_um:.0f} um of ({settings.x_um:.0f}, {settings.y_um:.0f}) um on "
                "the plate: put the standard there, or correct [parameters.standard]",
            )
        approaches = approaches_of(work, standard, work.table_deg)
        if not approaches:
            raise OperationFailed(
                NO_STANDARD, f"{work.gripper.shown} cannot reach the standard where it lies"
            )
        work.shared.standard = None
        take(work, approaches[0], standard=True)
        yield SAFE_POINT


class CarryStandardBack(FibreOperation):
    """The standard is carried to where it was taken up, and held just above the plate."""

    name = "carry the standard back"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        yield from retract_probe(work)
        fibre = work.held_fibre()
        yield work.rise(work.settings.places.travel_um)
        if fibre.held:
            yield from self._see_it(work)
        yield work.go({work.table: fibre.reach.angle_deg} | home_of(work))
        with work.mico.collision.contact("grasp"):
            yield work.go_up(work.grasp_um)

    @staticmethod
    def _see_it(work: HandlingContext) -> Steps:
        fibre, positions = work.held_fibre(), work.settings.places
        yield work.go(
            work.at(work.gripper, positions.view_x_um * work.jaws.forward, positions.view_y_um)
        )
        image = yield work.image()
        assert isinstance(image, CameraImage)
        if not seen_at(work, fibre, image, in_jaws(work, fibre), work.height_now()):
            fibre.held = False


def home_of(work: HandlingContext) -> dict[str, float]:
    """Return where the gripper's axes stand with the standard where it was taken up."""
    fibre = work.held_fibre()
    x, y = along(line_of(fibre), fibre.inside_um).tolist()
    return work.at(work.gripper, x, y)


class WipeAtHome(Wipe):
    """The same where the standard belongs."""

    name = "shake the standard off"

    @override
    def where(self, work: HandlingContext) -> dict[str, float]:
        return home_of(work)


class LeaveStandard(FibreOperation):
    """The standard is done with; the plate is looked at anew before anything is taken."""

    name = "note the standard"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        fibre.done_s, fibre.put_away = work.clock.now_s(), not fibre.held
        fibre.failure = fibre.failure if fibre.put_away else OperationFailed(ADHESION, "standard")
        work.shared.done_with(fibre)
        work.fibre, work.shared.surveyed = None, False
        yield SAFE_POINT
