"""Numbers that are none, and words that mean nothing, at an axis: refused, and it goes on."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from contract.station_rig import free_port, wait_until
from contract.test_gateway_epics import Client
from cosmic.app.configuration.gateways import EpicsSettings
from cosmic.app.gateways.epics import EpicsGateway
from cosmic.app.gateways.plain import from_json
from cosmic.app.gateways.session import GatewaySession
from cosmic.app.platform import build_platform
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.network.caller import Access
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station
from cosmic.mico.api.mico import Mico


@contextmanager
def opened() -> Iterator[tuple[Station, Client]]:
    platform = build_platform(applications=("mico",))
    try:
        platform.initialize()
        host = Host("mico", Mico(platform.mico, "station"))
        station = Station("fibres", platform.policy)
        station.host("mico", host)
        settings = EpicsSettings(prefix="T:", port=free_port())
        gateway = EpicsGateway(station, {"mico": host}, settings)
        client = Client(gateway.port)
        try:
            yield station, client
        finally:
            client.end()
            gateway.close()
            host.close()
    finally:
        platform.shut_down()


@pytest.mark.timeout(120)
def test_a_target_that_is_none_or_too_far_is_refused_and_the_record_is_done() -> None:
    with opened() as (_, client):
        assert not client.put("T:left_x", 1e9), "without the right to move"
        assert wait_until(lambda: client.get("T:left_x.DMOV") == 1.0, 5.0)
        assert client.put("T:control", 1)
        for number in (float("nan"), float("inf"), -1e300, 1e9):
            for field in ("", ".DVAL", ".RLV"):
                assert not client.put(f"T:left_x{field}", number), (field, number)
                why = client.get("T:left_x:reason")
                assert "finite" in why or "outside its limit" in why, (field, number)
        assert not client.put("T:left_x.TWV", float("nan"))
        assert not client.put("T:left_x.RBV", 1.0)
        assert not client.put("T:left_x.HLM", 1e9)
        assert wait_until(lambda: client.get("T:left_x.DMOV") == 1.0, 5.0)
        assert client.put("T:left_x", 4.0), "the next move is made"
        assert client.get("T:left_x.DMOV") == 1.0
        assert abs(client.get("T:left_x.RBV") - 4.0) < 1.0
        assert client.put("T:mico:stop", "{}")
        assert not client.put("T:left_x", 5.0)
        assert "STOP" in client.get("T:left_x:reason").upper()
        assert wait_until(lambda: client.get("T:left_x.DMOV") == 1.0, 5.0)


@pytest.mark.timeout(60)
def test_a_motion_that_names_nothing_is_no_motion() -> None:
    with opened() as (station, _):
        session = GatewaySession(station, "notebook", Access.MOVE, door="http")
        with pytest.raises(CallRefused, match="kind"):
            session.order("mico", "axes.begin", {"motion": {}}, ("left.x",))
        session.close()


def test_what_does_not_fit_an_object_is_named_in_plain_words() -> None:
    with pytest.raises(CallRefused) as refused:
        from_json({"low": "x", "nonsense": 1}, LimitSettings)
    text = str(refused.value)
    assert "channel: key is missing" in text
    assert "low should be a valid number, not 'x'" in text
    assert "nonsense: unknown key; is it misspelt?" in text
    assert "pydantic" not in text
