"""EPICS: what is declared is a record; puts pass the lease, and who dies leaves nothing moving."""

import asyncio
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import Any

import caproto
import pytest

from contract.cabinet import Cabinet, Colour, Lamp, WithBell
from contract.station_rig import free_port, wait_until
from cosmic.app.configuration.gateways import Doors, EpicsSettings, HttpSettings, doors
from cosmic.app.gateways.approvals import Approvals
from cosmic.app.gateways.epics import EpicsGateway
from cosmic.app.gateways.epics_channels import Who, whole
from cosmic.app.gateways.session import GatewaySession
from cosmic.frame.declaration import command, state
from cosmic.frame.errors import ConfigError, OperationCancelled
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.network.caller import Access
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station

CHILD = Path(__file__).with_name("epics_child.py")
INVALID = 3


class Client:
    """A client in a process of its own."""

    def __init__(self, port: int) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(CHILD), str(port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, operation: str, name: str, value: object = None) -> Any:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps([operation, name, value]) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def put(self, name: str, value: object) -> bool:
        return bool(self.ask("put", name, value))

    def get(self, name: str) -> Any:
        return self.ask("get", name)

    def end(self) -> None:
        self.process.kill()
        self.process.wait(10)
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()


@dataclass
class Door:
    home: Cabinet
    station: Station
    port: int
    failures: list[Failure]


@contextmanager
def opened(
    kind: type[Cabinet] = Cabinet, *, write: bool = True, approvals: Approvals | None = None
) -> Iterator[Door]:
    home, policy = kind(), FailurePolicy()
    failures: list[Failure] = []
    policy.subscribe(failures.append)
    station = Station("fibres", policy)
    host = Host("cabinet", home)
    station.host("cabinet", host)
    settings = EpicsSettings(prefix="T:", port=free_port(), write=write)
    ask = None if approvals is None else approvals.ask
    gateway = EpicsGateway(station, {"cabinet": host}, settings, ask)
    try:
        yield Door(home, station, gateway.port, failures)
    finally:
        gateway.close()
        host.close()


@contextmanager
def used(door: Door) -> Iterator[Client]:
    client = Client(door.port)
    try:
        yield client
    finally:
        client.end()


def test_a_command_declared_tomorrow_is_a_record_without_a_line_of_code() -> None:
    with opened(WithBell) as door, used(door) as client:
        assert client.put("T:cabinet:ring", '{"times": 2}')
        assert json.loads(client.get("T:cabinet:ring")) == {"result": "ding ding "}
        assert isinstance(door.home, WithBell)
        assert door.home.rung == [2]
        assert not client.put("T:cabinet:ring", '{"times": "2"}')
        assert "times" in json.loads(client.get("T:cabinet:ring"))["error"]
        assert not client.put("T:cabinet:ring", "[1")
        assert door.home.rung == [2]


def test_what_moves_needs_the_right_and_ends_with_the_client() -> None:
    with opened() as door:
        with used(door) as client:
            move = "T:cabinet:drawers:left_x:move"
            assert not client.put(move, '{"target_um": 5.0}')
            assert door.home.drawers["left.x"].moved_um == []
            assert client.put("T:control", 1)
            assert client.get("T:control:holder").startswith("EPICS")
            assert client.put(move, '{"target_um": 5.0}')
            assert door.home.drawers["left.x"].moved_um == [5.0]
            state = "T:cabinet:drawers:left_x:position_um"
            assert wait_until(lambda: client.get(state) == 5.0)
            dead_man = door.home.drawers["left.x"].dead_men[-1]
            assert not dead_man.expired
            client.process.send_signal(signal.SIGKILL)
            assert wait_until(lambda: dead_man.expired, 1.0)
            assert wait_until(lambda: door.station.lease.state.local)
        assert not door.failures


def test_a_client_that_is_frozen_and_wants_to_be_watched_loses_the_right() -> None:
    with opened() as door, used(door) as client:
        assert client.put("T:control", 2)
        assert client.put("T:cabinet:drawers:left_x:move", '{"target_um": 5.0}')
        dead_man = door.home.drawers["left.x"].dead_men[-1]
        client.process.send_signal(signal.SIGSTOP)
        assert not dead_man.expired
        assert wait_until(lambda: dead_man.expired, 1.5), "what moves bears 1 s of silence"
        assert wait_until(lambda: door.station.lease.state.local, 1.5)
        client.process.send_signal(signal.SIGCONT)
        assert not client.put("T:cabinet:drawers:left_x:move", '{"target_um": 6.0}')
        assert door.home.drawers["left.x"].moved_um == [5.0]


def test_whatever_a_watched_client_says_keeps_what_moves() -> None:
    with opened() as door, used(door) as client:
        assert client.put("T:control", 1)
        assert client.put("T:control", 2)
        assert client.put("T:cabinet:drawers:left_x:move", '{"target_um": 5.0}')
        dead_man = door.home.drawers["left.x"].dead_men[-1]
        until_s = time.monotonic() + 1.3
        while time.monotonic() < until_s:
            assert client.get("T:control") == 1.0
        assert not dead_man.expired


