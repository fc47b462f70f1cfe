"""Mail settings: bad values are refused with a reason; the password is never returned and stays in a file of 0600."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from server.mail.settings import BadMailSetting, MailSettings, MailSettingsFile, checked
from server.mail.smtp_dial import Account
from tests.server.mail.post import certificates

GOOD: dict[str, Any] = {
    "host": "smtp.example.org",
    "port": 587,
    "security": "starttls",
    "user": "car",
    "password": "hunter2",
    "sender": "car@example.org",
    "sender_name": "Prüfstand",
    "allowed": ["example.org", "*.example.org", "ann@example.com"],
    "limit_mb": 18.0,
    "link_base": "http://192.168.4.1:8000/",
    "ca": "",
}
OLD = checked(GOOD, MailSettings())


def change(**some: Any) -> MailSettings:
    return checked({**{name: value for name, value in GOOD.items() if name != "password"}, **some}, OLD)


def test_what_is_good_is_taken() -> None:
    assert OLD.host == "smtp.example.org"
    assert OLD.link_base == "http://192.168.4.1:8000"
    assert OLD.allowed == ("example.org", "*.example.org", "ann@example.com")
    assert OLD.limit_bytes == 18_000_000
    assert OLD.is_complete
    assert not MailSettings().is_complete


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("host", "smtp example.org"),
        ("host", "smtp.example.org\r\nEHLO evil"),
        ("host", "-smtp"),
        ("host", "http://smtp.example.org"),
        ("host", "smtp.example.org:25"),
        ("port", 0),
        ("port", 65536),
        ("port", True),
        ("security", "ssl"),
        ("user", "car\r\n"),
        ("password", "a\r\nb"),
        ("password", "x" * 501),
        ("sender", "car@example.org, evil@x"),
        ("sender", "Car <car@example.org>"),
        ("sender_name", "Car\r\nBcc: evil@x"),
        ("sender_name", "x" * 101),
        ("allowed", ["a@b, c@d"]),
        ("allowed", "example.org"),
        ("allowed", ["x.org"] * 201),
        ("limit_mb", 0.05),
        ("limit_mb", 51.0),
        ("limit_mb", float("nan")),
        ("limit_mb", float("inf")),
        ("limit_mb", True),
        ("link_base", "ftp://host"),
        ("link_base", "http://"),
        ("link_base", "javascript:alert(1)"),
        ("link_base", "http://host/?a=b"),
        ("link_base", "http://user@host"),
        ("link_base", "http://host/ evil"),
        ("link_base", "http://[bad"),
        ("link_base", "http://host:99999"),
        ("ca", "no certificate"),
        ("ca", "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----"),
        ("ca", "x" * 40_000),
    ],
)
def test_what_cannot_be_set_is_refused_in_a_sentence_that_names_it(field: str, value: Any) -> None:
    with pytest.raises(BadMailSetting) as why:
        change(**{"password": "hunter2", field: value})
    assert why.value.field == field
    assert str(why.value).endswith(".")
    assert "hunter2" not in str(why.value)


@pytest.mark.parametrize(
    ("host", "kept"),
    [("smtp.example.org", "smtp.example.org"), (" localhost ", "localhost"), ("192.168.4.2", "192.168.4.2"),
     ("fd00::2", "fd00::2"), ("bücher.example", "xn--bcher-kva.example"), ("", "")],
)  # fmt: skip
def test_hosts(host: str, kept: str) -> None:
    assert change(host=host, password="x").host == kept


@pytest.mark.parametrize(
    "other",
    [
        {"host": "evil.example.org"},
        {"port": 2525},
        {"user": "somebody"},
        {"security": "none"},
        {"ca": "own"},
    ],
    ids=str,
)
def test_a_password_is_told_to_nobody_but_whom_it_was_given_for(other: dict[str, Any], tmp_path: Path) -> None:
    if other.get("ca"):
        other = {"ca": certificates(tmp_path)[0]}
    with pytest.raises(BadMailSetting) as why:
        change(**other)
    assert why.value.field == "password"
    assert "again" in str(why.value)


@pytest.mark.parametrize(
    "same",
    [{}, {"host": "SMTP.Example.org"}, {"security": "tls"}, {"sender": "b@c.de"}, {"allowed": []}, {"limit_mb": 5}],
    ids=str,
)
def test_the_password_stays_where_it_is_not_given(same: dict[str, Any]) -> None:
    assert change(**same).password == "hunter2"


def test_a_password_goes_with_its_user_and_by_an_empty_one() -> None:
    assert change(user="").password == ""
    assert change(password="").password == ""
    assert change(password="", host="other.example.org").password == ""


def test_a_password_never_goes_unencrypted_over_a_network() -> None:
    with pytest.raises(BadMailSetting) as why:
        change(security="none", password="hunter2")
    assert why.value.field == "security"
    assert change(security="none", host="127.0.0.1", password="hunter2").password == "hunter2"
    assert change(security="none", host="localhost", password="hunter2").password == "hunter2"
    assert change(security="none", user="").security == "none"


def test_no_text_of_the_settings_holds_the_password() -> None:
    assert "hunter2" not in repr(OLD)
    assert "hunter2" not in str(OLD)
    assert "hunter2" not in repr(Account.of(OLD))
    assert "hunter2" not in f"{Account.of(OLD)}"


def test_what_is_written_is_read_again_and_is_for_this_user_only(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    before = os.umask(0)
    try:
        MailSettingsFile(path).write(OLD)
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert MailSettingsFile(path).read() == OLD
    assert [one.name for one in tmp_path.iterdir()] == ["settings.toml"]


def test_a_file_that_others_may_read_is_closed_to_them(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    MailSettingsFile(path).write(OLD)
    path.chmod(0o644)
    assert MailSettingsFile(path).read() == OLD
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_no_file_sends_nothing(tmp_path: Path) -> None:
    file = MailSettingsFile(tmp_path / "settings.toml")
    assert file.read() == MailSettings()
    assert file.complaint is None


@pytest.mark.parametrize("content", [b"host = ", b"\xff\xfe", b'host = "a b"', b"port = 'x'", b"x" * 200_000])
def test_a_file_that_cannot_be_used_is_set_aside_and_told(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes(content)
    file = MailSettingsFile(path)
    assert file.read() == MailSettings()
    assert file.complaint is not None
    assert "set them again" in file.complaint
    assert (tmp_path / "settings.unusable.toml").read_bytes() == content


def test_a_folder_that_takes_nothing_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    MailSettingsFile(path).write(OLD)
    script = (
        "import resource, signal, sys; from pathlib import Path\n"
        "from server.mail.settings import MailSettings, MailSettingsFile\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"  # every write is refused, for root too
        "MailSettingsFile(Path(sys.argv[1])).write(MailSettings())\n"
    )
    ended = subprocess.run([sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False)
    assert "OSError: [Errno 27] File too large" in ended.stderr
    assert os.listdir(tmp_path) == ["settings.toml"]
    assert MailSettingsFile(path).read() == OLD
