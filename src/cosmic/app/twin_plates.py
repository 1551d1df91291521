"""Plates of the simulated platform, changed as somebody would do it: it takes a while."""

from typing_extensions import override

from cosmic.autonomy.handling.plate_change import PlateHandler
from cosmic.autonomy.procedures.operation import Awaited
from cosmic.frame.clock import Clock
from cosmic.frame.errors import OperationCancelled
from cosmic.twin.scene import Scene


class TwinPlates(PlateHandler):
    """Puts plates on the table of a scene, by its clock."""

    name = "simulated handler"

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene = scene
        self._clock = clock

    @override
    def change(self, plate: int) -> Awaited:
        self._scene.check_plate_change()
        return _Exchange(self._scene, self._clock)

    @override
    def put(self, plate: int) -> None:
        self._scene.change_plate()

    @override
    def restore(self, plate: int) -> None:
        while self._scene.plate < plate - 1:
            self._scene.change_plate()


class _Exchange:
    """One change of the plate under way, until the platform's clock says that it is over."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene = scene
        self._clock = clock
        self._until_s = clock.now_s() + scene.settings.plate.exchange_s
        self._cancelled = False

    @property
    def done(self) -> bool:
        """True when the time is over, or somebody ended it."""
        return self._cancelled or self._clock.now_s() >= self._until_s

    def wait(self, timeout_s: float | None = None) -> object:  # noqa: ARG002 - by the protocol
        """Put the plate there; raises where it was ended before."""
        if self._cancelled:
            raise OperationCancelled("the plate was not changed")
        return self._scene.change_plate()

    def cancel(self) -> None:
        """Leave the old plate there."""
        self._cancelled = True
