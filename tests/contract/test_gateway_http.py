"""HTTP: what is declared is commanded, read and followed, through the lease and the checks."""

import json
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from threading import Event, Thread
from typing import Any

import httpx
import pytest
from PySide6.QtWidgets import QPushButton
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from contract.cabinet import Cabinet, WithBell
from contract.station_rig import free_port, wait_until
from cosmic.app.configuration.gateways import HttpClient, HttpSettings, doors
from cosmic.app.gateways.approvals import Approvals
from cosmic.app.gateways.http import HttpGateway
from cosmic.app.gateways.http_server import BODY_LIMIT_BYTES, listening
from cosmic.app.gateways.openapi import mcp_tools
from cosmic.app.panels.approvals import ApprovalsPanel
from cosmic.frame.declaration import command
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.network.certificates import make_certificates
from cosmic.frame.network.host import Host
from cosmic.frame.network.line_settings import Certificates
from cosmic.frame.network.station import Station

BROWSER = Path(__file__).with_name("browser_child.py")
TOKENS = {"move": "m" * 20, "call": "c" * 20, "view": "v" * 20}


@dataclass
class Door:
    home: Cabinet
    station: Station
    address: str
    failures: list[Failure]

    def client(self, access: str = "move", **more: Any) -> httpx.Client:
        headers = {"Authorization": f"Bearer {TOKENS[access]}"}
        return httpx.Client(base_url=self.address, headers=headers, timeout=20.0, **more)

    @contextmanager
    def line(
        self, access: str = "move", follow: tuple[str, ...] = (), **more: Any
    ) -> Iterator[Any]:
        with connect(self.address.replace("http", "ws") + "/api/events", proxy=None) as made:
            made.send(json.dumps({"token": TOKENS[access], "follow": list(follow)} | more))
            assert json.loads(made.recv(5.0))["topic"] == "hello"
            yield made


@contextmanager
def opened(
    kind: type[Cabinet] = Cabinet,
    approvals: Approvals | None = None,
    certificates: Certificates | None = None,
) -> Iterator[Door]:
    home, policy = kind(), FailurePolicy()
    failures: list[Failure] = []
    policy.subscribe(failures.append)
    station = Station("fibres", policy)
    host = Host("cabinet", home)
    station.host("cabinet", host)
    clients = tuple(
        HttpClient.model_validate({"name": each, "token": token, "access": each})
        for each, token in TOKENS.items()
    )
    asks = approvals is not None
    settings = HttpSettings(listen=f"127.0.0.1:{free_port()}", client=clients, approve=asks)
    if certificates is not None:
        files = {"certificate": str(certificates.certificate), "key": str(certificates.key)}
        settings = settings.model_copy(update=files)
    hosts, ask = {"cabinet": host}, None
    if approvals is not None:
        hosts["approvals"] = Host("approvals", approvals)
        station.host("approvals", hosts["approvals"])
        ask = approvals.ask
    gateway = HttpGateway(station, hosts, settings, {"platform": "test"}, ask)
    try:
        yield Door(home, station, gateway.address, failures)
    finally:
        gateway.close()
        for each in hosts.values():
            each.close()


@pytest.fixture
def door() -> Iterator[Door]:
    with opened() as made:
        yield made


def test_a_command_declared_tomorrow_is_there_without_a_line_of_code() -> None:
    with opened(WithBell) as door, door.client("call") as http:
        assert http.post("/api/cabinet/ring", json={"times": 2}).json() == {"result": "ding ding "}
        assert door.home.rung == [2]
        described = http.get("/openapi.json").json()["paths"]["/api/cabinet/ring"]["post"]
        body = described["requestBody"]["content"]["application/json"]["schema"]
        assert body["properties"]["times"] == {"type": "integer", "default": 1}
    tool = {each["name"]: each for each in mcp_tools({"cabinet": WithBell})}["cabinet_ring"]
    assert tool["inputSchema"]["properties"]["times"]["type"] == "integer"


