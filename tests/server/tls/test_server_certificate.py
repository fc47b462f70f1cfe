"""The server's certificate, against the rules of Apple and Chrome, as OpenSSL reads it."""

from __future__ import annotations

import datetime as dt
import ipaddress
import re
import subprocess
from pathlib import Path

import pytest

from server.tls import authority, server_certificate
from server.tls.names import names_of

NOW = dt.datetime(2027, 3, 1, 12, 0, tzinfo=dt.UTC)
ADDRESSES = tuple(map(ipaddress.ip_address, ("192.168.4.1", "10.1.2.3", "fd00::2")))
NAMES = names_of(ADDRESSES, "pit")
OURS = authority.make(host="pit", now=NOW)


def days(n: float) -> dt.timedelta:
    return dt.timedelta(days=n)


def openssl(folder: Path, *arguments: str) -> str:
    done = subprocess.run(["openssl", *arguments], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "ca.pem").write_bytes(OURS.pem)
    server_certificate.keep(tmp_path, server_certificate.make(OURS, NAMES, now=NOW))
    return tmp_path


def test_openssl_takes_it_for_every_name_of_the_server(folder: Path) -> None:
    at = str(int(NOW.timestamp()))
    common = ("verify", "-x509_strict", "-purpose", "sslserver", "-attime", at, "-CAfile", "ca.pem")
    for name in NAMES.dns:
        openssl(folder, *common, "-verify_hostname", name, server_certificate.FILE)
    for ip in NAMES.ips:
        openssl(folder, *common, "-verify_ip", str(ip), server_certificate.FILE)


def test_it_keeps_the_rules_of_apple_and_chrome(folder: Path) -> None:
    """Apple: SHA-2, EC or RSA of 2048 bits, names in the SAN, EKU serverAuth, at most 825 days for an authority that a
    person installed and 398 for those it ships; Chrome the same 398."""
    text = openssl(folder, "x509", "-in", server_certificate.FILE, "-noout", "-text")
    assert "ecdsa-with-SHA256" in text
    assert "ASN1 OID: prime256v1" in text
    assert "TLS Web Server Authentication" in text
    assert re.search(r"Basic Constraints: critical\s+CA:FALSE", text)
    assert re.search(r"Key Usage: critical\s+Digital Signature\n", text)
    for name in ("DNS:pit.local", "DNS:localhost", "IP Address:192.168.4.1", "IP Address:FD00:0:0:0:0:0:0:2"):
        assert name in text
    dates = openssl(
        folder, "x509", "-in", server_certificate.FILE, "-noout", "-startdate", "-enddate", "-dateopt", "iso_8601"
    )
    start, end = (dt.datetime.fromisoformat(found) for found in re.findall(r"=(.*)Z", dates))
    assert end - start + dt.timedelta(seconds=1) == days(397)


@pytest.mark.parametrize(
    ("off", "begun", "ended"),
    [(-31, False, False), (-29, True, False), (0, True, False), (366, True, False), (368, True, True)],
)
def test_it_is_dated_back_for_clocks_that_are_wrong(off: float, begun: bool, ended: bool) -> None:
    cert = server_certificate.make(OURS, NAMES, now=NOW).cert
    phone = NOW + days(off)
    assert (phone >= cert.not_valid_before_utc, phone > cert.not_valid_after_utc) == (begun, ended)


def test_a_server_whose_clock_woke_up_in_the_past_dates_by_its_authority() -> None:
    cert = server_certificate.make(OURS, NAMES, now=dt.datetime(1970, 1, 1, tzinfo=dt.UTC)).cert
    assert cert.not_valid_before_utc < NOW < cert.not_valid_after_utc


def test_it_ends_with_its_authority() -> None:
    last = OURS.cert.not_valid_after_utc
    made = server_certificate.make(OURS, NAMES, now=last - days(10))
    assert made.cert.not_valid_after_utc == last
    assert server_certificate.why_renew(made, OURS, NAMES, now=last - days(1)) is None  # another would end no later


@pytest.mark.parametrize(
    ("names", "after", "why"),
    [
        (NAMES, days(0), None),
        (NAMES, days(306), None),
        (NAMES, days(308), "it would have ended on 2028-03-0"),
        (NAMES, days(-28), None),
        (NAMES, days(-30), None),  # its own authority is from then: the clock is wrong, not the certificate
        (names_of(ADDRESSES[:2], "pit"), days(0), "addresses or names changed"),
        (names_of(ADDRESSES, "pit2"), days(0), "addresses or names changed"),
        (names_of(reversed(ADDRESSES), "pit"), days(0), None),
    ],
)
def test_it_is_renewed_when_it_must_be(names: object, after: dt.timedelta, why: str | None) -> None:
    made = server_certificate.make(OURS, NAMES, now=NOW)
    reason = server_certificate.why_renew(made, OURS, names, now=NOW + after)  # type: ignore[arg-type]
    assert (reason is None) if why is None else (reason is not None and why in reason)


def test_a_clock_that_was_put_back_gives_a_new_one() -> None:
    made = server_certificate.make(OURS, NAMES, now=NOW + days(400))
    assert server_certificate.why_renew(made, OURS, NAMES, now=NOW) == "the clock was put back"


def test_that_of_another_authority_is_renewed() -> None:
    other = authority.make(host="pit", now=NOW)
    assert (
        server_certificate.why_renew(server_certificate.make(other, NAMES, now=NOW), OURS, NAMES, now=NOW)
        == "the authority is another"
    )


def test_it_is_kept_for_its_owner_only_and_found_again(folder: Path) -> None:
    assert (folder / server_certificate.FILE).stat().st_mode & 0o777 == 0o600
    found = server_certificate.load(folder)
    assert found is not None
    assert server_certificate.why_renew(found, OURS, NAMES, now=NOW) is None


@pytest.mark.parametrize("content", [None, b"", b"half a fi"])
def test_what_cannot_be_read_is_made_anew(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / server_certificate.FILE).write_bytes(content)
    assert server_certificate.load(tmp_path) is None
