"""The server's own authority: made once, kept for its owner only, bound to private names."""

from __future__ import annotations

import datetime as dt
import subprocess
from ipaddress import ip_address
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from server.tls import authority
from server.tls.authority import EARLIEST, TlsRefused, load_or_make, make

NOW = dt.datetime(2027, 3, 1, 12, 0, tzinfo=dt.UTC)


def test_it_is_made_once(tmp_path: Path) -> None:
    first = load_or_make(tmp_path / "tls", host="pit", now=NOW)
    second = load_or_make(tmp_path / "tls", host="other", now=NOW + dt.timedelta(days=900))
    assert second.fingerprint == first.fingerprint
    assert [path.name for path in (tmp_path / "tls").iterdir()] == [authority.FILE]


def test_its_key_is_for_its_owner_only(tmp_path: Path) -> None:
    load_or_make(tmp_path / "tls", host="pit", now=NOW)
    kept = tmp_path / "tls" / authority.FILE
    assert kept.stat().st_mode & 0o777 == 0o600
    kept.chmod(0o644)
    load_or_make(tmp_path / "tls", host="pit", now=NOW)
    assert kept.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    "content", [b"", b"nothing", b"-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n"]
)
def test_a_damaged_one_is_never_replaced_in_silence(tmp_path: Path, content: bytes) -> None:
    kept = tmp_path / authority.FILE
    kept.write_bytes(content)
    with pytest.raises(TlsRefused, match=r"is damaged.*every phone must be set up again"):
        load_or_make(tmp_path, host="pit", now=NOW)
    assert kept.read_bytes() == content


def test_a_key_of_another_authority_is_refused(tmp_path: Path) -> None:
    one, other = (make(host="pit", now=NOW) for _ in range(2))
    (tmp_path / authority.FILE).write_bytes(authority.private_pem(one.key) + other.pem)
    with pytest.raises(TlsRefused, match="its key is not that of its certificate"):
        load_or_make(tmp_path, host="pit", now=NOW)


def test_a_folder_that_cannot_be_used_is_reported(tmp_path: Path) -> None:
    (tmp_path / "tls").write_text("a file")
    with pytest.raises(TlsRefused, match="cannot be used"):
        load_or_make(tmp_path / "tls", host="pit", now=NOW)


def test_of_two_servers_that_begin_at_once_one_authority_stays(tmp_path: Path) -> None:
    first = load_or_make(tmp_path, host="pit", now=NOW)
    authority._keep(tmp_path / authority.FILE, make(host="pit", now=NOW))
    assert load_or_make(tmp_path, host="pit", now=NOW).fingerprint == first.fingerprint
    assert [path.name for path in tmp_path.iterdir()] == [authority.FILE]


def test_a_clock_before_catgraph_existed_is_wrong() -> None:
    made = make(host="pi", now=dt.datetime(1970, 1, 1, tzinfo=dt.UTC))
    assert made.cert.not_valid_before_utc == EARLIEST - authority.BACK
    assert made.cert.not_valid_after_utc == EARLIEST + authority.VALID


def test_it_is_p_256_and_may_sign_certificates_and_nothing_else() -> None:
    cert = make(host="pit", now=NOW).cert
    key = cert.public_key()
    assert isinstance(key, ec.EllipticCurvePublicKey)
    assert isinstance(key.curve, ec.SECP256R1)
    basic = cert.extensions.get_extension_for_class(x509.BasicConstraints)
    assert (basic.critical, basic.value.ca, basic.value.path_length) == (True, True, 0)
    usage = cert.extensions.get_extension_for_class(x509.KeyUsage)
    assert (usage.critical, usage.value.key_cert_sign, usage.value.digital_signature) == (True, True, False)
    assert cert.extensions.get_extension_for_class(x509.NameConstraints).critical


def test_two_authorities_of_one_machine_have_names_of_their_own() -> None:
    assert make(host="pit", now=NOW).name != make(host="pit", now=NOW).name
    assert len(make(host="h" * 200, now=NOW).name) <= 64


def forged(by: authority.Authority, name: x509.GeneralName) -> bytes:
    """What a thief of the key would make: a certificate for any name."""
    key = ec.generate_private_key(ec.SECP256R1())
    return (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "thief")]))
        .issuer_name(by.cert.subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(NOW - dt.timedelta(days=1))
        .not_valid_after(NOW + dt.timedelta(days=30))
        .add_extension(x509.SubjectAlternativeName([name]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(by.key, hashes.SHA256())
        .public_bytes(serialization.Encoding.PEM)
    )


@pytest.mark.parametrize(
    ("name", "is_taken"),
    [
        (x509.DNSName("pit.local"), True),
        (x509.DNSName("bank.example.org"), False),
        (x509.DNSName("evil-local"), False),
        (x509.DNSName("local.example.org"), False),
        (x509.IPAddress(ip_address("192.168.4.1")), True),
        (x509.IPAddress(ip_address("8.8.8.8")), False),
        (x509.IPAddress(ip_address("fd00::1")), True),
        (x509.IPAddress(ip_address("2001:4860:4860::8888")), False),
    ],
    ids=str,
)
def test_openssl_takes_nothing_outside_the_constraints(tmp_path: Path, name: x509.GeneralName, is_taken: bool) -> None:
    ours = make(host="pit", now=NOW)
    (tmp_path / "ca.pem").write_bytes(ours.pem)
    (tmp_path / "leaf.pem").write_bytes(forged(ours, name))
    at = str(int(NOW.timestamp()))
    command = ["openssl", "verify", "-attime", at, "-purpose", "sslserver", "-CAfile", "ca.pem", "leaf.pem"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode == 0) is is_taken, done.stderr
    assert is_taken or "permitted subtree violation" in done.stderr
