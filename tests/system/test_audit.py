"""The audit trail: who commanded what, with which verdict, kept and filtered."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

import cosmic
from contract.cabinet import Cabinet
from contract.station_rig import free_port, wait_until
from contract.test_gateway_epics import Client
from cosmic.app.audit import PlatformAudit, audit_file
from cosmic.app.cli import main
from cosmic.app.gateways.approvals import Approvals
from cosmic.app.gateways.session import GatewaySession
from cosmic.app.platform import build_platform
from cosmic.frame.audit import AuditEntry, AuditTrail, read_entries
from cosmic.frame.declaration import command
from cosmic.frame.errors import MoveRefused
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import Access
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station
from cosmic.mico.api.mico import Mico
from system.served_program import served_program


@pytest.fixture
def trail(tmp_path: Path) -> Path:
    """What a script and a client of HTTP did on the simulated platform."""
    path = tmp_path / "audit.jsonl"
    platform = build_platform(applications=("mico",))
    try:
        platform.initialize()
        with PlatformAudit(platform, path) as audit:
            mico = Mico(platform.mico, "script")
            host = Host("mico", Mico(platform.mico, "station"))
            station = Station("fibres", platform.policy)
            station.host("mico", host)
            end = audit.join(station)
            client = GatewaySession(station, "notebook", Access.MOVE, door="http")
            motion = {"kind": "MoveTo", "target": 3.0, "unit": "um"}
            order = client.order("mico", "axes.begin", {"motion": motion}, ("left.x",))
            with pytest.raises(MoveRefused):
                client.carry_out(order)
            client.take_control(in_process=True)
            other = GatewaySession(station, "guest", Access.MOVE, door="epics")
            with pytest.raises(MoveRefused):
                other.take_control()
            far = {"kind": "MoveTo", "target": 1e6, "unit": "um"}
            ends = [
                client.carry_out(client.order("mico", "axes.begin", {"motion": each}, ("left.x",)))
                for each in (motion, far)
            ]
            assert wait_until(lambda: all(each.done for each in ends))
            client.release_control()
            other.close()
            mico["left.x"].move_to(2.0)
            with pytest.raises(cosmic.MoveRefused):
                mico["left.x"].move_to(1e6)
            mico.stop("enough")
            assert wait_until(lambda: path.is_file() and "enough" in path.read_text())
            client.close()
            end()
            host.close()
    finally:
        platform.shut_down()
    return path


def test_what_a_script_commands_on_its_own_platform_stands_in_the_trail() -> None:
    with cosmic.connect(applications=("mico",), rate=20) as rig:
        rig.mico["left.x"].move_to(2.0)
        with pytest.raises(cosmic.MoveRefused):
            rig.mico["left.x"].move_to(1e6)
        rig.mico.stop("enough")
    kept = list(read_entries(audit_file()))
    moves = [(each["who"], each["verdict"]) for each in kept if each["what"] == "move left.x"]
    assert ("script", "begun") in moves
    assert any(verdict == "refused" for _, verdict in moves)
    stops = [(each["what"], each.get("why")) for each in kept if "stop" in each["what"]]
    assert stops == [("stop", "enough")] * 2, "closing stops once more"


def test_a_text_that_is_none_ends_no_trail_and_stops_nothing(tmp_path: Path) -> None:
    policy, stops = FailurePolicy(), list[str]()
    policy.on_safe_stop(stops.append)
    trail = AuditTrail(tmp_path / "audit.jsonl", policy)
    trail.start()
    try:
        for why in ("no directory /data/\udce4", "enough"):  # a path that is no UTF-8
            trail.note(AuditEntry("script", "local", "stop", "done", why))
    finally:
        trail.request_end()
        trail.join()
    whys = [entry["why"] for entry in read_entries(trail.path)]
    assert whys == ["no directory /data/\udce4", "enough"]
    assert not stops


def test_closing_is_no_reset_of_a_stop() -> None:
    with cosmic.connect(applications=("mico",), rate=20) as rig:
        rig.mico["left.x"].move_to(2.0)
    assert [each for each in read_entries(audit_file()) if "stop" in each["what"]] == []


def test_every_command_stands_in_the_trail_and_can_be_found(
    trail: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    entries = [json.loads(line) for line in trail.read_text(encoding="utf-8").splitlines()]
    found = {(each["door"], each["what"], each["verdict"]) for each in entries}
    assert ("http", "mico.axes.begin", "refused") in found
    assert ("local", "move left.x", "begun") in found
    assert ("local", "move left.x", "done") in found
    assert ("gate", "move left.x", "refused") in found
    assert ("local", "stop", "done") in found
    assert all(each["when"].endswith("+00:00") for each in entries)

    def listed(*options: str) -> list[dict[str, str]]:
        assert main(["audit", str(trail), "--json", *options]) == 0
        return [json.loads(line) for line in capsys.readouterr().out.splitlines()]

    assert len(listed()) == len(entries)
    own = [
        (each["what"], each["verdict"], each.get("why", "").partition(":")[0])
        for each in listed("--who", "notebook", "--door", "http")
    ]
    begin = "mico.axes.begin"
    assert own[0] == (begin, "refused", "NO_LEASE")
    assert sorted(set(own[1:])) == [
        (begin, "begun", ""),
        (begin, "done", ""),
        (begin, "refused", "LIMIT"),
    ]
    (refused,) = listed("--who", "guest", "--what", "right to move")
    assert refused["verdict"] == "refused"
    assert "held by notebook" in refused["why"]
    assert {each["why"].partition(":")[0] for each in listed("--verdict", "refused")} == {
        "NO_LEASE",
        "LIMIT",
    }
    assert listed("--since", "2100-01-01") == []
    assert main(["audit", str(trail), "--what", "stop"]) == 0
    assert "enough" in capsys.readouterr().out


def test_a_trail_that_is_not_there_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["audit", str(tmp_path / "none.jsonl")]) == 1
    assert "no audit trail" in capsys.readouterr().err


@pytest.mark.timeout(120)
def test_every_door_of_a_station_is_named_with_verdict_and_reason(tmp_path: Path) -> None:
    web, line, records = free_port(), free_port(), free_port()
    more = ("--name", "fibres", "--epics", "T:")
    port = {"EPICS_CA_SERVER_PORT": str(records)}
    motion = {"kind": "MoveTo", "target": 3.0, "unit": "um"}
    with ExitStack() as opened:
        served = opened.enter_context(served_program(tmp_path, web, line, *more, variables=port))
        http = served.http
        http.post("/api/mico/axes/left.x/begin", json={"motion": motion})
        http.post("/api/campaigns/start", json={"recipe": "quick", "folder": "monday"})
        tool = {"name": "mico_axes_begin", "arguments": {"axes_key": "left.x", "motion": motion}}
        http.post("/mcp", json={"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": tool})
        client = Client(records)
        opened.callback(client.end)
        assert not client.put("T:left_x", 3.0)
        with cosmic.connect(stations={"fibres": f"tcp/127.0.0.1:{line}"}) as rig:
            with pytest.raises(cosmic.MoveRefused):
                rig.mico["left.x"].move_to(3.0)
            assert http.post("/api/control").is_success
            assert http.post("/api/mico/stop", json={"reason": "enough"}).is_success
        (path,) = tmp_path.rglob("audit.jsonl")
        assert wait_until(lambda: "enough" in path.read_text("utf-8"), 5.0)
    found = [json.loads(each) for each in path.read_text("utf-8").splitlines()]
    for door in ("http", "mcp", "epics", "station"):
        refused = [
            each
            for each in found
            if each["door"] == door and each["what"] == "mico.axes.begin" and each["who"]
        ]
        assert [each["verdict"] for each in refused] == ["refused"], door
        assert refused[0]["why"].startswith("NO_LEASE"), door
    told = {(each["door"], each["what"], each["verdict"]) for each in found}
    assert ("http", "campaigns.start", "refused") in told
    assert ("http", "mico.stop", "done") in told
    assert ("station", "right to move", "done") in told


class Jogged(Cabinet):
    @command(moves=True, renews=True)
    def renew(self) -> None:
        """Keep what travels alive."""


@pytest.fixture
def station(tmp_path: Path) -> Iterator[tuple[Station, Approvals, Path]]:
    """A station whose trail is written, with approvals and nothing that moves."""
    platform = build_platform(applications=("daqco",))
    approvals = Approvals(platform.policy)
    home, path = Jogged(), tmp_path / "audit.jsonl"
    host = Host("cabinet", home)
    try:
        with PlatformAudit(platform, path) as audit:
            made = Station("fibres", platform.policy)
            made.host("cabinet", host)
            end = audit.join(made, approvals)
            yield made, approvals, path
            end()
    finally:
        approvals.close()
        host.close()
        platform.shut_down()


def written(path: Path, word: str) -> list[dict[str, Any]]:
    """Return what the trail holds once `word` is in it."""
    assert wait_until(lambda: path.is_file() and word in path.read_text("utf-8"), 5.0)
    return [json.loads(each) for each in path.read_text("utf-8").splitlines()]


def test_what_a_person_approves_and_refuses_is_in_the_trail(
    station: tuple[Station, Approvals, Path],
) -> None:
    made, approvals, path = station
    client = GatewaySession(made, "notebook", Access.MOVE, approvals.ask, door="http")
    for decide in (approvals.approve, approvals.refuse):
        client.carry_out(client.order("cabinet", "drawers.move", {"target_um": 5.0}, ("top",)))
        decide(approvals.waiting[0].number)
    client.close()
    entries = written(path, '"verdict": "refused"')
    decided = [each for each in entries if each["what"] == "approval"]
    assert [each["verdict"] for each in decided] == ["done", "refused"]
    assert {each["details"]["for"] for each in decided} == {"notebook"}
    assert decided[0]["details"]["command"] == "cabinet.drawers.move"


def test_what_is_kept_alive_is_not_written_each_time(
    station: tuple[Station, Approvals, Path],
) -> None:
    made, _, path = station
    client = GatewaySession(made, "notebook", Access.MOVE, door="http")
    with pytest.raises(MoveRefused):
        client.carry_out(client.order("cabinet", "renew", {}))
    client.take_control()
    for _ in range(20):
        client.carry_out(client.order("cabinet", "renew", {}))
    client.carry_out(client.order("cabinet", "lock", {"code": 7}))
    client.close()
    entries = [each for each in written(path, "cabinet.lock") if each["what"] == "cabinet.renew"]
    assert [each["verdict"] for each in entries] == ["refused"]


def test_who_may_not_command_is_in_the_trail_and_a_flood_does_not_fill_it(
    station: tuple[Station, Approvals, Path],
) -> None:
    made, _, path = station
    viewer = GatewaySession(made, "guest", Access.VIEW, door="http")
    for _ in range(300):
        with pytest.raises(CallRefused):
            viewer.order("cabinet", "drawers.move", {"target_um": 5.0}, ("top",))
    time.sleep(0.2)
    with pytest.raises(CallRefused):
        viewer.order("cabinet", "apply", {"settings": {"name": "x"}})
    viewer.close()
    entries = [each for each in written(path, "cabinet.apply") if each["who"] == "guest"]
    assert 10 < len(entries) < 100
    assert {each["verdict"] for each in entries} == {"refused"}
    assert "may not call" in entries[0]["why"]
    assert any("refusals before" in each.get("details", {}).get("left_out", "") for each in entries)
