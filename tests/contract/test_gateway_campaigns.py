"""Campaigns at the gateways: by the declaration alone, with the same right and approval."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from contract.station_rig import free_port, wait_until
from contract.test_gateway_epics import Client
from cosmic.app.configuration.gateways import EpicsSettings, HttpClient, HttpSettings
from cosmic.app.gateways.approvals import Approvals
from cosmic.app.gateways.campaigns import Campaigns
from cosmic.app.gateways.epics import EpicsGateway
from cosmic.app.gateways.http import HttpGateway
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import current_call
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station

TOKEN = "m" * 20
FACTS = {"platform": "test", "simulated": True, "applications": ()}
BROWSER = Path(__file__).with_name("browser_child.py")


class StandIn:
    """Behaves as a campaign to whoever starts it: nothing moves."""

    def __init__(self, recipe: Path, folder: Path) -> None:
        self.recipe = SimpleNamespace(name=recipe.stem)
        self.store = SimpleNamespace(folder=folder)
        self.phase, self.operation, self.end_reason, self.shortfall = "ready", "", "", ""
        self.left_s, self.request = 60.0, ""
        self.progress = SimpleNamespace(done=3, good=2, failed=1, elapsed_s=20.0)
        self.fibres = ()
        self.ended = threading.Event()
        self.by = ""
        self.changed: Callable[[], object] = lambda: None

    @property
    def over(self) -> bool:
        return self.phase in ("ended", "stopped")

    @property
    def unfinished(self) -> bool:
        return self.phase == "stopped"

    def on_change(self, listener: Callable[[], object]) -> None:
        self.changed = listener

    def run_here(self) -> None:
        call = current_call()
        self.by = "" if call is None else call.caller.name
        self.phase, self.operation = "running", "take the fibre"
        self.changed()
        self.ended.wait(30.0)

    def pause(self) -> None:
        self.phase = "paused"

    def resume(self) -> None:
        self.phase = "running"

    def abort(self, reason: str) -> None:
        if not self.over:
            self.phase, self.end_reason = "stopped", reason
        self.ended.set()

    def end(self) -> None:
        self.phase, self.end_reason = "ended", "2 good fibres"
        self.ended.set()


@dataclass
class Door:
    http: httpx.Client
    epics: int
    page: str
    approvals: Approvals
    begun: list[StandIn] = field(default_factory=list)

    def command(self, name: str, **arguments: Any) -> httpx.Response:
        return self.http.post(f"/api/campaigns/{name}", json=arguments)

    def tool(self, name: str, **arguments: Any) -> Any:
        parameters = {"name": name, "arguments": arguments}
        said = {"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": parameters}
        (found,) = self.http.post("/mcp", json=said).json()["result"]["content"]
        return found["text"]


@contextmanager
def opened(home: Path, *, approve: bool = False) -> Iterator[Door]:
    policy, begun = FailurePolicy(), []
    (home / "mine.toml").write_text("", encoding="utf-8")

    def begin(recipe: Path, folder: Path) -> Any:
        begun.append(StandIn(recipe, folder))
        return begun[-1]

    with ExitStack() as at_end:
        station = Station("fibres", policy)
        campaigns = Campaigns(lambda: home, policy)
        campaigns.use(begin)
        host = Host("campaigns", campaigns)
        station.host("campaigns", host)
        at_end.callback(host.close)
        at_end.callback(campaigns.close)
        approvals = Approvals(policy)
        at_end.callback(approvals.close)
        client = HttpClient(name="lab", token=TOKEN, access="move")
        web = HttpSettings(listen=f"127.0.0.1:{free_port()}", client=(client,))
        http = HttpGateway(
            station, {"campaigns": host}, web, FACTS, approvals.ask if approve else None
        )
        at_end.callback(http.close)
        records = EpicsGateway(
            station, {"campaigns": host}, EpicsSettings(prefix="T:", port=free_port())
        )
        at_end.callback(records.close)
        headers = {"Authorization": f"Bearer {TOKEN}"}
        made = httpx.Client(base_url=http.address, headers=headers, timeout=30.0)
        address = f"{http.address}#token={TOKEN}"
        yield Door(at_end.enter_context(made), records.port, address, approvals, begun)


def test_a_campaign_is_started_watched_and_ended_over_http_and_mcp(tmp_path: Path) -> None:
    with opened(tmp_path) as door:
        start = {"recipe": "mine", "folder": "first"}
        refused = door.command("start", **start)
        assert refused.json()["error"]["verdict"]["reason"] == "NO_LEASE"
        assert door.begun == []
        door.http.post("/api/control")
        assert "quick" in door.command("recipes").json()["result"]
        assert door.command("start", recipe="mine", folder="../x").status_code == 400
        assert door.command("start", recipe="/etc/passwd", folder="x").status_code == 400
        begun = door.command("start", **start)
        assert begun.status_code == 202
        assert wait_until(lambda: door.begun[0].phase == "running")
        assert door.begun[0].by == "lab", "it moves by the right of who started it"
        assert "end it first" in door.command("start", **start).json()["error"]["text"]
        where = f"/api/operations/{begun.json()['operation']}"
        said = "3 fibres, 2 good, take the fibre"
        assert wait_until(lambda: door.http.get(where).json()["text"] == said)
        assert json.loads(door.tool("read_state", application="campaigns"))["good"] == 2
        door.tool("campaigns_pause")
        assert (
            json.loads(door.tool("read_state", application="campaigns", path="phase")) == "paused"
        )
        assert json.loads(door.tool("campaigns_resume")) is None
        assert json.loads(door.tool("campaigns_results")) == []
        door.begun[0].end()
        assert door.http.get(where, params={"wait": 5}).json()["done"] is True
        assert door.http.get("/api/campaigns/state/end_reason").json() == "2 good fibres"
        again = door.command("start", recipe="mine", folder="second").json()["operation"]
        assert wait_until(lambda: door.begun[1].phase == "running")
        door.command("abort", reason="enough")
        ended = door.http.get(f"/api/operations/{again}", params={"wait": 5})
        assert ended.json()["error"]["text"] == "enough"


def test_who_started_a_campaign_and_falls_silent_ends_it(tmp_path: Path) -> None:
    with opened(tmp_path) as door:
        door.http.post("/api/control")
        door.command("start", recipe="mine", folder="first")
        assert wait_until(lambda: door.begun[0].phase == "stopped", 5.0)


def test_an_assistant_that_thinks_keeps_the_right_to_move_and_what_moves_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http.MCP_WAIT_S", 0.1)
    with opened(tmp_path) as door:
        taken = json.loads(door.tool("take_control", keep_s=8.0))
        assert taken["in_control"]
        assert "silent for 8 s" in taken["control"]["why"], "a window shows how long"
        door.tool("campaigns_start", recipe="mine", folder="first")
        assert wait_until(lambda: door.begun[0].phase == "stopped", 4.0), "nobody is seen there"
        assert door.http.get("/api/station").json()["in_control"]
        door.tool("take_control", keep_s=1.0)
        time.sleep(1.5)
        assert "NO_LEASE" in door.command("resume").text


def test_an_assistant_that_holds_a_line_open_is_there_until_that_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http.MCP_WAIT_S", 0.1)
    with opened(tmp_path) as door:
        begin = {"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {}}
        session = door.http.post("/mcp", json=begin).headers["Mcp-Session-Id"]
        headers = {"Accept": "text/event-stream", "Mcp-Session-Id": session}
        with door.http.stream("GET", "/mcp", headers=headers) as line:
            words = line.iter_raw()  # closed with its last reference, and the line with it
            assert next(words) == b": alive\n\n"
            door.tool("take_control", keep_s=8.0)
            door.tool("campaigns_start", recipe="mine", folder="first")
            assert not wait_until(lambda: door.begun[0].over, 2.5), "its line is open"
        assert wait_until(lambda: door.begun[0].phase == "stopped", 1.0), "it is gone"
        assert door.http.get("/api/station").json()["in_control"]
        assert door.http.delete("/mcp", headers=headers).is_success
        assert door.http.get("/api/station").json()["control"]["local"]


def test_an_assistant_follows_and_ends_what_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.app.gateways.http.MCP_WAIT_S", 0.1)
    with opened(tmp_path) as door:
        door.tool("take_control")
        begun = json.loads(door.tool("campaigns_start", recipe="mine", folder="first"))
        assert begun["goes_on"] == "campaign mine"
        follow = {"operation": begun["operation"], "wait_s": 0.5}
        assert json.loads(door.tool("follow_operation", **follow))["operation"]
        assert "ended by" in door.tool("follow_operation", **follow, end=True)
        assert door.begun[0].phase == "stopped"
        assert not json.loads(door.tool("release_control"))["in_control"]


def test_nobody_keeps_the_right_to_move_longer_than_the_platform_allows(tmp_path: Path) -> None:
    with opened(tmp_path) as door:
        assert "60" in door.http.post("/api/control?keep=3600").json()["error"]["text"]
        door.tool("take_control", keep_s=3600)
        assert "silent for 60 s" in door.http.get("/api/station").json()["control"]["why"]


def test_a_campaign_waits_for_a_persons_approval(tmp_path: Path) -> None:
    with opened(tmp_path, approve=True) as door:
        door.http.post("/api/control")
        asked = door.command("start", recipe="mine", folder="first")
        assert asked.json()["text"] == "waits for approval"
        assert door.begun == []
        (waiting,) = door.approvals.waiting
        assert "recipe='mine'" in waiting.details
        door.approvals.approve(waiting.number)
        assert wait_until(lambda: bool(door.begun) and door.begun[0].phase == "running")
        assert door.command("abort").is_success, "what ends it waits for nobody"


@pytest.mark.timeout(60)
def test_a_campaign_is_started_and_watched_as_records_of_epics(tmp_path: Path) -> None:
    with opened(tmp_path) as door:
        client, watcher = Client(door.epics), Client(door.epics)
        try:
            start = json.dumps({"recipe": "mine", "folder": "first"})
            assert not client.put("T:campaigns:start", start)
            assert "right to move" in client.get("T:campaigns:start")
            assert client.put("T:control", 1)
            held = threading.Thread(target=lambda: client.put("T:campaigns:start", start))
            held.start()
            assert wait_until(lambda: watcher.get("T:campaigns:phase") == "running")
            assert watcher.get("T:campaigns:operation") == "take the fibre"
            assert watcher.get("T:campaigns:done") == 3
            assert watcher.put("T:campaigns:abort", '{"reason": "enough"}')
            held.join(10.0)
            assert not held.is_alive()
            assert wait_until(lambda: watcher.get("T:campaigns:end_reason") == "enough")
        finally:
            client.end()
            watcher.end()


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("PySide6.QtWebEngineWidgets") is None, reason="there is no browser of Qt here"
)
def test_the_page_shows_a_campaign_in_a_browser(tmp_path: Path) -> None:
    with opened(tmp_path) as door:

        def shown(wanted: str) -> str:
            command = [sys.executable, str(BROWSER), door.page, wanted]
            done = subprocess.check_output(command, stderr=subprocess.DEVNULL, text=True)
            return " ".join(done.split())

        assert "Campaign none was started here" in shown("none was started")
        door.http.post("/api/control?keep=60")
        with door.http.stream("GET", "/mcp"):  # nothing moves for whom nobody sees
            door.command("start", recipe="mine", folder="first")
            text = shown("running")
            assert "Recipe mine in first State running Operation take the fibre" in text
            assert "Fibres 3 done, 1 failed Good 2 (67 %) Elapsed 20 s, left: 1 min 0 s" in text
            door.command("abort", reason="enough")
        assert "State stopped: enough" in shown("enough")