def test_an_assistant_uses_the_same_commands_over_mcp(door: Door) -> None:
    with door.client() as http:

        def said(method: str, **parameters: Any) -> Any:
            message = {"jsonrpc": "2.0", "id": 1, "method": method, "params": parameters}
            return http.post("/mcp", json=message).json()

        assert said("initialize")["result"]["serverInfo"]["name"] == "CoSMic"
        names = {each["name"] for each in said("tools/list")["result"]["tools"]}
        assert {"cabinet_stop", "cabinet_lamp_shine", "cabinet_drawers_move"} <= names
        move = {"name": "cabinet_drawers_move", "arguments": {"drawers_key": "top"}}
        move["arguments"]["target_um"] = 4.0
        refused = said("tools/call", **move)["result"]
        assert refused["isError"]
        assert "right to move" in refused["content"][0]["text"]
        http.post("/api/control")
        assert said("tools/call", **move)["result"]["content"][0]["text"] == "4.0"
        assert said("tools/call", name="cabinet_emit", arguments={})["error"]["code"] == -32602
        for tool, wrong in (("take_control", "keep_s"), ("follow_operation", "wait_s")):
            for value in (None, "soon", [], True, -1):
                refused = said("tools/call", name=tool, arguments={wrong: value})["error"]
                assert refused["message"].startswith(f"{wrong}: a number of seconds")
        assert said("nothing")["error"]["code"] == -32601
        for number in ("NaN", "1e999", "[1]", "{}"):  # of what an answer cannot carry
            message = f'{{"jsonrpc": "2.0", "method": "ping", "id": {number}}}'
            answer = http.post("/mcp", content=message)
            assert answer.json()["error"]["code"] == -32600, number
        notice = {"jsonrpc": "2.0", "method": "notifications/initialized"}
        assert http.post("/mcp", json=notice).status_code == 202
    assert door.home.drawers["top"].moved_um == [4.0]
    assert not door.failures


def test_what_moves_needs_the_right_and_goes_through_the_lease(door: Door) -> None:
    with door.client() as http:
        path = "/api/cabinet/drawers/left.x/move"
        refused = http.post(path, json={"target_um": 5.0})
        assert refused.status_code == 409
        assert refused.json()["error"]["verdict"]["reason"] == "NO_LEASE"
        assert http.post("/api/control").json()["control"]["holder"] == "move"
        assert http.post(path, json={"target_um": 5}).json() == {"result": 5.0}
        assert door.home.drawers["left.x"].moved_um == [5.0]
        assert http.get("/api/cabinet/state/drawers/left.x/position_um").json() == 5.0
        http.delete("/api/control")
        assert door.station.lease.state.local


def test_what_a_command_takes_is_said_in_its_own_names(door: Door) -> None:
    with door.client() as http:
        said = http.post("/api/cabinet/drawers/top/move", json={}).json()["error"]["text"]
    assert said == "drawers.move takes target_um; unknown: none, missing: target_um"


def test_settings_and_words_come_as_json(door: Door) -> None:
    with door.client("call") as http:
        settings = {"name": "new", "brightest": 2.0}
        assert http.post("/api/cabinet/apply", json={"settings": settings}).is_success
        assert http.get("/api/cabinet/state/settings").json() == settings
        http.post("/api/cabinet/lamp/shine", json={"colour": "green", "level": 0.5})
        assert http.get("/api/cabinet/state/lamp/shown").json() == {"colour": "green", "level": 0.5}
        bright = http.post("/api/cabinet/apply", json={"settings": {"name": "x", "brightest": 11}})
        assert (bright.status_code, bright.json()["error"]["text"]) == (422, "too bright")


def test_what_goes_on_is_followed_and_ended(door: Door) -> None:
    with door.client("call") as http:
        begun = http.post("/api/cabinet/export", json={})
        assert begun.status_code == 202
        where = f"/api/operations/{begun.json()['operation']}"
        door.home.tasks[0].report(0.5, "half")
        assert wait_until(lambda: http.get(where).json().get("text") == "half")
        http.delete(where)
        assert wait_until(lambda: door.home.tasks[0].cancel_requested)
        door.home.tasks[0].finish()
        assert http.get(where, params={"wait": 5}).json()["done"] is True
        assert http.get("/api/operations/999").status_code == 404


def test_a_wait_that_makes_no_sense_is_refused_before_anything_moves(door: Door) -> None:
    with door.client() as http:
        http.post("/api/control")
        path = "/api/cabinet/drawers/left.x/move"
        for wait in ("61", "-1", "nan", "soon"):
            refused = http.post(path, params={"wait": wait}, json={"target_um": 5.0})
            assert refused.status_code == 400
            assert "wait" in refused.json()["error"]["text"]
        assert door.home.drawers["left.x"].moved_um == []