def test_a_right_that_is_not_given_has_its_reason() -> None:
    with opened() as door, used(door) as client, used(door) as other:
        assert client.put("T:control", 1)
        assert not other.put("T:control", 1)
        assert "held by EPICS" in other.get("T:control:reason")
        assert not client.put("T:control", -3)
        assert "seconds of silence" in client.get("T:control:reason")
        assert client.put("T:control", 0)
        assert other.put("T:control", 1)
        assert other.get("T:control:reason") == ""


def test_a_state_is_a_record_with_its_fields_and_says_when_nobody_knows_it() -> None:
    class Bench(Cabinet):
        def __init__(self) -> None:
            super().__init__()
            self.focus: float | None = None
            self.count = 2**40

        @property
        @state
        def focus_um(self) -> float | None:
            return self.focus

        @property
        @state
        def frames(self) -> int:
            return self.count

        @property
        @state
        def tools(self) -> tuple[str, ...]:
            return ("tip",)

        def know(self, focus: float | None, count: int) -> None:
            self.focus, self.count = focus, count
            self.note_change()

    with opened(Bench) as door, used(door) as client:
        assert isinstance(door.home, Bench)
        assert wait_until(lambda: client.get("T:cabinet:lamp:shown:colour") == "red")
        door.home.lamp.shine(Colour.GREEN, level=0.5)
        assert wait_until(lambda: client.get("T:cabinet:lamp:shown:colour") == "green")
        assert client.get("T:cabinet:lamp:shown:level") == 0.5
        for name in ("focus_um", "frames"):
            assert wait_until(lambda name=name: client.ask("alarm", f"T:cabinet:{name}") == INVALID)
        door.home.know(3.5, 7)
        assert wait_until(lambda: client.get("T:cabinet:focus_um") == 3.5)
        assert client.ask("alarm", "T:cabinet:focus_um") == 0
        assert client.get("T:cabinet:frames") == 7
        door.home.know(None, 8)
        assert wait_until(lambda: client.ask("alarm", "T:cabinet:focus_um") == INVALID)
        assert client.ask("find", "T:cabinet:frames", 10)
        assert not client.ask("find", "T:cabinet:tools", 0.5), "a list is no text"


def test_parts_that_come_and_go_are_records_as_well() -> None:
    with opened() as door, used(door) as client:
        assert client.put("T:control", 1)
        door.home.put_in("low")
        door.home.fit(Lamp())
        time.sleep(0.3)  # a client that searched in vain is slow to search again
        assert client.ask("find", "T:cabinet:drawers:low:move", 10)
        assert client.put("T:cabinet:drawers:low:move", '{"target_um": 5.0}')
        assert door.home.drawers["low"].moved_um == [5.0]
        assert wait_until(lambda: client.get("T:cabinet:drawers:low:position_um") == 5.0)
        assert client.put("T:cabinet:spare:shine", '{"colour": "green"}')
        assert client.put("T:cabinet:drawers:left_x:move", '{"target_um": 6.0}')
        door.home.take_out("low")
        assert not client.put("T:cabinet:drawers:low:move", '{"target_um": 7.0}')
        assert "there is no 'low'" in client.get("T:cabinet:drawers:low:move")
        with used(door) as later:
            assert wait_until(
                lambda: not later.ask("find", "T:cabinet:drawers:low:position_um", 0.2)
            )


def test_two_things_that_would_be_one_record_are_named() -> None:
    home = Cabinet()
    home.put_in("left_x")  # beside "left.x"
    station, host = Station("fibres", FailurePolicy()), Host("cabinet", home)
    station.host("cabinet", host)
    with pytest.raises(ConfigError, match="T:cabinet:drawers:left_x:"):
        EpicsGateway(station, {"cabinet": host}, EpicsSettings(prefix="T:", port=free_port()))
    host.close()


def test_what_keeps_a_motion_alive_does_not_end_it() -> None:
    class Jogged(Cabinet):
        @command(moves=True, renews=True)
        def renew(self) -> None:
            """Keep what travels alive."""

    with opened(Jogged) as door, used(door) as client, used(door) as other:
        assert client.put("T:control", 1)
        client.ask("begin", "T:cabinet:travel", list(b"{}"))
        assert wait_until(lambda: bool(door.home.tasks))
        assert client.put("T:cabinet:renew", "{}")
        assert not door.home.tasks[0].done
        assert other.put("T:cabinet:stop", "{}")
        assert wait_until(lambda: door.home.tasks[0].done)


@pytest.mark.parametrize("said", ["1", 1, 2.5, "now!", '{"why": 1}', ""])
def test_a_stop_is_carried_out_whatever_is_put(said: object) -> None:
    with opened() as door, used(door) as client:
        assert client.put("T:cabinet:stop", said)
        assert door.home.stops == 1


