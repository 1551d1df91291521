"""A campaign over HTTP on the simulated platform: started, watched, paused, carried out, ended."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.sync.client import connect

from contract.station_rig import free_port, wait_until
from system.campaign_bench import TRANSPORT
from system.served_program import served_program

pytestmark = pytest.mark.slow


@dataclass
class Served:
    http: httpx.Client
    token: str

    @contextmanager
    def line(self, *topics: str) -> Iterator[Any]:
        """Give a WebSocket, which keeps the right to move alive; what it follows is to be read."""
        where = str(self.http.base_url).replace("http", "ws").rstrip("/") + "/api/events"
        with connect(where, proxy=None) as made:
            made.send(json.dumps({"token": self.token, "follow": topics}))
            assert json.loads(made.recv(5.0))["topic"] == "hello"
            yield made

    def state(self, name: str) -> Any:
        return self.http.get(f"/api/campaigns/state/{name}").json()

    def command(self, name: str, **arguments: Any) -> httpx.Response:
        return self.http.post(f"/api/campaigns/{name}", json=arguments)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """A station in a process of its own, so that what it computes silences no client here."""
    (tmp_path / "campaigns").mkdir()
    (tmp_path / "campaigns" / "one.toml").write_text(TRANSPORT, encoding="utf-8")
    options = ("--rate", "8", "--sample", "three-dry")
    with served_program(tmp_path, free_port(), free_port(), *options) as program:
        yield Served(program.http, program.token)


@pytest.mark.timeout(300)
def test_a_campaign_is_carried_out_for_a_client_of_http(served: Served) -> None:
    assert "one" in served.command("recipes").json()["result"]
    refused = served.command("start", recipe="one", folder="first")
    assert refused.json()["error"]["verdict"]["reason"] == "NO_LEASE"
    with served.line():
        assert served.http.post("/api/control").is_success
        begun = served.command("start", recipe="one", folder="first")
        assert begun.status_code == 202, begun.text
        again = served.command("start", recipe="one", folder="second")
        assert "a campaign is running" in again.json()["error"]["text"]
        assert served.command("start", recipe="one", folder="../out").status_code == 400
        assert wait_until(lambda: served.state("operation") != "", 30.0)
        assert served.command("pause").is_success
        assert wait_until(lambda: served.state("phase") == "paused", 60.0)
        assert served.command("resume").is_success
        where = f"/api/operations/{begun.json()['operation']}"
        until = time.monotonic() + 200.0
        while (now := served.http.get(where, params={"wait": 10}).json()).get("done") is not True:
            assert "error" not in now, now
            assert time.monotonic() < until, now
        assert served.state("phase") == "ended"
        with served.line("campaigns/state") as watching:
            told = json.loads(watching.recv(5.0))
        assert (told["topic"], told["payload"]["good"]) == ("campaigns/state", 1)
        (fibre,) = [
            each for each in served.command("results").json()["result"] if each["outcome"] == "good"
        ]
        assert fibre["length_um"] > 100.0


@pytest.mark.timeout(200)
def test_a_campaign_ends_with_the_client_that_started_it(served: Served) -> None:
    with served.line():
        served.http.post("/api/control")
        assert served.command("start", recipe="one", folder="first").status_code == 202
        assert wait_until(lambda: served.state("operation") != "", 30.0)
    assert wait_until(lambda: served.state("phase") in ("stopped", "failed"), 30.0)
    assert served.http.get("/api/station").json()["control"]["local"]
    path = "/api/mico/state/axes/left.z/_latest/position"
    before = served.http.get(path).json()
    time.sleep(0.3)
    assert served.http.get(path).json() == pytest.approx(before, abs=0.2)