class Busy(Cabinet):
    """The cabinet with a command that takes until `over` is set."""

    def __init__(self) -> None:
        super().__init__()
        self.begun, self.over = Event(), Event()

    @command(timeout_s=0.1)
    def toil(self) -> None:
        self.begun.set()
        self.over.wait(20.0)


@pytest.mark.parametrize("patient", [True, False], ids=["refused", "hung up"])
def test_a_command_whose_turn_did_not_come_is_not_carried_out_later(*, patient: bool) -> None:
    with opened(Busy) as door, door.client() as http, door.client("call") as other:
        home = door.home
        assert isinstance(home, Busy)
        toiling = Thread(target=lambda: other.post("/api/cabinet/toil", json={}))
        toiling.start()
        assert home.begun.wait(10.0)
        http.post("/api/control")
        try:
            with nullcontext() if patient else suppress(httpx.ReadTimeout):
                refused = http.post(
                    "/api/cabinet/drawers/left.x/move",
                    json={"target_um": 5.0},
                    timeout=20.0 if patient else 0.3,
                )
                assert refused.status_code == 503
                assert "was not carried out" in refused.json()["error"]["text"]
            time.sleep(0.5)  # until it is noticed
            http.post("/api/control")
        finally:
            home.over.set()
            toiling.join(10.0)
        assert http.post("/api/cabinet/lamp/shine", json={"colour": "green"}).is_success
        assert door.home.drawers["left.x"].moved_um == []


def test_who_hangs_up_while_waiting_ends_what_was_begun(door: Door) -> None:
    with door.client("call") as http, suppress(httpx.ReadTimeout):
        http.post("/api/cabinet/export", params={"wait": 30}, timeout=0.6)
    assert wait_until(lambda: bool(door.home.tasks) and door.home.tasks[0].cancel_requested)
    door.home.tasks[0].finish()


def test_state_and_streams_are_followed_over_a_websocket(door: Door) -> None:
    with door.line("view", ("cabinet/state", "cabinet/samples")) as line:
        seen: dict[str, Any] = {}
        for first in range(100):
            door.home.emit(first, 2)
            time.sleep(0.05)  # the state comes a moment after the first samples
            word = json.loads(line.recv(5.0))
            seen.setdefault(word["topic"], word["payload"])
            if {"cabinet/state", "cabinet/samples"} <= seen.keys():
                break
        assert seen["cabinet/state"]["settings"]["name"] == "lamp"
        assert seen["cabinet/samples"]["values"] == [0.0, 1.0]
        line.send(json.dumps({"follow": ["cabinet/nothing"]}))
        with pytest.raises(ConnectionClosed):
            while True:
                line.recv(5.0)


def test_a_client_that_is_gone_leaves_nothing_moving(door: Door) -> None:
    with door.client() as http, door.line() as line:
        http.post("/api/control")
        http.post("/api/cabinet/drawers/top/move", json={"target_um": 1.0})
        dead_man = door.home.drawers["top"].dead_men[0]
        assert not wait_until(lambda: dead_man.expired, 1.5), "the line keeps it alive"
        line.socket.shutdown(socket.SHUT_RDWR)
        assert wait_until(lambda: dead_man.expired, 1.0)
        assert door.station.lease.state.local


def test_a_line_that_only_looks_keeps_nothing_moving_for_another_program(door: Door) -> None:
    with door.client() as http, door.line(looks_only=True), door.line(looks_only=True):
        http.post("/api/control")
        http.post("/api/cabinet/drawers/top/move", json={"target_um": 1.0})
        dead_man = door.home.drawers["top"].dead_men[0]
        assert wait_until(lambda: dead_man.expired, 1.5)
        assert wait_until(lambda: door.station.lease.state.local, 1.0)
        http.post("/api/control")
        with door.line() as line:
            line.send(json.dumps({"follow": ["cabinet/state"]}))
            assert json.loads(line.recv(5.0))["topic"] == "cabinet/state"
        assert wait_until(lambda: door.station.lease.state.local, 0.8), "its own line has ended"


def test_the_page_only_looks() -> None:
    with opened() as door, door.client() as http:
        assert "looks_only: true" in http.get("/").text


