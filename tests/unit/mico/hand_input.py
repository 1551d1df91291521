"""An input device that a test holds in its hand."""

from collections.abc import Mapping
from threading import Event

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError
from cosmic.mico.hw.input_device import Feedback, InputDevice, InputInfo, InputKind, InputState


class HandInput(InputDevice):
    """Says what the test sets; `frozen`, `broken`, `hanging` and `connected` are its troubles."""

    def __init__(self, quiet_s: float | None = 0.05) -> None:
        self.axes = {"x": 0.0, "y": 0.0}
        self.buttons = {"fine": False, "hold": False, "stop": False}
        self.connected = True
        self.frozen = False
        self.broken: Exception | None = None
        self.go_on = Event()
        self.go_on.set()
        self.felt: list[dict[str, float]] = []
        self.closed = 0
        self.polls = 0
        self._time_s = WALL.now_s()
        self._info = InputInfo(
            "hand", "Hand", InputKind.HAPTIC, ("x", "y"), (), Feedback.FORCE, quiet_s
        )

    @property
    def info(self) -> InputInfo:
        return self._info

    def poll(self) -> InputState:
        self.go_on.wait(5.0)
        self.polls += 1
        if self.broken is not None:
            raise self.broken
        if not self.frozen:
            self._time_s = WALL.now_s()
        return InputState(dict(self.axes), dict(self.buttons), self.connected, self._time_s)

    def feel(self, force: Mapping[str, float]) -> None:
        self.felt.append(dict(force))

    def close(self) -> None:
        self.closed += 1

    def break_down(self) -> None:
        self.broken = DeviceError("the cable is torn")
