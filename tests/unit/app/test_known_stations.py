"""Stations that answered are remembered, and found again by their name."""

import logging
from concurrent.futures import ThreadPoolExecutor

import pytest

import cosmic
from cosmic.app.cli import main
from cosmic.app.stations.address import (
    StationAddress,
    known_stations,
    remember_stations,
    stations_file,
)
from cosmic.frame.errors import ConfigError
from cosmic.frame.network.errors import StationAway

VISION = StationAddress("fibervision", "tcp/127.0.0.1:7448")
STATION = StationAddress("fiberstation", "tls/192.168.1.5:7447")


def test_a_station_used_before_is_found_by_its_name_alone(
    capsys: pytest.CaptureFixture[str],
) -> None:
    remember_stations([VISION])
    remember_stations([STATION])
    assert StationAddress.read("fibervision") == VISION
    assert StationAddress.known("fiberstation") == STATION
    assert main(["stations"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "fibervision=tcp/127.0.0.1:7448",
        "fiberstation=tls/192.168.1.5:7447",
    ]


def test_its_newest_address_holds() -> None:
    remember_stations([VISION])
    remember_stations([StationAddress("fibervision", "tcp/127.0.0.1:9999")])
    assert known_stations() == {"fibervision": "tcp/127.0.0.1:9999"}


def test_what_the_user_wrote_into_the_file_stays() -> None:
    remember_stations([VISION])
    text = stations_file().read_text(encoding="utf-8")
    stations_file().write_text(f"{text}# the microscope\n", encoding="utf-8")
    remember_stations([STATION])
    assert "# the microscope" in stations_file().read_text(encoding="utf-8")
    assert set(known_stations()) == {"fibervision", "fiberstation"}


def test_several_that_are_remembered_at_once_are_all_kept() -> None:
    stations = [StationAddress(f"station{n}", f"tcp/127.0.0.1:{7500 + n}") for n in range(8)]
    with ThreadPoolExecutor(len(stations)) as pool:
        list(pool.map(lambda each: remember_stations([each]), stations))
    assert known_stations() == {each.name: each.endpoint for each in stations}


def test_an_unknown_name_is_refused_with_those_that_are_known() -> None:
    remember_stations([VISION])
    with pytest.raises(ConfigError, match=r"no station 'fiber' was used before.*fibervision"):
        cosmic.connect(stations=["fiber"])


def test_a_script_names_a_station_as_the_refusal_of_its_name_says() -> None:
    with pytest.raises(ConfigError, match=r"no station 'fiber'.*fiber=tcp/127.0.0.1:PORT"):
        cosmic.connect(stations="fiber")
    with pytest.raises(StationAway, match=r"fiber at tcp/127.0.0.1:9 does not answer"):
        cosmic.connect(stations="fiber=tcp/127.0.0.1:9")


def test_a_damaged_file_is_named_and_left_as_it_is(caplog: pytest.LogCaptureFixture) -> None:
    stations_file().parent.mkdir(parents=True, exist_ok=True)
    stations_file().write_text("[stations", encoding="utf-8")
    with caplog.at_level(logging.WARNING):
        remember_stations([VISION])
    assert "not remembered" in caplog.text
    assert stations_file().read_text(encoding="utf-8") == "[stations"
    with pytest.raises(ConfigError, match=r"stations\.toml: not valid TOML"):
        StationAddress.read("fibervision")
