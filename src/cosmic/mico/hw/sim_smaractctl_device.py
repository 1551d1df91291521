"""One simulated MCS2: its channels, its events, its requests and what waits to be sent."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Condition, Lock
from typing import Final, cast

from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.mico.hw import sim_smaractctl_moves as moves
from cosmic.mico.hw import sim_smaractctl_properties as properties
from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.sim_device import LibraryLock, SimulatedDevice
from cosmic.mico.hw.sim_faults import Fault, Faults
from cosmic.mico.hw.sim_queue import PacketQueue
from cosmic.mico.hw.sim_smaractctl_channel import NOTHING_MOVES, Channel
from cosmic.mico.hw.sim_smaractctl_types import Refused
from cosmic.twin.scene import Scene
from cosmic.twin.settings import ControllerSettings

CHANNELS_PER_MODULE: Final = 3
DEVICE_INDEX: Final = 0xFFFF
"""Queue of the events that belong to no channel."""
Command = Callable[[float], None]
_ENDS: Final = {
    "overheated": sa.SA_CTL_ERROR_OVER_TEMPERATURE,
    "hv_range": sa.SA_CTL_ERROR_POWER_SUPPLY_DISABLED,
    "overridden": sa.SA_CTL_ERROR_MOVEMENT_OVERRIDDEN,
}


@dataclass(slots=True)
class Request:
    """One question or one write that was sent and not fetched yet.

    Attributes
    ----------
    due_s : float or None
        When the answer is there; None while it was not sent.
    transmission : int
        The buffer or group that it waits in; 0 for none.
    code : int
        Result of it.
    """

    key: int
    writes: bool
    due_s: float | None = None
    transmission: int = 0
    code: int = 0
    dtype: int = sa.SA_CTL_DTYPE_NONE
    value: properties.Value = 0


@dataclass(slots=True)
class Transmission:
    """Commands that wait for their buffer to be flushed, or their group to be closed."""

    group: bool
    commands: list[Command] = field(default_factory=list)


class Device(SimulatedDevice[Channel]):
    """One controller as the library sees it; called with the library's lock held.

    Parameters
    ----------
    number : int
        Its place along the scene's wiring.
    serial : str
        What is printed on it.
    lock : LibraryLock
        The library's; never held while anything waits.
    """

    def __init__(
        self, number: int, serial: str, scene: Scene, faults: Faults, lock: LibraryLock
    ) -> None:
        settings = scene.settings.controller
        self.number = number
        self.serial: str = serial
        self.name: str = serial
        self.settings: ControllerSettings = settings
        self.faults = faults
        self.clock: Clock = scene.clock
        self.lock = lock
        self.changed = Condition(cast("Lock", lock))
        self.queue = PacketQueue(f"simulated {serial}", settings.queue_capacity)
        self.random = random.Random(f"mcs2 {number} {scene.seed}")
        self.values: dict[int, int] = {}
        self.handle = 0
        self.waiting = 0
        self.cancelled = False
        self._lost = False
        self.requests: dict[int, Request] = {}
        self.transmissions: dict[int, Transmission] = {}
        self._next_transmission = 1
        self._next_request = 0
        wiring = scene.wiring[number]
        self.modules: int = -(-len(wiring) // CHANNELS_PER_MODULE)
        self.channels: list[Channel] = [
            self._channel(scene, at, name) for at, name in enumerate(wiring)
        ]

    def _channel(self, scene: Scene, index: int, name: str | None) -> Channel:
        stage, memory = self._stage_at(scene, index, name)
        channel = Channel(
            self.number,
            index,
            stage,
            memory,
            settings=self.settings,
            faults=self.faults,
            seed=scene.seed,
            now_s=scene.clock.now_s(),
            post=self.post,
        )
        properties.power_up(channel)
        return channel

    def channel(self, index: int) -> Channel:
        """Return a channel; raises `Refused` where there is none."""
        if not 0 <= index < len(self.channels):
            raise Refused(sa.SA_CTL_ERROR_INVALID_CHANNEL_INDEX)
        return self.channels[index]

    @property
    def disconnected(self) -> bool:
        """Whether the client reaches nothing: also once the cable is in again, until it closes."""
        return self._lost or self.unplugged

    def latency_s(self, channel: int | None = None) -> float:
        """Return how long an answer takes."""
        low, high = self.settings.packet_latency_low_s, self.settings.packet_latency_high_s
        return self.random.uniform(low, high) + self.faults.delay_s(self.number, channel)

    def post(self, event: int, index: int, value: int, time_s: float) -> None:
        """Send an event at `time_s`."""
        channel = None if index == DEVICE_INDEX else index
        self.queue.push((event, index, value, 0, 0), time_s + self.latency_s(channel))
        self.changed.notify_all()

    def open(self, handle: int) -> None:
        """Start to work for a client; nothing moves, nothing stops."""
        self.close()
        self.handle = handle
        self._lost = False
        for key in (sa.SA_CTL_PKEY_EVENT_NOTIFICATION_OPTIONS, sa.SA_CTL_PKEY_AUTO_RECONNECT):
            self.values.pop(key, None)

    def close(self) -> None:
        """Forget the client; the channels go on with what they do."""
        self.handle = 0
        self.queue.clear()
        self.requests.clear()
        self.transmissions.clear()
        self.cancelled = False
        self.changed.notify_all()

    # Commands

    def run(self, command: Command, transmission: int, now_s: float) -> None:
        """Execute a command now, or keep it until its buffer or group is sent."""
        if transmission == 0:
            command(now_s)
            return
        self.transmission(transmission).commands.append(command)

    def transmission(self, handle: int) -> Transmission:
        """Return a buffer or group; raises `Refused` where there is none."""
        if handle not in self.transmissions:
            raise Refused(sa.SA_CTL_ERROR_INVALID_TRANSMIT_HANDLE)
        return self.transmissions[handle]

    def open_transmission(self, *, group: bool) -> int:
        """Return the handle of a new buffer or group."""
        handle = self._next_transmission
        self._next_transmission = handle % 255 + 1
        self.transmissions[handle] = Transmission(group)
        return handle

    def send(self, handle: int, now_s: float) -> None:
        """Execute what was kept, all at once; a group tells that it was."""
        kept = self.transmission(handle)
        if not kept.commands:
            raise Refused(sa.SA_CTL_ERROR_BUFFER_EMPTY)
        del self.transmissions[handle]
        for request in self.requests.values():
            if request.transmission == handle:
                request.transmission = 0  # the number of a buffer is used again
        for command in kept.commands:
            command(now_s)
        if kept.group:
            value = handle << 24
            self.post(sa.SA_CTL_EVENT_CMD_GROUP_TRIGGERED, DEVICE_INDEX, value, now_s)

    def drop(self, handle: int) -> None:
        """Forget what was kept, and what was asked with it."""
        del self.transmissions[handle]
        kept = self.requests.items()
        self.requests = {n: each for n, each in kept if each.transmission != handle}

    def movement(self, index: int, start: Callable[[Channel, float], None]) -> Command:
        """Return the command that starts a movement; a refusal comes as its end."""
        channel = self.channel(index)

        def run(now_s: float) -> None:
            try:
                start(channel, now_s)
            except Refused as refused:
                channel.finish(refused.code, now_s)
            channel.advance(now_s)

        return run

    def move(self, index: int, value: int) -> Command:
        """Return the command to make a movement."""
        return self.movement(index, lambda channel, now_s: moves.move(channel, now_s, value))

    # Requests

    def ask(self, key: int, transmission: int, *, writes: bool) -> int:
        """Return the number of a new request; raises `Refused`, also when there are too many."""
        if transmission:
            self.transmission(transmission)
        for _ in range(sa.SA_CTL_REQUEST_ID_MAX_COUNT):
            number = self._next_request
            self._next_request = (number + 1) % sa.SA_CTL_REQUEST_ID_MAX_COUNT
            if number not in self.requests:
                self.requests[number] = Request(key, writes, transmission=transmission)
                return number
        raise Refused(sa.SA_CTL_ERROR_BUFFER_LIMIT_REACHED)

    def answer(self, number: int, index: int, now_s: float, act: Callable[[Request], None]) -> None:
        """Do what a request asks for and have its answer sent."""
        request = self.requests.get(number)
        if request is None:
            act(Request(0, writes=True))  # its answer was cancelled, the write still happens
            return
        try:
            act(request)
        except Refused as refused:
            request.code = refused.code
        at = index if 0 <= index < len(self.channels) else None
        request.due_s = now_s + self.latency_s(at)
        if self.values.get(sa.SA_CTL_PKEY_EVENT_NOTIFICATION_OPTIONS):
            value = number | request.writes << 8 | request.dtype << 16 | 1 << 24
            value |= request.key << 32
            event = sa.SA_CTL_EVENT_REQUEST_READY, DEVICE_INDEX, _signed(value), 0, 0
            self.queue.push(event, request.due_s)
        self.changed.notify_all()

    # Trouble

    @override
    def on_inject(self, fault: Fault, now_s: float) -> None:
        self.advance(now_s)
        if fault.name == "unplugged":
            self._lost = not self.values.get(sa.SA_CTL_PKEY_AUTO_RECONNECT)
            self.queue.push((sa.SA_CTL_EVENT_CONNECTION_LOST, DEVICE_INDEX, 0, 0, 0), now_s)
        super().on_inject(fault, now_s)

    @override
    def _strike(self, channel: Channel, fault: Fault, now_s: float) -> None:
        if fault.name == "unplugged":
            channel.halt(now_s)  # the device stops what was started over that cable
        elif fault.name in _ENDS and channel.phase not in NOTHING_MOVES:
            channel.interrupt(_ENDS[fault.name], now_s)
        elif fault.name == "sensor_lost":
            channel.lose_sensor(now_s)
        elif fault.name == "end_stop":
            channel.meet_obstacle(now_s)


def _signed(value: int) -> int:
    return value - 2**64 if value >= 2**63 else value