def test_who_takes_over_ends_what_goes_on_for_a_client(door: Door) -> None:
    with door.client() as http, door.line():
        http.post("/api/control")
        http.post("/api/cabinet/travel")
        assert wait_until(lambda: bool(door.home.tasks))
        door.station.lease.take_over()
        assert wait_until(lambda: door.home.tasks[0].done, 1.0)
        assert door.home.tasks[0].failure is not None


def test_a_client_that_falls_silent_loses_the_right_to_move(door: Door) -> None:
    with door.client() as http:
        http.post("/api/control")
        http.post("/api/cabinet/drawers/top/move", json={"target_um": 1.0})
        dead_man = door.home.drawers["top"].dead_men[0]
        assert wait_until(lambda: dead_man.expired, 3.0)
        late = http.post("/api/cabinet/drawers/top/move", json={"target_um": 2.0})
        assert late.status_code == 409


def test_tokens_decide_who_may_do_what(door: Door) -> None:
    assert httpx.get(f"{door.address}/api/station").status_code == 401
    wrong = {"Authorization": "Bearer wrong"}
    assert httpx.get(f"{door.address}/api/station", headers=wrong).status_code == 401
    with door.client("view") as viewer:
        assert viewer.get("/api/cabinet/state/settings/name").json() == "lamp"
        assert viewer.post("/api/cabinet/apply", json={"settings": {"name": "x"}}).is_client_error
        assert viewer.post("/api/control").is_client_error
        assert viewer.post("/api/cabinet/stop", json={}).is_success, "everybody may stop"
    with door.client("call") as caller:
        assert caller.post("/api/control").is_client_error
        moved = caller.post("/api/cabinet/drawers/top/move", json={"target_um": 1.0})
        assert moved.is_client_error
    assert door.home.stops == 1
    assert door.home.drawers["top"].moved_um == []


@pytest.fixture
def approvals() -> Iterator[Approvals]:
    made = Approvals(FailurePolicy())
    yield made
    made.close()


def test_what_moves_waits_for_a_person_and_nothing_else_does(
    approvals: Approvals, qtbot: Any
) -> None:
    panel = ApprovalsPanel(approvals)
    qtbot.addWidget(panel)
    with opened(approvals=approvals) as door, door.client() as http, door.line():
        http.post("/api/control")
        assert http.post("/api/cabinet/lamp/shine", json={"colour": "green"}).status_code == 200
        path = "/api/cabinet/drawers/left.x/move"
        asked = http.post(path, json={"target_um": 5.0})
        assert asked.status_code == 202
        assert asked.json()["text"] == "waits for approval"
        where = f"/api/operations/{asked.json()['operation']}"
        assert door.home.drawers["left.x"].moved_um == []
        qtbot.waitUntil(lambda: panel.texts != ())
        assert panel.texts == ("move: cabinet.drawers.move left.x, target_um=5.0",)
        own = http.post("/api/approvals/approve", json={"number": 1})
        assert own.status_code == 400, "who asks cannot approve"
        panel.choose(0)
        panel.findChildren(QPushButton)[0].click()
        assert http.get(where, params={"wait": 5}).json()["result"] == 5.0
        refused = http.post(path, json={"target_um": 7.0})
        where = f"/api/operations/{refused.json()['operation']}"
        qtbot.waitUntil(lambda: panel.texts != ())
        panel.choose(0)
        panel.findChildren(QPushButton)[1].click()
        assert "operator refused" in http.get(where, params={"wait": 5}).json()["error"]["text"]
        assert http.post("/api/cabinet/stop", json={}).is_success, "a stop waits for nobody"
        assert door.home.drawers["left.x"].moved_um == [5.0]
    panel.end()


def test_a_command_that_was_overtaken_by_a_stop_is_not_carried_out_when_approved(
    approvals: Approvals,
) -> None:
    with opened(approvals=approvals) as door, door.client() as http, door.line():
        http.post("/api/control")
        asked = http.post("/api/cabinet/drawers/top/move", json={"target_um": 5.0})
        http.post("/api/cabinet/stop", json={})
        approvals.approve(approvals.waiting[0].number)
        where = f"/api/operations/{asked.json()['operation']}"
        assert http.get(where, params={"wait": 5}).json()["error"]["kind"] == "MoveCancelled"
        assert door.home.drawers["top"].moved_um == []


