"""A stage as a package of somebody else may drive it: `StageUnit` over numbers in memory."""

from collections.abc import Callable

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.hw.stages import AxisOptions, StageUnit


class OwnStage(StageUnit):
    """Two linear axes that stand where they are sent; a test replaces what it wants to go wrong.

    Attributes
    ----------
    wrong : dict
        By the name of a method: what is called in its place.
    stops : list of int
        The axes that were stopped.
    """

    serial, firmware = "OWN-1", "1.0"
    axes = (AxisOptions(axis=1, unit="um"), AxisOptions(axis=2, unit="um"))
    errors = (DeviceError,)

    def __init__(self) -> None:
        self.wrong: dict[str, Callable[[int], object]] = {}
        self.stops: list[int] = []
        self.where = [0.0, 0.0]

    def _maybe(self, name: str, axis: int, usual: object) -> object:
        return self.wrong[name](axis) if name in self.wrong else usual

    def position(self, axis):
        return self._maybe("position", axis, self.where[axis])

    def moving(self, axis):
        return self._maybe("moving", axis, False)

    def move_to(self, axis, target):
        self.where[axis] = target

    def move_by(self, axis, distance):
        self.where[axis] += distance

    def step(self, axis, steps, frequency_hz):
        raise DeviceError("no steps", fault=DeviceFault.UNSUPPORTED)

    def reference(self, axis):
        self.where[axis] = 0.0

    def has_reference(self, axis):
        return self._maybe("has_reference", axis, True)

    def referenced(self, axis):
        return True

    def stop(self, axis):
        self._maybe("stop", axis, None)
        self.stops.append(axis)

    def close(self):
        pass

    def fault(self, error):
        return error.fault
