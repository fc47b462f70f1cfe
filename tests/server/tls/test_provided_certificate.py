"""A provided certificate: its faults are reported as sentences, and a changed one is read again."""

from __future__ import annotations

import datetime as dt
import logging
from pathlib import Path

import pytest

from server.tls.authority import TlsRefused
from server.tls.certificate_renewal import ProvidedCertificateRenewal, read_provided
from tests.server.tls.certificates import pair

NOW = dt.datetime(2027, 3, 1, 12, 0, tzinfo=dt.UTC)


def days(n: float) -> dt.timedelta:
    return dt.timedelta(days=n)


@pytest.mark.parametrize("is_rsa", [False, True])
def test_a_good_one_is_taken_with_its_names(tmp_path: Path, is_rsa: bool) -> None:
    files = pair(tmp_path, start=NOW, names=("car.example.org", "*.pit.example.org"), is_rsa=is_rsa)
    found = read_provided(files.cert, files.key, now=NOW)
    assert found.names == ("car.example.org", "*.pit.example.org")
    assert found.warning is None


@pytest.mark.parametrize(
    ("after", "text"),
    [
        (days(-1), "is valid from 2027-03-01 12:00 UTC only"),
        (days(75.9), None),
        (days(76.1), "expires on 2027-05-30"),
        (days(90), "expires on 2027-05-30"),
    ],
)
def test_a_fault_of_a_usable_certificate_is_reported(tmp_path: Path, after: dt.timedelta, text: str | None) -> None:
    files = pair(tmp_path, start=NOW)
    warning = read_provided(files.cert, files.key, now=NOW + after).warning
    assert warning is None if text is None else text in str(warning)


def test_an_expired_one_is_refused(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW)
    with pytest.raises(TlsRefused, match=r"expired on 2027-05-30 12:00 UTC\.$"):
        read_provided(files.cert, files.key, now=NOW + days(90.1))


def test_a_key_of_another_certificate_is_refused(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW)
    other = tmp_path / "other"
    other.mkdir()
    with pytest.raises(TlsRefused, match=r"key\.pem belongs to another certificate than the first in .*cert\.pem"):
        read_provided(files.cert, pair(other, start=NOW).key, now=NOW)


def test_a_key_with_a_password_is_refused(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW, password=b"secret")
    with pytest.raises(TlsRefused, match="is protected by a password"):
        read_provided(files.cert, files.key, now=NOW)


def test_one_without_names_is_refused(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW, names=())
    with pytest.raises(TlsRefused, match="names no host"):
        read_provided(files.cert, files.key, now=NOW)


@pytest.mark.parametrize("which", ["cert", "key"])
@pytest.mark.parametrize(
    ("content", "text"), [(None, "cannot be read: No such file"), (b"\x00nothing", "holds no .* as PEM")]
)
def test_what_is_no_certificate_or_key_is_named(tmp_path: Path, which: str, content: bytes | None, text: str) -> None:
    files = pair(tmp_path, start=NOW)
    broken: Path = getattr(files, which)
    if content is None:
        broken.unlink()
    else:
        broken.write_bytes(content)
    with pytest.raises(TlsRefused, match=f"{broken.name}.*{text}|{broken.name} {text}"):
        read_provided(files.cert, files.key, now=NOW)


def test_a_changed_pair_is_read_again(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW)
    served = ProvidedCertificateRenewal(files.cert, files.key, now=NOW)
    assert served.refresh(NOW) is None
    renewed = pair(tmp_path, start=NOW + days(60), is_rsa=True)
    assert "was read again, it ends on 2027-07-29" in str(served.refresh(NOW + days(60)))
    assert served.given.cert.serial_number == renewed.serial
    assert served.refresh(NOW + days(60)) is None


def test_a_bad_one_leaves_the_one_of_before_and_is_reported_once(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW)
    served = ProvidedCertificateRenewal(files.cert, files.key, now=NOW)
    before = files.key.read_bytes()
    renewed = pair(tmp_path, start=NOW + days(1))
    new_key = files.key.read_bytes()
    files.key.write_bytes(before)  # half-way: the certificate is new, the key is not
    assert "of before stays" in str(served.refresh(NOW + days(1)))
    assert "belongs to another" in str(served._reported)
    assert served.refresh(NOW + days(1)) is None
    assert served.given.cert.serial_number == files.serial
    files.key.write_bytes(new_key)
    assert "was read again" in str(served.refresh(NOW + days(1)))
    assert served.given.cert.serial_number == renewed.serial


def test_files_that_vanish_are_reported_once_and_change_nothing(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW)
    served = ProvidedCertificateRenewal(files.cert, files.key, now=NOW)
    content = files.cert.read_bytes()
    files.cert.unlink()
    assert "No such file" in str(served.refresh(NOW))
    assert served.refresh(NOW) is None
    files.cert.write_bytes(content)
    assert "was read again" in str(served.refresh(NOW))


def test_one_that_expires_while_it_is_served_is_reported_once(tmp_path: Path) -> None:
    files = pair(tmp_path, start=NOW)
    served = ProvidedCertificateRenewal(files.cert, files.key, now=NOW)
    assert served.refresh(NOW + days(75)) is None
    assert "expires on 2027-05-30" in str(served.refresh(NOW + days(77)))
    assert served.refresh(NOW + days(78)) is None
    assert "expired" in str(served.refresh(NOW + days(91)))
    assert served.refresh(NOW + days(92)) is None


def test_no_key_is_ever_answered(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    files = pair(tmp_path, start=NOW)
    files.cert.write_bytes(files.key.read_bytes())
    with caplog.at_level(logging.DEBUG), pytest.raises(TlsRefused) as refused:
        read_provided(files.cert, files.key, now=NOW)
    secret = files.key.read_text().splitlines()[1]
    assert secret not in str(refused.value) + caplog.text
