"""A recorded procedure replayed on a platform, with the same engine as all others."""

from cosmic.autonomy.handling.context import Applications, HandlingContext
from cosmic.autonomy.handling.marked import MarkedFibre
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.recorded.operations import Surroundings, build_recorded
from cosmic.autonomy.recorded.steps import GripperStep, OperationStep, RecordedProcedure
from cosmic.autonomy.shipped.fibre_handling import FibreHandling
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.vision.algorithms import grey


def gripper_of(procedure: RecordedProcedure, handling: FibreHandling) -> str:
    """Return the gripper that a procedure is replayed with: the first it names."""
    for step in procedure.step:
        named = ""
        if isinstance(step, OperationStep):
            named = step.gripper
        elif isinstance(step, GripperStep):
            named = step.tool
        if named:
            return named
    return handling.held_by or handling.grippers[0]


def replay_on(
    handling: FibreHandling, procedure: RecordedProcedure, around: Surroundings
) -> ProcedureRun[HandlingContext]:
    """Return a run that replays a procedure; begin it by `start` or `run_here`.

    Raises
    ------
    NotAvailable
        Something else runs.
    ConfigError
        A step cannot be carried out here.
    """
    gripper = gripper_of(procedure, handling)
    built = build_recorded(procedure, handling.context(gripper), around)
    operations = tuple(each.operation for each in procedure.step if isinstance(each, OperationStep))
    run = handling.prepare_recorded(built, gripper, operations, values=procedure.given)

    def close() -> None:
        if run.over:
            around.end_recording(handling.context(gripper).daqco)

    run.on_change(close)
    return run


def mark_one(rig: Applications) -> MarkedFibre:
    """Return the first fibre that is certain on the next image; raises `NotAvailable`."""
    # Imported here: it loads OpenCV and scipy.
    from cosmic.vico.core.vision.finding import find_fibres

    image = rig.vico.camera().next_image()
    found = next((each for each in find_fibres(grey(image.data)) if each.certain), None)
    if found is None:
        raise NotAvailable("no fibre is seen for certain; check zoom, light and focus")
    return MarkedFibre(image, found.centre_line_px)
