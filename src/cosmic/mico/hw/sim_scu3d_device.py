"""One simulated controller unit: three channels, one queue, one cable."""

import random
from threading import Condition, Lock
from typing import cast

from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.mico.hw.scu3d_ctypes import (
    SA_COMMAND_OVERRIDDEN_ERROR,
    SA_ERROR_PACKET_TYPE,
    SA_HV_RANGE_ERROR,
    SA_OTHER_ERROR,
    SA_TEMP_OVERHEAT_ERROR,
)
from cosmic.mico.hw.sim_device import LibraryLock, SimulatedDevice
from cosmic.mico.hw.sim_faults import Fault, Faults
from cosmic.mico.hw.sim_queue import Packet, PacketQueue
from cosmic.mico.hw.sim_scu3d_channel import Channel
from cosmic.twin.scene import Scene

_ENDS_MOVEMENTS = {
    "overheated": SA_TEMP_OVERHEAT_ERROR,
    "hv_range": SA_HV_RANGE_ERROR,
    "overridden": SA_COMMAND_OVERRIDDEN_ERROR,
}


class Device(SimulatedDevice[Channel]):
    """One unit as the library sees it; called with the library's lock held.

    Parameters
    ----------
    number : int
        Its place along the scene's wiring.
    scene : Scene
        What it drives.
    lock : LibraryLock
        The library's; never held while anything waits.
    newest_error : int
        The last status code that this version of the library knows a name for.
    """

    def __init__(
        self, number: int, scene: Scene, faults: Faults, lock: LibraryLock, *, newest_error: int
    ) -> None:
        settings = scene.settings.controller
        self.number = number
        self.serial = settings.first_serial + number
        self.settings = settings
        self.faults = faults
        self.newest_error = newest_error
        self.lock = lock
        self.changed = Condition(cast("Lock", lock))
        self.queue = PacketQueue(f"simulated SCU {self.serial}", settings.queue_capacity)
        self.asynchronous = False
        self.notification: int | None = None
        self.random = random.Random(f"device {number} {scene.seed}")
        self.clock: Clock = scene.clock
        self.channels = [
            self._channel(scene, index, name) for index, name in enumerate(scene.wiring[number])
        ]

    def _channel(self, scene: Scene, index: int, name: str | None) -> Channel:
        stage, memory = self._stage_at(scene, index, name)
        return Channel(
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

    def reported(self, code: int) -> int:
        """Return a status code as this version of the library tells it."""
        return code if code <= self.newest_error else SA_OTHER_ERROR

    def post(self, packet: Packet, time_s: float) -> None:
        """Send a packet at `time_s`; a synchronous client has nowhere to read it."""
        if not self.asynchronous:
            return
        if packet[0] == SA_ERROR_PACKET_TYPE:
            packet = (packet[0], packet[1], self.reported(packet[2]), 0, 0)
        settings = self.settings
        latency_s = self.random.uniform(
            settings.packet_latency_low_s, settings.packet_latency_high_s
        )
        latency_s += self.faults.delay_s(self.number, packet[1])
        self.queue.push(packet, time_s + latency_s)
        self.changed.notify_all()

    def open(self, *, asynchronous: bool, reset: bool, now_s: float) -> None:
        """Start to work for a client."""
        self.advance(now_s)
        self.close()
        self.asynchronous = asynchronous
        for channel in self.channels:
            channel.report = 0
            if reset:
                channel.power_cycle(now_s)

    def close(self) -> None:
        """Forget the client; the channels go on with what they do."""
        self.queue.clear()
        self.notification = None
        self.changed.notify_all()

    @override
    def _strike(self, channel: Channel, fault: Fault, now_s: float) -> None:
        if fault.name == "hv_range":
            channel.hv_error = True
        if fault.name in _ENDS_MOVEMENTS and (channel.moving or fault.name == "hv_range"):
            channel.interrupt(_ENDS_MOVEMENTS[fault.name], now_s)
        elif fault.name == "sensor_lost":
            channel.lose_sensor(now_s)
        elif fault.name == "end_stop":
            channel.meet_obstacle(now_s)