BAD: list[tuple[str, bytes]] = [
    ("/api/cabinet/apply", b"{"),
    ("/api/cabinet/apply", b"[]"),
    ("/api/cabinet/apply", b"\xff\xfe"),
    ("/api/cabinet/apply", b"[" * 50_000),
    ("/api/cabinet/apply", b'{"settings": ' + b"[" * 30_000 + b"]" * 30_000 + b"}"),
    ("/api/cabinet/apply", b'{"settings": {"name": 1}}'),
    ("/api/cabinet/apply", b'{"settings": {"name": "x", "other": 1}}'),
    ("/api/cabinet/apply", b'{"@": ["x"], "settings": {"name": "x"}}'),
    ("/api/cabinet/drawers/none/move", b'{"target_um": 1.0}'),
    ("/api/cabinet/drawers/top/move", b'{"target_um": "1"}'),
    ("/api/cabinet/drawers/top/move", b'{"target_um": 1' + b"0" * 400 + b"}"),
    ("/api/cabinet/drawers/top/move", b'{"target_um": 1.0, "#": 7}'),
    ("/api/cabinet/drawers/top/nudge", b"{}"),
    ("/api/cabinet/emit", b'{"first": 0, "count": 1}'),
    ("/api/cabinet/__class__", b"{}"),
    ("/api/cabinet/", b"{}"),
    ("/api/nothing/apply", b"{}"),
    ("/api/cabinet/apply", b"x" * (BODY_LIMIT_BYTES + 1)),
]


def test_what_makes_no_sense_is_refused_and_nobody_else_notices(door: Door) -> None:
    with door.client() as http:
        http.post("/api/control")
        for path, said in BAD:
            answer = http.post(path, content=said)
            assert answer.is_client_error, (path, said[:60], answer.text)
            assert answer.json()["error"]["text"]
        assert http.get("/api/cabinet/state/drawers/top/position_um").json() == 0.0
    assert door.home.drawers["top"].moved_um == []
    assert not door.failures


@pytest.mark.parametrize(
    "said",
    [b"now!", b"[]", b'{"reason": 5}', b'{"why": "x", "#": "1"}', b"x" * (BODY_LIMIT_BYTES + 1)],
    ids=["no JSON", "a list", "another name", "odd names", "too long"],
)
def test_a_stop_is_carried_out_whatever_it_is_said_with(door: Door, said: bytes) -> None:
    with door.client("view") as http:
        assert http.post("/api/cabinet/stop", content=said).is_success
        assert http.post("/api/cabinet/stop?wait=soon").is_success
        call = {"name": "cabinet_stop", "arguments": [5]}
        message = {"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": call}
        assert http.post("/mcp", json=message).json()["result"]["isError"] is False
    assert door.home.stops == 3
    assert not door.failures