@pytest.mark.parametrize(("said", "put"), [(0.5, 1), (-0.2, 1), (7.0, 7), (0.0, 0)])
def test_a_part_of_one_is_not_cut_to_nothing_where_a_put_stops(said: float, put: int) -> None:
    values: list[int] = []

    async def took(_who: Who, value: int) -> None:
        values.append(value)

    channel = whole(put=took, otherwise=1)
    double = caproto.ChannelType.DOUBLE
    asyncio.run(channel.auth_write("host", "user", [said], double, None))
    assert values == [put]


def test_a_gateway_that_only_shows_still_lets_everybody_stop() -> None:
    with opened(write=False) as door, used(door) as client:
        assert not client.put("T:control", 1)
        assert not client.put("T:cabinet:apply", '{"settings": {"name": "x"}}')
        assert client.put("T:cabinet:stop", "{}")
        assert door.home.stops == 1
        assert door.home.name == "lamp"


@pytest.fixture
def approvals() -> Iterator[Approvals]:
    made = Approvals(FailurePolicy())
    yield made
    made.close()


def test_what_is_taken_back_after_its_approval_is_not_begun_any_more(approvals: Approvals) -> None:
    station = Station("fibres", FailurePolicy())
    host = Host("cabinet", Cabinet())
    station.host("cabinet", host)
    session = GatewaySession(station, "notebook", Access.MOVE, door="http")
    go_on, begun = Event(), list[str]()
    try:
        order = session.order("cabinet", "drawers.move", {"target_um": 5.0}, ("left.x",))
        before = approvals.ask("notebook", order, lambda: begun.append("before") or go_on.wait(10))
        after = approvals.ask("notebook", order, lambda: begun.append("after"))
        for asked in approvals.waiting:
            approvals.approve(asked.number)
        assert wait_until(lambda: begun == ["before"])
        after.cancel()
        go_on.set()
        assert before.exception(10.0) is None
        assert isinstance(after.exception(10.0), OperationCancelled)
        assert begun == ["before"]
    finally:
        go_on.set()
        session.close()
        host.close()


def test_what_moves_over_epics_waits_for_a_person(approvals: Approvals) -> None:
    move = "T:cabinet:drawers:left_x:move"
    with opened(approvals=approvals) as door, used(door) as client, used(door) as other:

        def asked(target_um: float) -> Thread:
            def put() -> None:
                with suppress(json.JSONDecodeError):  # killed while it waits
                    answers.append(client.put(move, json.dumps({"target_um": target_um})))

            made = Thread(target=put)
            made.start()
            assert wait_until(lambda: approvals.waiting != ())
            return made

        answers: list[bool] = []
        assert client.put("T:control", 1)
        held = asked(5.0)
        assert door.home.drawers["left.x"].moved_um == []
        assert approvals.waiting[0].details == "left.x, target_um=5.0"
        approvals.approve(approvals.waiting[0].number)
        held.join(10.0)
        held = asked(6.0)
        approvals.refuse(approvals.waiting[0].number)
        held.join(10.0)
        held = asked(7.0)
        assert other.put("T:cabinet:stop", "{}"), "a stop waits for nobody"
        held.join(10.0)
        assert answers == [True, False, False]
        assert approvals.waiting == (), "what was stopped does not wait any more"
        assert door.home.drawers["left.x"].moved_um == [5.0]
        held = asked(8.0)
        client.process.send_signal(signal.SIGKILL)
        held.join(10.0)
        assert wait_until(lambda: approvals.waiting == ()), "who is gone asks for nothing"
    assert door.home.drawers["left.x"].moved_um == [5.0]


def test_who_asks_at_one_door_leaves_no_other_open() -> None:
    asking, quiet = EpicsSettings(prefix="T:", approve=True), EpicsSettings(prefix="T:")
    web = HttpSettings(listen="127.0.0.1:8470")
    assert Doors(web, asking).asks_first
    assert Doors(web.model_copy(update={"approve": True}), quiet).asks_first
    assert not Doors(web, quiet).asks_first


def test_bytes_that_are_no_channel_access_harm_nobody() -> None:
    with opened() as door, used(door) as client:
        lines = []
        for number in range(40):
            raw = socket.create_connection(("127.0.0.1", door.port))
            raw.sendall(bytes([number, 255 - number]) * 500)
            lines.append(raw)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as search:
            for number in range(200):
                search.sendto(bytes([number % 256]) * 40, ("127.0.0.1", door.port))
        assert client.put("T:cabinet:stop", "{}")
        assert door.home.stops == 1
        for raw in lines:
            raw.close()
        assert not door.failures


@pytest.mark.parametrize("prefix", ["", "COSMIC:", "BL-1.2:"])
def test_a_prefix_is_what_epics_takes(prefix: str) -> None:
    assert EpicsSettings(prefix=prefix).prefix == prefix
    with pytest.raises(ValueError, match="prefix"):
        EpicsSettings(prefix="no spaces")


def test_a_prefix_of_the_command_line_that_is_none_is_refused_in_words() -> None:
    with pytest.raises(ConfigError, match=r"--epics: prefix: .*'a b'"):
        doors(HttpSettings(), EpicsSettings(), prefix="a b")
