"""Certificates for stations, and the settings of a line."""

import stat
from pathlib import Path

import pytest
from cryptography import x509

from cosmic.frame.errors import ConfigError
from cosmic.frame.network.certificates import make_certificates, name_in, station_certificates
from cosmic.frame.network.line_settings import Certificates, Line
from cosmic.frame.network.zenoh_wire import config


def test_each_station_gets_all_it_needs_and_a_key_that_only_its_owner_reads(tmp_path: Path) -> None:
    made = make_certificates(
        tmp_path, "fibres", "vision", addresses={"fibres": ["192.168.1.5", "fibres.lab"]}
    )
    assert made["vision"] == station_certificates(tmp_path / "vision")
    for name, files in made.items():
        certificate = x509.load_pem_x509_certificate(files.certificate.read_bytes())
        authority = x509.load_pem_x509_certificate(files.authority.read_bytes())
        certificate.verify_directly_issued_by(authority)
        assert certificate.subject.rfc4514_string() == f"CN={name}"
        assert name_in(files) == name
        assert stat.S_IMODE(files.key.stat().st_mode) == 0o600
    hosts = x509.load_pem_x509_certificate(made["fibres"].certificate.read_bytes()).extensions
    names = hosts.get_extension_for_class(x509.SubjectAlternativeName).value
    assert {"fibres", "localhost", "fibres.lab"} == set(names.get_values_for_type(x509.DNSName))
    assert "192.168.1.5" in [str(each) for each in names.get_values_for_type(x509.IPAddress)]


def test_a_station_that_comes_later_is_signed_by_the_same_authority(tmp_path: Path) -> None:
    first = make_certificates(tmp_path, "fibres")["fibres"]
    second = make_certificates(tmp_path, "vision")["vision"]
    assert first.authority.read_bytes() == second.authority.read_bytes()


def test_a_certificate_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    files = make_certificates(tmp_path, "fibres")["fibres"]
    files.certificate.write_text("nonsense")
    with pytest.raises(ConfigError, match=r"certificate\.pem"):
        name_in(files)


def test_nothing_is_overwritten_and_no_name_is_let_through(tmp_path: Path) -> None:
    make_certificates(tmp_path, "fibres")
    for name in ("fibres", "authority", "../up", "", "a b"):
        with pytest.raises(ConfigError):
            make_certificates(tmp_path, name)
    with pytest.raises(ConfigError, match="not among the stations"):
        make_certificates(tmp_path, "vision", addresses={"visoin": ["192.168.1.5"]})
    with pytest.raises(ConfigError, match="there is no such file"):
        station_certificates(tmp_path / "vision")
    (tmp_path / "authority" / "key.pem").write_text("hm")
    with pytest.raises(ConfigError, match="cannot be read"):
        make_certificates(tmp_path, "vision")


FILES = Certificates(Path("authority.pem"), Path("certificate.pem"), Path("key.pem"))


@pytest.mark.parametrize(
    ("endpoint", "certificates", "clients", "words"),
    [
        ("tcp/0.0.0.0:7450", None, (), "only tls with certificates"),
        ("tcp/192.168.1.5:7450", None, (), "only tls with certificates"),
        ("tcp/[::]:7450", None, (), "only tls with certificates"),
        ("tcp/192.168.1.5:7450", FILES, ("vision",), "only tls with certificates"),
        ("tls/192.168.1.5:7450", None, ("vision",), "needs certificates"),
        ("tls/192.168.1.5:7450", FILES, (), "list the clients"),
        ("udp/127.0.0.1:7450", None, (), "is not an endpoint"),
        ("tcp/127.0.0.1", None, (), "is not an endpoint"),
        ("127.0.0.1:7450", None, (), "is not an endpoint"),
        ("tcp/127.0.0.1:http", None, (), "is not an endpoint"),
    ],
)
def test_nothing_listens_beyond_this_computer_without_certificates(
    endpoint: str, certificates: Certificates | None, clients: tuple[str, ...], words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        Line(endpoint, True, "fibres", certificates, clients)


def test_a_client_does_not_send_beyond_this_computer_without_certificates_either() -> None:
    with pytest.raises(ConfigError):
        Line("tcp/192.168.1.5:7450", listens=False, station="fibres")


def test_the_engine_accepts_every_setting_and_finds_nobody_by_itself(tmp_path: Path) -> None:
    files = make_certificates(tmp_path, "fibres")["fibres"]
    made = config(Line("tls/127.0.0.1:7450", True, "fibres", files, ("vision", "other")))
    for key in ("multicast/enabled", "gossip/enabled"):
        assert made.get_json(f"scouting/{key}") == "false"
    assert made.get_json("transport/shared_memory/enabled") == "false"
    assert '"default_permission":"deny"' in made.get_json("access_control")
    client = config(Line("tcp/127.0.0.1:7450", listens=False, station="fibres"))
    assert client.get_json("listen/endpoints") == "[]"


def test_what_no_certificate_can_bear_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="name of a computer"):
        make_certificates(tmp_path / "a", "fibre", addresses={"fibre": ["müller.local"]})
    with pytest.raises(ConfigError, match="at most 64"):
        make_certificates(tmp_path / "a", "x" * 65)
    assert not (tmp_path / "a").exists()


def test_an_authority_whose_key_was_taken_away_asks_for_it(tmp_path: Path) -> None:
    make_certificates(tmp_path, "fibre")
    key = tmp_path / "authority" / "key.pem"
    kept = key.rename(tmp_path / "kept.pem")
    with pytest.raises(ConfigError, match=r"key\.pem: the authority lacks this file"):
        make_certificates(tmp_path, "vision")
    kept.rename(key)
    assert make_certificates(tmp_path, "vision")