def test_a_flood_of_one_client_is_held_back_and_a_stop_still_passes(
    door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http.MOST_REQUESTS_S", 2.0)
    with door.client("view") as flooding, door.client("call") as other:
        codes = [flooding.get("/api/station").status_code for _ in range(30)]
        assert codes[0] == 200
        assert 429 in codes
        assert other.post("/api/cabinet/stop", json={}).is_success
    assert door.home.stops == 1
    assert not door.failures


def test_whoever_asks_too_often_may_stop_all_the_same(
    door: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http.MOST_REQUESTS_S", 2.0)
    with door.client("view") as http:
        while http.get("/api/station").status_code != 429:
            pass
        assert http.post("/api/cabinet/stop", json={}).is_success
        assert http.post("/api/cabinet/lamp/shine", json={}).status_code == 429
        stops = [http.post("/api/cabinet/stop", json={}).status_code for _ in range(60)]
        assert stops[-1] == 429, "a flood of stops is one as well"
    assert door.home.stops > 10


def test_raw_bytes_that_are_no_http_harm_nobody(door: Door) -> None:
    host, port = door.address.removeprefix("http://").split(":")
    for said in (b"\x00" * 1000, b"GET / HTTP/9\r\n\r\n", b"A" * 100_000, b"POST / HTTP/1.1\r\n"):
        with socket.create_connection((host, int(port))) as raw, suppress(OSError):
            raw.sendall(said)
            raw.shutdown(socket.SHUT_WR)
            raw.recv(1000)
    with door.client("view") as http:
        assert http.get("/api/station").json()["you"] == "view"
    assert not door.failures


def test_commands_and_events_pass_over_tls_and_nothing_else_does(tmp_path: Path) -> None:
    own = make_certificates(tmp_path / "own", "fibres")["fibres"]
    other = make_certificates(tmp_path / "other", "fibres")["fibres"]
    trusting = ssl.create_default_context(cafile=str(own.authority))
    strange = ssl.create_default_context(cafile=str(other.authority))
    with opened(certificates=own) as door:
        assert door.address.startswith("https://")
        line = door.address.replace("https", "wss") + "/api/events"
        with (
            door.client(verify=trusting) as http,
            connect(line, ssl=trusting, proxy=None) as events,
        ):
            events.send(json.dumps({"token": TOKENS["move"], "follow": []}))
            assert json.loads(events.recv(5.0))["payload"] == "move"
            assert http.post("/api/control").json()["in_control"]
            path = "/api/cabinet/drawers/left.x/move"
            assert http.post(path, json={"target_um": 5.0}).json() == {"result": 5.0}
        with door.client(verify=strange) as http, pytest.raises(httpx.ConnectError):
            http.get("/api/station")
        plain = door.address.replace("https", "http")
        with pytest.raises(httpx.TransportError):
            httpx.get(f"{plain}/api/station")
        assert door.home.drawers["left.x"].moved_um == [5.0]
        assert not door.failures


def test_answers_are_sent_without_waiting_for_an_acknowledgement() -> None:
    with listening(HttpSettings(listen=f"127.0.0.1:{free_port()}")) as bound:
        with socket.create_connection(bound.getsockname()):
            came, _ = bound.accept()
        with came:
            # asyncio turns Nagle's delay off for what says that it is TCP, and for nothing else.
            assert came.proto == socket.IPPROTO_TCP


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("PySide6.QtWebEngineWidgets") is None, reason="there is no browser of Qt here"
)
def test_the_page_comes_back_with_its_station() -> None:
    client = HttpClient(name="desk", token=TOKENS["view"])
    settings = HttpSettings(listen=f"127.0.0.1:{free_port()}", client=(client,))

    @contextmanager
    def served(platform: str) -> Iterator[None]:
        station = Station("fibres", FailurePolicy())
        about = {"platform": platform, "simulated": True, "applications": []}
        gateway = HttpGateway(station, {}, settings, about)
        try:
            yield
        finally:
            gateway.close()

    page = f"http://{settings.listen}/#token={client.token}"
    with ExitStack() as at_end:
        with served("the one before"):
            command = [sys.executable, str(BROWSER), page, "the one after"]
            browser = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            at_end.callback(browser.communicate)
            at_end.callback(browser.kill)
            time.sleep(5.0)  # until it is shown
        time.sleep(3.0)  # until it asked in vain
        with served("the one after"):
            said, _ = browser.communicate(timeout=45.0)
    assert "the one after" in said


def test_the_page_and_the_description_need_no_token(door: Door) -> None:
    page = httpx.get(door.address)
    assert "Live image" in page.text
    assert "frame-ancestors 'none'" in page.headers["content-security-policy"]
    assert httpx.get(f"{door.address}/openapi.json").json()["openapi"].startswith("3.1")


@pytest.mark.parametrize(
    "settings",
    [
        {"listen": "0.0.0.0:8470"},
        {"listen": "192.168.1.2:80", "certificate": "a", "key": "b"},
        {"listen": "nowhere:x"},
        {"listen": "127.0.0.1:1", "certificate": "a"},
    ],
)
def test_an_address_beyond_this_computer_needs_certificate_and_clients(settings: Any) -> None:
    from cosmic.app.configuration.gateways import EpicsSettings

    with pytest.raises(ConfigError):
        doors(HttpSettings(**settings), EpicsSettings())


@pytest.mark.parametrize("listen", ["no such host", "no-such-host.invalid:8470", "127.0.0.1:x"])
def test_what_is_no_address_is_named_and_nothing_is_said_of_certificates(listen: str) -> None:
    from cosmic.app.configuration.gateways import EpicsSettings

    with pytest.raises(
        ConfigError, match=f"(?s){listen.partition(':')[0]}.*127.0.0.1:8470"
    ) as told:
        doors(HttpSettings(), EpicsSettings(), listen=listen)
    assert "certificate" not in str(told.value)
