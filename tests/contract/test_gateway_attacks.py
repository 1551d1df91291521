"""Hostile lines at HTTP and EPICS: whoever behaves notices nothing, and nothing is left moving."""

import json
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from itertools import count

import httpx
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from contract import test_gateway_epics as epics
from contract import test_gateway_http as http
from contract.station_rig import wait_until

CROWD = 100
TOP = "/api/cabinet/drawers/top/move"


# HTTP


@pytest.fixture
def door() -> Iterator[http.Door]:
    with http.opened() as made:
        yield made


def raw(port: int, said: bytes = b"") -> socket.socket:
    """Return a line at which something was said, and no answer read."""
    line = socket.create_connection(("127.0.0.1", port), 5.0)
    line.settimeout(5.0)
    line.sendall(said)
    return line


HALF = {
    "nothing is said": b"",
    "half a head": b"GET /api/station HTTP/1.1\r\nHost:",
    "a body that never comes": b"POST /mcp HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\n",
    "a wrong token": b"GET /api/station HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer x\r\n\r\n",
    "half a websocket": b"GET /api/events HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\n"
    b"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
    b"dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n\x81\xfe",
}


@pytest.mark.parametrize("said", HALF.values(), ids=list(HALF))
def test_a_hundred_lines_without_a_token_keep_nobody_out(door: http.Door, said: bytes) -> None:
    port = int(door.address.rpartition(":")[2])
    with ExitStack() as lines:
        for _ in range(CROWD):
            lines.enter_context(closing(raw(port, said)))
        begun_s = time.perf_counter()
        with door.client() as client:
            assert client.post("/api/control").json()["in_control"]
            assert client.post(TOP, json={"target_um": 5.0}).json() == {"result": 5.0}
            assert client.post("/api/cabinet/stop", json={}).is_success
        assert time.perf_counter() - begun_s < 3.0
    assert door.home.stops == 1
    assert not door.failures


