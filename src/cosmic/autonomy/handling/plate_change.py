"""A plate on which nothing is left is changed for the next one, by a person or by a handler."""

from threading import Lock
from typing import Final, Protocol

from typing_extensions import override

from cosmic.autonomy.handling.context import HEIGHTS, FibreOperation, HandlingContext
from cosmic.autonomy.handling.prepare import clear_image
from cosmic.autonomy.procedures.operation import SAFE_POINT, Awaited, OperationFailed, Steps
from cosmic.frame.errors import NotAvailable, OperationCancelled
from cosmic.frame.operation import Task

STILL_HELD: Final = "fibre in the jaws"


class PlateHandler(Protocol):
    """What puts another plate on the table, such as a robot with a magazine."""

    @property
    def name(self) -> str:
        """What the record calls it."""
        ...

    def change(self, plate: int) -> Awaited:
        """Begin to put a plate there; what is returned ends when nothing moves there any more.

        Tools are out of the way meanwhile. It must return at once.

        Parameters
        ----------
        plate : int
            From 2 on.
        """
        ...

    def put(self, plate: int) -> None:
        """Take note that a person has put a plate there.

        Raises
        ------
        NotAvailable
            That cannot be.
        """
        ...

    def restore(self, plate: int) -> None:
        """Have a plate there with which a campaign is gone on with, as a person left it."""
        ...


class PlateByPerson:
    """A person puts each plate there and says so; any thread.

    Parameters
    ----------
    simulated : PlateHandler, optional
        Told of each plate: on the twin it is there only then.
    """

    name = "person"

    def __init__(self, simulated: PlateHandler | None = None) -> None:
        self._simulated = simulated
        self._lock = Lock()
        self._asked: Task | None = None
        self._plate = 0

    @property
    def request(self) -> str:
        """What a person is asked for; empty for nothing."""
        asked = self._asked
        if asked is None or asked.done:
            return ""
        return f"put plate {self._plate} on the table, and confirm it"

    def change(self, plate: int) -> Task:
        """Ask for a plate; what is returned ends once somebody says that it is there."""
        task = Task(f"plate {plate}")
        task.on_cancel(lambda: task.fail(OperationCancelled("nobody waits for the plate now")))
        self._plate, self._asked = plate, task
        return task

    def put(self, plate: int) -> None:  # noqa: ARG002 - by the protocol
        """Say that the plate is there which was asked for.

        Raises
        ------
        NotAvailable
            None was asked for, or it cannot be there.
        """
        with self._lock:
            asked = self._asked
            if asked is None or asked.done:
                raise NotAvailable("no plate is waited for")
            if self._simulated is not None:
                self._simulated.put(self._plate)
            asked.finish()

    def restore(self, plate: int) -> None:
        """Have the twin show the plate that a person left there."""
        if self._simulated is not None:
            self._simulated.restore(plate)


class ChangePlate(FibreOperation):
    """Tools go out of the way, and another plate is put there.

    What was known of the old one is forgotten, heights included: plates are not equally thick.
    """

    name = "change the plate"

    def __init__(self, handler: PlateHandler, plate: int) -> None:
        self._handler = handler
        self._plate = plate

    @override
    def precondition(self, work: HandlingContext) -> None:
        if any(arm.fibre is not None and arm.fibre.held for arm in work.arms):
            raise OperationFailed(STILL_HELD, "put it away before the plate is changed")

    @override
    def steps(self, work: HandlingContext) -> Steps:
        for arm in work.arms:
            yield from clear_image(arm)
        yield SAFE_POINT
        yield self._handler.change(self._plate)
        work.shared.new_plate()
        for arm in work.arms:
            arm.calibration.made.pop(HEIGHTS, None)
            arm.calibration.registry.forget(HEIGHTS, arm.settings.gripper)
            arm.stray_um = 0.0
        yield SAFE_POINT
