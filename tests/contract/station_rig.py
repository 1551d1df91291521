"""A station with one application, and a client of it over either transport."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault, UnknownAxisError, refusal
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.network.caller import Access, current_call
from cosmic.frame.network.client_side_connection import ClientSideConnection
from cosmic.frame.network.dead_man import DeadMan
from cosmic.frame.network.line_settings import Certificates, Line
from cosmic.frame.network.remote import remote
from cosmic.frame.network.server_listener import ServerListener
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Transport
from cosmic.frame.network.zenoh_wire import ZenohWire
from cosmic.frame.operation import Task
from cosmic.frame.verdict import MoveVerdict, Reason
from unit.frame.network.memory_wire import MemoryHub, MemoryWire

VERDICT = MoveVerdict(
    allowed=False,
    reason=Reason.COLLISION,
    axis="left.x",
    value=12.5,
    unit="um",
    bodies=("left.gripper", "table"),
    place_um=(1.0, 2.0, 3.0),
    text="left.x would touch the table",
)


class Application:
    """Offers one function of each kind."""

    def __init__(self) -> None:
        self.moved: list[float] = []
        self.moved_at_s: list[float] = []
        self.stops = 0
        self.entered = threading.Event()
        self.go_on = threading.Event()
        self.at_once_done = threading.Event()
        self.dead_man: DeadMan | None = None
        self.callers: list[str] = []
        self.together = 0
        self.most_together = 0
        self.tasks: list[Task] = []

    @remote
    def add(self, a: float, b: float = 1.0) -> float:
        return a + b

    @remote
    def echo(self, value: object) -> object:
        return value

    @property
    @remote(reads=True)
    def count(self) -> int:
        return len(self.moved)

    @remote(moves=True, limit_s=0.3)
    def move(self, target_um: float) -> float:
        call = current_call()
        assert call is not None
        self.dead_man = call.dead_man
        self.callers.append(call.caller.name)
        self.moved_at_s.append(time.monotonic())
        self.moved.append(target_um)
        return target_um

    @remote(moves=True)
    def travel(self) -> Task:
        task = Task("Travel")
        task.on_cancel(lambda: task.fail(DeviceError("halted", fault=DeviceFault.OVERRIDDEN)))
        self.tasks.append(task)
        return task

    @remote
    def export(self) -> Task:
        self.tasks.append(Task("Export"))
        return self.tasks[-1]

    @remote(at_once=True)
    def stop(self) -> None:
        self.stops += 1
        self.at_once_done.set()

    @remote
    def wait_here(self) -> str:
        self.together += 1
        self.most_together = max(self.most_together, self.together)
        self.entered.set()
        self.go_on.wait(5.0)
        self.together -= 1
        return "done"

    @remote
    def refuse(self) -> None:
        raise refusal(VERDICT)

    @remote
    def break_device(self) -> None:
        raise DeviceError("device 1 hangs", fault=DeviceFault.TIMEOUT, code=5, device=1)

    @remote
    def ask_axis(self) -> None:
        raise UnknownAxisError("left.q", ["left.x"])

    @remote
    def be_wrong(self) -> float:
        return 1 / 0

    @remote
    def image(self, rows: int) -> NDArray[np.uint8]:
        return np.arange(rows * 4, dtype=np.uint8).reshape(rows, 4)

    def hidden(self) -> str:
        return "not for others"


@dataclass
class StationRig:
    """What a test needs; `client` is the transport under test."""

    station: Station
    application: Application
    client: Transport
    another: Callable[[str], Transport]
    failures: list[Failure] = field(default_factory=list)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def wait_until(condition: Callable[[], Any], timeout_s: float = 20.0) -> bool:
    """Look every 5 ms until `condition` holds; False when it did not in time."""
    until_s = WALL.now_s() + timeout_s
    while not condition():
        if WALL.now_s() > until_s:
            return False
        WALL.sleep(0.005)
    return True


@contextmanager
def listening(
    station: Station,
    line: Line,
    access: Callable[[str], Access | None] = lambda _: Access.MOVE,
) -> Iterator[ServerListener]:
    listener = ServerListener(station, ZenohWire(line), access)
    try:
        listener.start()
        yield listener
    finally:
        listener.shut_down()


@contextmanager
def connected(
    endpoint: str,
    name: str = "vision",
    *,
    timeout_s: float = 10.0,
    certificates: Certificates | None = None,
) -> Iterator[ClientSideConnection]:
    line = Line(endpoint, listens=False, station="fibres", certificates=certificates)
    client = ClientSideConnection("fibres", name, lambda: ZenohWire(line), FailurePolicy())
    try:
        client.start()
        assert timeout_s == 0.0 or client.wait_until_here(timeout_s), client.state
        yield client
    finally:
        client.close()


@contextmanager
def connected_in_memory(
    station: Station,
    name: str = "vision",
    access: Access = Access.MOVE,
    *,
    kind: type[ClientSideConnection] = ClientSideConnection,
) -> Iterator[ClientSideConnection]:
    """A client in the same process, over a line that is memory."""
    hub = MemoryHub()
    listener = ServerListener(station, MemoryWire(hub), {name: access})
    client = kind(station.name, name, lambda: MemoryWire(hub), FailurePolicy())
    try:
        listener.start()
        client.start()
        assert client.wait_until_here(10.0), client.state
        yield client
    finally:
        client.close()
        listener.shut_down()


@contextmanager
def station_rig(transport: str) -> Iterator[StationRig]:
    """Yield a station and a client of it; `transport` is "memory" or "zenoh"."""
    policy = FailurePolicy()
    station, application = Station("fibres", policy), Application()
    station.host("stage", application)
    station.host("camera", Application())
    with ExitStack() as stack:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        if transport == "zenoh":
            line = Line(endpoint, listens=True, station="fibres")
            stack.enter_context(listening(station, line))

        def connect(name: str) -> Transport:
            if transport == "zenoh":
                return stack.enter_context(connected(endpoint, name))
            return stack.enter_context(connected_in_memory(station, name))

        rig = StationRig(station, application, connect("vision"), connect)
        policy.subscribe(rig.failures.append)
        yield rig
        application.go_on.set()