def test_a_client_with_too_many_lines_is_refused_and_no_other_is(
    door: http.Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http_lines.MOST_LINES", 3)
    with ExitStack() as lines:
        for _ in range(3):
            lines.enter_context(door.line("view"))
        with door.client("view") as one_more:
            assert one_more.get("/api/station").status_code == 429
        with pytest.raises(ConnectionClosed):
            lines.enter_context(door.line("view"))
        with door.client("move") as other:
            assert other.get("/api/station").is_success
    with door.client("view") as later:
        assert wait_until(lambda: later.get("/api/station").is_success)


@pytest.mark.parametrize(
    "said",
    [b"\0\1", "nonsense", "[]", '{"token": null}', '{"token": "\\ud800"}', '{"token": {"a": 1}}'],
)
def test_a_first_word_that_is_no_token_ends_its_line_with_a_reason(
    door: http.Door, said: str | bytes
) -> None:
    where = door.address.replace("http", "ws") + "/api/events"
    with connect(where, proxy=None) as line:
        line.send(said)
        with pytest.raises(ConnectionClosed) as told:
            line.recv(5.0)
        assert told.value.rcvd is not None
        assert told.value.rcvd.code in {4400, 4401}
        assert told.value.rcvd.reason
    assert not door.failures


@pytest.mark.parametrize(
    "topic",
    [
        "nothing/state",
        "cabinet/drawers/none/samples",
        "cabinet/a/b/samples",
        "/",
        "cabinet/state/x",
    ],
)
def test_only_what_is_there_is_followed(door: http.Door, topic: str) -> None:
    before = threading.active_count()
    with door.line("view", (topic,)) as line, pytest.raises(ConnectionClosed):
        line.recv(5.0)
    assert threading.active_count() <= before + 1, "each topic has a thread"


def test_a_line_that_is_cut_while_requests_crowd_ends_what_moves(
    door: http.Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    with door.client() as client, door.line(follow=("cabinet/state",)) as line:
        client.post("/api/control")
        client.post(TOP, json={"target_um": 1.0})
        dead_man = door.home.drawers["top"].dead_men[0]
        monkeypatch.setattr("cosmic.app.gateways.http.MOST_WAITING", 0)
        line.socket.shutdown(socket.SHUT_RDWR)
        assert wait_until(lambda: dead_man.expired, 0.7), "before silence alone would end it"


def test_who_guesses_tokens_waits_whatever_address_it_claims_and_by_whatever_door(
    door: http.Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http.SLOWED_AFTER", 5)
    for number in range(6):
        claimed = {"Authorization": "Bearer x", "X-Forwarded-For": f"10.0.0.{number}"}
        begun_s = time.perf_counter()
        assert httpx.get(door.address + "/api/station", headers=claimed).status_code == 401
    assert time.perf_counter() - begun_s > 0.9
    with connect(door.address.replace("http", "ws") + "/api/events", proxy=None) as line:
        begun_s = time.perf_counter()
        line.send('{"token": "x"}')
        with pytest.raises(ConnectionClosed):
            line.recv(5.0)
        assert time.perf_counter() - begun_s > 0.9
    with door.client() as client:
        begun_s = time.perf_counter()
        assert client.get("/api/station").is_success
        assert time.perf_counter() - begun_s < 0.9


def test_a_line_through_a_proxy_stays_open_and_counts(
    door: http.Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http_lines.STRANGER_S", 0.5)
    monkeypatch.setattr("cosmic.app.gateways.http_lines.MOST_LINES", 1)
    where, claimed = door.address.replace("http", "ws") + "/api/events", "10.1.2.3"
    with connect(where, proxy=None, additional_headers={"X-Forwarded-For": claimed}) as line:
        line.send(json.dumps({"token": http.TOKENS["view"], "follow": ["cabinet/state"]}))
        until_s = time.perf_counter() + 1.5
        while time.perf_counter() < until_s:
            line.recv(5.0)
        with door.client("view") as one_more:
            answer = one_more.get("/api/station", headers={"X-Forwarded-For": claimed})
            assert answer.status_code == 429


FILES = (
    *("..%2f..%2f..%2fetc%2fpasswd", "../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd"),
    *("/etc/passwd", "%00", "..%5c..%5cwindows", "..", ".", "a" * 3000),
)


def test_no_name_of_a_file_leads_out_of_the_folder_of_recordings(door: http.Door) -> None:
    port = int(door.address.rpartition(":")[2])
    for name in FILES:
        head = f"GET /api/files/{name} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n"
        head += f"Authorization: Bearer {http.TOKENS['move']}\r\n\r\n"
        with closing(raw(port, head.encode())) as line:
            answer = line.makefile("rb").read()
        assert answer.startswith((b"HTTP/1.1 4",)), (name, answer[:60])
        assert b"root:" not in answer
    assert not door.failures


def test_who_dribbles_a_body_holds_up_nobody(door: http.Door) -> None:
    port = int(door.address.rpartition(":")[2])
    head = f"POST {TOP} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {http.TOKENS['call']}\r\n"
    with ExitStack() as lines:
        slow = [
            lines.enter_context(closing(raw(port, f"{head}Content-Length: 900\r\n\r\n{{".encode())))
            for _ in range(40)
        ]
        with door.client() as client:
            took = []
            for _ in range(20):
                for each in slow:
                    with suppress(OSError):
                        each.send(b" ")
                begun_s = time.perf_counter()
                assert client.post("/api/cabinet/stop", json={}).is_success
                took.append(time.perf_counter() - begun_s)
        assert sorted(took)[10] < 0.3
    assert door.home.drawers["top"].moved_um == []


def test_headers_of_strange_letters_are_no_token(door: http.Door) -> None:
    port = int(door.address.rpartition(":")[2])
    for token in (b"\xff\xfe", b"m" * 5000, b"", http.TOKENS["move"].encode() + b"\xc3"):
        head = b"GET /api/station HTTP/1.1\r\nHost: x\r\nConnection: close\r\n"
        with closing(raw(port, head + b"Authorization: Bearer " + token + b"\r\n\r\n")) as line:
            assert line.recv(100).startswith(b"HTTP/1.1 401")
    assert httpx.get(f"{door.address}/api/station?token={http.TOKENS['move']}").status_code == 401


# Channel Access


def head(command: int, size: int, kind: int, count: int, first: int, second: int) -> bytes:
    return struct.pack(">HHHHII", command, size, kind, count, first, second)


def padded(said: bytes) -> bytes:
    return said + bytes(-len(said) % 8)


HELLO = head(0, 0, 0, 13, 0, 0) + b"".join(
    head(c, 8, 0, 0, 0, 0) + b"evil\0\0\0\0" for c in (20, 21)
)
WRITE, MONITOR, CREATE = 19, 1, 18


class RawLine:
    """A client of Channel Access that may say anything."""

    def __init__(self, port: int) -> None:
        self.socket = raw(port, HELLO)
        self._numbers = count(1)

    def open(self, name: str) -> int:
        said = padded(name.encode() + b"\0")
        number = next(self._numbers)
        self.socket.sendall(head(CREATE, len(said), 0, 0, number, 13) + said)
        while True:
            command, size, _, _, first, second = struct.unpack(">HHHHII", self._read(16))
            self._read(size)
            if command == CREATE and first == number:
                return int(second)

    def write(self, record: int, said: bytes | int) -> None:
        """Write a text or a whole number; no answer is read."""
        body = padded(said) if isinstance(said, bytes) else struct.pack(">i4x", said)
        kind, count = (4, len(said)) if isinstance(said, bytes) else (5, 1)
        self.socket.sendall(head(WRITE, len(body), kind, count, record, 1) + body)

    def _read(self, size: int) -> bytes:
        found = b""
        while len(found) < size:
            piece = self.socket.recv(size - len(found))
            assert piece, "the line is closed"
            found += piece
        return found

    def ended(self) -> bool:
        self.socket.settimeout(5.0)
        try:
            while self.socket.recv(65_536):
                pass
        except TimeoutError:
            return False
        except OSError:
            pass
        return True


def stop_s(client: epics.Client) -> float:
    begun_s = time.perf_counter()
    assert client.put("T:cabinet:stop", "{}")
    return time.perf_counter() - begun_s


def test_a_hundred_idle_lines_of_channel_access_keep_nobody_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.epics_channels.MOST_CLIENTS", 30)
    with epics.opened() as door, epics.used(door) as before, ExitStack() as lines:
        stop_s(before)
        for _ in range(CROWD):
            lines.enter_context(closing(raw(door.port)))
        with epics.used(door) as later:
            stop_s(later)
        assert stop_s(before) < 2.0, "who was there before is there still"
        assert not door.failures


BROKEN = {
    "an unknown record": head(4, 8, 6, 1, 999, 7) + bytes(8),
    "an unknown monitor": head(2, 0, 6, 1, 999, 7),
    "an unknown command": head(99, 0, 0, 0, 0, 0),
}


@pytest.mark.parametrize("said", BROKEN.values(), ids=list(BROKEN))
def test_who_breaks_the_protocol_leaves_nothing_moving(said: bytes) -> None:
    with epics.opened() as door, closing(raw(door.port)):
        line = RawLine(door.port)
        with closing(line.socket):
            control, move = line.open("T:control"), line.open("T:cabinet:drawers:top:move")
            line.write(control, 1)
            line.write(move, b'{"target_um": 5.0}')
            assert wait_until(lambda: door.home.drawers["top"].moved_um == [5.0])
            dead_man = door.home.drawers["top"].dead_men[-1]
            assert not dead_man.expired
            line.socket.sendall(said)
            assert line.ended(), "a line that does not answer must not stay open"
            assert wait_until(lambda: dead_man.expired, 1.0)
            assert wait_until(lambda: door.station.lease.state.local)
        assert not door.failures


def test_a_message_that_promises_much_is_not_kept() -> None:
    with epics.opened() as door, epics.used(door) as client:
        line = RawLine(door.port)
        with closing(line.socket):
            record = line.open("T:cabinet:apply")
            promised = struct.pack(">HHHHIIII", 4, 0xFFFF, 4, 0, record, 7, 2**31, 2**31)
            sent = len(promised)
            with suppress(OSError):
                line.socket.sendall(promised)
                for _ in range(640):
                    line.socket.sendall(bytes(65_536))
                    sent += 65_536
            assert sent < 30_000_000, "it is read on and on"
        assert stop_s(client) < 2.0


def test_who_monitors_too_much_is_cut_off_and_nobody_waits() -> None:
    with epics.opened() as door, epics.used(door) as client:
        line = RawLine(door.port)
        with closing(line.socket):
            record = line.open("T:cabinet:apply")
            one = struct.pack(">fffHH", 0, 0, 0, 1, 0)
            with suppress(OSError):
                for first in range(0, 30_000, 1000):
                    numbers = range(first, first + 1000)
                    line.socket.sendall(
                        b"".join(head(MONITOR, 16, 4, 0, record, each) + one for each in numbers)
                    )
            assert line.ended()
        assert stop_s(client) < 2.0
        assert not door.failures


@pytest.mark.parametrize("number", [float("nan"), float("inf"), -1e300])
def test_numbers_that_are_none_move_nothing(number: float) -> None:
    with epics.opened() as door, epics.used(door) as client:
        assert client.put("T:control", 1)
        said = json.dumps({"target_um": number, "more": 1})
        assert not client.put("T:cabinet:drawers:top:move", said)
        assert not client.put("T:cabinet:apply", "null")
        assert not client.put("T:cabinet:apply", "[" * 15_000)
        assert door.home.drawers["top"].moved_um == []
        assert stop_s(client) < 2.0
        assert not door.failures
