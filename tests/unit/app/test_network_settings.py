"""What the section [network] means."""

import shutil
from pathlib import Path

import pytest

import cosmic
from cosmic.app.configuration.gateways import HttpClient
from cosmic.app.configuration.network import NetworkSettings, serving
from cosmic.app.stations.address import StationAddress
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import ConfigError
from cosmic.frame.network.caller import Access
from cosmic.frame.network.certificates import make_certificates


def test_on_this_computer_everybody_may_do_everything_unless_names_are_listed() -> None:
    how = serving(NetworkSettings(), "Lab", Path())
    assert how.line.endpoint == "tcp/127.0.0.1:7447"
    assert how.allowed("anybody") is Access.MOVE


def test_whoever_is_not_listed_is_not_let_in() -> None:
    settings = NetworkSettings(view=("visitor", "desk"), call=("camera",), move=("desk",))
    how = serving(settings, "Lab", Path())
    assert how.allowed("visitor") is Access.VIEW
    assert how.allowed("camera") is Access.CALL
    assert how.allowed("desk") is Access.MOVE, "of two lists the one with more counts"
    assert how.allowed("anybody") is None
    assert set(how.line.clients) == {"visitor", "desk", "camera"}


@pytest.mark.parametrize(
    ("platform", "name"),
    [("FiberStation", "fiberstation"), ("Labor Süd 2", "labor-s-d-2"), ("纤维", "station")],
)
def test_a_station_is_called_as_its_platform(platform: str, name: str) -> None:
    assert serving(NetworkSettings(), platform, Path()).name == name


def test_with_certificates_a_station_bears_the_name_in_them(tmp_path: Path) -> None:
    make_certificates(tmp_path / "keys", "fibres")
    settings = NetworkSettings(
        certificates="keys/fibres", move=("desk",), listen="tls/192.168.1.5:7447"
    )
    how = serving(settings, "Lab", tmp_path)
    assert how.name == "fibres"
    assert how.line.encrypted
    assert serving(settings, "Lab", tmp_path, name="other").name == "other"


def test_with_certificates_somebody_has_to_be_let_in(tmp_path: Path) -> None:
    make_certificates(tmp_path / "keys", "fibres")
    settings = NetworkSettings(certificates="keys/fibres", listen="tls/192.168.1.5:7447")
    with pytest.raises(ConfigError, match=r"list the clients[\s\S]*move = "):
        serving(settings, "Lab", tmp_path)


def test_an_address_names_the_station_and_where_it_listens() -> None:
    address = StationAddress.read("fibervision=tcp/127.0.0.1:7448")
    assert (address.name, address.endpoint) == ("fibervision", "tcp/127.0.0.1:7448")
    for text in ("", "fibervision=", "=tcp/127.0.0.1:7448"):
        with pytest.raises(ConfigError, match=r"it reads NAME=|was used before.*Give its address"):
            StationAddress.read(text)


def test_a_token_is_in_no_record_and_in_no_recording(tmp_path: Path) -> None:
    client = HttpClient(name="desk", token="correct horse battery", access="move")
    assert "horse" not in f"{client}{client.model_dump()}"
    shutil.copytree(shipped_config_dir(), tmp_path / "config")
    platform = tmp_path / "config" / "platform.toml"
    with platform.open("a") as file:
        file.write('\n[[network.http.client]]\nname = "desk"\ntoken = "correct horse battery"\n')
    with (
        cosmic.connect(config=platform, applications=("daqco",)) as rig,
        rig.daqco.record(tmp_path / "push.h5"),
    ):
        pass
    assert b"horse" not in (tmp_path / "push.h5").read_bytes()
    with cosmic.open_recording(tmp_path / "push.h5") as recording:
        assert 'token = ""' in recording.configuration
