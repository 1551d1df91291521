"""A controller for tests of the core: answers at once and does what the test scripts."""

import queue
import threading
from collections.abc import Sequence

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Capabilities,
    Channel,
    Completed,
    Controller,
    DeviceIdentity,
    Direction,
    Event,
    Failed,
    PositionerKind,
    PositionerType,
    PositionKnownRead,
    PositionRead,
    ReferenceKind,
    SafeDirectionRead,
    SensorPresentRead,
    TypeRead,
)

LINEAR = PositionerType(1, "linear", PositionerKind.LINEAR, ReferenceKind.END_STOP)
ROTARY = PositionerType(8, "rotary", PositionerKind.ROTARY, ReferenceKind.END_STOP)


class ScriptedController(Controller):
    """Every movement is taken at once and ends when the test says so, or at once if `instant`.

    `layout` has a string of three letters for each device: L, R, N, or x for no channel.
    """

    name = "scripted"
    simulated = True
    capabilities = Capabilities(group_start=False, velocity=False, position_known=True)

    def __init__(self, layout: Sequence[str] = ("LLN",), *, instant: bool = True) -> None:
        self.layout = list(layout)
        self.instant = instant
        self.known = True
        self.calls: list[tuple[object, ...]] = []
        self.position: dict[Channel, float] = {}
        self.activity: dict[Channel, Activity] = {}
        self.queues: dict[int, queue.SimpleQueue[Event]] = {}
        self.broken: DeviceError | None = None
        self.block = threading.Event()
        self.block.set()
        self.muted = False
        self.unplugged: set[int] = set()
        self.opened: list[int] = []

    def of(self, name: str) -> list[tuple[object, ...]]:
        return [call for call in self.calls if call[0] == name]

    def find_devices(self) -> tuple[int, ...]:
        return tuple(100 + i for i in range(len(self.layout)) if i not in self.unplugged)

    def open(self, serials: Sequence[int] = ()) -> tuple[DeviceIdentity, ...]:
        self.opened = sorted(serials or self.find_devices())
        self.queues = {index: queue.SimpleQueue() for index in range(len(self.opened))}
        return tuple(DeviceIdentity(i, serial, "1.0") for i, serial in enumerate(self.opened))

    def close(self) -> None:
        self.calls.append(("close",))

    def receive(self, device: int, timeout_s: float) -> Event | None:
        if self.broken:
            raise self.broken
        try:
            return self.queues[device].get(timeout=0.02)
        except queue.Empty:
            return None

    def emit(self, event: Event) -> None:
        assert event.channel is not None
        if not self.muted:
            self.queues[event.channel.device].put(event)

    def _kind(self, channel: Channel) -> str:
        letters = self.layout[self.opened[channel.device] - 100]
        letter = letters.ljust(18, "x")[channel.channel]
        if letter == "x":
            raise DeviceError("no such channel", fault=DeviceFault.NO_CHANNEL)
        return letter

    def report_completion(self, channel: Channel) -> None:
        self._kind(channel)

    def ask_sensor_present(self, channel: Channel) -> None:
        self.emit(SensorPresentRead(channel, self._kind(channel) != "N"))

    def ask_type(self, channel: Channel) -> None:
        self.emit(TypeRead(channel, ROTARY if self._kind(channel) == "R" else LINEAR))

    def ask_position_known(self, channel: Channel) -> None:
        self.emit(PositionKnownRead(channel, self.known))

    def ask_safe_direction(self, channel: Channel) -> None:
        self.emit(SafeDirectionRead(channel, Direction.BACKWARD))

    def ask_position(self, channel: Channel, unit: str) -> None:
        if self.broken:
            raise self.broken
        self.emit(PositionRead(channel, self.position.get(channel, 0.0), unit))

    def ask_activity(self, channel: Channel) -> None:
        self.emit(ActivityRead(channel, self.activity.get(channel, Activity.STOPPED)))

    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        self.calls.append(("frequency", channel, frequency_hz))

    def _move(self, channel: Channel, activity: Activity, end: float | None) -> None:
        self.block.wait(5)
        if self.broken:
            raise self.broken
        self.activity[channel] = activity
        if self.instant:
            self.end(channel, end)

    def end(self, channel: Channel, position: float | None = None) -> None:
        """Bring the channel to rest at `position`."""
        if position is not None:
            self.position[channel] = position
        self.activity[channel] = Activity.HOLDING
        self.emit(Completed(channel))

    def fail(self, channel: Channel, fault: DeviceFault) -> None:
        self.activity[channel] = Activity.STOPPED
        self.emit(Failed(channel, DeviceError(f"{fault}", fault=fault)))

    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        self.calls.append(("step", channel, steps, amplitude_v, frequency_hz))
        self._move(channel, Activity.STEPPING, None)

    def move_to(self, channel: Channel, target: float, unit: str, *, hold_s: float) -> None:
        self.calls.append(("move_to", channel, target, unit, hold_s))
        self._move(channel, Activity.TARGETING, target)

    def move_by(self, channel: Channel, distance: float, unit: str, *, hold_s: float) -> None:
        raise AssertionError("the core moves to targets only")

    def calibrate(self, channel: Channel) -> None:
        self.calls.append(("calibrate", channel))
        self._move(channel, Activity.CALIBRATING, None)

    def reference(self, channel: Channel, *, hold_s: float) -> None:
        self.calls.append(("reference", channel))
        self.known = True
        self._move(channel, Activity.REFERENCING, -6000.0)

    def move_to_end_stop(self, channel: Channel, direction: object, *, hold_s: float) -> None:
        self.calls.append(("end_stop", channel, direction))
        self._move(channel, Activity.TARGETING, 6000.0)

    def stop(self, channel: Channel) -> None:
        self.calls.append(("stop", channel))
        self.activity[channel] = Activity.STOPPED
        self.emit(Completed(channel))
