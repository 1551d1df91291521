"""The audit trail: who commanded what, with which verdict, kept and filtered."""

import json
from pathlib import Path

import pytest

import cosmic
from contract.station_rig import wait_until
from cosmic.app.audit import PlatformAudit
from cosmic.app.cli import main
from cosmic.app.gateways.session import GatewaySession
from cosmic.app.platform import build_platform
from cosmic.frame.errors import MoveRefused
from cosmic.frame.network.caller import Access
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station
from cosmic.mico.api.mico import Mico


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
    (refused,) = listed("--who", "notebook")
    assert refused["why"].startswith("NO_LEASE")
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
