"""Certificates with which stations prove to each other who they are."""

import ipaddress
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from cosmic.frame.errors import ConfigError
from cosmic.frame.network.line_settings import Certificates
from cosmic.frame.network.station import checked_name

VALID_DAYS: Final = 3650
LONGEST_NAME: Final = 64
"""A certificate bears no longer one."""
_LOCAL: Final = ("localhost", "127.0.0.1", "::1")

Key = ec.EllipticCurvePrivateKey


def make_certificates(
    folder: Path,
    *stations: str,
    addresses: Mapping[str, Sequence[str]] | None = None,
    valid_days: int = VALID_DAYS,
) -> dict[str, Certificates]:
    """Make an authority and a certificate for each station, and return where they are.

    `folder` gets ``authority/`` and a folder for each station with all that it needs: carry that
    one to the station's computer, by hand. The authority's key signs further stations later and
    should be kept where no station runs.

    Parameters
    ----------
    addresses : mapping of str to sequence of str
        Host names and IP addresses under which a station is reached; clients that only connect
        need none. This computer's own are always among them.

    Raises
    ------
    ConfigError
        A name or a host is none, a station has certificates there already, or the authority is
        broken or lacks its key.
    """
    known = addresses or {}
    for name in (*stations, *known):
        _check(folder, name, known=name in stations)
        for host in known.get(name, ()):
            _general(host)
    key, authority = _authority(folder / "authority", valid_days)
    made = {}
    for name in stations:
        hosts = (name, *_LOCAL, *known.get(name, ()))
        made[name] = _make_station(folder / name, name, hosts, key, authority, valid_days)
    return made


def _check(folder: Path, name: str, *, known: bool) -> None:
    try:
        checked_name(name)
    except ValueError as exc:
        raise ConfigError(str(exc)) from exc
    if not known or name == "authority":
        raise ConfigError(f"{name!r} is not among the stations")
    if len(name) > LONGEST_NAME:
        raise ConfigError(f"{name[:20]}...: a name has at most {LONGEST_NAME} letters")
    if (folder / name).exists():
        raise ConfigError(f"{folder / name} is there already; remove it to make new ones")


def _authority(folder: Path, valid_days: int) -> tuple[Key, x509.Certificate]:
    certificate_file, key_file = folder / "certificate.pem", folder / "key.pem"
    if certificate_file.exists() and key_file.exists():
        return _read_authority(certificate_file, key_file)
    if folder.exists():
        missing = key_file if certificate_file.exists() else certificate_file
        raise ConfigError(
            f"{missing}: the authority lacks this file; bring it back to sign further stations, or "
            "begin in another folder"
        )
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name("CoSMic stations")
    usage = x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=True,
        encipher_only=False,
        decipher_only=False,
    )
    certificate = (
        _builder(name, name, key.public_key(), valid_days)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .sign(key, hashes.SHA256())
    )
    _write(folder, certificate, key)
    return key, certificate


def _read_authority(certificate_file: Path, key_file: Path) -> tuple[Key, x509.Certificate]:
    try:
        certificate = x509.load_pem_x509_certificate(certificate_file.read_bytes())
        key = serialization.load_pem_private_key(key_file.read_bytes(), password=None)
    except (ValueError, TypeError) as exc:
        raise ConfigError(
            f"{certificate_file.parent}: the authority cannot be read: {exc}"
        ) from exc
    if not isinstance(key, Key):
        raise ConfigError(f"{key_file}: this is not a key that this program made")
    return key, certificate


def _make_station(
    folder: Path,
    name: str,
    hosts: Sequence[str],
    authority_key: Key,
    authority: x509.Certificate,
    valid_days: int,
) -> Certificates:
    key = ec.generate_private_key(ec.SECP256R1())
    both = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH])
    certificate = (
        _builder(_name(name), authority.subject, key.public_key(), valid_days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(
            x509.SubjectAlternativeName([_general(each) for each in hosts]), critical=False
        )
        .add_extension(both, critical=False)
        .sign(authority_key, hashes.SHA256())
    )
    _write(folder, certificate, key)
    authority_file = folder / "authority.pem"
    authority_file.write_bytes(authority.public_bytes(serialization.Encoding.PEM))
    return station_certificates(folder)


def station_certificates(folder: Path) -> Certificates:
    """Return the certificates in a station's folder.

    Raises
    ------
    ConfigError
        A file is missing.
    """
    found = Certificates(
        authority=folder / "authority.pem",
        certificate=folder / "certificate.pem",
        key=folder / "key.pem",
    )
    for file in (found.authority, found.certificate, found.key):
        if not file.is_file():
            raise ConfigError(f"{file}: there is no such file; make certificates for the station")
    return found


def name_in(files: Certificates) -> str:
    """Return the name that a certificate proves.

    Raises
    ------
    ConfigError
        It cannot be read, or bears none.
    """
    try:
        certificate = x509.load_pem_x509_certificate(files.certificate.read_bytes())
        return str(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)
    except (OSError, ValueError, IndexError) as exc:
        raise ConfigError(f"{files.certificate}: the name in it cannot be read: {exc}") from exc


def out_of_date(files: Certificates) -> str:
    """Return why a certificate is not accepted today, in words; empty: it is, or cannot be read."""
    try:
        certificate = x509.load_pem_x509_certificate(files.certificate.read_bytes())
    except (OSError, ValueError):
        return ""
    first, last = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    today = datetime.now(UTC)
    if first <= today <= last:
        return ""
    return (
        f"{files.certificate} is valid from {first:%Y-%m-%d} to {last:%Y-%m-%d}, and it is "
        f"{today:%Y-%m-%d} here: check the date of this computer, or make new certificates"
    )


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _general(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError as exc:
        raise ConfigError(
            f"{host!r} is not the name of a computer: letters, digits, dots and hyphens, others as "
            "xn--..."
        ) from exc


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePublicKey, valid_days: int
) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))  # clocks differ
        .not_valid_after(now + timedelta(days=valid_days))
    )


def _write(folder: Path, certificate: x509.Certificate, key: Key) -> None:
    folder.mkdir(parents=True, mode=0o700)
    pem = serialization.Encoding.PEM
    key_file = folder / "key.pem"
    key_file.touch(mode=0o600)
    key_file.write_bytes(
        key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    )
    (folder / "certificate.pem").write_bytes(certificate.public_bytes(pem))
