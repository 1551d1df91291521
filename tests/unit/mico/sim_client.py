"""A client of the simulated library that calls C functions as a C program would, by address."""

import ctypes
from dataclasses import dataclass
from typing import Any

from cosmic.frame.clock import Clock, ManualClock
from cosmic.mico.hw.scu3d_ctypes import PROTOTYPES, SA_PACKET, function_type
from cosmic.mico.hw.sim_scu3d import SimulatedLibrary, load_simulated_library

OK, SYNC, ASYNC, RESET = 0, 0, 1, 2
ERROR, POSITION, ANGLE, COMPLETED, STATUS = 1, 2, 3, 4, 5
STOPPED, SETTING, MOVING, TARGETING, HOLDING, CALIBRATING, REFERENCING = range(7)
FOR_EVER = 60_000


@dataclass(frozen=True)
class Packet:
    type: int
    channel: int
    data1: int
    data2: int
    data3: int


class Client:
    """Calls by name; every function is reached through its raw address."""

    def __init__(
        self, library: SimulatedLibrary | None = None, *, mode: int | None = ASYNC
    ) -> None:
        self.library = library or load_simulated_library(clock=ManualClock(auto_advance=True))
        self.clock: Clock = self.library.clock
        self.skipped: list[Packet] = []
        self._functions: dict[str, Any] = {}
        if mode is not None:
            assert self.call("InitDevices", mode) == OK

    def call(self, name: str, *args: object) -> int:
        if name not in self._functions:
            pointer = getattr(self.library, f"SA_{name}")
            address = ctypes.cast(pointer, ctypes.c_void_p).value
            self._functions[name] = function_type(f"SA_{name}")(address)
        return int(self._functions[name](*args))

    def ok(self, name: str, *args: object) -> None:
        status = self.call(name, *args)
        assert status == OK, f"SA_{name}{args} answered {status}"

    def read(self, name: str, *args: object) -> int:
        """Call a function whose last argument is where it writes its answer."""
        out = PROTOTYPES[f"SA_{name}"][-1]._type_()  # type: ignore[attr-defined]
        self.ok(name, *args, ctypes.byref(out))
        return int(out.value)

    def receive(self, device: int = 0, timeout_ms: int = 200) -> Packet:
        packet = SA_PACKET()
        self.ok("ReceiveNextPacket_A", device, timeout_ms, ctypes.byref(packet))
        return _frozen(packet)

    def look(self, device: int = 0, timeout_ms: int = 200) -> Packet:
        packet = SA_PACKET()
        self.ok("LookAtNextPacket_A", device, timeout_ms, ctypes.byref(packet))
        return _frozen(packet)

    def receive_if(self, device: int, channel: int, timeout_ms: int = 200) -> Packet:
        packet = SA_PACKET()
        self.ok("ReceiveNextPacketIfChannel_A", device, channel, timeout_ms, ctypes.byref(packet))
        return _frozen(packet)

    def drain(self, device: int = 0, timeout_ms: int = 0) -> list[Packet]:
        packets = []
        while (packet := self.receive(device, timeout_ms)).type:
            packets.append(packet)
        return packets

    def until(self, wanted: int, device: int = 0, *, within_s: float = 60.0) -> Packet:
        """Receive until a packet of that type comes; the others are in `skipped`."""
        end_s = self.clock.now_s() + within_s
        while self.clock.now_s() < end_s:
            packet = self.receive(device)
            if packet.type == wanted:
                return packet
            if packet.type:
                self.skipped.append(packet)
        raise AssertionError(f"no packet of type {wanted} within {within_s} s")

    def ask(self, name: str, device: int, channel: int, *args: object) -> Packet:
        self.ok(f"{name}_A", device, channel, *args)
        return self.receive(device)

    def status(self, device: int = 0, channel: int = 0) -> int:
        self.ok("GetStatus_A", device, channel)
        return self.until(STATUS, device).data1

    def position(self, device: int = 0, channel: int = 0) -> int:
        self.ok("GetPosition_A", device, channel)
        return self.until(POSITION, device).data2

    def advance(self, duration_s: float) -> None:
        self.clock.sleep(duration_s)

    def truth(self, name: str = "0.0") -> float:
        return self.library.scene.truth()[name]

    def settle(self, device: int = 0) -> list[Packet]:
        """Let two simulated seconds pass and return all packets."""
        self.advance(2.0)
        return self.drain(device, 5)


def _frozen(packet: SA_PACKET) -> Packet:
    names = ("packetType", "channelIndex", "data1", "data2", "data3")
    return Packet(*(int(getattr(packet, name)) for name in names))
